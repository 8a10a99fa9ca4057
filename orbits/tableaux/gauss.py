"""Gauss collocation: nodes at the zeros of the shifted Legendre polynomial, order 2s, symplectic and symmetric.

    c_i : zeros of P_s(2c - 1)        a_ij = int_0^{c_i} l_j(t) dt        b_j = int_0^1 l_j(t) dt

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3 (collocation), VI.4.1 (symplecticity).
"""

from __future__ import annotations

from functools import lru_cache

import mpmath

from orbits.errors import InputError, shown
from orbits.tableaux.interpolation import collocation, legendre_zeros
from orbits.tableaux.partitioned import DIGITS
from orbits.tableaux.symplectic import SymplecticTableau, symplectic


@lru_cache(maxsize=64)
def gauss(stages: int) -> SymplecticTableau:
    """Return the Gauss method with `stages` >= 1 stages, order 2s.

    Raises InputError if `stages` is not a positive integer.
    """
    if not isinstance(stages, int) or isinstance(stages, bool) or stages < 1:
        raise InputError(
            f"the number of stages must be a positive integer, got {shown(stages)}; use e.g. Gauss(stages=8)"
        )
    with mpmath.workdps(DIGITS + 10):
        a, b = collocation(legendre_zeros(stages))
        return symplectic(f"Gauss({stages})", a, a, b, 2 * stages)
