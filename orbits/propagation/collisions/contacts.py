"""What a chain of legs does where two of its bodies may touch: the step is searched, and the bodies collide.

A leg ends before such a step. So it does before a sample within a step, which it takes and takes back, to know what
collides in it before the sample. Each collision changes the bodies, ends the run, or is only listed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.kernels.steps import IMPACT
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.leg import Leg
from orbits.propagation.collisions.bodies_of_run import BodiesOfRun, state_in_step
from orbits.propagation.collisions.impact import Impact, Step, impacts
from orbits.propagation.collisions.merge_and_bounce import State
from orbits.propagation.collisions.of_a_run import Collisions
from orbits.propagation.events.base import Found
from orbits.propagation.events.bodies_left import Left
from orbits.propagation.events.seeking import Seeking
from orbits.trajectory import changes
from orbits.trajectory.events import BODY, OTHER, TIME


class End(NamedTuple):
    """The end of a step in which bodies may touch: its time, q and v there, and the massless bodies that may."""

    time: float
    state: tuple[Array, Array]
    touching: NDArray[np.intp]

    @classmethod
    def of(cls, leg: Leg) -> End | None:
        """Return the end of the last step of a leg, or None if no bodies may touch in it."""
        touching = leg.observers.touching(leg.loop.taken)
        return None if touching is None else cls(leg.time, leg.state(), touching)


class Ahead(NamedTuple):
    """The next step of a leg: the time at which it ends, and the collisions in it, in the order of time."""

    end: float
    impacts: list[Impact]


class Outcome(NamedTuple):
    """What interrupts a march at a contact.

    found : an event before it, or at it; ended : the row of the collision that ends the run, and the bodies there
    time, state : where another leg begins: a time in the next step, and the changed bodies
    """

    found: Found | None = None
    ended: tuple[Array, State] | None = None
    time: float = 0.0
    state: State | None = None


class Contacts:
    """The contacts of the bodies of a run.

    of : the bodies; events : of the run, among which collisions are listed
    """

    def __init__(self, of: BodiesOfRun, collisions: Collisions, events: Seeking) -> None:
        self._of, self._collisions, self._events = of, collisions, events
        self._direction = of.clock.direction
        self._ahead: Ahead | None = None

    def forget(self) -> None:
        """Forget the step ahead: the march goes on."""
        self._ahead = None

    def may_lie_before(self, leg: Leg, time: float) -> bool:
        """Return whether there may be contacts between a leg and a time up to which it has taken its steps."""
        ahead = self._ahead
        if not self._is_later(time, leg.time):
            return False
        if ahead is None or self._is_later(time, ahead.end):
            return True
        return any(not self._is_later(x.time, time) and not self._is_known(x) for x in ahead.impacts)

    def takes_step_up_to(self, leg: Leg, time: float) -> bool:
        """Take the next step of a leg, and return whether it leads no further than to a time: it may become shorter
        than the one that the clock tried and did not take. Otherwise it is taken back; what collides in it is known. Of
        a step that cannot be taken, as an ephemeris ends in it, say, the part up to the time is looked at.
        """
        if self._ahead is not None and not self._is_later(time, self._ahead.end):
            return False
        stepper, retired = leg.stepper, leg.losses.retired
        kept, counts, known = stepper.copied(), stepper.counts(), retired.table().copy()
        leg.times.aim(leg.times.next_place())
        failure, end = None, None
        try:
            leg.advance(1)
        except IntegrationError as error:
            failure = error
        else:
            reached = leg.time if leg.loop.taken else self._direction * math.inf  # nothing attracts
            if not self._is_later(reached, time):
                leg.bounds.passes = False
                return True
            end = End.of(leg) if leg.loop.taken else None
            leg.go_back(0)
        for name, array in kept.items():  # also of particles that were lost at the beginning of the step
            stepper.state[name][...] = array
        retired.take_back(known, leg.step)
        stepper.evaluations, stepper.particle_evaluations = counts
        leg.bounds.met = None
        if failure is not None:
            reached, end = time, self._end_of_part(leg, time, failure)
        self._ahead = Ahead(reached, [] if end is None else self._impacts(leg, end))
        return False

    def _end_of_part(self, leg: Leg, time: float, failure: IntegrationError) -> End:
        """Return the end of the part of the next step up to a time, in which any particle may touch a body. Raises the
        failure of the step if not even that can be taken.
        """
        try:
            return End(time, state_in_step(leg, time), leg.problem.particles[~leg.losses.retired.gone()])
        except IntegrationError:
            raise failure from None

    def before(self, leg: Leg, time: float) -> Outcome | None:
        """Deal with the contacts in the step that was taken back, up to a time; return what interrupts the leg first,
        if any.
        """
        assert self._ahead is not None
        return self._first(leg, self._ahead.impacts, time)

    def in_step(self, leg: Leg, end: End) -> Outcome | None:
        """Deal with the contacts of the next step of a leg, which ends there; return what interrupts it, if any."""
        return self._first(leg, self._impacts(leg, end), end.time)

    def follow_events(self) -> None:
        """Seek the events of the bodies that are there now, in a run that is resumed."""
        of, rows = self._of, self._of.changes.rows
        of_massive = of.massive[rows[:, changes.BODY].astype(int)]
        for time in (np.unique(rows[of_massive, changes.TIME] * self._direction) * self._direction).tolist():
            bodies = of.changes.bodies_at(time)
            self._events.of_bodies.go_on_with(Left(bodies, of.massive & ~bodies.present, time))

    def _is_later(self, time: float, other: float) -> bool:
        return (time - other) * self._direction > 0.0

    def _is_known(self, impact: Impact) -> bool:
        """Return whether a collision is listed already, or a body of it is gone."""
        if not (self._of.bodies.present[impact.first] and self._of.bodies.present[impact.second]):
            return True
        listed = self._events.of_bodies.log.rows
        pairs = np.sort(listed[listed[:, TIME] == impact.time][:, [BODY, OTHER]], axis=1)
        return bool((pairs == [impact.first, impact.second]).all(axis=1).any())

    # --------------------------------------------------------------------------------------------- what happens

    def _first(self, leg: Leg, found: list[Impact], until: float) -> Outcome | None:
        """Deal with the collisions of a step, up to a time; return what interrupts the leg first, if any."""
        for impact in found:
            if self._is_later(impact.time, until):
                return None
            if not self._is_known(impact):
                outcome = self._collide(leg, impact)
                if outcome is not None:
                    return outcome
        return None

    def _collide(self, leg: Leg, impact: Impact) -> Outcome | None:
        """Let two bodies collide in the next step of a leg."""
        of, time = self._of, impact.time
        q, v = of.whole(state_in_step(leg, time), leg.time)
        before = State(of.bodies.gm, of.bodies.radii, q, v)
        known = self._collisions.events(self._events.of_bodies.log.rows)
        try:
            done = self._collisions.act(of.system, of.bodies, before, impact, known, self._direction)
        except IntegrationError:
            self._seek_up_to(leg, time, q, v)
            raise
        changed = len(done.rows) > 0 and done.vanished is None
        found = self._seek_up_to(leg, time, q, v) if done.ends or changed else None
        if found is not None:
            return Outcome(found)
        for row in done.found:
            self._events.of_bodies.add(row, True)
        if done.ends:
            return Outcome(ended=(done.found[-1], before))
        of.note(done.rows)
        if done.vanished is not None:  # massless: nothing else changes by a bit
            numbers = np.cumsum(of.there) - 1
            for body in done.vanished:
                leg.losses.retire(leg, int(numbers[body]), IMPACT, leg.step, time, q[body], v[body])
        if not changed:
            return None
        if self._events.of_bodies:
            former = list(self._events.asked.bounds)
            self._events.of_bodies.go_on_with(Left(of.bodies, of.massive & ~of.bodies.present, time))
            found = self._events.of_bodies.jump(former, time, (q, v), (done.after.q, done.after.v))
        return Outcome(found, None, time, done.after)

    def _seek_up_to(self, leg: Leg, time: float, q: Array, v: Array) -> Found | None:
        """Seek events up to a collision in the next step; return the first one that interrupts the run, if any.

        q, v : of all bodies there, (n, 3)
        """
        there = self._of.present_massive()
        return self._events.before(leg, time, record=True, end=(q[there], v[there]))

    # ----------------------------------------------------------------------------------------------- the search

    def _impacts(self, start: Leg, end: End) -> list[Impact]:
        """Return the collisions in the step from where a leg is to an end, in the order of time."""
        of, collisions, whole = self._of, self._collisions, self._of.whole
        q, v = whole(start.state(), start.time), whole(end.state, start.time)

        def at(time: float) -> tuple[Array, Array]:
            try:
                return whole(state_in_step(start, time), start.time)
            except IntegrationError:  # where a pair goes through one point; the whole step leaps over it
                return np.full((len(of.there), 3), np.nan), np.full((len(of.there), 3), np.nan)

        massive, radii, order = np.flatnonzero(of.present_massive()), of.bodies.radii, of.integrator.order
        step = Step(start.time, end.time, q, v, at, massive, start.problem.strength[: 1 + len(massive)])
        alone = np.zeros(len(of.massive), dtype=bool)
        alone[of.there & ~of.massive] = start.follower.alone(start.stepper.state)
        for x in (*step.before, *step.after):
            x[alone] = np.nan
        found = impacts(step, radii, collisions.passes, order)
        numbers = np.flatnonzero(of.there)
        for particle in numbers[end.touching].tolist():
            if alone[particle] and of.bodies.present[particle]:
                large = massive[radii[massive] + radii[particle] > 0.0].tolist()
                pairs = [(min(body, particle), max(body, particle)) for body in large]
                found += impacts(self._step_of(particle, start, step), radii, collisions.passes, order, pairs)
        return sorted(found, key=lambda x: (x.time * self._direction, x.first, x.second))

    def _step_of(self, particle: int, start: Leg, step: Step) -> Step:
        """Return a step of the massive bodies and a massless one, which covers it by steps of its own."""
        of, number = self._of, int((~self._of.massive & self._of.there)[:particle].sum())

        def at(time: float) -> tuple[Array, Array]:
            with start.losses.retired.all_but(number):
                return of.whole(start.state_at(Place(0, time)), start.time)

        return step._replace(before=at(step.begin), after=at(step.end), at=at)
