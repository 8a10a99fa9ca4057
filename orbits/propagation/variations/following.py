"""Tangent vectors that follow the march of a system from sample to sample."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from orbits.checks import whole_number
from orbits.errors import InputError, IntegrationError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.transformed import TimeTransformed
from orbits.marching.legs import within_step
from orbits.marching.legs.leg import available_threads
from orbits.marching.stepping.choice_of_form import form_of_bodies
from orbits.marching.stepping.pool import Pool
from orbits.marching.tangents.in_maps import MapTangents, require_map_tangents
from orbits.marching.tangents.of_bodies import Tangents, require_tangents
from orbits.propagation.marchers import bound, with_light
from orbits.propagation.variations.slopes import slopes_of
from orbits.system import System
from orbits.system.model import given_bodies, model
from orbits.system.parameters import Parameter
from orbits.time_grid import TimeGrid

T = TypeVar("T")


class Varied(NamedTuple):
    """What is followed in one march: massive bodies, some of which are varied.

    system : all of them have mass; varied : their numbers in it; numbers : those in the system of the caller
    """

    system: System
    varied: NDArray[np.intp]
    numbers: NDArray[np.intp]


def require_followable(
    system: System, integrator: Integrator, grid: TimeGrid, parameters: Sequence[Parameter] = ()
) -> None:
    """Raise InputError, with the reason, if the variations of a run, or those by parameters, are not known."""
    if system.rigid:
        raise InputError("the variations of rigid bodies are not known; leave them out: system.replaced(forces=()).")
    acting, given = model(system), given_bodies(system)
    if given and len(given) < int(system.massive.sum()):
        raise InputError(
            "the variations of bodies with a mass among those of an ephemeris are not known; expected massless ones: "
            "set their GM to 0."
        )
    if given and system.massive.all():
        raise InputError(
            "all bodies are read from an ephemeris, and depend on no start; expected a massless one: system.add(...)."
        )
    grid.clock.check(integrator)
    if integrator.follows_kepler:
        if acting.forces or parameters:
            what = f"of {type(system.forces[0]).__name__}" if acting.forces else "by parameters"
            raise InputError(
                f"the variations {what} are not known in the map of {integrator.label}; use Gauss(stages=8)."
            )
        require_map_tangents(integrator, acting.lagrangian)
        if integrator.in_encounters.follow_particles and not system.massive.all():
            raise InputError(
                f"the variations of {integrator.label} are not known where particles take steps of their own; use "
                'encounters="warn", or Gauss(stages=8) without dt.'
            )
    else:
        require_tangents(integrator, by_force=bool(acting.forces or parameters))
    form_of_bodies(integrator, acting.lagrangian, grid.clock, with_particles=False, forces=acting.forces)
    if isinstance(grid.clock, TimeTransformed):
        raise InputError(
            f"variations need steps of time, not {grid.clock.describe(integrator)}: leave dt out for steps that are "
            "chosen one by one, or give dt=... a length."
        )


def massive_of(system: System) -> Varied:
    """Return the massive bodies of a system, all of them varied."""
    numbers = np.flatnonzero(system.massive)
    light = [name for name, massive in zip(system.names, system.massive, strict=True) if not massive]
    return Varied(system.remove(*light) if light else system, np.arange(len(numbers)), numbers)


def particle_of(system: System, number: int, *, coupled: bool) -> Varied:
    """Return a massless particle among the massive bodies, which are varied too if `coupled`."""
    light, there = with_light(system, (number,))
    numbers = np.flatnonzero(there)
    varied = np.arange(len(numbers)) if coupled else np.flatnonzero(numbers == number)
    return Varied(light, varied, numbers[varied])


def each_in_threads(
    work: Callable[[int], T], particles: Sequence[int], threads: int | None
) -> Iterator[T | IntegrationError]:
    """Yield the results of a function for massless particles, in their order, computed in threads; for one whose motion
    cannot be integrated, the error.

    threads : how many; None for all processors. The results do not depend on it
    """
    count = available_threads() if threads is None else whole_number(threads, "threads, if given,")

    def guarded(particle: int) -> T | IntegrationError:
        try:
            return work(particle)
        except IntegrationError as error:
            return error

    if count == 1 or len(particles) < 2:
        yield from map(guarded, particles)
        return
    pool = Pool(min(count, len(particles)))
    try:
        yield from pool.map(guarded, particles)
    finally:  # also after an interrupt: those that have begun are waited for
        pool.shutdown(cancel_futures=True)


def tangents_of(
    followed: Varied,
    integrator: Integrator,
    vectors: Array,
    scale: float | None = None,
    *,
    clock: Clock | None = None,
    parameters: Sequence[Parameter] = (),
) -> Tangents | MapTangents:
    """Return tangent vectors (count, 2, varied, 3) of what is followed; scale as in `Tangents`.

    parameters : each has a vector after the others, of derivatives by it
    clock : of constant steps, for a map on Kepler orbits, which is marched with them
    """
    acting = model(followed.system)
    values = followed.system.values
    which = (followed.varied, values.q, values.v, vectors, scale)
    if integrator.follows_kepler:
        assert clock is not None
        return MapTangents(acting.lagrangian, acting.vectors, integrator, clock.h, *which)
    slopes = slopes_of(followed.system, parameters) if parameters else None
    return Tangents(acting.lagrangian, acting.vectors, integrator, *which, forces=acting.forces, slopes=slopes)


def at_samples(
    followed: Varied, integrator: Integrator, grid: TimeGrid, tangents: Tangents | MapTangents, *, exactly: bool
) -> Iterator[tuple[Tangents | MapTangents, float]]:
    """Yield the tangent vectors at each sample, and the time there.

    exactly : at the sample, after a part of a step; otherwise after the last whole step before it
    """
    if isinstance(tangents, MapTangents):
        for sample, time in enumerate(grid.times.tolist()):
            place = grid.place(sample)
            tangents.advance(place)
            yield (tangents.seen(place.rest), time) if exactly else (tangents, tangents.time)
        return
    march = bound(followed.system, integrator, grid.clock, threads=1, dense=True)
    for sample, time in enumerate(grid.times.tolist()):
        place = grid.place(sample)
        for motion, _ in within_step.stretches(march, place):
            tangents.follow(motion)
        if not exactly or march.leg.times.is_at(place):
            yield tangents, march.time
            continue
        part = tangents.branched()
        for motion, _ in within_step.stretches(*within_step.towards(march.leg, time)):
            part.follow(motion)
        yield part, time
