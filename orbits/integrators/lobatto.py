"""Lobatto IIIA–IIIB: variational partitioned Runge–Kutta methods with nodes at both ends of the step, order 2s - 2.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, V_i),   extremized under   q+ = q + h sum_i b_i V_i

IIIA gives the positions and IIIB the momenta, or the other way round. For a separable Lagrangian IIIA–IIIB with two
stages is Störmer–Verlet, the method of the trapezoidal discrete Lagrangian.

Source: Hairer, Lubich & Wanner (2006), sec. II.2.2, VI.4.1; Marsden & West (2001), sec. 2.6; Sun (1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.checks import is_whole
from orbits.errors import InputError, shown
from orbits.integrators.collocation.variational import VariationalRungeKutta
from orbits.integrators.forms import Array, Form
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.integrators.stormer_verlet import kick_drift_kick
from orbits.kernels.lanes import WIDTH
from orbits.tableaux import SymplecticTableau, lobatto_iiia_iiib, lobatto_iiib_iiia


def drift_kick_drift(h: float) -> tuple[Array, Array]:
    """Half a drift, a kick, half a drift."""
    return np.array([0.0, h, 0.0]), np.array([h / 2, h / 2])


def _checked(name: str, stages: Any) -> int:
    if not is_whole(stages) or not 2 <= stages <= WIDTH:
        raise InputError(
            f"{name} needs a whole number of stages between 2 and {WIDTH}, got {shown(stages)}; use e.g. "
            f"{name}(stages=3)"
        )
    return int(stages)


@dataclass(frozen=True)
class LobattoIIIAB(VariationalRungeKutta):
    """Lobatto IIIA for the positions, IIIB for the momenta, 2 ... 8 stages, order 2s - 2.

    stages : s

    Implicit except for two stages with a separable Lagrangian; symplectic, symmetric; conserves linear and angular
    momentum. The ends of a step are stages, so forces are evaluated at the output positions.
    Raises InputError for other stages; a march raises ConvergenceError if a step does not converge.
    """

    stages: int = 3

    name: ClassVar[str] = "lobatto-iiia-iiib"
    summary: ClassVar[str] = "Lobatto IIIA–IIIB: variational, implicit, order 2s - 2"
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. II.2.2, VI.4.1; Sun (1993)"

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", _checked("LobattoIIIAB", self.stages))

    @property
    def tableau(self) -> SymplecticTableau:
        """IIIA with its symplectic partner."""
        return lobatto_iiia_iiib(self.stages)

    @property
    def second_order(self) -> Form:
        """With two stages, the kicks and drifts of Störmer–Verlet."""
        return Splitting(kick_drift_kick, drifts=1) if self.stages == 2 else super().second_order

    @classmethod
    def examples(cls) -> tuple[LobattoIIIAB, ...]:
        """Return the methods with 2, 3 and 4 stages."""
        return tuple(cls(stages=s) for s in (2, 3, 4))


@dataclass(frozen=True)
class LobattoIIIBA(VariationalRungeKutta):
    """Lobatto IIIB for the positions, IIIA for the momenta, 2 ... 8 stages, order 2s - 2.

    stages : s

    Symplectic, symmetric; conserves linear and angular momentum. With two stages and a separable Lagrangian it is
    explicit: drift - kick - drift.
    Raises InputError for other stages; a march raises ConvergenceError if a step does not converge.
    """

    stages: int = 3

    name: ClassVar[str] = "lobatto-iiib-iiia"
    summary: ClassVar[str] = "Lobatto IIIB–IIIA: variational, implicit, order 2s - 2"
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. II.2.2, VI.4.1; Sun (1993)"

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", _checked("LobattoIIIBA", self.stages))

    @property
    def tableau(self) -> SymplecticTableau:
        """IIIB with its symplectic partner."""
        return lobatto_iiib_iiia(self.stages)

    @property
    def second_order(self) -> Form:
        """With two stages, two drifts and a kick."""
        return Splitting(drift_kick_drift, drifts=2) if self.stages == 2 else super().second_order

    @classmethod
    def examples(cls) -> tuple[LobattoIIIBA, ...]:
        """Return the methods with 2 and 3 stages."""
        return tuple(cls(stages=s) for s in (2, 3))
