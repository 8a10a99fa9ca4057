"""A chain of legs: the march of a run whose bodies change, each leg with its own bodies and masses.

Where bodies collide, or an event acts on them, the state is found by a partial step of the method, changed, and marched
on: with steps chosen one by one from there; with constant steps by a partial step to the next multiple of dt, so that
the grid of steps stays. What is found depends on the whole steps alone: samples change nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, IntegrationError, StorageError
from orbits.integrators.forms import Array
from orbits.marching.clocks.step_times import Place, Places
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs.excursions.planet_excursions import Legs
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.march import March
from orbits.marching.legs.next_step import pass_by, step_back
from orbits.marching.legs.record import Record, seen_by
from orbits.marching.legs.samples import Samples
from orbits.propagation.collisions.bodies_of_run import BodiesOfRun
from orbits.propagation.collisions.contacts import Contacts, End, Outcome
from orbits.propagation.collisions.merge_and_bounce import State
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.marchers import WORK
from orbits.system import System
from orbits.trajectory import changes
from orbits.trajectory.changes import CHANGES, COUNTS, Bodies, Changes, checked_rows, of_bodies

ROOM = 8192
"""The most changes that an archive holds, if they are not mergers, of which there are fewer than bodies."""


class ChainOfLegs(March):
    """A march of a system whose bodies collide, or are changed by events; states are of all bodies of the run, NaN for
    those that are gone.

    bodies : those of the run, at its start; events : of the run, where collisions are listed
    room : for changes, in its checkpoint; None for what the collisions need

    current : the march of those that are there now
    """

    def __init__(self, bodies: BodiesOfRun, events: Seeking, room: int | None = None) -> None:
        system, clock, collisions = bodies.system, bodies.clock, bodies.collisions
        self.system, self.clock, self.bodies, self._events = system, clock, bodies, events
        self._contacts = None if collisions is None else Contacts(bodies, collisions, events)
        self._seeks = collisions is not None and bool(events.of_bodies)  # other events, from collision to collision
        few = collisions is not None and collisions.only_merges
        self._room = room or (2 * len(system) if few else ROOM)
        self._work = np.zeros((len(system.forces), 7))
        self._grid = -1  # the step of the grid within which a leg began, until its end is reached
        self._seen: list[tuple[Bodies, Record]] = []  # of earlier legs with passages
        self._leg = self.bodies.march(system.values.q, system.values.v, clock)
        self._shapes = {name: (x.shape, x.dtype) for name, x in self._leg.checkpoint().items()}

    # ----------------------------------------------------------------------------------------- what a march shows

    @property
    def current(self) -> Legs:
        return self._leg

    @cached_property
    def samples(self) -> SamplesOfChain:
        """Its states at samples."""
        return SamplesOfChain(self)

    @property
    def step(self) -> int:
        """Whole steps taken; of constant steps those of the grid."""
        return max(self._grid, 0) + self._leg.step

    @property
    def time(self) -> float:
        return self._leg.time

    @property
    def home(self) -> Leg:
        return self._leg.home

    def changes(self) -> Changes:
        return self.bodies.changes

    def excursions(self) -> tuple[NDArray[np.int64], int] | None:
        return self._leg.excursions()

    def retired(self, by: float | None = None) -> list[Retirement]:
        """Return the particles that were retired, numbered as in the system at the start; by : see `March.retired`."""
        numbers = np.flatnonzero(self.bodies.there)
        return [lost._replace(body=int(numbers[lost.body])) for lost in self._leg.retired(by)]

    def accounts(self) -> Array:
        """Return the time integrals of each force up to the state returned last; see `Leg.accounts`."""
        work: Array = self.with_work_before(self._leg.accounts()[None])[0]
        return work

    def with_work_before(self, accounts: Array) -> Array:
        """Return the time integrals of all forces, (m, forces, columns), given those in the current leg."""
        work: Array = np.repeat(self._work[None], len(accounts), axis=0)
        work[:, self.bodies.acting()] += accounts
        return work

    def state(self) -> tuple[Array, Array]:
        return self.bodies.whole(self._leg.state(), self.time)

    def state_after(self, offset: float) -> tuple[Array, Array]:
        return self.bodies.whole(self._leg.state_after(offset), self.time + offset)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        self._settle()
        time = self.clock.time_at(place)
        if self._grid < 0:
            return self.bodies.whole(self._leg.state_at(place), time)
        return self.bodies.whole(self._leg.state_after(time - self._leg.time), time)

    def compile(self) -> None:
        self._leg.compile()

    def close(self) -> None:
        self._leg.close()

    def seen(self) -> list[tuple[System, Record]]:
        """Return the bodies of each leg of whole steps in which there are passages to be judged, and its record without
        the closest approaches; of a resumed run, from the leg on in which it went on.
        """
        return [(of_bodies(self.system, there), record) for there, record in (*self._seen, *self._seen_in_leg())]

    def _seen_in_leg(self) -> list[tuple[Bodies, Record]]:
        home = self.home
        record = self.clock.to_be_judged(partial(seen_by, home, noting_end=False)) if self._grid < 0 else None
        if record is None or not len(record.listed):
            return []
        return [(self.bodies.of_leg(), record._replace(closest=None))]

    # ------------------------------------------------------------------------------------------------ the march

    def is_before(self, place: Place) -> bool:
        """Return whether there may be whole steps, or collisions, left before a place."""
        if self.ended is not None:
            return False
        self._settle()
        if self._steps_before(place):
            return True
        return self._contacts is not None and self._contacts.may_lie_before(self.home, self.clock.time_at(place))

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place or a collision. Raises what `advance` raises."""
        self.found, leg, contacts = None, self._leg, self._contacts
        time, leads_beyond = self.clock.time_at(place), False
        try:
            if self._steps_before(place):
                leg.approach(place if self._grid < 0 else Place(1, 0.0))
            elif contacts is not None:
                leads_beyond = not contacts.takes_step_up_to(leg.home, time)
        except IntegrationError:
            if self._seeks:
                self._events.after(leg)  # the steps before the one that failed
            raise
        touched = None
        if contacts is not None and leads_beyond:
            self._interrupt(contacts.before(leg.home, time))
            return
        if contacts is not None:
            contacts.forget()
            touched = None if leg.home.bounds.met is None else End.of(leg.home)
        if touched is not None:
            step_back(leg)
        self.found = self._events.after(leg) if self._seeks else None
        waits = touched is not None and self.samples.come_first(touched.time)
        if contacts is not None and touched is not None and self.found is None and not waits:
            self._interrupt(contacts.in_step(leg.home, touched))
            if leg is self._leg and self.found is None and self.ended is None:
                pass_by(leg)

    def _interrupt(self, outcome: Outcome | None) -> None:
        """Do what a contact leads to."""
        if outcome is not None:
            self.found, self.ended = outcome.found, outcome.ended
            if outcome.state is not None:
                self._begin_leg(outcome.time, outcome.state)

    def change(self, kind: str, time: float, q: Array, v: Array, before: System, after: System) -> None:
        """Go on with changed bodies from a time in the step that begins where the march is.

        q, v : of all bodies, (n, 3), at that time; before, after : the bodies without and with the change
        kind : of the event that changed them, for messages. Raises EventError for a change that a run cannot make.
        """
        state, rows = self.bodies.changed(kind, time, q, v, before, after)
        if not len(rows):
            return
        self.bodies.note(rows)
        self._begin_leg(time, state)

    def follow_events(self) -> None:
        """Seek the events of the bodies that are there now, after a change, or in a run that is resumed."""
        if self._seeks and self._contacts is not None:
            self._contacts.follow_events()
        elif self._events.of_bodies.interrupts:
            self._events.asked.follow(self.bodies.now())

    def _settle(self) -> None:
        """Go on with whole steps, once the part of a step with which a leg began is done."""
        if self._grid >= 0 and self._leg.step:
            if self._seeks:
                self._events.of_bodies.flush()
            self._work = self.accounts()
            step, self._grid = self._grid + 1, -1
            self._follow(self.bodies.march(*self._leg.state(), self.clock), self._leg, step, self.time)

    def leg_of_whole_steps(self, place: Place) -> Legs | None:
        """Return the march of the bodies that are there now, if it has whole steps before a place."""
        return self._leg if self._grid < 0 and self._leg.is_before(place) else None

    def _steps_before(self, place: Place) -> bool:
        return place.steps > self._grid if self._grid >= 0 else self._leg.is_before(place)

    def _begin_leg(self, time: float, state: State) -> None:
        """Go on from a changed state at a time in the next step."""
        self._seen += self._seen_in_leg()
        self.changed = True
        self._work = self.accounts()
        if self._contacts is not None:
            self._contacts.forget()
        grid, lost = self._grid if self._grid >= 0 else self._leg.step, self._leg
        clock, begun, steps = lost.begun_within(self.clock, grid, time)
        self._grid = grid if clock is not self.clock else -1
        lost = lost.home.follower.losing_by(lost, time)
        self.bodies.begin_leg()
        there = self.bodies.there
        self._follow(self.bodies.march(state.q[there], state.v[there], clock, begun), lost, steps, time)

    def _follow(self, leg: Legs, lost: Legs, step: int, time: float) -> None:
        """Go on with another leg from a time, after `step` steps of its clock; lost : by when particles have been
        retired.
        """
        old, self._leg = self._leg, leg
        leg.go_on_from(lost, step, time)
        leg.home.stepper.take_counts(old.home.stepper)
        old.close()

    # ------------------------------------------------------------------------------------------------- checkpoints

    def checkpoint(self) -> dict[str, NDArray[Any]]:
        """Return all that is needed to resume bit for bit, in arrays whose shapes do not change in a run.

        Raises StorageError if there are more changes than an archive has room for.
        """
        self._settle()
        known = self._leg.checkpoint()
        known["counts"][0] = self.step
        out: dict[str, NDArray[Any]] = {}
        for name, (shape, dtype) in self._shapes.items():
            out[name] = np.zeros(shape, dtype=dtype)
            out[name][_corner(known[name].shape)] = known[name]
        rows = self.bodies.changes.rows
        if len(rows) > self._room:
            raise StorageError(
                f"bodies have changed more than {self._room:,} times, for which an archive has room. End the run "
                "before, or omit archive=...; the samples so far stay readable."
            )
        out[COUNTS] = np.array([len(rows), self._grid >= 0, 0], dtype=np.int64)
        out[CHANGES] = np.zeros((self._room, changes.COLUMNS))
        out[CHANGES][: len(rows)] = rows
        if self._work.size:
            out[WORK] = self._work.copy()
        return out

    def restore(self, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Restore a checkpoint of a march of the same run. Raises InputError or ArchiveError if it is not one."""
        rows, within, former = (int(x) for x in checkpoint[COUNTS])
        if not (0 <= rows <= self._room and within in (0, 1) and former >= 0 and (rows or not within)):
            raise ArchiveError(f"the changes in its checkpoint are counted as {checkpoint[COUNTS].tolist()}.")
        self.bodies.know(checked_rows(checkpoint, self.system))
        self._work = checkpoint[WORK].copy() if self._work.size else self._work
        self.bodies.begin_leg()
        self.changed = self.bodies.changes.begin_legs
        counts = np.asarray(checkpoint["counts"]).copy()
        self._grid = int(counts[0]) if within else -1
        values, there, clock, begun = self.system.values, self.bodies.there, self.clock, 0.0
        if within:
            begun = float(self.bodies.changes.rows[-1, changes.TIME])
            clock, _, _ = self.clock.begun_within(self._grid, begun)
        counts[0] += 0 if within else former  # earlier versions counted the steps of each leg
        self._leg.close()
        self._leg = self.bodies.march(values.q[there], values.v[there], clock, begun)
        parts = {name: checkpoint[name][_corner(x.shape)] for name, x in self._leg.checkpoint().items()}
        self._leg.restore({**parts, "counts": counts})
        if within:  # what it knows of earlier legs is of the steps of the grid; its own is the part of one
            self._leg.home.times.step = 0


class SamplesOfChain(Samples):
    """States at samples: in a block those of the leg that marched it, with all bodies of the run."""

    _march: ChainOfLegs
    _first: float | None = None
    _waits_at: float | None = None
    _leg: Legs | None = None

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to: one within the next step, or a part of one, which
        bodies may come to in contact.
        """
        self._leg = leg = self._march.leg_of_whole_steps(places.at(0))
        count = 1 if leg is None or self._march.time == self._waits_at else leg.samples.together(places)
        self._first = self._march.clock.time_at(places.at(0)) if count > 1 else None
        return count

    def come_first(self, end: float) -> bool:
        """Return whether some of those to which the block led come before the end of the step of a contact: they are
        taken before it, from where the march is, and those in that step one by one.
        """
        march, self._waits_at = self._march, None
        if self._first is not None and (self._first - end) * march.clock.direction < 0.0:
            self._first, self._waits_at = None, march.time
        return self._waits_at is not None

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched, with states that are known."""
        same = self._leg is not None and self._leg is self._march.current
        return self._march.current.samples.passed(places) if same else 0

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched."""
        march = self._march
        times = [march.clock.time_at(places.at(k)) for k in range(len(places.steps))]
        states = zip(*march.current.samples.in_block(places), times, strict=True)
        q, v = zip(*[march.bodies.whole((q, v), time) for q, v, time in states], strict=True)
        return np.stack(q), np.stack(v)

    def accounts(self) -> Array:
        """Return what is known of each force at each of the states returned last, (m or 1, forces, columns)."""
        return self._march.with_work_before(self._march.current.samples.accounts())


def _corner(shape: tuple[int, ...]) -> tuple[slice, ...]:
    return tuple(slice(0, length) for length in shape)
