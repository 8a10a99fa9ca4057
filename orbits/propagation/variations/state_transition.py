"""State-transition matrices: how states at later times depend on those at the start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Unpack

import numpy as np

from orbits import integrators
from orbits.checks import checked_flag
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import InputError, RetiredWarning, counted
from orbits.finding import SHOWN, Finding
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.propagation.checks.available_memory import MEMORY_SHARE, memory
from orbits.propagation.checks.before_the_start import found_ahead, warn_or_refuse
from orbits.propagation.marchers import bound
from orbits.propagation.variations.following import (
    Varied,
    at_samples,
    each_in_threads,
    massive_of,
    particle_of,
    require_followable,
    tangents_of,
)
from orbits.results.state_transition import StateTransition
from orbits.system import System
from orbits.system.model import given_bodies
from orbits.system.parameters import Parameter, parameters_of
from orbits.time_grid import TimeGrid


def state_transition(
    system: System,
    integrator: Integrator | str | None = None,
    *,
    dt: Any = None,
    duration: Any = None,
    until: Any = None,
    samples: Any = None,
    coupled: bool = True,
    parameters: Sequence[str] = (),
    check_step: bool | Literal["refuse"] = True,
    threads: int | None = None,
    **others: Unpack[NoOthers],
) -> StateTransition:
    """Return the state-transition matrix of a run: the derivative of the state at its end by that at its start.

        stm = orbits.state_transition(system, duration=1 * u.yr)
        stm["Mercury", "Venus"]  # 6 x 6: Mercury at the end by Venus at the start
        covariance = stm.matrix @ covariance @ stm.matrix.T

        stm = orbits.state_transition(system, duration=1 * u.yr, parameters=["Apophis.A2", "Ceres.gm"])
        stm["Apophis", "Apophis.A2"]  # (6,): Apophis at the end by its A2

    system, integrator, dt, duration, until, check_step : as in `orbits.propagate`
    samples : None for the end alone; or a number of samples or their times, as in `orbits.propagate`, for a matrix at
        each
    coupled : whether the derivatives of massless particles by the start of the massive bodies are computed too; without
        them, which is much faster, these blocks are NaN
    parameters : names of numbers by which the derivatives are computed too, at the same start: GM of massive bodies,
        "Ceres.gm"; the numbers of forces and terms, "Apophis.A2", "Earth.J2", "Earth.k2"; per the units of the system.
        Without `coupled` those of forces on massless particles alone
    threads : number of threads for massless particles; None for all processors. No bit of the result depends on it

    It is the derivative of what the method computes: of its steps, for as many as are taken, at fixed lengths. That of
    a symplectic method is symplectic to round-off. The orbit is that of `orbits.propagate` to the last bit for massive
    bodies, and to round-off for massless particles. For all methods and terms; for
    forces without a Lagrangian, and for parameters, with symplectic Runge-Kutta methods such as Gauss. Nothing is
    stored: an interrupted computation is lost.

    Raises InputError for invalid arguments, for a method, a term or a force whose derivative is not known, and for a
    matrix that exceeds the range of numbers; otherwise as `orbits.propagate`. The blocks of a
    massless particle that is lost on the way are NaN, with a `RetiredWarning`.
    """
    for name in others:
        raise unknown_argument(state_transition, name)
    if not isinstance(system, System):
        raise InputError(f"system must be an orbits.System, got {type(system).__name__}")
    integrator = integrators.named("gauss" if integrator is None else integrator)
    with_bodies = checked_flag(coupled, "coupled")
    grid = TimeGrid.of(system, dt, duration=duration, until=until, samples=2 if samples is None else samples)
    if samples is None:
        grid = TimeGrid(grid.clock, grid.times[-1:])
    asked = asked_parameters(system, integrator, grid, parameters, with_bodies)
    warn_or_refuse(found_ahead(system, integrator, grid), check_step)
    options: Any = {"coupled": with_bodies, "threads": threads, "at_end": samples is None}
    return state_transition_of(system, integrator, grid, parameters=asked, **options)


def asked_parameters(
    system: System, integrator: Integrator, grid: TimeGrid, names: Sequence[str], coupled: bool
) -> tuple[Parameter, ...]:
    """Return the parameters of these names. Raises InputError, with the reason, if the derivatives of a run, or those
    by one of them, are not known.
    """
    found = parameters_of(system, names)
    require_followable(system, integrator, grid, found)
    if coupled or given_bodies(system):
        return found
    massless = {name for name, massive in zip(system.names, system.massive, strict=True) if not massive}
    for one in found:
        if massless and not (one.of == "forces" and one.body in massless):
            raise InputError(
                f"massive bodies depend on {one.name}, and so do massless ones by them; expected coupled=True."
            )
    return found


def state_transition_of(
    system: System,
    integrator: Integrator,
    grid: TimeGrid,
    *,
    coupled: bool,
    parameters: Sequence[Parameter] = (),
    threads: int | None = None,
    at_end: bool = False,
) -> StateTransition:
    """As `state_transition`, on an existing grid of steps and samples; at_end : without an axis of samples."""
    N = len(system.names)
    needed = 8 * len(grid) * (6 * N) ** 2
    if needed > MEMORY_SHARE * memory():
        raise InputError(
            f"state-transition matrices of {N:,} bodies at {len(grid):,} samples need {needed / 2**30:.1f} GiB of "
            "memory, more than this machine has; expected fewer samples, or fewer massless particles at a time."
        )
    out, beside = np.zeros((len(grid), N, 6, N, 6)), np.zeros((len(grid), N, 6, len(parameters)))
    given = given_bodies(system)
    # What is read from an ephemeris depends on no start: its blocks are 0.
    momenta = np.zeros((0, 0)) if given else _fill(massive_of(system), integrator, grid, parameters, out, beside)
    coupled = coupled and not given
    particles = np.flatnonzero(~system.massive).tolist()
    for p in particles:
        out[:, p] = np.nan
        out[:, p, :, ~system.massive if not given else slice(None)] = 0.0
        out[:, p, :, p] = beside[:, p] = np.nan

    def fill(p: int) -> None:
        _fill(particle_of(system, p, coupled=coupled), integrator, grid, parameters, out, beside, p)

    for p, failure in zip(particles, each_in_threads(fill, particles, threads), strict=True):
        if failure is not None:
            Finding(
                f"the state transition of {system.names[p]} is not known from the step on that its motion cannot take: "
                f"{failure}",
                RetiredWarning,
                "state transition not known",
            ).warn()
    if integrator.in_encounters.retire_particles and particles:
        _forget_retired(system, integrator, grid, out)
    samples: Any = 0 if at_end else slice(None)
    return StateTransition(
        system,
        np.array(grid.times[samples]),
        out.reshape(len(grid), 6 * N, 6 * N)[samples],
        momenta,
        made_by=made_by(system, integrator, grid),
        parameters=tuple(one.name for one in parameters),
        by_parameters=beside.reshape(len(grid), 6 * N, -1)[samples],
    )


def made_by(system: System, integrator: Integrator, grid: TimeGrid) -> str:
    """Return method and steps in words."""
    return f"{integrator.label}, {grid.clock.describe(integrator, system.units.time)}"


def _forget_retired(system: System, integrator: Integrator, grid: TimeGrid, out: Array) -> None:
    """Write NaN for massless particles from where a run retires them, and warn of these."""
    march = bound(system, integrator, grid.clock)
    try:
        march.advance_to(grid.place(len(grid) - 1))
        lost = march.retired()
    finally:
        march.close()
    for one in lost:
        out[np.abs(grid.times) > abs(grid.clock.time(one.reading)), one.body] = np.nan
    if lost:
        Finding(
            f"{integrator.label} retires {counted(len(lost), 'massless particle')}, whose state transition is NaN from "
            "there on:",
            RetiredWarning,
            "state transition retired",
            [f"{system.names[one.body]} ({one.reason})" for one in lost[:SHOWN]],
            len(lost) - SHOWN,
        ).warn()


def _fill(
    followed: Varied,
    integrator: Integrator,
    grid: TimeGrid,
    parameters: Sequence[Parameter],
    out: Array,
    beside: Array,
    particle: int | None = None,
) -> Array:
    """Write the rows of what is followed, or of one particle in it, into `out`, (n, N, 6, N, 6), and `beside`,
    (n, N, 6, P); return what `Tangents.to_momenta` has at the start and at each sample.
    """
    numbers, count = followed.numbers, len(followed.varied)
    vectors = np.eye(6 * count).reshape(6 * count, count, 2, 3).swapaxes(1, 2)
    there = [k for k, one in enumerate(parameters) if one.body in followed.system]
    own = [parameters[k] for k in there]
    tangents = tangents_of(followed, integrator, vectors, clock=grid.clock, parameters=own)
    momenta = [tangents.to_momenta()]
    for k, (now, _) in enumerate(at_samples(followed, integrator, grid, tangents, exactly=True)):
        # (columns, 2, bodies, 3) to (bodies, 6, columns)
        rows = now.vectors().transpose(2, 1, 3, 0).reshape(count, 6, -1)
        for i, body in enumerate(numbers.tolist()):
            if particle is None or body == particle:
                out[k, body][:, numbers] = rows[i, :, : 6 * count].reshape(6, count, 6)
                beside[k, body] = 0.0
                beside[k, body][:, there] = rows[i, :, 6 * count :]
        momenta.append(now.to_momenta())
    return np.array(momenta)
