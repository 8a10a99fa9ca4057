"""Gauss collocation: nodes at the zeros of the shifted Legendre polynomial, order 2s, symplectic and symmetric.

    c_i : zeros of P_s(2c - 1)        a_ij = int_0^{c_i} l_j(t) dt        b_j = int_0^1 l_j(t) dt

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3 (collocation), VI.4.1 (symplecticity).
"""

from __future__ import annotations

from functools import lru_cache

from orbits.checks import whole_number
from orbits.errors import InputError
from orbits.many_digits import many_digits
from orbits.tableaux.interpolation import collocation, legendre_zeros
from orbits.tableaux.partitioned import DIGITS
from orbits.tableaux.symplectic import SymplecticTableau, symplectic

MOST_STAGES = 32
"""Of more stages, the coefficients lose more digits than are carried."""


@lru_cache(maxsize=64)
def gauss(stages: int) -> SymplecticTableau:
    """Return the Gauss method with 1 ... 32 stages, order 2s.

    Raises InputError unless `stages` is such a whole number.
    """
    stages = whole_number(stages, "the number of stages")
    if stages > MOST_STAGES:
        raise InputError(
            f"the number of stages is {stages}; expected at most {MOST_STAGES}: the coefficients of more are not known "
            "to enough digits."
        )
    with many_digits(DIGITS + 10):
        a, b = collocation(legendre_zeros(stages))
        return symplectic(f"Gauss({stages})", a, a, b, 2 * stages)
