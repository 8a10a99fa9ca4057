"""Störmer–Verlet: the variational integrator of the trapezoidal discrete Lagrangian.

    L_d(q, q+; h) = h/2 [L(q, (q+ - q)/h) + L(q+, (q+ - q)/h)]

For a separable Lagrangian, q'' = g(q), its discrete Euler–Lagrange equations are kick - drift - kick:

    v_half = v + h/2 g(q),     q+ = q + h v_half,     v+ = v_half + h/2 g(q+)

Source: Hairer, Lubich & Wanner (2006), sec. I.1.4; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator
from orbits.integrators.forms import Array
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.integrators.rigid.rotating import Rotating
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.tableaux import PartitionedTableau, lobatto_iiia_iiib

if TYPE_CHECKING:
    from orbits.discrete.base import DiscreteLagrangian


def kick_drift_kick(h: float) -> tuple[Array, Array]:
    """Half a kick, a drift, half a kick."""
    return np.array([h / 2, h / 2]), np.array([h])


@dataclass(frozen=True)
class StormerVerlet(Integrator):
    """The explicit second-order workhorse, known in the field as leapfrog.

    One force evaluation per step; symplectic, symmetric; conserves linear and angular momentum to round-off. Its energy
    error is bounded and proportional to dt^2: take some hundreds of steps in the shortest period, or `Gauss` if more
    than a few digits matter.
    """

    name: ClassVar[str] = "stormer-verlet"
    summary: ClassVar[str] = "Störmer–Verlet (leapfrog): variational, explicit, order 2"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    variational: ClassVar[bool] = True
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. I.1.4; Marsden & West (2001), sec. 2.6"

    @property
    def tableau(self) -> PartitionedTableau:
        """Lobatto IIIA-IIIB with two stages."""
        return lobatto_iiia_iiib(2)

    @property
    def second_order(self) -> Splitting:
        """Half a kick, a drift, half a kick."""
        return Splitting(kick_drift_kick, drifts=1)

    def form_of_rotors(self, lagrangian: Lagrangian) -> Rotating:
        """Half a kick, the free motion, half a kick."""
        return Rotating.between(lagrangian, kick_drift_kick)

    def discrete_lagrangian(self, lagrangian: Lagrangian) -> DiscreteLagrangian | None:
        """For rigid bodies, that of kicks and exact rotations; else that of the tableau."""
        if not lagrangian.rotors:
            return None
        from orbits.discrete.rotors import kick_rotate_kick

        return kick_rotate_kick(lagrangian)
