"""Events of massless bodies, which follow the massive ones and whose motion within steps is not recorded.

Between two samples of the run, each of these bodies is marched again from the first sample, with the massive ones alone
and with a mass so small that it moves nothing: its motion within steps is then known, and events are sought on it. What
is found follows from the samples, so that a run that is resumed finds the same; and it is on the motion of the run, on
which `run.at` is as well, however chaotic that is.

Where events only record and steps are chosen one by one, a march through many samples comes first: most ways between
two have no event, and are left out. It excludes, but finds nothing, so that it does not matter which samples are looked
at together. Constant steps through many samples would lead to another motion than those from each of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EventError, IntegrationError, with_unit
from orbits.integrators.base import Integrator
from orbits.integrators.maps.encounters import FOLLOW
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.constant import Clock
from orbits.marching.following.excursion_rules import METHOD
from orbits.marching.legs import within_step
from orbits.marching.stepping.motion import Motion
from orbits.propagation.events.base import Found, Sample
from orbits.propagation.events.functions import Raised
from orbits.propagation.events.search.along_motion import NUMBERS, MotionSearch
from orbits.propagation.events.search.brackets import NotFiniteError
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.marchers import bound
from orbits.system import System
from orbits.time_grid import dynamical_time
from orbits.trajectory.events import MOST_EVENTS

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs

Array = NDArray[np.float64]

LIGHT = 1e-36
"""The mass of a followed body as a fraction of the lightest massive one: it moves no last bit of any."""

NOTHING = 1e-9
"""The fraction of a step, of the dynamical time, or of the distance of two bodies, in which nothing happens twice."""

FEWEST, TOGETHER, MANY = 8, 64, 256
"""The fewest and the most samples of which the motion through all may exclude events between two; its most steps."""

OFF = 1e-9
"""How far it may pass a sample, as a fraction of the longest way of a body in a step."""


class ParticleSearches:
    """The massless bodies of a run whose events are sought, followed from sample to sample.

    seeking : the events of the run; begun : where the run begins, or the last sample before it goes on

    stops : whether any of them ends the run
    """

    def __init__(
        self, system: System, integrator: Integrator, clock: Clock, seeking: Seeking, begun: Sample
    ) -> None:
        self._system, self._integrator, self._clock = system, integrator, clock
        self._searches, self._last = seeking.particles, begun
        self._light = [with_light(system, search.subjects) for search in self._searches]
        self._scales = [dynamical_time(light) for light, _ in self._light]
        self.stops = any(search.interrupts for search in self._searches)
        together = clock.lets_particles_choose and not self.stops
        self._most = min(TOGETHER, NUMBERS // (6 * len(system))) if together else 1

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._searches)

    @property
    def last(self) -> Sample:
        """The sample from which they are followed."""
        return self._last

    def enough(self, samples: int, steps: int) -> bool:
        """Return whether to seek events after so many samples and steps of the run; if they may end it, after each."""
        return samples >= self._most or steps >= MANY // 2

    def that_may_find(self, samples: Sequence[Sample]) -> list[list[int]]:
        """Return for the way to each of the next samples the numbers of the searches that may find events on it."""
        may_find = [self._may_find(k, samples) for k in range(len(self._searches))]
        return [[k for k, on_ways in enumerate(may_find) if on_ways[way]] for way in range(len(samples))]

    def seek(
        self, time: float, lost: dict[int, float], end: Sample | None = None, which: Sequence[int] | None = None
    ) -> tuple[MotionSearch, Found] | None:
        """Seek events from the last sample up to a time; return the first one that ends the run, if any, with its
        search: those after it are not listed.

        lost : the times at which particles were retired, by their numbers; end : the sample there, if there is one
        which : the numbers of the searches, all by default
        """
        direction, first = self._clock.direction, None
        for k in range(len(self._searches)) if which is None else which:
            search = self._searches[k]
            until = min([time, *(lost[k] for k in search.subjects if k in lost)], key=lambda t: t * direction)
            gone = end is not None and bool(np.isnan(end.q[list(search.subjects)]).any())
            found = self._one(k, until, None if gone or until != time else end, gone or until != time)
            if found is not None and (first is None or (found.time - first[1].time) * direction < 0.0):
                first = search, found
        count = sum(len(search.log.rows) for search in self._searches)
        if count > MOST_EVENTS:
            self._searches[0].log.broken = True
            raise EventError(
                f"there are more than {MOST_EVENTS:,} events of massless bodies by t = "
                + with_unit(f"{time:.10g}", self._system.units.time)
                + ". Seek fewer (a bound, a direction, fewer bodies), or run in parts; all before stays readable.",
                time=time,
            )
        if first is not None:
            for search in self._searches:
                search.log.drop_after(first[1].time)
        return first

    def go_on(self, sample: Sample) -> None:
        """Follow them from the next sample, up to which events were sought."""
        self._last = sample
        for search in self._searches:
            search.log.settle()

    def state_at(self, time: float) -> tuple[Array, Array]:
        """Return q and v of all bodies, (n, 3), at a time after the last sample, as `run.at` computes them."""
        march, start = along_steps(self._system, self._integrator, self._clock, *self._last)
        place = self._clock.place(time - start)
        march.advance_to(place)
        return march.state_at(place)

    def _one(self, number: int, time: float, end: Sample | None, lost: bool) -> Found | None:
        """Seek the events of one search up to a time; lost : whether a particle is retired there."""
        search, (_, there) = self._searches[number], self._light[number]
        if not ((time - self._last.time) * self._clock.direction > 0.0 and np.isfinite(self._last.q[there]).all()):
            return None
        begun = self._last
        if end is not None and self._hardly_moves(number, abs(time - begun.time)):
            return search.between(*(np.array(pair) for pair in zip(begun, end, strict=True)))
        try:
            for motion in self._motions(number, time, end):
                found = search.along(motion, begun.time)
                if found is not None:
                    return found
        except EventError:
            raise
        except IntegrationError as error:
            if lost:
                return None
            search.log.broken = True
            names = " and ".join(self._system.names[k] for k in search.subjects)
            raise EventError(
                f"the events of {names} cannot be sought from t = {begun.time:.10g} to "
                + with_unit(f"{time:.10g}", self._system.units.time)
                + ": a step of its motion fails there. Use a smaller dt, or softening if bodies come very close, or "
                "leave these events out; all before stays readable.",
                time=begun.time,
            ) from error
        return None

    def _hardly_moves(self, number: int, duration: float) -> bool:
        """Return whether the bodies of a search hardly move from the last sample on: by their forces, or straight past
        one another.
        """
        if duration >= NOTHING * self._scales[number]:
            return False
        q, v = (x[self._light[number][1]] for x in (self._last.q, self._last.v))
        ways = (duration * np.linalg.norm(v - each, axis=1) for each in v)
        return all((way <= NOTHING * np.linalg.norm(q - at, axis=1)).all() for way, at in zip(ways, q, strict=True))

    def _may_find(self, number: int, samples: Sequence[Sample]) -> NDArray[np.bool_]:
        """Return on which of the ways to the next samples a search may find events, (samples,): the others are excluded
        by the motion through all samples, if it leads to each of them.
        """
        every, some, steps = np.ones(len(samples), dtype=bool), np.zeros(len(samples), dtype=bool), 0
        search, (_, there), direction = self._searches[number], self._light[number], self._clock.direction
        if len(samples) < FEWEST or not np.isfinite(samples[-1].q[there]).all():
            return every
        times, q = np.array([sample.time for sample in samples]), np.array([sample.q[there] for sample in samples])
        ends = np.array([self._last.time, *times]) * direction
        try:
            for motion in self._motions(number, samples[-1].time, samples[-1]):
                steps += len(motion)
                if steps > MANY or not _leads_to(motion, times, q, direction):
                    return every
                begun, over = search.may_be(motion)[:, :, None] * direction
                some |= ((begun <= ends[1:]) & (over >= ends[:-1])).any(axis=0)
        except (IntegrationError, NotFiniteError, Raised):  # if they are met between two samples, they are told there
            return every
        return some

    def _motions(self, number: int, time: float, end: Sample | None) -> Iterator[Motion]:
        """Yield the motion of the bodies of a search to a time, in stretches; end : the state in which it ends exactly,
        if there is one.
        """
        system, there = self._light[number]
        for motion, ends in self._stretches(system, there, time):
            if ends and end is not None:
                motion.end_in(end.q[there], end.v[there])
            yield motion

    def _stretches(self, system: System, there: NDArray[np.bool_], time: float) -> Iterator[tuple[Motion, bool]]:
        """Yield the motion to a time from the beginning of the step with the last sample, in stretches, and whether
        each is the last one.
        """
        begun, q, v = self._last.time, self._last.q[there], self._last.v[there]
        integrator, clock = self._integrator, self._clock
        if FOLLOW in integrator.in_encounters:  # as it is followed there
            integrator, clock = METHOD, Adaptive().towards(clock.direction)
        march, start = along_steps(system, integrator, clock, begun, q, v, dense=True)
        if clock.changes:  # a march then counts its time from its begin
            march.leg.times.end_exactly()
            yield from within_step.stretches(march, clock.place(time - begun))
            return
        place = self._clock.place(time - start)
        rest = not place.steps or abs(place.rest) > NOTHING * abs(self._clock.h)
        for motion, ends in within_step.stretches(march, place):
            yield motion, ends and not rest
        if rest:
            yield from within_step.stretches(*within_step.towards(march.leg, time))


def _leads_to(motion: Motion, times: Array, q: Array, direction: float) -> bool:
    """Return whether a motion leads to positions, (m, n, 3), at those of the times (m,) that it covers."""
    ahead, ends = times * direction, motion.times * direction
    inside = (ends[0] <= ahead) & (ahead <= ends[-1])
    steps = np.minimum(np.searchsorted(ends, ahead[inside], side="right"), len(motion)) - 1
    lengths = motion.lengths[steps]
    there, v = motion.at(steps, (times[inside] - motion.times[steps]) / lengths)
    off, ways = (np.linalg.norm(x, axis=2).max(axis=1, initial=0.0) for x in (there - q[inside], v))
    return bool((off <= OFF * np.abs(lengths) * ways).all())


def along_steps(
    system: System, integrator: Integrator, clock: Clock, time: float, q: Array, v: Array, **options: Any
) -> tuple[Legs, float]:
    """Return a march that goes on from a sample along the steps of the run, and when it begins: a partial step to the
    sample is taken back.
    """
    start, state = clock.step_begin(time), (q, v)
    if start != time:
        march = bound(system, integrator, clock, threads=1, state=state, start=time, **options)
        state = march.home.state_after(start - time)
    return bound(system, integrator, clock, threads=1, state=state, start=start, **options), start


def with_light(system: System, particles: tuple[int, ...]) -> tuple[System, NDArray[np.bool_]]:
    """Return the massive bodies of a system and these particles, with a mass, and which of all bodies these are."""
    there = system.massive.copy()
    there[list(particles)] = True
    gone = [name for name, stays in zip(system.names, there, strict=True) if not stays]
    left = system.remove(*gone) if gone else system
    gm = left.values.gm.copy()
    gm[gm == 0.0] = LIGHT * gm[gm > 0.0].min()
    return left.replaced(gm=gm), there
