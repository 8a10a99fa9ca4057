"""Small tableaux: the symplectic Euler methods, explicit Euler, and the classical Runge–Kutta method.

Source: Hairer, Lubich & Wanner (2006), sec. I.1.2, VI.3; Kutta (1901).
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

from orbits.many_digits import many_digits
from orbits.tableaux.partitioned import DIGITS, PartitionedTableau, exact
from orbits.tableaux.symplectic import SymplecticTableau, symplectic


@lru_cache(maxsize=1)
def kick_drift() -> SymplecticTableau:
    """Return symplectic Euler with L_d = h L(q, (q+ - q)/h): momenta first, then positions with the new momenta."""
    return symplectic("symplectic Euler, kick-drift", [[0]], [[1]], [1], 1)


@lru_cache(maxsize=1)
def drift_kick() -> SymplecticTableau:
    """Return symplectic Euler with L_d = h L(q+, (q+ - q)/h): positions first, then momenta at the new positions."""
    return symplectic("symplectic Euler, drift-kick", [[1]], [[0]], [1], 1)


@lru_cache(maxsize=1)
def explicit_euler() -> PartitionedTableau:
    """Return the explicit Euler method."""
    return _unpartitioned("explicit Euler", [[0]], [1], 1)


@lru_cache(maxsize=1)
def runge_kutta_4() -> PartitionedTableau:
    """Return the classical Runge–Kutta method of four stages."""
    half, third, sixth = Fraction(1, 2), Fraction(1, 3), Fraction(1, 6)
    a = [[0, 0, 0, 0], [half, 0, 0, 0], [0, half, 0, 0], [0, 0, 1, 0]]
    return _unpartitioned("Runge-Kutta 4", a, [sixth, third, third, sixth], 4)


def _unpartitioned(name: str, a: object, b: object, order: int) -> PartitionedTableau:
    with many_digits(DIGITS + 10):
        return PartitionedTableau(name, exact(a), exact(a), exact(b), order)
