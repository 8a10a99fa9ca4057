"""Lobatto IIIA–IIIB: variational partitioned Runge–Kutta methods with nodes at both ends of the step, order 2s - 2.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, V_i),   extremized under   q+ = q + h sum_i b_i V_i

IIIA gives the positions and IIIB the momenta, or the other way round. For a separable Lagrangian IIIA–IIIB with two
stages is Störmer–Verlet, the method of the trapezoidal discrete Lagrangian.

Source: Hairer, Lubich & Wanner (2006), sec. II.2.2, VI.4.1; Marsden & West (2001), sec. 2.6; Sun (1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

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


@dataclass(frozen=True)
class Lobatto(VariationalRungeKutta):
    """The base of both, with a tableau of `stages` stages, and the form of that with two."""

    stages: int = 3

    two: ClassVar[Splitting]

    def __post_init__(self) -> None:
        name, stages = type(self).__name__, self.stages
        if not is_whole(stages) or not 2 <= stages <= WIDTH:
            raise InputError(
                f"{name} needs a whole number of stages between 2 and {WIDTH}, got {shown(stages)}; use e.g. "
                f"{name}(stages=3)"
            )
        object.__setattr__(self, "stages", int(stages))

    @property
    def second_order(self) -> Form:
        """With two stages, kicks and drifts."""
        return self.two if self.stages == 2 else super().second_order


@dataclass(frozen=True)
class LobattoIIIAB(Lobatto):
    """Lobatto IIIA for the positions, IIIB for the momenta, 2 ... 8 stages, order 2s - 2.

    stages : s

    Implicit except for two stages with a separable Lagrangian, which are those of Störmer–Verlet; symplectic,
    symmetric; conserves linear and angular momentum. The ends of a step are stages, so forces are evaluated at the
    output positions.
    Raises InputError for other stages; a march raises ConvergenceError if a step does not converge.
    """

    name: ClassVar[str] = "lobatto-iiia-iiib"
    summary: ClassVar[str] = "Lobatto IIIA–IIIB: variational, implicit, order 2s - 2"
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. II.2.2, VI.4.1; Sun (1993)"
    two: ClassVar[Splitting] = Splitting(kick_drift_kick, drifts=1)

    @property
    def tableau(self) -> SymplecticTableau:
        """IIIA with its symplectic partner."""
        return lobatto_iiia_iiib(self.stages)

    @classmethod
    def examples(cls) -> tuple[LobattoIIIAB, ...]:
        """Return the methods with 2, 3 and 4 stages."""
        return tuple(cls(stages=s) for s in (2, 3, 4))


@dataclass(frozen=True)
class LobattoIIIBA(Lobatto):
    """Lobatto IIIB for the positions, IIIA for the momenta, 2 ... 8 stages, order 2s - 2.

    stages : s

    Symplectic, symmetric; conserves linear and angular momentum. With two stages and a separable Lagrangian it is
    explicit: drift - kick - drift.
    Raises InputError for other stages; a march raises ConvergenceError if a step does not converge.
    """

    name: ClassVar[str] = "lobatto-iiib-iiia"
    summary: ClassVar[str] = "Lobatto IIIB–IIIA: variational, implicit, order 2s - 2"
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. II.2.2, VI.4.1; Sun (1993)"
    two: ClassVar[Splitting] = Splitting(drift_kick_drift, drifts=2)

    @property
    def tableau(self) -> SymplecticTableau:
        """IIIB with its symplectic partner."""
        return lobatto_iiib_iiia(self.stages)

    @classmethod
    def examples(cls) -> tuple[LobattoIIIBA, ...]:
        """Return the methods with 2 and 3 stages."""
        return tuple(cls(stages=s) for s in (2, 3))
