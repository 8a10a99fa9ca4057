"""Lobatto IIIA and IIIB: nodes at both ends and at the extrema of a Legendre polynomial; the pair has order 2s - 2.

    c_i : 0, 1 and the zeros of P'_{s-1}(2c - 1)
    IIIA: collocation at these nodes          IIIB: b_i a_bar_ij + b_j a_ji = b_i b_j

Each is symmetric; neither alone is symplectic, the pair is. With s = 2 and a separable Lagrangian, IIIA–IIIB is
Störmer–Verlet.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.4, II.2.2, VI.4.1; Sun (1993).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import mpmath

from orbits.checks import whole_number
from orbits.many_digits import many_digits
from orbits.tableaux.interpolation import collocation, legendre
from orbits.tableaux.partitioned import DIGITS
from orbits.tableaux.symplectic import SymplecticTableau, symplectic


def _nodes(stages: int) -> list[Any]:
    """0, 1 and the zeros of P'_{s-1}(2c - 1), by Newton's method from Chebyshev's points."""
    n = stages - 1
    inner = []
    for i in range(1, n):
        x = mpmath.cos(mpmath.pi * i / n)
        for _ in range(100):
            p, slope = legendre(n, x)
            # Legendre's equation gives the second derivative: (1 - x^2) P'' = 2 x P' - n (n + 1) P.
            correction = slope * (1 - x * x) / (2 * x * slope - n * (n + 1) * p)
            x -= correction
            if abs(correction) < mpmath.mpf(10) ** (-DIGITS):
                break
        inner.append((1 + x) / 2)
    return [mpmath.mpf(0), *sorted(inner), mpmath.mpf(1)]


@lru_cache(maxsize=64)
def lobatto_iiia_iiib(stages: int) -> SymplecticTableau:
    """Return the pair with IIIA for positions and IIIB for momenta, order 2s - 2. Raises InputError below 2 stages."""
    a, a_bar, b = _pair(stages)
    return symplectic(f"LobattoIIIAB({stages})", a, a_bar, b, 2 * stages - 2)


@lru_cache(maxsize=64)
def lobatto_iiib_iiia(stages: int) -> SymplecticTableau:
    """Return the pair with IIIB for positions and IIIA for momenta, order 2s - 2. Raises InputError below 2 stages."""
    a, a_bar, b = _pair(stages)
    return symplectic(f"LobattoIIIBA({stages})", a_bar, a, b, 2 * stages - 2)


def _pair(stages: int) -> tuple[Any, Any, Any]:
    stages = whole_number(stages, "the number of stages of a Lobatto method", least=2)
    with many_digits(DIGITS + 10):
        a, b = collocation(_nodes(stages))
        s = range(stages)
        return a, [[b[j] * (1 - a[j][i] / b[i]) for j in s] for i in s], b
