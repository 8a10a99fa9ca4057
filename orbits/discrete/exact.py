"""The exact discrete Lagrangian: the action of the true motion from q0 to q1 in the time h,

    L_d^E(q0, q1; h) = int_0^h L(q(t), q'(t), t) dt,      -D1 L_d^E = p(0),   D2 L_d^E = p(h).

The free particle, the harmonic oscillator, the Kepler problem and the free rigid body have closed forms. For any other
Lagrangian the boundary-value problem is solved by Gauss collocation on a mesh, which is a discrete variational problem
as well. The mesh is refined until more stages change nothing; the stationary action is then L_d^E to round-off.

Source: Marsden & West (2001), sec. 1.6, 2.3; Hairer, Lubich & Wanner (2006), sec. VI.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbits.discrete.base import Array, DiscreteLagrangian, Jet, Mechanics, require_mechanics
from orbits.discrete.boundary import OfSteps, jets_of, stationary
from orbits.discrete.exact_linear import exact_linear
from orbits.discrete.lambert import Way, exact_kepler
from orbits.discrete.rotors import kick_rotate_kick
from orbits.discrete.vprk import Vprk, vprk
from orbits.errors import ConvergenceError, InputError, shown
from orbits.lagrangians.base import Lagrangian, show
from orbits.tableaux.gauss import gauss

STAGES, FEWER = 8, 6
MESHES = (1, 2, 4, 8, 16, 32, 64)
AGREED = 1e-12
"""If orders 12 and 16 agree to this, 0.1^12, the error of order 16 is about 0.1^16."""


@dataclass(frozen=True, eq=False, repr=False)
class ExactByCollocation(OfSteps):
    """The action along the converged solution of the boundary-value problem; see `exact`."""

    name: str
    lagrangian: Mechanics
    rule: Vprk
    fewer: Vprk

    def _jets(self, q0: Array, q1: Array, h: float, t: float) -> list[Jet]:
        """Return the steps of the converged mesh."""
        points, solved, failed = np.array([q0, q1]), False, None
        for mesh in MESHES:
            if len(points) != mesh + 1:  # no coarser mesh has been solved
                points = q0 + np.linspace(0.0, 1.0, mesh + 1)[:, None] * (q1 - q0)
            try:
                points = stationary(self.rule, points, h / mesh, t)
                jets = jets_of(self.rule, points, h / mesh, t)
                check = stationary(self.fewer, points, h / mesh, t)
                d1 = self.fewer.d1(check[0], check[1], h / mesh, t)
                d2 = self.fewer.d2(check[-2], check[-1], h / mesh, t + h - h / mesh)
            except ConvergenceError as error:
                failed = error
                if solved or mesh >= 8:
                    break
                continue
            miss = max(np.max(np.abs(d1 - jets[0].d1)), np.max(np.abs(d2 - jets[-1].d2)))
            if miss <= AGREED * max(np.max(np.abs(d1)), np.max(np.abs(d2))):
                return jets
            solved = True
            points = self._halved(points, jets, h / mesh, t)
        raise ConvergenceError(
            f"{self.name}: the motion of '{self.lagrangian.name}' from q0 = {show(q0)} to q1 = {show(q1)} in "
            f"h = {h:.6g} was not found: the boundary-value problem does not converge from the "
            "straight line. Use a smaller h, or points joined by a motion without close encounters.",
            time=t,
        ) from failed

    def _halved(self, points: Array, jets: list[Jet], h: float, t: float) -> Array:
        """Return the path with a midpoint added to each step, by cubic Hermite interpolation."""
        finer = [points[0]]
        for k, jet in enumerate(jets):
            v0 = self.lagrangian.velocity(points[k], -jet.d1, t + k * h)
            v1 = self.lagrangian.velocity(points[k + 1], jet.d2, t + (k + 1) * h)
            finer += [0.5 * (points[k] + points[k + 1]) + 0.125 * h * (v0 - v1), points[k + 1]]
        return np.array(finer)


def exact_by_collocation(lagrangian: Mechanics) -> ExactByCollocation:
    """Return the exact discrete Lagrangian by collocation, for Lagrangians without a closed form; see `exact`."""
    return ExactByCollocation(
        "exact-by-collocation", lagrangian, vprk(lagrangian, gauss(STAGES)), vprk(lagrangian, gauss(FEWER))
    )


def exact(lagrangian: Mechanics, *, way: Way = "short") -> DiscreteLagrangian:
    """Return the exact discrete Lagrangian of a Lagrangian.

    way : which of the two arcs of a Kepler orbit: "short" for below 180 degrees, "long" for above
    'free-particle', 'harmonic-oscillator', 'kepler' and free rigid bodies have closed forms, with constants taken from
    the Lagrangian.
    For any other Lagrangian the motion is found by iteration from the straight line between the points. Where h is so
    long that several motions join them, it may find another one than expected, or none, a ConvergenceError. Raises
    InputError for a `way` of a Lagrangian without two arcs.
    """
    require_mechanics(lagrangian)
    name = lagrangian.name.replace("_", "-").replace(" ", "-")
    if name in ("free-particle", "harmonic-oscillator"):
        origin = np.zeros(lagrangian.dimension)
        qq, qv, vv = lagrangian.hessians(origin, origin)
        probe = np.linspace(1.0, 2.0, lagrangian.dimension)
        f, p = lagrangian.gradients(probe, probe, 0.7)
        if _close(qv, 0.0 * qv, vv) and _close(f, qq @ probe, f) and _close(p, vv @ probe, p):
            return exact_linear(vv, -qq, lagrangian=lagrangian)
    elif name == "kepler" and lagrangian.dimension in (2, 3):
        probe = np.linspace(1.0, 2.0, lagrangian.dimension)
        f, p = lagrangian.gradients(probe, probe)
        mass, r2 = float(p[0] / probe[0]), float(probe @ probe)
        gm = -float(f @ probe) * np.sqrt(r2) / mass
        if gm > 0.0 and _close(p, mass * probe, p) and _close(f, -mass * gm * probe / r2**1.5, f):
            return exact_kepler(gm, way, mass=mass, lagrangian=lagrangian)
    elif (free := _free_rotor(lagrangian)) is not None:
        return free
    if way != "short":
        raise InputError(f"way = {shown(way)} chooses an arc of a Kepler orbit; '{lagrangian.name}' has no such arcs")
    return exact_by_collocation(lagrangian)


def _free_rotor(lagrangian: Mechanics) -> DiscreteLagrangian | None:
    """Return the closed form of a rigid body about a fixed point, if no torque acts on it."""
    if not isinstance(lagrangian, Lagrangian) or len(lagrangian.rotors) != 1 or lagrangian.dimension != 4:
        return None
    probes = np.array([[1.0, 0.3, -0.2, 0.6], [0.2, -0.7, 0.9, 0.4]])
    if any(lagrangian.gradients(q, np.zeros(4))[0].any() for q in probes):
        return None
    return kick_rotate_kick(lagrangian, name=f"exact-{lagrangian.name}")


def _close(x: Array, y: Array, size: Array) -> bool:
    return bool(np.max(np.abs(x - y)) <= 1e-13 * np.max(np.abs(size)))
