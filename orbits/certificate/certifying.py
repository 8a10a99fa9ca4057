"""`certify`: a method's properties, measured on the problem it will be used for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from orbits.body_names import few
from orbits.certificate.certificate import Certificate, Finding
from orbits.certificate.constrained import ConstrainedProblem
from orbits.certificate.kernels import kernels_agree
from orbits.certificate.measuring import EPS, Measured, Problem
from orbits.certificate.orders import order_of_discrete_lagrangian, order_of_map
from orbits.checks import has_unit, nonzero_number, single_number
from orbits.diagnostics.convergence import Slope
from orbits.diagnostics.symplecticity import symplecticity
from orbits.diagnostics.tangent import plain_step, symplecticity_defect
from orbits.errors import InputError, IntegrationError, counted, shown
from orbits.integrators import named
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator
from orbits.lagrangians.base import CONSTRAINED, NEWTONIAN, SEPARABLE, Lagrangian
from orbits.marching.clocks.transformed import TimeTransformed
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.marching.flow import starting_state

if TYPE_CHECKING:
    from orbits.system import System

ORDER_SLACK = 0.2
"""Fraction of the order by which a fitted slope may fall short; a steeper slope is no fault."""

BENT = 0.5
"""The part of a slope by which slopes between neighbouring errors may differ where it tells an order: the motion of a
close pair has a small share in errors, so that steps far too long for it are not seen by their size.
"""

PLACES = 3
"""The number of states of the march at which kernels are compared."""

HIGH_ORDER = 8
"""Above this order, errors reach round-off before their slope reaches the order. Half the order is then required;
between a third and a half, the measurement decides nothing.
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
    """Measure on an actual problem what `integrator` declares, and what every variational integrator must have.

    problem : a `System`, or a `Lagrangian` with initial q, v of shape (d,) (its own example by default)
    integrator : a method, or its name as on the command line: "gauss(stages=4)"
    dt : the step; a Quantity, or a number in the problem's unit of time; for a `System` also a clock of constant steps
        in transformed time, `TimeTransformed(step=0.3)`
    t : initial time, for a Lagrangian that depends on time

    Measured are
    - whether the kernels of L are derivatives of one another; if they are not, nothing else means anything, and is left
      out
    - the step, against an independent solution of its equations
    - the residual of its discrete Euler–Lagrange equations
    - its momenta, against those of its L_d (an equivalent L_d has the same equations, but other momenta)
    - the momentum map of each symmetry
    - symplecticity, from the exact derivative of the step: of the massive bodies, and of massless particles
    - the area of a loop of initial conditions
    - reversibility
    - the order of the map and of L_d, above the round-off plateau
    - whether the energy error is bounded

    Forces without a Lagrangian take energy and momenta away, which is no failure of a method. With them it is measured
    that the momenta change by the impulse and the torque of the forces and by nothing else; all other properties are
    measured without them.

    Raises InputError if the method cannot be used for the problem, IntegrationError if no step can be taken.

        print(orbits.certify(orbits.lagrangians.pendulum, orbits.Gauss(stages=4), dt=0.1))
    """
    integrator = named(integrator)
    if isinstance(problem, Lagrangian):
        if isinstance(dt, ChangingSteps):
            raise InputError(
                f"dt is {shown(dt)}, a clock for bodies; a Lagrangian is certified with steps of one length: dt=0.1. "
                "In transformed time it is another Lagrangian: orbits.lagrangians.time_transformed(L, monitor=...)."
            )
        start, p = starting_state(problem, q, v, None, t)
        step = _without_units(dt)
        kind = ConstrainedProblem if CONSTRAINED in problem.traits else Problem
        bound = kind(problem, integrator, step, start, p, float(t))
        speeds = problem.vector(problem.example.v if q is None and problem.example else cast(ArrayLike, v), "v")
        return _certificate(bound, speeds, problem.name, "", [])
    from orbits.system import System

    if not isinstance(problem, System):
        raise InputError(f"certify needs a System or a Lagrangian, got {type(problem).__name__}")
    if q is not None or v is not None:
        raise InputError("a System has initial positions and velocities of its own: leave out q and v")
    if isinstance(dt, TimeTransformed):
        return _in_transformed_time(problem, integrator, dt)
    if isinstance(dt, ChangingSteps):
        raise InputError(
            f"dt is {shown(dt)}: steps that are chosen one by one depend on the state, so that no method is symplectic "
            "with them. Certify with a length, dt=..., or with dt=orbits.TimeTransformed()."
        )
    if problem.rigid:
        raise InputError(
            "certificates are of positions and velocities, and know no attitudes; certify the method for points, "
            "system.replaced(forces=()). Rigid bodies keep what it declares, as their free rotation is exact."
        )
    if any(term.gives_bodies for term in problem.terms):
        raise InputError(
            "certificates are of massive bodies that are integrated, but those of a system in an ephemeris are read; "
            "certify the method with them integrated: System.solar_system(...)."
        )
    return _of_system(problem, integrator, dt)


