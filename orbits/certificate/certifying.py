"""`certify`: a method measured on the problem that it is going to be used for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from orbits.body_names import few
from orbits.certificate.measuring import EPS, Measured, Problem
from orbits.certificate.values import Certificate, Finding
from orbits.diagnostics.convergence import Slope
from orbits.diagnostics.tangent import plain_step, symplecticity_defect
from orbits.errors import InputError, IntegrationError, shown
from orbits.integrators import named
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.marching.flow import starting_state

if TYPE_CHECKING:
    from orbits.system import System

ORDER_SLACK = 0.2
"""How far, relatively, a fitted slope may lie below the order; above it is no fault."""

HIGH_ORDER = 8
"""Above this order, errors pass from the regime of long steps to round-off before the slope is the order: half of it is
asked for, and between a third and a half nothing can be said.
"""


def certify(
    problem: System | Lagrangian,
    integrator: Integrator | str,
    dt: Any,
    *,
    q: ArrayLike | None = None,
    v: ArrayLike | None = None,
    t: float = 0.0,
) -> Certificate:
    """Measure what `integrator` declares, and what a variational integrator must have, on an actual problem.

    problem : a `System`, or a `Lagrangian` with its start q, v of shape (d,) (its own example by default)
    integrator : a method, or its name as on the command line: "gauss(stages=4)"
    dt : the step; a Quantity, or a number in the problem's unit of time
    t : time of the start, for a Lagrangian that depends on it

    Measured are: the step against a plain solution of its equations; the residual of its discrete Euler–Lagrange
    equations, and its momenta against those of its L_d, without which an equivalent L_d would pass for its own; the
    charge of each symmetry; symplecticity, from the exact derivative of the step, of the massive bodies and of
    particles' fibres; the area of a loop of initial conditions; reversibility; the order of the map and of L_d, above
    the plateau of round-off; whether the energy is bounded. Forces of a system that have no Lagrangian take energy and
    momenta by what they are, which is no failure of a method: with them it is measured that the momenta change by no
    more than the forces' impulse and torque, and all else without them.

    Raises InputError if the method cannot serve the problem, IntegrationError if no step can be taken.

        print(orbits.certify(orbits.lagrangians.pendulum, orbits.Gauss(stages=4), dt=0.1))
    """
    integrator = named(integrator)
    if isinstance(problem, Lagrangian):
        start, p = starting_state(problem, q, v, None, t)
        step = float(_plain(dt))
        bound = Problem(problem, integrator, step, start, p, float(t))
        return _certificate(bound, problem.name, "", [])
    from orbits.system import System

    if not isinstance(problem, System):
        raise InputError(f"certify needs a System or a Lagrangian, got {type(problem).__name__}")
    if q is not None or v is not None:
        raise InputError("a System has its own start: leave q and v out")
    return _of_system(problem, integrator, dt)


def _of_system(system: System, integrator: Integrator, dt: Any) -> Certificate:
    from orbits.certificate.bodies import balances, step_of_bodies
    from orbits.marching.choice import form_of_bodies
    from orbits.system.model import lagrangian_of, model

    acting = model(system, np.flatnonzero(system.massive))
    names = [force.name for force in acting.forces]
    form_of_bodies(integrator, acting.lagrangian, with_particles=not system.massive.all(), forces=names)
    values, units = system.values, system.units
    step = float(units.time_value(dt, "dt"))
    massive = values.gm > 0.0
    lagrangian = lagrangian_of(system)
    q, v = values.q[massive].ravel(), values.v[massive].ravel()
    bound = Problem(lagrangian, integrator, step, q, lagrangian.momentum(q, v), 0.0)
    particles = [(values.q[k], values.v[k]) for k in np.flatnonzero(~massive)[:3]]
    count = int(np.sum(~massive))
    many = f", {count} massless particle{'s' * (count > 1)}" if count else ""
    unit = units.time.to_string() if hasattr(units.time, "to_string") else str(units.time)
    more: list[Finding] = []
    _check_step(bound)
    if SEPARABLE not in lagrangian.traits and not names:
        more.append(_finding("step of bodies", step_of_bodies(bound, acting), None, needed=True))
    for name, measured in balances(bound, acting) if names else ():
        more.append(_finding(f"balance: {name}", measured, MOMENTUM_MAPS in integrator.declares, needed=True))
    taken = f"; what {few(sorted(set(names)))} takes is left out but for the balances" if names else ""
    return _certificate(bound, f"{int(np.sum(massive))} bodies{many}{taken}", unit, particles, more)


def _certificate(
    problem: Problem, name: str, unit: str, particles: list[Any], more: Iterable[Finding] = ()
) -> Certificate:
    _check_step(problem)
    findings = (*_findings(problem, particles), *more)
    return Certificate(name, problem.integrator.label, problem.dt, unit, findings)


def _check_step(problem: Problem) -> None:
    if not (math.isfinite(problem.dt) and problem.dt != 0.0):
        raise InputError(f"dt must be finite and not zero, got {shown(problem.dt)}")


def _findings(problem: Problem, particles: list[Any]) -> Iterator[Finding]:
    method = problem.integrator
    declares = method.declares
    yield _finding("step solves its equations", problem.step_solves_its_equations(), None, needed=True)
    has = problem.has_discrete_lagrangian()
    if has:
        yield _finding("discrete Euler-Lagrange residual", problem.euler_lagrange(), method.variational, needed=True)
        yield _finding("momenta of L_d", problem.legendre_transforms(), method.variational, needed=True)
    else:
        reason = "its tableau is not symplectic" if method.variational else "it has none"
        yield Finding("discrete Lagrangian", math.nan, math.nan, "", False, method.variational, True, reason)
    for name, measured in problem.momentum_maps():
        yield _finding(f"momentum map: {name}", measured, MOMENTUM_MAPS in declares, needed=True)
    yield _finding("symplecticity", problem.symplecticity(), SYMPLECTIC in declares, needed=True)
    if particles:
        yield _finding("symplecticity of particles", _fibres(problem, particles), SYMPLECTIC in declares, needed=True)
    yield _finding("area of a loop", problem.areas(), SYMPLECTIC in declares, needed=True)
    yield _finding("reversibility", problem.reversibility(), SYMMETRIC in declares, needed=False)
    yield _order("order of the map", problem.order(), method.order)
    if has:
        yield _order("order of L_d", problem.order_of_discrete_lagrangian(), method.order)
    if problem.lagrangian.autonomous:
        try:
            energy = problem.energy()
        except IntegrationError as error:
            energy = Measured(math.nan, 0.5, "of its oscillation", f"the long march fails: {error}")
        # Bounded while steps resolve the motion: close encounters and chaos at long steps end it for any method.
        yield _finding("drift of the energy", energy, None, needed=False)


def _finding(name: str, measured: Measured, declared: bool | None, *, needed: bool) -> Finding:
    return Finding(name, measured.value, measured.bound, measured.unit, measured.holds, declared, needed, measured.note)


def _order(name: str, fitted: Slope, order: int) -> Finding:
    if math.isnan(fitted.order):
        note = "too few errors between round-off and the regime of long steps"
        return Finding(name, math.nan, float(order), "", False, None, False, note)
    asked = (1.0 - ORDER_SLACK) * order if order <= HIGH_ORDER else 0.5 * order
    if order > HIGH_ORDER and (order / 3 < fitted.order < asked or fitted.order > 1.5 * order):
        note = f"a slope of {fitted.order:.1f}, between round-off and the regime of long steps"
        return Finding(name, math.nan, float(order), "", False, None, False, note)
    note = f"from {len(fitted.h)} steps" + ("" if order <= HIGH_ORDER else ", half the order is asked for")
    return Finding(name, fitted.order, float(order), "", fitted.order > asked, True, True, note)


def _fibres(problem: Problem, particles: list[Any]) -> Measured:
    """For given massive bodies, the map of a particle's own (q, p): a body of GM = 1e-30 pulls on nothing."""
    from orbits.lagrangians.newtonian import n_body

    worst, tiny = 0.0, 1e-30
    gm = [value for name, value in problem.lagrangian.parameters.items() if name.startswith("GM")]
    terms = getattr(problem.lagrangian, "summands", ())
    lagrangian = n_body([*gm, tiny], math.sqrt(problem.lagrangian.parameters["eps2"]), terms)
    speeds = problem.lagrangian.velocity(problem.q, problem.p, problem.t)
    for x, w in particles:
        q, v = np.append(problem.q, x), np.append(speeds, w)
        p = lagrangian.momentum(q, v, problem.t)
        step = plain_step(lagrangian, problem.integrator.tableau, q, p, problem.dt, problem.t)
        d = len(problem.q)
        own = [d, d + 1, d + 2, 2 * d + 3, 2 * d + 4, 2 * d + 5]
        weights = np.full(3, math.sqrt(tiny * np.max(np.abs(w)) / np.max(np.abs(x))))
        worst = max(worst, symplecticity_defect(step.derivative[np.ix_(own, own)], weights))
    return Measured(worst, 32.0 * EPS * 6.0**0.5, "", f"{len(particles)} of the particles")


def _plain(dt: Any) -> float:
    try:
        return float(dt)
    except (TypeError, ValueError):
        raise InputError(f"a Lagrangian has no units: dt must be a number, got {shown(dt)}") from None
