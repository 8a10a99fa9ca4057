"""Measurements of the form in which `propagate` marches bodies with terms that depend on velocities, or forces.

The other measurements are those of the Lagrangian and of the method's map of positions and momenta. Here are the step
in velocities, which is the same map, and the balances of forces without a Lagrangian: momenta may change only by the
accounted torque and impulse.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from orbits.certificate.measuring import EPS, STEPS, Measured, Problem
from orbits.diagnostics.tangent import plain_step
from orbits.integrators.collocation.transformed_bodies import ENERGY, KNOWN
from orbits.lagrangians.base import Lagrangian
from orbits.marching.legs.leg import Leg

if TYPE_CHECKING:
    from orbits.system.model import Model

Array = np.typing.NDArray[np.float64]

OTHER_ENERGY = 1.0 + 2.0**-20
"""E0 as a multiple of the energy: so close to it that the motion is that of the bodies."""

PLACES = 5
"""The number of states of the march at which the step is compared."""


def step_of_bodies(problem: Problem, acting: Model) -> Measured:
    """Compare steps in positions and velocities with plain solutions, in units of 2^-53 of the state."""
    lagrangian, h, worst, grown = problem.lagrangian, problem.dt, 0.0, 1.0
    speeds = float(np.max(np.abs(problem.path.v)))
    for k in range(0, len(problem.path) - 1, max(1, len(problem.path) // PLACES)):
        q, p, t = problem.path.q[k], problem.path.p[k], float(problem.path.t[k])
        plain = plain_step(lagrangian, problem.integrator.tableau, q, p, h, t)
        one, other = _marched(problem, acting, q, lagrangian.velocity(q, p, t), t, 1)
        off = float(np.max(np.abs(one - plain.q) * problem.weights)) / problem.size
        more = float(np.max(np.abs(other - lagrangian.velocity(plain.q, plain.p, t + h)))) / speeds
        worst = max(worst, off / EPS, more / EPS)
        grown = max(grown, problem.growth(plain.derivative))
    return Measured(worst, 64.0 * grown, "x 2^-53", "steps of bodies against plain solutions")


def steps_in_transformed_time(problem: Problem, marcher: Leg) -> Measured:
    """Compare steps of a march of bodies in transformed time, and the time that they take, with plain solutions for its
    Lagrangian; in units of 2^-53 of the state.

    E0 is not the energy of the march: the terms with H - E0, which make a step symplectic, would otherwise be lost in
    round-off.
    """
    h, worst, grown = problem.dt, 0.0, 1.0
    start = marcher.checkpoint()
    start["memory"][-1, [ENERGY, KNOWN]] = OTHER_ENERGY * problem.lagrangian.parameters["E0"], 1.0
    marcher.restore(start)
    lagrangian = problem.lagrangian.with_parameters(E0=float(start["memory"][-1, ENERGY]))
    n = len(problem.q) // 3
    gm = np.repeat(np.array(list(lagrangian.parameters.values())[1 : 1 + n]), 3)
    for _ in range(PLACES):
        q, v = (x.ravel() for x in marcher.state())
        begun = marcher.time
        plain = plain_step(lagrangian, problem.integrator.tableau, q, gm * v, h)
        marcher.advance(1)
        one, other = (x.ravel() for x in marcher.state())
        took = h * float(problem.integrator.tableau.b @ [_rate(lagrangian, Q) for Q in plain.Q])
        late = abs(marcher.time - begun - took) / max(abs(marcher.time), abs(took))
        worst = max(worst, problem.apart((one, gm * other), (plain.q, plain.p)), late / EPS)
        grown = max(grown, problem.growth(plain.derivative))
        marcher.advance(max(0, len(problem.path) // PLACES - 1))
    return Measured(worst, 64.0 * grown, "x 2^-53", "steps of bodies, and their times, against plain solutions")


def _rate(lagrangian: Lagrangian, q: Array) -> float:
    """Return the monitor g at q, by which the masses in the kinetic energy are divided."""
    mass = lagrangian.hessians(q, np.zeros_like(q))[2]
    return float(lagrangian.parameters["GM1"] / mass[0, 0])


def balances(problem: Problem, acting: Model) -> Iterator[tuple[str, Measured]]:
    """The change of each momentum map over the march, less the contribution of forces, relative to the sum of its
    terms.
    """
    lagrangian, t = problem.lagrangian, problem.t + STEPS * problem.dt
    marcher = _marcher(problem, acting, problem.q, lagrangian.velocity(problem.q, problem.p, problem.t), problem.t)
    marcher.advance(STEPS)
    q, v = (x.ravel() for x in marcher.state())
    p, done = lagrangian.momentum(q, v, t), marcher.accounts().sum(axis=0)
    for symmetry in lagrangian.symmetries:
        kind = symmetry.name.split()[0]
        if kind not in ("translation", "rotation"):
            continue
        # A force changes a charge by its product with the generator: for a translation along u by the impulse along u,
        # for a rotation about u by the torque. The generator at points on the axes gives u.
        given = _along(symmetry.xi, kind, len(q)) @ (done[4:7] if kind == "translation" else done[1:4])
        change = symmetry.charge(q, p, t) - symmetry.charge(problem.q, problem.p, problem.t)
        scale = max(symmetry.charge_size(q, p, t), symmetry.charge_size(problem.q, problem.p, problem.t))
        off = abs(change - float(given)) / scale if scale > 0.0 else 0.0
        yield symmetry.name, Measured(off, 4.0 * EPS * STEPS**0.5, "relative", f"{STEPS} steps, less what forces gave")


def _along(xi: object, kind: str, size: int) -> Array:
    """Return the unit vector u of xi(q) = u or xi(q) = u x q for each body."""
    assert callable(xi)
    if kind == "translation":
        return np.asarray(xi(np.zeros(size)))[:3]
    e = np.tile(np.eye(3), (1, size // 3))
    turned = [np.asarray(xi(row))[:3] for row in e]
    return np.array([turned[1][2], turned[2][0], turned[0][1]])


def _marched(problem: Problem, acting: Model, q: Array, v: Array, t: float, steps: int) -> tuple[Array, Array]:
    marcher = _marcher(problem, acting, q, v, t)
    marcher.advance(steps)
    x, w = marcher.state()
    return x.ravel(), w.ravel()


def _marcher(problem: Problem, acting: Model, q: Array, v: Array, t: float) -> Leg:
    lagrangian: Lagrangian = acting.lagrangian
    massive = np.ones(len(q) // 3, dtype=bool)
    x, w = q.reshape(-1, 3), v.reshape(-1, 3)
    options = {"forces": acting.forces, "start": t}
    return Leg.of(lagrangian, problem.integrator, acting.vectors, massive, x, w, problem.dt, **options)
