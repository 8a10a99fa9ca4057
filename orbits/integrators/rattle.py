"""RATTLE: the variational integrator of the trapezoidal discrete Lagrangian with constraints.

    L_d(q, q+; h) = h/2 [L(q, (q+ - q)/h) + L(q+, (q+ - q)/h)]    with g(q) = 0

Among paths on the constraints, its discrete Euler–Lagrange equations have multipliers,

    D2 L_d(q-, q) + D1 L_d(q, q+) = G(q)^T lambda,    g(q+) = 0,      G = dg/dq,

and the momentum of q is the one that is tangent to the constraints, G M^-1 p = 0. SHAKE has the same positions, with
another choice of momenta. Without constraints it is Störmer–Verlet.

Source: Andersen (1983); Leimkuhler & Skeel (1994); Hairer, Lubich & Wanner (2006), sec. VII.1.4; Marsden & West (2001),
sec. 3.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.integrators.kicks_and_drifts.with_constraints import ConstrainedSplitting
from orbits.integrators.stormer_verlet import kick_drift_kick
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux import PartitionedTableau, lobatto_iiia_iiib


@dataclass(frozen=True)
class Rattle(Integrator):
    """Störmer–Verlet with holonomic constraints, order 2: rods, surfaces, linkages in Cartesian coordinates.

    For separable Lagrangians with constraints g(q) = 0, by `orbits.march`: symplectic on the constraints, symmetric;
    conserves the momentum maps of symmetries of L and g; keeps g = 0 and the velocities tangent, to round-off. One
    force evaluation per step, and a few of g. For higher orders compose it: `Composition(Rattle(), order=4)`, 6, 8, 10.
    Without constraints it is `StormerVerlet`.
    A march raises InputError for a start that is not on the constraints, ConvergenceError for a step so long that
    nothing leads back to them.
    """

    name: ClassVar[str] = "rattle"
    summary: ClassVar[str] = "RATTLE: Störmer–Verlet with constraints: variational, order 2"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    variational: ClassVar[bool] = True
    source: ClassVar[str] = (
        "Andersen (1983); Leimkuhler & Skeel (1994); Hairer, Lubich & Wanner (2006), sec. VII.1.4; Marsden & West "
        "(2001), sec. 3.5"
    )

    @property
    def tableau(self) -> PartitionedTableau:
        """Without constraints: Lobatto IIIA-IIIB with two stages."""
        return lobatto_iiia_iiib(2)

    @property
    def second_order(self) -> Splitting:
        """Without constraints: half a kick, a drift, half a kick."""
        return Splitting(kick_drift_kick, drifts=1)

    @property
    def constrained(self) -> ConstrainedSplitting:
        """The same with multipliers."""
        return ConstrainedSplitting()
