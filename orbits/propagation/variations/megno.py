"""MEGNO and Lyapunov exponents: whether orbits are regular or chaotic.

A tangent vector x of a regular orbit grows linearly with time, that of a chaotic one exponentially. With

    Y(t) = (2 / t) integral of t' d(ln |x|),     MEGNO = mean of Y over the time from 0 to t,

MEGNO tends to 2 for quasi-periodic orbits, to 0 at a stable periodic one, and grows as lambda t / 2 with the largest
Lyapunov exponent lambda.

Source: Cincotta & Simó (2000), A&AS 147, 205; Cincotta, Giordano & Simó (2003), Physica D 182, 151.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, Unpack

import numpy as np
from astropy import units as u

from orbits import integrators
from orbits.checks import checked_flag, whole_number
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import InputError, IntegrationError, RetiredWarning, shown
from orbits.finding import Finding
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.marching.tangents.of_particles import march_together
from orbits.propagation.checks.before_the_start import found_ahead, warn_or_refuse
from orbits.propagation.variations.following import (
    Varied,
    at_samples,
    each_in_threads,
    massive_of,
    particle_of,
    require_followable,
    tangents_of,
)
from orbits.propagation.variations.of_particles import (
    Growths,
    growths_of_particles,
    judge,
    passages_of_run,
)
from orbits.propagation.variations.state_transition import made_by
from orbits.results.megno import Megno, TangentGrowth
from orbits.system import System
from orbits.system.model import given_bodies, model
from orbits.time_grid import TimeGrid, dynamical_time

VECTORS = 8
"""The tangent vectors that are followed by default: they fill the lanes of a register, so that eight take the time of
one."""

MOST_VECTORS = 10_000
"""More than so many would take their memory, and say nothing more: a system has 6 N independent ones."""

WHOLE = "all massive bodies"


def megno(
    system: System,
    integrator: Integrator | str | None = None,
    *,
    dt: Any = None,
    duration: Any = None,
    until: Any = None,
    samples: Any = 101,
    coupled: bool = False,
    vectors: int = VECTORS,
    seed: int = 0,
    check_step: bool | Literal["refuse"] = True,
    threads: int | None = None,
    **others: Unpack[NoOthers],
) -> Megno:
    """Return MEGNO and Lyapunov exponents of all massive bodies together, and of each massless particle; among bodies
    of an ephemeris, which depend on no start, of massless particles alone.

        m = orbits.megno(system, "gauss", dt=6 * u.day, duration="10000 yr")
        m.massive.megno[-1], m.massive.lyapunov[-1]
        m["Ceres"].megno

    system, integrator, dt, duration, until, samples, check_step : as in `orbits.propagate`
    coupled : whether the tangent vectors of massless particles include variations of the massive bodies; by default
        only the particle is varied, in the field of the bodies on their orbits, which is the usual indicator and much
        faster
    vectors : the number of tangent vectors; up to eight take the time of one, but for massless particles in a
        `WisdomHolman` map, where each takes its own
    seed : of the directions of the tangent vectors, which are random
    threads : number of threads for massless particles; None for all processors. No bit of the result depends on it

    With `WisdomHolman` in Jacobi coordinates, by Newton's gravity alone, massless particles march eight at a time,
    unless they are coupled, which makes maps of thousands of orbits a matter of a minute; with terms, in democratic
    heliocentric coordinates and with `SABA` each is followed by itself. Passages that a map cannot follow are reported
    at the end, with a warning and as `passage` of the orbit; WisdomHolman(encounters="retire") gives NaN from there on.

    The length of a vector is that of all dq and dv tau, in the coordinates that are marched, with the dynamical time
    tau at the start of the massive bodies and the particle, or of the bodies alone if particles march together; MEGNO
    does not depend on this choice in the end. Vectors are scaled when they become large. Nothing is stored: an
    interrupted computation is lost.

    Raises as `orbits.state_transition`. A massless particle that is lost on the way has NaN from there on, with a
    `RetiredWarning`.
    """
    for name in others:
        raise unknown_argument(megno, name)
    if not isinstance(system, System):
        raise InputError(f"system must be an orbits.System, got {type(system).__name__}")
    integrator = integrators.named("gauss" if integrator is None else integrator)
    seed, coupled = checked_seed(seed), checked_flag(coupled, "coupled")
    count = whole_number(vectors, "vectors", most=MOST_VECTORS)
    grid = TimeGrid.of(system, dt, duration=duration, until=until, samples=samples)
    require_followable(system, integrator, grid)
    warn_or_refuse(found_ahead(system, integrator, grid), check_step)
    return megno_of(system, integrator, grid, coupled=coupled, vectors=count, seed=seed, threads=threads)


def checked_seed(seed: Any) -> int:
    """Return a whole number from 0 on. Raises InputError for anything else."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"seed is {shown(seed)}; expected a whole number from 0 on.")
    return int(seed)


