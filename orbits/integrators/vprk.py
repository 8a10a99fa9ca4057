"""`VPRK`: a variational partitioned Runge–Kutta method from a pair of tableaux of the user."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError, shown
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC
from orbits.integrators.collocation.variational import VariationalRungeKutta
from orbits.kernels.lanes import WIDTH
from orbits.tableaux import SymplecticTableau, convergence_order, symplectic
from orbits.tableaux.symplectic import FLOAT_TOLERANCE

Table = tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class VPRK(VariationalRungeKutta):
    """A variational partitioned Runge–Kutta method from a pair of tableaux of your own, 1 ... 8 stages.

    a : (s, s), for the positions: Q_i = q + h sum_j a_ij V_j
    b : (s,), weights, none of them zero
    a_bar : (s, s), for the momenta; by default the one that completes `a` to a symplectic pair,
        a_bar_ij = b_j (1 - a_ji / b_i)

    Numbers are floats, or texts such as "1/6" and "0.2", which are read exactly. Floats are adjusted to an exactly
    symplectic pair after the check that b_i a_bar_ij + b_j a_ji = b_i b_j to 2^-50. Raises InputError for a pair that
    is not symplectic. The order is determined from the order conditions, up to 6.
    """

    a: Table = (("0", "0"), ("1/2", "1/2"))
    b: tuple[Any, ...] = ("1/2", "1/2")
    a_bar: Table | None = None

    name: ClassVar[str] = "vprk"
    summary: ClassVar[str] = "variational partitioned Runge–Kutta method from your own pair of tableaux"
    source: ClassVar[str] = "Marsden & West (2001), sec. 2.6; Hairer, Lubich & Wanner (2006), sec. VI.6.2"

    def __post_init__(self) -> None:
        object.__setattr__(self, "a", _rows(self.a, "a"))
        object.__setattr__(self, "b", _row(self.b, "b"))
        if self.a_bar is not None:
            object.__setattr__(self, "a_bar", _rows(self.a_bar, "a_bar"))
        if not 1 <= len(self.b) <= WIDTH:
            raise InputError(f"VPRK needs between 1 and {WIDTH} stages, got {len(self.b)} weights b")
        _pair(self.a, self.b, self.a_bar)

    @property
    def tableau(self) -> SymplecticTableau:
        """The pair of coefficients."""
        return _pair(self.a, self.b, self.a_bar)

    @property
    def declares(self) -> frozenset[str]:  # type: ignore[override]
        """Symplectic and momentum maps always; symmetric if the pair is."""
        own = {SYMPLECTIC, MOMENTUM_MAPS}
        return frozenset(own | {SYMMETRIC} if self.tableau.symmetric else own)

    @classmethod
    def examples(cls) -> tuple[VPRK, ...]:
        """Return Störmer–Verlet's pair, the default, and a non-symmetric pair of order 2 with distinct tables."""
        return cls(), cls(a=(("1/5", "1/10"), ("1/2", "2/5")), b=("3/10", "7/10"))


@lru_cache(maxsize=64)
def _pair(a: Table, b: tuple[Any, ...], a_bar: Table | None) -> SymplecticTableau:
    numbers = [_number(x) for x in b]
    table = [[_number(x) for x in row] for row in a]
    inexact = any(isinstance(x, float) for values in (b, *a, *(a_bar or ())) for x in values)
    if a_bar is None:
        s = range(len(b))
        if any(x == 0 for x in numbers) or len(table) != len(b) or any(len(row) != len(b) for row in table):
            # The check of the pair will say what is wrong.
            completed = table
        else:
            completed = [[numbers[j] * (1 - table[j][i] / numbers[i]) for j in s] for i in s]
    else:
        completed = [[_number(x) for x in row] for row in a_bar]
    tolerance = {"tolerance": FLOAT_TOLERANCE} if inexact else {}
    order = convergence_order(symplectic("VPRK", table, completed, numbers, 1, **tolerance))
    return symplectic("VPRK", table, completed, numbers, order, **tolerance)


def _number(x: Any) -> Fraction:
    return Fraction(x)


def _row(values: Any, what: str) -> tuple[Any, ...]:
    try:
        if isinstance(values, str) or np.iscomplexobj(values):
            raise TypeError
        row = tuple(x if isinstance(x, str) else float(x) for x in values)
        for x in row:
            Fraction(x)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise InputError(
            f'VPRK: {what} must consist of finite numbers, or texts such as "1/6"; got {shown(values)}'
        ) from None
    return row


def _rows(values: Any, what: str) -> Table:
    if isinstance(values, str) or not hasattr(values, "__iter__") or getattr(values, "shape", None) == ():
        raise InputError(f"VPRK: {what} must be a square table, such as ((0, 0), (0.5, 0.5)); got {shown(values)}")
    return tuple(_row(row, what) for row in values)