def _of_system(system: System, integrator: Integrator, dt: Any) -> Certificate:
    from orbits.certificate.bodies import balances, step_of_bodies
    from orbits.marching.clocks.constant import ConstantSteps
    from orbits.marching.stepping.choice_of_form import form_of_bodies
    from orbits.system.model import lagrangian_of, model

    acting = model(system, np.flatnonzero(system.massive))
    names = [force.name for force in acting.forces]
    values, units = system.values, system.units
    step = float(units.time_value(dt, "dt"))
    nonzero_number(step, "dt")
    with_particles = not system.massive.all()
    what: dict[str, Any] = {"with_particles": with_particles, "forces": acting.forces}
    form_of_bodies(integrator, acting.lagrangian, ConstantSteps(step), **what)
    massive = values.gm > 0.0
    lagrangian = lagrangian_of(system)
    q, v = values.q[massive].ravel(), values.v[massive].ravel()
    if len(q) == 3 and not v.any():
        raise InputError(
            f"{system.names[int(massive.argmax())]} is the only massive body, and at rest: errors are measured "
            "relative to the motion of massive bodies. Give it a velocity, or a second body a mass."
        )
    bound = Problem(lagrangian, integrator, step, q, lagrangian.momentum(q, v), 0.0)
    particles = [(values.q[k], values.v[k]) for k in np.flatnonzero(~massive)[:3]]
    count = int(np.sum(~massive))
    many = f", {count} massless particle{'s' * (count > 1)}" if count else ""
    unit = units.time.to_string() if hasattr(units.time, "to_string") else str(units.time)

    def more() -> Iterator[Finding]:
        if SEPARABLE not in lagrangian.traits and not names and not integrator.follows_kepler:
            yield _finding("step of bodies", step_of_bodies(bound, acting), None, needed=True)
        for name, measured in balances(bound, acting) if names else ():
            yield _finding(f"balance: {name}", measured, MOMENTUM_MAPS in integrator.declares, needed=True)

    taken = f"; what {few(sorted(set(names)))} takes is left out but for the balances" if names else ""
    return _certificate(bound, v, f"{counted(int(np.sum(massive)), 'body')}{many}{taken}", unit, particles, more())


