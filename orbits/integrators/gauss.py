"""Gauss: the variational partitioned Runge–Kutta method of collocation at Gauss nodes, order 2s.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, V_i),   extremized under   q+ = q + h sum_i b_i V_i

with a_bar = a; the nodes are the zeros of P_s(2c - 1). With one stage it is the implicit midpoint rule.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3, VI.6.3, VIII.6; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from orbits.checks import checked_flag, is_whole
from orbits.errors import InputError, shown
from orbits.integrators.base import option
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.collocation.variational import VariationalRungeKutta
from orbits.integrators.forms import Form
from orbits.tableaux import SymplecticTableau, gauss

MOST = 32
"""Stages in four registers. With more, the fixed-point iteration does not converge for the long steps that would make
them worthwhile."""


@dataclass(frozen=True)
class Gauss(VariationalRungeKutta):
    """Gauss collocation with 1 ... 32 stages, order 2s: the method of choice when accuracy matters.

    stages : s; 8 stages (order 16) fill one register. Fewer save nothing: eight lanes are evaluated anyway, and the
        iteration starts from a poorer prediction. More need several registers, for long steps of separable Lagrangians

    close_pairs : whether the distances of all massive bodies keep their digits where they are small beside those from
        the origin, as with moons. Without it, those of the heaviest body and of up to 4 bodies do, and all in runs
        without dt. For forces that depend on positions alone

    Implicit, symplectic, symmetric; conserves linear and angular momentum to round-off. With 8 stages, 15 steps per
    period leave only round-off for a nearly circular orbit; eccentric orbits need more. A step whose iteration does not
    converge is always an error.
    Raises InputError for other stages; a march raises ConvergenceError if a step does not converge.
    """

    stages: int = 8
    close_pairs: bool = option(False)

    name: ClassVar[str] = "gauss"
    summary: ClassVar[str] = "Gauss collocation: variational, implicit, order 2s, to the round-off floor"
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. II.1.3, VIII.6; Marsden & West (2001), sec. 2.6"

    def __post_init__(self) -> None:
        if not is_whole(self.stages) or not 1 <= self.stages <= MOST:
            raise InputError(
                f"Gauss needs a whole number of stages between 1 and {MOST}, got {shown(self.stages)}; use e.g. "
                "Gauss(stages=8)"
            )
        object.__setattr__(self, "stages", int(self.stages))
        object.__setattr__(self, "close_pairs", checked_flag(self.close_pairs, "close_pairs"))

    @property
    def tableau(self) -> SymplecticTableau:
        """Collocation at the zeros of a Legendre polynomial."""
        return gauss(self.stages)

    @property
    def second_order(self) -> Form:
        """All stages at once, to the round-off floor."""
        return Collocation(self.tableau, close=self.close_pairs)

    def form_with(self, forces: int, inner: int = 0) -> Form | None:
        """As for all methods of this family; with `close_pairs` there is none."""
        if self.close_pairs:
            raise InputError(
                f"{self.label}: close_pairs=True is for forces that depend on positions alone, which is not so here; "
                f"use Gauss(stages={self.stages})."
            )
        return super().form_with(forces, inner)

    @classmethod
    def examples(cls) -> tuple[Gauss, ...]:
        """Return the methods with 1, 2, 3, 4 and 8 stages."""
        return tuple(cls(stages=s) for s in (1, 2, 3, 4, 8))
