"""The events of a run, sought block by block as it is marched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EventError, InputError, IntegrationError
from orbits.marching.legs import within_step
from orbits.marching.legs.next_step import in_next_steps, pass_by, step_back
from orbits.marching.watching.leg_observers import SUSPECT
from orbits.propagation.events.asked import Asked
from orbits.propagation.events.base import STOP, Array, Bound, Found, Sample, Sought
from orbits.propagation.events.log import EVENTS, PARTICLE_EVENTS, firm_rows, padded_rows
from orbits.propagation.events.search.along_motion import MotionSearch
from orbits.propagation.events.search.meaning import SAME
from orbits.trajectory.events import BROKEN, MOST_EVENTS, NUMBER, TIME, Events, in_order

if TYPE_CHECKING:
    from collections.abc import Mapping

    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.system import System


class Seeking:
    """The events of a run, and what was found of them.

    events : as they were given;  direction : of the run in time, 1 or -1

    of_bodies : the search on the motion of the bodies with mass, as it is marched
    particles : the searches for the events of massless bodies, each on a motion with those of its `subjects`
    seek_of_particles : seeks their events up to the last sample
    touching, act, stops : see `Asked`
    Raises InputError for events that cannot be sought among these bodies.
    """

    def __init__(self, system: System, events: Sought | Sequence[Sought], direction: float) -> None:
        self.asked = asked = Asked(system, events, direction)
        groups, self._direction = asked.by_particles(), direction
        self.of_bodies = MotionSearch(asked, groups.pop((), []), ())
        self.events, self.touching, self.act, self.stops = asked.events, asked.touching, asked.act, asked.stops
        self.particles = [MotionSearch(asked, numbers, bodies) for bodies, numbers in groups.items()]
        self.seek_of_particles: Callable[[], object] = lambda: None

    def check(self, marcher: Legs) -> None:
        """Raise InputError for a march that does not tell the motion within its steps."""
        if self.of_bodies and marcher.home.stepper.loops.parallel is not None:
            raise InputError(
                "events are sought on the motion within steps, which is not recorded for the "
                f"{len(self.asked.system):,} bodies of this run on several threads; use threads=1, or leave out "
                "events=..."
            )

    def complete(self) -> None:
        """Seek all events up to the steps and the sample that were taken last; call it before the list is stored."""
        self.of_bodies.flush()
        self.seek_of_particles()

    def table(self) -> Events:
        """Return what was found so far."""
        rows = [self.of_bodies.log.rows, *(search.log.rows for search in self.particles)]
        words = [bound.words for bound in self.asked.bounds]
        found = in_order(rows, self._direction) if self.particles else rows[0]
        return Events(self.asked.system, words, found, self.asked.views)

    def checkpoint(self) -> dict[str, NDArray[Any]]:
        """Return what is found up to the state that the march has reached, as arrays of fixed shapes."""
        known = self.of_bodies.log.checkpoint() if self.events else {}
        if self.particles:
            logs = [search.log for search in self.particles]
            firm = in_order([log.rows[: log.firm] for log in logs], self._direction)
            later = in_order([log.rows[log.firm :] for log in logs], self._direction)
            count = BROKEN if any(log.broken for log in logs) else len(firm)
            rows = np.concatenate([firm, later])[:MOST_EVENTS]
            known |= dict(zip(PARTICLE_EVENTS, padded_rows(rows, count), strict=True))
        return known

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], path: Any) -> None:
        """Go on with the list of a checkpoint."""
        expected = len(self.asked.bounds), len(self.asked.system), path
        if self.events:
            log = self.of_bodies.log
            log.take(firm_rows(checkpoint, EVENTS, *expected))
            if self.touching:  # the march may list a collision before it comes to events that are earlier in its step
                ends = np.array([event.then == STOP for event in self.asked.of])[log.rows[:, NUMBER].astype(int)]
                log.forget()
                if ends.any():
                    log.pass_by(float(log.rows[ends, TIME][-1]))
        if self.particles:
            rows = firm_rows(checkpoint, PARTICLE_EVENTS, *expected)
            for search in self.particles:
                search.log.take(rows[np.isin(rows[:, NUMBER], search.numbers)])

    def remarks(self) -> list[str]:
        """Return what is to be said of events that mean nothing, or may be incomplete."""
        return [*self.of_bodies.remarks(), *(said for search in self.particles for said in search.remarks())]

    # ------------------------------------------------------------------------------------------- along the march

    def after(self, marcher: Legs) -> Found | None:
        """Take the block that was just marched; return the first event in it that interrupts the run, if any.

        The events before it are then recorded, and it is as well; the march is at the begin of its step. So it is if
        it stopped as a pair of bodies might come to its bound in the last step, but none does.
        """
        if marcher.last.bounds.met != SUSPECT:
            return self._after(marcher)
        end = Sample(marcher.time, *marcher.state())
        step_back(marcher)
        found = self._after(marcher) or self._at_a_bound(marcher, end, end.time)
        if found is None:
            pass_by(marcher)
        return found

    def jump_at(
        self, acted: Sequence[Found], former: list[Bound], before: tuple[Array, Array], after: tuple[Array, Array]
    ) -> Found | None:
        """Go through what events did to the bodies, as `MotionSearch.jump`; their functions are zero there anyway."""
        massive = self.asked.system.massive[:, None]
        then, now = ((np.where(massive, q, np.nan), np.where(massive, v, np.nan)) for q, v in (before, after))
        return self.of_bodies.jump(former, acted[0].time, then, now, [one.number for one in acted])

    def before_sample(self, marcher: Legs, sample: Sample) -> Found | None:
        """Return the event that ends the run between the state of the march and a sample less than a step ahead, if a
        pair of bodies comes to its bound there: where it is without a sample.
        """
        if self.stops is None or (sample.time - marcher.time) * self._direction <= 0.0:
            return None
        if not self.stops.may_end(marcher, sample):
            return None
        end = None
        with suppress(IntegrationError):
            end = in_next_steps(marcher, sample.time, lambda: Sample(marcher.time, *marcher.state()))
        if end is None or (end.time - sample.time) * self._direction < 0.0:
            end = sample
        return self._at_a_bound(marcher, end, sample.time)

    def _at_a_bound(self, marcher: Legs, end: Sample, until: float) -> Found | None:
        """Return the first event that ends the run between the state of the march and another, if a pair of bodies
        comes to its bound up to a time; it is recorded, with those before it.
        """
        assert self.stops is not None
        passed = self.stops.first(marcher, end, self.of_bodies.log.last + SAME * abs(end.time - marcher.time))
        if passed is None or (passed.time - until) * self._direction > 0.0:
            return None
        earlier = self.before(marcher, passed.time, record=True)
        if earlier is not None:
            return earlier
        t, (q, v) = np.array([passed.time]), (x[None] for x in marcher.state_after(passed.time - marcher.time))
        rising, columns = np.array([passed.rising]), np.array([passed.column])
        self.of_bodies.add(self.of_bodies.rows_of(passed.number, rising, t, q, v, columns)[0], True)
        self.of_bodies.log.pass_by(passed.time)
        return passed

    def _after(self, marcher: Legs) -> Found | None:
        if not self.of_bodies:
            return None
        found = self.of_bodies.take(marcher.last.motion())
        if found is not None:
            marcher.go_back(found.steps)
        return found

    def before(
        self, marcher: Legs, time: float, record: bool, end: tuple[Array, Array] | None = None
    ) -> Found | None:
        """Seek events between the state of the march and a time less than a step ahead.

        record : whether to record them; otherwise only those up to one that interrupts the run are recorded, if any
        end : q and v there, (bodies, 3), if the march goes on from there: what is found is then firm
        """
        self.of_bodies.flush()
        if not self.of_bodies or (time - marcher.time) * self._direction <= 0.0:
            return None
        for motion, ends in within_step.stretches(*within_step.towards(marcher.leg, time)):
            if ends and end is not None:
                motion.end_in(*end)
            found = self.of_bodies.seek(motion, end is not None, record)
            if found is not None:
                return found
        return None

    def ahead(self, marcher: Legs, time: float) -> Found | None:
        """Seek the first event that interrupts the run between the state of the march and a time less than a step
        ahead, in whole steps: it is where it is without a sample at this time. If the march cannot take them, on the
        way to the time.
        """
        self.of_bodies.flush()
        if not self.of_bodies.interrupts or (time - marcher.time) * self._direction <= 0.0:
            return None
        try:
            return in_next_steps(marcher, time, lambda: self.of_bodies.seek(marcher.last.motion(), False, False, time))
        except EventError:
            raise
        except IntegrationError:
            return self.before(marcher, time, record=False)