def _in_transformed_time(system: System, integrator: Integrator, clock: TimeTransformed) -> Certificate:
    from orbits.certificate.bodies import steps_in_transformed_time
    from orbits.lagrangians.bodies_in_transformed_time import bodies_in_transformed_time
    from orbits.marching.legs.leg import Leg
    from orbits.system.model import lagrangian_of, model

    values, massive = system.values, np.flatnonzero(system.massive)
    acting = model(system, massive)
    # What cannot be marched in transformed time is refused here.
    marcher = Leg.of(
        acting.lagrangian,
        integrator,
        acting.vectors,
        system.massive,
        values.q,
        values.v,
        clock,
        forces=acting.forces,
    )
    clock.check_bodies(marcher.problem.strength, values, system.names)
    q, v = values.q.ravel(), values.v.ravel()
    newton = lagrangian_of(system)
    transformed = bodies_in_transformed_time(values.gm, newton.energy(q, v), values.softening)
    problem = Problem(transformed, integrator, clock.step, q, newton.momentum(q, v), 0.0)
    more = [_finding("steps of bodies", steps_in_transformed_time(problem, marcher), None, needed=True)]
    speeds = transformed.velocity(q, problem.p)
    return _certificate(problem, speeds, counted(len(values.gm), "body"), "in transformed time", [], more)


