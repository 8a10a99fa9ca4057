"""A march whose bodies change: a chain of legs, each with its own bodies and masses.

Where bodies collide, the state is found by a partial step of the method, changed, and marched on: with steps chosen one
by one from there; with constant steps by a partial step to the next multiple of dt, so that the grid of steps stays.
What is found depends on the whole steps alone: samples change nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, EventError, IntegrationError, StorageError
from orbits.integrators.base import Integrator
from orbits.kernels.steps import IMPACT
from orbits.marching.clocks.constant import Clock, ConstantSteps
from orbits.marching.clocks.step_times import Place
from orbits.marching.clocks.variable_steps import ending
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.march import March
from orbits.marching.legs.planet_excursions import Legs
from orbits.marching.stepping.motion import Motion
from orbits.propagation.collisions.bodies_of_run import FIRST_BLOCK, BodiesOfRun, state_in_step
from orbits.propagation.collisions.impact import Impact
from orbits.propagation.collisions.merge_and_bounce import State
from orbits.propagation.collisions.of_a_run import Collisions, rows_of_change
from orbits.propagation.collisions.steps_ahead import Ahead, StepsAhead
from orbits.propagation.events.base import Found
from orbits.propagation.events.left import Left
from orbits.propagation.events.particles import stretches
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.marchers import WORK
from orbits.system import System
from orbits.trajectory import changes
from orbits.trajectory.changes import CHANGES, COUNTS, Bodies, Changes, checked_rows
from orbits.trajectory.events import BODY, OTHER, TIME

Array = NDArray[np.float64]

ROOM = 8192
"""The most changes that an archive holds, if they are not mergers, of which there are fewer than bodies."""


class ChangingMarch(March):
    """A march of a system whose bodies collide, with the interface of `Leg` that runs need.

    system : at the start; events : of the run, where collisions are listed; approaches : as in `propagate`
    """

    def __init__(
        self,
        system: System,
        integrator: Integrator,
        clock: Clock,
        threads: int | None,
        events: Seeking,
        approaches: bool | None = None,
    ) -> None:
        self.system, self.integrator, self.clock = system, integrator, clock
        collisions = Collisions(system, events.touching) if events.touching else None
        self._events, self._collisions = events, collisions
        self._of = BodiesOfRun(system, integrator, clock, threads, collisions, bool(events), approaches)
        if collisions is not None:
            self._search = StepsAhead(self._of, collisions, bool(events))
        self.ended: tuple[Array, State] | None = None
        self.found: Found | None = None
        self._work = np.zeros((len(system.forces), 7))
        self._steps = 0  # of earlier legs, in archives of versions that counted those of each leg
        self._grid = -1  # the step of the grid within which a leg began, until its end is reached
        self._ahead: Ahead | None = None
        self._marcher = self._of.march(system.values.q, system.values.v, clock)
        self._largest = self._marcher.block
        self._shapes = {name: (x.shape, x.dtype) for name, x in self._marcher.checkpoint().items()}

    # ----------------------------------------------------------------------------------------- what a march shows

    @property
    def current(self) -> Legs:
        """The march of the current leg."""
        return self._marcher

    @property
    def step(self) -> int:
        """Whole steps taken; of constant steps those of the grid."""
        return self._grid + self._marcher.step if self._grid >= 0 else self._steps + self._marcher.step

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return self._marcher.time

    @property
    def reading(self) -> float:
        """The reading of the clock: whole steps, or the time."""
        return self.time if self.clock.changes else self.step

    @property
    def home(self) -> Leg:
        """The current leg, or the one whose clock it has."""
        return self._marcher.home

    def changes(self) -> Changes:
        """Return the changes so far."""
        return self._of.changes()

    def retired(self) -> list[Retirement]:
        """Return the particles that were retired, numbered as in the system at the start."""
        return self._numbered(self._marcher.retired())

    def retired_by(self, time: float) -> list[Retirement]:
        """Return these, and the particles that cannot be followed up to a time less than a step ahead."""
        return self._numbered(self._marcher.retired_by(time))

    def _numbered(self, retired: list[Retirement]) -> list[Retirement]:
        numbers = np.flatnonzero(self._of.there)
        return [lost._replace(body=int(numbers[lost.body])) for lost in retired]

    def accounts(self) -> Array:
        """Return the time integrals of each force up to the state returned last; see `Leg.accounts`."""
        return self._work + self._marcher.accounts()

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3); NaN for bodies that are gone."""
        return self._of.whole(self._marcher.state(), self.time)

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) after a partial step of `offset`; computed on a copy, without changing the march."""
        return self._of.whole(self._marcher.state_after(offset), self.time + offset)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced, without changing the march."""
        self._settle()
        time = self.clock.time_at(place)
        if self._grid < 0:
            return self._of.whole(self._marcher.state_at(place), time)
        return self._of.whole(self._marcher.state_after(time - self._marcher.time), time)

    def compile(self) -> None:
        """Compile, or load from the cache, all that `approach` needs."""
        self._marcher.compile()

    def close(self) -> None:
        """Release the threads."""
        self._marcher.close()

    # ------------------------------------------------------------------------------------------------ the march

    def is_before(self, place: Place) -> bool:
        """Return whether there may be whole steps, or collisions, left before a place."""
        if self.ended is not None:
            return False
        self._settle()
        if self._steps_before(place):
            return True
        if self._collisions is None:
            return False
        time, direction = self.clock.time_at(place), self.clock.direction
        if not (time - self._marcher.time) * direction > 0.0:
            return False
        if self._ahead is None or (self._ahead.end - time) * direction <= 0.0:
            return True
        return any((x.time - time) * direction <= 0.0 and not self._is_known(x) for x in self._ahead.impacts)

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place or a collision. Raises what `advance` raises."""
        self.found = None
        if self._steps_before(place):
            self._march(place)
            return
        time, direction = self.clock.time_at(place), self.clock.direction
        if self._ahead is None or (self._ahead.end - time) * direction <= 0.0:
            # Several steps, if they become shorter than the one that the clock tried and did not take.
            ahead, search = self._ahead, self._search
            self._ahead = search.next(self._marcher, ()) if ahead is None else search.after(ahead)
        self._take(self._ahead, time)

    def _march(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place or a collision."""
        marcher, begun = self._marcher, self._marcher.step
        before = {} if self._collisions is None else marcher.checkpoint()
        self._ahead = None
        try:
            if self._grid >= 0:
                marcher.advance(1)
            else:
                marcher.approach(place)
        except IntegrationError:
            if self._seeks:
                self._events.after(marcher)  # the steps before the one that failed
            raise
        marcher.block = min(2 * marcher.block, self._largest)
        met, marcher.met = marcher.met, None
        if met is None:
            self.found = self._events.after(marcher) if self._seeks else None
            return
        motion = marcher.motion() if self._seeks else None
        if motion is not None:
            self.found = self._events.take(_part(motion, slice(0, len(motion) - 1)))
            if self.found is not None:
                marcher.go_back(self.found.steps)
                return
        start = self._of.again(marcher, before)
        start.advance(marcher.step - begun - 1)
        self._take(Ahead(start, marcher, marcher.time, self._search.impacts(start, marcher)), marcher.time)
        if motion is None or marcher is not self._marcher:
            return
        if self.ended is None and self.found is None:
            self.found = self._events.take(_part(motion, slice(len(motion) - 1, len(motion))))
        if self.ended is not None or self.found is not None:
            marcher.restore(start.checkpoint())  # a run that is resumed finds what comes later in this step

    def change(self, kind: str, time: float, q: Array, v: Array, before: System, after: System) -> None:
        """Go on with changed bodies from a time in the step that begins where the march is.

        q, v : of all bodies, (n, 3), at that time; before, after : the bodies without and with the change
        kind : of the event that changed them, for messages. Raises EventError for a change that a run cannot make.
        """
        if after.names != before.names or (after.massive != before.massive).any():
            raise EventError(
                f"{kind} at t = {time:.10g}: the function returned other bodies, or gave one a mass that had none or "
                "took all of it; expected the same bodies, of which q, v, gm and radii may change.",
                time=time,
            )
        same = ("units", "softening", "terms", "forces", "epoch")
        if any(getattr(after, name) != getattr(before, name) for name in same):
            raise EventError(
                f"{kind} at t = {time:.10g}: the function changed something besides q, v, gm and radii, which stays as "
                "it is in a run.",
                time=time,
            )
        numbers = [self.system.names.index(name) for name in after.names]
        old = State(self._of.bodies.gm, self._of.bodies.radii, q, v)
        new = State(*(x.copy() for x in old))
        for kept, changed in zip(new, (after.values.gm, _radii(after), after.values.q, after.values.v), strict=True):
            kept[numbers] = changed
        rows = rows_of_change(self.system, self._of.bodies, time, old, new)
        if not len(rows):
            return
        self._of.note(np.concatenate([self._of.rows, rows]))
        self._work = self._work + self._marcher.accounts()
        self._begin_leg(self._marcher, time, new)

    @property
    def now(self) -> System:
        """The bodies at the start of the run, with the masses and radii that they have now."""
        radii = None if self.system.radii is None else self._of.bodies.radii
        return self.system.replaced(gm=self._of.bodies.gm, radii=radii)

    def steps_beyond(self, time: float) -> Iterator[Legs]:
        """Yield marches that have taken one step each, from here to a time or beyond; this march does not move."""
        self._settle()
        ahead, direction = self._marcher, self.clock.direction
        while (time - ahead.time) * direction > 0.0:
            following = self._of.again(ahead, ahead.checkpoint())
            following.advance(1)
            if following.step == ahead.step:
                return
            yield following
            ahead = following

    def _settle(self) -> None:
        """Go on with whole steps, once the part of a step with which a leg began is done."""
        if self._grid >= 0 and self._marcher.step:
            self._reach_grid()

    def _steps_before(self, place: Place) -> bool:
        return place.steps > self._grid if self._grid >= 0 else self._marcher.is_before(place)

    def _is_known(self, impact: Impact) -> bool:
        """Return whether a collision is listed already, or a body of it is gone."""
        if not (self._of.bodies.present[impact.first] and self._of.bodies.present[impact.second]):
            return True
        listed = self._events.log.rows
        pairs = np.sort(listed[listed[:, TIME] == impact.time][:, [BODY, OTHER]], axis=1)
        return bool((pairs == [impact.first, impact.second]).all(axis=1).any())

    def _take(self, ahead: Ahead, until: float) -> None:
        """Deal with the collisions of a step, up to a time, until one of them begins a new leg or ends the run."""
        marcher = self._marcher
        for impact in ahead.impacts:
            if (impact.time - until) * self.clock.direction > 0.0:
                return
            if not self._is_known(impact):
                self._collide(ahead, impact)
                if marcher is not self._marcher or self.ended is not None or self.found is not None:
                    return

    def _collide(self, ahead: Ahead, impact: Impact) -> None:
        """Let two bodies collide in a step."""
        start = ahead.start
        q, v = self._of.whole(state_in_step(start, impact.time), start.time)
        before = State(self._of.bodies.gm, self._of.bodies.radii, q, v)
        assert self._collisions is not None
        known = self._collisions.events(self._events.log.rows)
        try:
            done = self._collisions.act(self.system, self._of.bodies, before, impact, known, self.clock.direction)
        except IntegrationError:
            self._seek_up_to(ahead, impact.time, q, v)
            raise
        if done.ends or (len(done.rows) and done.vanished is None):
            self.found = self._seek_up_to(ahead, impact.time, q, v)
            if self.found is not None:
                return
        for row in done.found:
            self._events.note(row)
        if done.ends:
            self.ended = done.found[-1], before
        if not len(done.rows):
            return
        self._of.note(np.concatenate([self._of.rows, done.rows]))
        if done.vanished is not None:  # massless: nothing else changes by a bit
            numbers = np.cumsum(self._of.there) - 1
            for body in done.vanished:
                for march in (self._marcher, start):
                    home = march.home
                    home.losses.retire(home, int(numbers[body]), IMPACT, start.step, impact.time, q[body], v[body])
            return
        if self._seeks:
            left = self._left(self._of.bodies, impact.time)
            self.found = self._events.go_through(impact.time, (q, v), (done.after.q, done.after.v), left)
        self._work = self._work + start.accounts()
        self._begin_leg(start, impact.time, done.after)

    @property
    def _seeks(self) -> bool:
        """Whether other events are sought along the march, from collision to collision."""
        return self._collisions is not None and bool(self._events)

    def _seek_up_to(self, ahead: Ahead, time: float, q: Array, v: Array) -> Found | None:
        """Seek events up to a collision, in a step; return the first one that interrupts the run, if any.

        q, v : of all bodies there, (n, 3)
        """
        if not self._seeks:
            return None
        for motion in ahead.passed:
            found = self._events.take(motion)
            if found is not None:
                return found
        self._events.flush()
        if not (time - ahead.start.time) * self.clock.direction > 0.0:
            return None
        there = self._of.present_massive()
        for motion, ends in stretches(*ahead.start.towards(time)):
            if ends:  # so that no zero falls between the motion before the collision and that after it
                motion.path[-1].reshape(2, -1)[:, : 3 * int(there.sum())] = q[there].T.ravel(), v[there].T.ravel()
            found = self._events.search(motion)
            if found is not None:
                return found
        return None

    def _left(self, bodies: Bodies, time: float) -> Left:
        return Left(bodies, self._of.massive & ~bodies.present, time)

    def follow_events(self) -> None:
        """Seek the events of the bodies that are there now, in a run that is resumed."""
        if self._seeks:
            known, direction = self._of.changes(), self.clock.direction
            of_massive = self._of.massive[self._of.rows[:, changes.BODY].astype(int)]
            for time in (np.unique(self._of.rows[of_massive, changes.TIME] * direction) * direction).tolist():
                self._events.go_on_with(self._left(known.bodies_at(time), time))
        elif self._events.interrupts:
            self._events.follow(self.now)

    def _begin_leg(self, start: Legs, time: float, state: State) -> None:
        """Go on from a changed state at a time in the step that begins where the march `start` is."""
        self.changed, self._ahead = True, None
        clock: Clock = self.clock
        begun, steps = time, start.step
        if not clock.changes:
            grid = self._grid if self._grid >= 0 else start.step
            rest = float(clock.time(grid + 1)) - time
            if rest * clock.direction > 0.0:
                self._grid, clock = grid, ConstantSteps(rest)
            else:  # at the very end of the step: the next one is whole
                self._grid, begun, steps = -1, 0.0, grid + 1
        old, lost = self._marcher, self._marcher
        if clock.changes and not self._of.massive.all():  # by then, not by the end of the step
            lost = self._of.again(old, ending(start.checkpoint()))
            lost.advance_to(Place(0, time))
        self._of.begin_leg()
        self._marcher = self._of.march(state.q[self._of.there], state.v[self._of.there], clock, begun)
        self._marcher.home.losses.go_on_from(self._marcher.home, lost.home)
        self._marcher.home.stepper.take_counts(old.home.stepper)
        self._marcher.block = FIRST_BLOCK
        if self._grid < 0:
            self._marcher.home.times.step = steps
        old.close()

    def _reach_grid(self) -> None:
        """Go on with whole steps from the end of the partial step with which a leg began."""
        old, step = self._marcher, self._grid + 1
        if self._seeks:
            self._events.flush()
        self._work = self._work + old.accounts()
        self._grid = -1
        q, v = old.state()
        self._marcher = self._of.march(q, v, self.clock)
        self._marcher.home.losses.go_on_from(self._marcher.home, old.home)
        self._marcher.home.stepper.take_counts(old.home.stepper)
        self._marcher.home.times.step, self._marcher.block = step, FIRST_BLOCK
        old.close()

    # ------------------------------------------------------------------------------------------------- checkpoints

    def checkpoint(self) -> dict[str, NDArray[Any]]:
        """Return all that is needed to resume bit for bit, in arrays whose shapes do not change in a run.

        Raises StorageError if there are more changes than an archive has room for.
        """
        self._settle()
        known = self._marcher.checkpoint()
        known["counts"][0] = self.step if not self.clock.changes else self._marcher.step
        out: dict[str, NDArray[Any]] = {}
        for name, (shape, dtype) in self._shapes.items():
            out[name] = np.zeros(shape, dtype=dtype)
            out[name][_corner(known[name].shape)] = known[name]
        out[COUNTS] = np.array([len(self._of.rows), int(self._grid >= 0), self._steps], dtype=np.int64)
        out[CHANGES] = np.zeros((self._room(), changes.COLUMNS))
        if len(self._of.rows) > len(out[CHANGES]):
            raise StorageError(
                f"bodies have changed more than {len(out[CHANGES]):,} times, for which an archive has room. End the "
                "run before, or omit archive=...; the samples so far stay readable."
            )
        out[CHANGES][: len(self._of.rows)] = self._of.rows
        if self._work.size:
            out[WORK] = self._work.copy()
        return out

    def restore(self, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Restore a checkpoint of a march of the same run. Raises InputError or ArchiveError if it is not one."""
        rows, within, steps = (int(x) for x in checkpoint[COUNTS])
        if not (0 <= rows <= self._room() and within in (0, 1) and steps >= 0 and (rows or not within)):
            raise ArchiveError(f"the changes in its checkpoint are counted as {checkpoint[COUNTS].tolist()}.")
        self._of.note(checked_rows(checkpoint, self.system))
        self._work = checkpoint[WORK].copy() if self._work.size else self._work
        self._of.begin_leg()
        self.changed = self._of.changes().begin_legs
        self._steps, self._grid = steps, int(checkpoint["counts"][0]) if within else -1
        values, there, clock, begun = self.system.values, self._of.there, self.clock, 0.0
        if within:
            begun = float(self._of.rows[-1, changes.TIME])
            clock = ConstantSteps(float(self.clock.time(self._grid + 1)) - begun)
        self._marcher.close()
        self._marcher = self._of.march(values.q[there], values.v[there], clock, begun)
        known: dict[str, NDArray[Any]] = {}
        for name, array in self._marcher.checkpoint().items():
            known[name] = checkpoint[name][_corner(array.shape)]
        if within:
            known["counts"] = np.concatenate([[0], known["counts"][1:]])
        self._marcher.restore(known)

    def _room(self) -> int:
        return 2 * len(self.system) if self._collisions is not None and self._collisions.only_merges else ROOM


def _part(motion: Motion, steps: slice) -> Motion:
    """Return the motion in some of the steps."""
    ends = slice(steps.start, steps.stop + 1)
    return motion.with_steps(motion.times[ends], motion.path[ends], motion.kicks[steps], motion.lengths[steps])


def _radii(system: System) -> Array:
    return np.zeros(len(system)) if system.radii is None else np.asarray(system.radii.value)


def _corner(shape: tuple[int, ...]) -> tuple[slice, ...]:
    return tuple(slice(0, length) for length in shape)