def megno_of(
    system: System,
    integrator: Integrator,
    grid: TimeGrid,
    *,
    coupled: bool,
    seed: int,
    vectors: int = VECTORS,
    threads: int | None = None,
) -> Megno:
    """As `megno`, on an existing grid of steps and samples."""
    def growth(followed: Varied) -> tuple[Array, IntegrationError | None]:
        # The time of what is followed alone, so that no particle depends on the others.
        scale = dynamical_time(followed.system)
        return _growth(followed, integrator, grid, scale if np.isfinite(scale) else 1.0, seed, vectors)

    heavy, massive, made = massive_of(system), None, made_by(system, integrator, grid)
    scale = dynamical_time(heavy.system)
    maps = integrator.follows_kepler and np.isfinite(scale)  # a body that is alone has no time for its particles
    together = maps and not coupled and march_together(integrator, model(system).lagrangian)
    if not given_bodies(system):
        found, failure = growth(heavy)
        if failure is not None:
            raise failure
        massive = _results(system, grid, [WHOLE], Growths.of([found]))[0]
    if system.massive.all():
        return Megno(system, massive, (), made)
    if together:
        starts = _starts(seed, scale, vectors, 1)[:, :, 0]
        growths = growths_of_particles(system, integrator, grid, starts, scale, threads)
    else:
        growths = _one_by_one(system, growth, coupled and massive is not None, threads)
        if integrator.follows_kepler:
            judge(system, integrator, grid, growths, passages_of_run(system, integrator, grid, threads))
    return Megno(system, massive, _results(system, grid, _light(system), growths), made)


def _one_by_one(
    system: System,
    growth: Callable[[Varied], tuple[Array, IntegrationError | None]],
    coupled: bool,
    threads: int | None,
) -> Growths:
    """Return the growth of each massless particle, which is followed by itself; warns of those that are lost."""
    numbers, found = np.flatnonzero(~system.massive).tolist(), []

    def of_particle(p: int) -> tuple[Array, IntegrationError | None]:
        return growth(particle_of(system, p, coupled=coupled))

    for p, one in zip(numbers, each_in_threads(of_particle, numbers, threads), strict=True):
        assert not isinstance(one, IntegrationError)  # which comes with what was known before
        values, failure = one
        found.append(values)
        if failure is not None:
            name = system.names[p]
            told = f"the MEGNO of {name} is not known from the step on that its motion cannot take: {failure}"
            Finding(told, RetiredWarning, "MEGNO not known").warn()
    return Growths.of(found)


def _results(system: System, grid: TimeGrid, names: Sequence[str], found: Growths) -> tuple[TangentGrowth, ...]:
    """Return what is known of what has these names."""
    unit = system.units.time
    t, rates, passages = u.Quantity(grid.times, unit), u.Quantity(found.lyapunov.T, 1 / unit), found.passage * unit
    return tuple(
        TangentGrowth(name, t, found.megno[:, k], found.spread[:, k], rates[k], None if met else passages[k])
        for k, (name, met) in enumerate(zip(names, np.isnan(found.passage).tolist(), strict=True))
    )


def _light(system: System) -> list[str]:
    return [name for name, massive in zip(system.names, system.massive.tolist(), strict=True) if not massive]


def _starts(seed: int, scale: float, count: int, bodies: int) -> Array:
    """Return `count` random tangent vectors, (count, 2, bodies, 3), of length 1."""
    vectors = np.random.default_rng(seed).standard_normal((count, 2, bodies, 3))
    vectors[:, 1] /= scale
    lengths = np.sqrt(np.sum(vectors[:, 0] ** 2 + (scale * vectors[:, 1]) ** 2, axis=(1, 2)))
    return np.asarray(vectors / lengths[:, None, None, None])


def _growth(
    followed: Varied, integrator: Integrator, grid: TimeGrid, scale: float, seed: int, vectors: int
) -> tuple[Array, IntegrationError | None]:
    """Return MEGNO, its spread and the rate of growth of tangent vectors of what is followed, (3, samples), and what
    ended it before the last sample.
    """
    starts = _starts(seed, scale, vectors, len(followed.varied))
    tangents = tangents_of(followed, integrator, starts, scale, clock=grid.clock)
    out, failure = np.full((3, len(grid)), np.nan), None
    try:
        for k, (now, time) in enumerate(at_samples(followed, integrator, grid, tangents, exactly=False)):
            if time != 0.0:
                mean, log = now.growth(time)
                spread = mean.std(ddof=1) if vectors > 1 else np.nan
                out[:, k] = mean.mean(), spread, log.mean() / abs(time)
    except IntegrationError as error:
        failure = error
    return out, failure