def _certificate(
    problem: Problem, v: np.ndarray, name: str, unit: str, particles: list[Any], more: Iterable[Finding] = ()
) -> Certificate:
    """v : the velocities at the start, (d,), which kernels that contradict each other may not give from momenta."""
    nonzero_number(problem.dt, "dt")
    findings = _of_kernels(problem, [(problem.q, v, problem.t)])
    if all(finding.holds for finding in findings):
        path, speeds = problem.path, problem.path.v
        places = range(0, len(path), max(1, len(path) // PLACES))
        findings = _of_kernels(problem, [(path.q[k], speeds[k], float(path.t[k])) for k in places])
    if all(finding.holds for finding in findings):
        findings = (*findings, *_findings(problem, particles), *more)
    return Certificate(name, problem.integrator.label, problem.dt, unit, findings)


def _of_kernels(problem: Problem, states: list[tuple[np.ndarray, np.ndarray, float]]) -> tuple[Finding, ...]:
    found = kernels_agree(problem.lagrangian, states)
    return tuple(_finding(name, measured, None, needed=True) for name, measured in found)


def _findings(problem: Problem, particles: list[Any]) -> Iterator[Finding]:
    method = problem.integrator
    declares = method.declares
    has = problem.has_discrete_lagrangian()
    if not method.follows_kepler:
        yield _finding("step solves its equations", problem.step_solves_its_equations(), None, needed=True)
    if has:
        yield _finding("discrete Euler-Lagrange residual", problem.euler_lagrange(), method.variational, needed=True)
        yield _finding("momenta of L_d", problem.legendre_transforms(), method.variational, needed=True)
    elif method.follows_kepler:
        reason = method.own_discrete_lagrangian
        if method.variational and NEWTONIAN not in problem.lagrangian.traits:
            reason = "that of Kepler motions and kicks is known, not that of other terms"
        yield Finding("discrete Lagrangian", math.nan, math.nan, "", False, None, False, reason)
    else:
        reason = "its tableau is not symplectic" if method.variational else "it has none"
        yield Finding("discrete Lagrangian", math.nan, math.nan, "", False, method.variational, True, reason)
    for name, measured in problem.more():
        yield _finding(name, measured, None, needed=True)
    for name, measured in problem.momentum_maps():
        yield _finding(f"momentum map: {name}", measured, MOMENTUM_MAPS in declares, needed=True)
    yield _finding("symplecticity", problem.symplecticity(), SYMPLECTIC in declares, needed=True)
    if particles:
        yield _finding("symplecticity of particles", _fibres(problem, particles), SYMPLECTIC in declares, needed=True)
    yield _finding("area of a loop", problem.areas(), SYMPLECTIC in declares, needed=True)
    yield _finding("reversibility", problem.reversibility(), SYMMETRIC in declares, needed=False)
    yield _order("order of the map", order_of_map(problem), method.order_with(problem.lagrangian))
    if problem.tells_order_of_discrete_lagrangian:
        yield _order("order of L_d", order_of_discrete_lagrangian(problem), method.order)
    if problem.lagrangian.autonomous:
        try:
            energy = problem.energy()
        except IntegrationError as error:
            energy = Measured(math.nan, 0.5, "of its oscillation", f"the long march fails: {error}")
        # Bounded only while steps resolve the motion: close encounters, or chaos at long steps, end it for any method.
        yield _finding("drift of the energy", energy, None, needed=False)


def _finding(name: str, measured: Measured, declared: bool | None, *, needed: bool) -> Finding:
    return Finding(name, measured.value, measured.bound, measured.unit, measured.holds, declared, needed, measured.note)


def _order(name: str, fitted: Slope, order: int) -> Finding:
    if math.isnan(fitted.order):
        note = "too few errors between round-off and steps that are too long"
        return Finding(name, math.nan, float(order), "", False, None, False, note)
    asked = (1.0 - ORDER_SLACK) * order if order <= HIGH_ORDER else 0.5 * order
    if order > HIGH_ORDER and (order / 3 < fitted.order < asked or fitted.order > 1.5 * order):
        return _undecided(name, order, f"a slope of {fitted.order:.1f}")
    if fitted.order < asked and fitted.bend > BENT * max(1.0, abs(fitted.order)):
        return _undecided(name, order, f"slopes that differ by {fitted.bend:.1f}")
    note = f"from {len(fitted.h)} steps" + ("" if order <= HIGH_ORDER else ", half the order is required")
    return Finding(name, fitted.order, float(order), "", fitted.order > asked, True, True, note)


def _undecided(name: str, order: int, why: str) -> Finding:
    note = f"{why}: no asymptotic regime between long steps and round-off"
    return Finding(name, math.nan, float(order), "", False, None, False, note)


def _fibres(problem: Problem, particles: list[Any]) -> Measured:
    """The map of a particle's own (q, p), the massive bodies being given: a body of GM = 1e-30 attracts nothing."""
    from orbits.lagrangians.newtonian import n_body

    worst, tiny = 0.0, 1e-30
    gm = [value for name, value in problem.lagrangian.parameters.items() if name.startswith("GM")]
    terms = getattr(problem.lagrangian, "summands", ())
    lagrangian = n_body([*gm, tiny], math.sqrt(problem.lagrangian.parameters["eps2"]), terms)
    speeds = problem.lagrangian.velocity(problem.q, problem.p, problem.t)
    if problem.integrator.follows_kepler:  # it has no tableau: by differences of its own steps
        masses, (places, moving) = np.append(gm, np.zeros(len(particles))), zip(*particles, strict=True)
        all_q, all_v = np.vstack([problem.q.reshape(-1, 3), *places]), np.vstack([speeds.reshape(-1, 3), *moving])
        found = symplecticity(masses, all_q, all_v, problem.integrator, problem.dt, terms=terms)
        bound, note = 32.0 * EPS * 6.0**0.5 + 4.0 * found.noise, f"{len(particles)} of the particles, by differences"
        return Measured(float(found.particles.max()), bound, "", note)
    for x, w in particles:
        q, v = np.append(problem.q, x), np.append(speeds, w)
        p = lagrangian.momentum(q, v, problem.t)
        step = plain_step(lagrangian, problem.integrator.tableau, q, p, problem.dt, problem.t)
        d = len(problem.q)
        own = [d, d + 1, d + 2, 2 * d + 3, 2 * d + 4, 2 * d + 5]
        place, speed = (np.max(np.abs(own if np.any(own) else whole)) for own, whole in ((x, q), (w, v)))
        weights = np.full(3, math.sqrt(tiny * speed / place))
        worst = max(worst, symplecticity_defect(step.derivative[np.ix_(own, own)], weights))
    return Measured(worst, 32.0 * EPS * 6.0**0.5, "", f"{len(particles)} of the particles")


def _without_units(dt: Any) -> float:
    if has_unit(dt):
        raise InputError(f"a Lagrangian has no units: dt must be a number, got {shown(dt)}")
    return single_number(dt, "dt")
