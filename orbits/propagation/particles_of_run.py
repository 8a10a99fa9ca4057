"""Events of massless bodies, which follow the massive ones and whose motion within steps is not recorded.

Between two samples of the run, each of these bodies is marched again from the first sample, with the massive ones alone
and with a mass so small that it moves nothing: its motion within steps is then known, and events are sought on it. What
is found follows from the samples, so that a run that is resumed finds the same; and it is on the motion of the run, on
which `run.at` is as well, however chaotic that is.

Where events only record, a march through many samples comes first: most ways between two have no event, and are left
out. It excludes, but finds nothing, so that it does not matter which samples are looked at together. Constant steps of
a method that is not symmetric lead through many samples on another motion than from each of them, as the partial step
to the first one is taken back: then every way is looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any
from weakref import proxy

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EventError, IntegrationError, with_unit
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.integrators.maps.encounters import FOLLOW
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.clock import Clock
from orbits.marching.following.excursion_rules import METHOD
from orbits.marching.legs import within_step
from orbits.marching.stepping.motion import Motion
from orbits.propagation.events.base import Found, Sample
from orbits.propagation.events.functions import Raised
from orbits.propagation.events.search.along_motion import NUMBERS, MotionSearch
from orbits.propagation.events.search.brackets import NotFiniteError
from orbits.propagation.marchers import bound, with_light
from orbits.system import System
from orbits.time_grid import dynamical_time
from orbits.trajectory.events import MOST_EVENTS

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.propagation.loop import Run
    from orbits.propagation.run_ends import RunEnds

NOTHING = 1e-9
"""The fraction of a step, of the dynamical time, or of the distance of two bodies, in which nothing happens twice."""

FEWEST, TOGETHER, MANY = 8, 64, 256
"""The fewest and the most samples of which the motion through all may exclude events between two; its most steps."""

OFF, ROUNDED = 1e-9, 1e-14
"""How far it may pass a sample, as a fraction of the longest way of a body in a step, and besides, for rounding errors,
of the largest distance of a body from the origin."""


class ParticlesOfRun:
    """The massless bodies of a run whose events are sought, followed from sample to sample along its loop.

    may_end : whether any of these events may end the run
    """

    def __init__(self, run: Run) -> None:
        system, values, clock = run.system, run.system.values, run.grid.clock
        # No circle of references: its events call `seek`, and a run has megabytes.
        self._watch: RunEnds = proxy(run.watch)
        self._system, self._integrator, self._clock, self._marcher = system, run.integrator, clock, run.marcher.current
        self._searches = run.watch.events.particles
        self._last = run.watch.before or Sample(0.0, values.q, values.v)  # from which they are followed
        self._light = [with_light(system, search.subjects) for search in self._searches]
        self._scales = [dynamical_time(light) for light, _ in self._light]
        self.may_end = any(search.interrupts for search in self._searches)
        together = not self.may_end
        self._most = min(TOGETHER, NUMBERS // (6 * len(system))) if together else 1
        self._waiting: list[Sample] = []
        self._step = self._reached = self._marcher.step
        self._end, self._kept = float(run.grid.goals[-1]), self._now()
        run.watch.events.seek_of_particles = self.seek

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._searches)

    def reach(self, times: Array, q: Array, v: Array, *, later: bool = False) -> bool:
        """Take the next samples; one alone, before it is stored, if `may_end`. Return whether an event up to it ends
        the run. Events that only record are sought up to several samples at once.

        times : (m,), with q and v, (m or more, n, 3); later : whether nothing is sought before the end of the run
        """
        if not self._searches:
            return False
        begun, steps = self._reached, self._marcher.step - self._reached
        for k, when in enumerate(times.tolist()):
            self._waiting.append(Sample(when, q[k].copy(), v[k].copy()))
            self._reached = begun + steps * (k + 1) // len(times)  # about the steps up to it
            enough = len(self._waiting) >= self._most or self._reached - self._step >= MANY // 2
            # No run is complete before its events are known.
            if (enough or when == self._end) and not later and self.seek():
                return True
        return False

    def seek(self) -> bool:
        """Seek events up to the last sample that was taken; return whether one of them ends the run."""
        waiting, self._waiting, self._step = self._waiting, [], self._reached
        may_find = [self._may_find(k, waiting) for k in range(len(self._searches))]
        for way, sample in enumerate(waiting):
            searches = [k for k, on_ways in enumerate(may_find) if on_ways[way]]
            if searches and self._ends_by(sample.time, sample, searches):
                return True
            self._last = sample
            for search in self._searches:
                search.log.settle()
            self._kept = self._now()
        return False

    def end(self) -> None:
        """Seek events up to the time at which the run was ended, if it was; an earlier one ends it instead."""
        stopped = self._watch.stopped
        if self._searches and stopped is not None:
            self._ends_by(float(stopped.time.value))

    def _ends_by(self, time: float, end: Sample | None = None, searches: Sequence[int] | None = None) -> bool:
        if (time - self._last.time) * self._clock.direction <= 0.0:
            return False
        watch, marcher = self._watch, self._marcher
        lost = {one.body: float(self._clock.time(one.reading)) for one in marcher.retired()}
        first = self._first(time, lost, end, searches)
        if first is None:
            return False
        search, found = first
        state = self._state_at(found.time)
        watch.end_at(search.asked.happening(found, state), found.time, state)
        if self._kept is not None:
            # The march has gone beyond: an archive goes on from the last sample, and finds again what comes after.
            checkpoint, firm = self._kept
            if (found.time - marcher.time) * self._clock.direction > 0.0:
                watch.events.before(marcher, found.time, record=True)
            watch.events.of_bodies.flush()
            watch.events.of_bodies.log.drop_after(found.time)
            watch.events.of_bodies.log.firm = min(firm, len(watch.events.of_bodies.log.rows))
            marcher.restore(checkpoint)
        return True

    def _now(self) -> tuple[dict[str, NDArray[np.generic]], int] | None:
        """Return where the march is, and how many of its events are firm, if particles may end it after that."""
        if not self.may_end:
            return None
        self._watch.events.of_bodies.flush()
        return self._marcher.checkpoint(), self._watch.events.of_bodies.log.firm

    def _first(
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

    def _state_at(self, time: float) -> tuple[Array, Array]:
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
        times, left = march.leg.times, True  # also if there is no whole step
        times.end_exactly()
        for motion, ends in within_step.stretches(march, clock.place(time - start)):
            left = abs(times.part_until(time)) > NOTHING
            yield motion, ends and not left
        if left:
            yield from within_step.stretches(*within_step.towards(march.leg, time))


def _leads_to(motion: Motion, times: Array, q: Array, direction: float) -> bool:
    """Return whether a motion leads to positions, (m, n, 3), at those of the times (m,) that it covers."""
    ahead, ends = times * direction, motion.times * direction
    inside = (ends[0] <= ahead) & (ahead <= ends[-1])
    if not inside.any():
        return True
    steps = np.minimum(np.searchsorted(ends, ahead[inside], side="right"), len(motion)) - 1
    lengths = motion.lengths[steps]
    there, v = motion.at(steps, (times[inside] - motion.times[steps]) / lengths)
    off, ways = (np.linalg.norm(x, axis=2).max(axis=1, initial=0.0) for x in (there - q[inside], v))
    reach = np.linalg.norm(q, axis=2).max(initial=0.0)
    return bool((off <= OFF * np.abs(lengths) * ways + ROUNDED * reach).all())


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
