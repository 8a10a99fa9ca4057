"""A march whose bodies change: a chain of legs, each with its own bodies and masses.

Where bodies collide, the state is found by a partial step of the method, changed, and marched on: with steps chosen one
by one from there; with constant steps by a partial step to the next multiple of dt, so that the grid of steps stays.
What is found depends on the whole steps alone: samples change nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, EventError, InputError, IntegrationError, StorageError
from orbits.integrators.base import Integrator
from orbits.kernels.steps import IMPACT, NOWHERE
from orbits.marching.clocks import variable_steps as clocks
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.constant import Clock, ConstantSteps, Place
from orbits.marching.clocks.variable_steps import ending
from orbits.marching.following.retirement import Retirement
from orbits.marching.marcher import Marcher
from orbits.marching.stepping.motion import Motion
from orbits.propagation.collisions.impact import Impact, Step, impacts
from orbits.propagation.collisions.merge_and_bounce import State
from orbits.propagation.collisions.of_a_run import Collisions, rows_of_change
from orbits.propagation.collisions.own_impacts import alone, own_impacts
from orbits.propagation.control.stop_conditions import Conditions
from orbits.propagation.events.base import Found
from orbits.propagation.events.left import Left
from orbits.propagation.events.particles import stretches
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.marchers import WORK, bound
from orbits.system import System
from orbits.trajectory import changes
from orbits.trajectory.changes import CHANGES, COUNTS, Bodies, Changes, checked_rows, no_changes, of_bodies
from orbits.trajectory.events import BODY, OTHER, TIME

Array = NDArray[np.float64]

FIRST_BLOCK = 8
"""The steps of the first block after a change; each block without an impact is followed by one twice as long."""

ROOM = 8192
"""The most changes that an archive holds, if they are not mergers, of which there are fewer than bodies."""


class Ahead(NamedTuple):
    """A step: the marches where it begins and ends, the time at which it ends, and the collisions in it, in the order
    of time.

    passed : the motion in whole steps before it in which no events were sought
    """

    start: Marcher
    after: Marcher
    end: float
    impacts: list[Impact]
    passed: tuple[Motion, ...] = ()


class ChangingMarch:
    """A march of a system whose bodies collide, with the interface of `Marcher` that runs need.

    system : at the start; events : of the run, where collisions are listed; approaches : as in `propagate`

    rows : (k, COLUMNS), the changes so far (see `orbits.trajectory.changes`)
    found : the event that interrupts the march before the next collision, or None
    ended : the row of the collision that ended the march, and the bodies there, or None
    changed : whether a leg of other masses or velocities has begun
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
        self._collisions = Collisions(system, events.touching) if events.touching else None
        self._events, self._threads, self._approaches = events, threads, approaches
        self._massive = system.massive
        self.rows: Array = no_changes()
        self.ended: tuple[Array, State] | None = None
        self.found: Found | None = None
        self.changed = False
        self._work = np.zeros((len(system.forces), 7))
        self._steps = 0  # of earlier legs, in archives of versions that counted those of each leg
        self._grid = -1  # the step of the grid within which a leg began, until its end is reached
        self._ahead: Ahead | None = None
        self.bodies = Changes(system, self.rows, clock.direction).bodies_after(0)
        self._there = np.ones(len(system), dtype=bool)
        self._leg: System | None = None  # the bodies of this leg, once they are needed
        self._marcher = self._made(system.values.q, system.values.v, clock)
        self._largest = self._marcher.block
        self._shapes = {name: (x.shape, x.dtype) for name, x in self._marcher.checkpoint().items()}

    # ----------------------------------------------------------------------------------------- what a march shows

    @property
    def current(self) -> Marcher:
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
    def evaluations(self) -> int:
        """Evaluations of the forces among the massive bodies."""
        return self._marcher.evaluations

    @property
    def particle_evaluations(self) -> int:
        """Evaluations of the field at massless particles."""
        return self._marcher.particle_evaluations

    @property
    def met(self) -> None:
        """None: conditions that end a run are not tested together with collisions that act."""

    def changes(self) -> Changes:
        """Return the changes so far."""
        return Changes(self.system, self.rows, self.clock.direction)

    def retired(self) -> list[Retirement]:
        """Return the particles that were retired, numbered as in the system at the start."""
        return self._numbered(self._marcher.retired())

    def retired_by(self, time: float) -> list[Retirement]:
        """Return these, and the particles that cannot be followed up to a time less than a step ahead."""
        return self._numbered(self._marcher.retired_by(time))

    def _numbered(self, retired: list[Retirement]) -> list[Retirement]:
        numbers = np.flatnonzero(self._there)
        return [lost._replace(body=int(numbers[lost.body])) for lost in retired]

    def accounts(self) -> Array:
        """Return the time integrals of each force up to the state returned last; see `Marcher.accounts`."""
        return self._work + self._marcher.accounts()

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3); NaN for bodies that are gone."""
        return self._whole(self._marcher.state(), self.time)

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) after a partial step of `offset`; computed on a copy, without changing the march."""
        return self._whole(self._marcher.state_after(offset), self.time + offset)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced, without changing the march."""
        self._settle()
        time = self._time_of(place)
        if self._grid < 0:
            return self._whole(self._marcher.state_at(place), time)
        return self._whole(self._marcher.state_after(time - self._marcher.time), time)

    def states_before_next(self, times: Array) -> list[tuple[Array, Array]]:
        """Return (q, v) at the first of these times, up to which the march has advanced."""
        return [self.state_at(self.clock.place(float(times[0])))]

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
        time, direction = self._time_of(place), self.clock.direction
        if not (time - self._marcher.time) * direction > 0.0:
            return False
        if self._ahead is None or (self._ahead.end - time) * direction <= 0.0:
            return True
        return any((x.time - time) * direction <= 0.0 and not self._is_known(x) for x in self._ahead.impacts)

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place or a collision. Raises what `advance` raises."""
        if self._steps_before(place):
            self._march(place)
            return
        time, direction = self._time_of(place), self.clock.direction
        if self._ahead is None or (self._ahead.end - time) * direction <= 0.0:
            # Several steps, if they become shorter than the one that the clock tried and did not take.
            self._ahead = self._next_step(self._marcher, ()) if self._ahead is None else self._step_after(self._ahead)
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
        start = self._again(before)
        start.advance(marcher.step - begun - 1)
        self._take(Ahead(start, marcher, marcher.time, self._impacts(start, marcher)), marcher.time)
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
        old = State(self.bodies.gm, self.bodies.radii, q, v)
        new = State(*(x.copy() for x in old))
        for kept, changed in zip(new, (after.values.gm, _radii(after), after.values.q, after.values.v), strict=True):
            kept[numbers] = changed
        rows = rows_of_change(self.system, self.bodies, time, old, new)
        if not len(rows):
            return
        self.rows = np.concatenate([self.rows, rows])
        self.bodies = self.changes().bodies_after(len(self.rows))
        self._work = self._work + self._marcher.accounts()
        self._begin_leg(self._marcher, time, new)

    @property
    def now(self) -> System:
        """The bodies at the start of the run, with the masses and radii that they have now."""
        return self.system.replaced(gm=self.bodies.gm, radii=None if self.system.radii is None else self.bodies.radii)

    def steps_beyond(self, time: float) -> Iterator[Marcher]:
        """Yield marches that have taken one step each, from here to a time or beyond; this march does not move."""
        self._settle()
        ahead, direction = self._marcher, self.clock.direction
        while (time - ahead.time) * direction > 0.0:
            following = self._again(ahead.checkpoint())
            following.advance(1)
            if following.step == ahead.step:
                return
            yield following
            ahead = following

    def _settle(self) -> None:
        """Go on with whole steps, once the part of a step with which a leg began is done."""
        if self._grid >= 0 and self._marcher.step:
            self._reach_grid()

    def advance_to(self, place: Place) -> None:
        """March on by all whole steps and collisions before a place. Raises what `advance` raises."""
        while self.is_before(place):
            self.approach(place)

    def _steps_before(self, place: Place) -> bool:
        return place.steps > self._grid if self._grid >= 0 else self._marcher.is_before(place)

    def _time_of(self, place: Place) -> float:
        return place.rest if self.clock.changes else float(self.clock.time(place.steps)) + place.rest

    def _step_after(self, ahead: Ahead) -> Ahead:
        return self._next_step(ahead.after, (*ahead.passed, ahead.after.motion()) if self._seeks else ())

    def _next_step(self, marcher: Marcher, passed: tuple[Motion, ...]) -> Ahead:
        """Search the next step of a march, on copies; passed : the motion in those before it."""
        now = marcher.checkpoint()
        after = self._again(now, seek=True)
        after.advance(1)
        end = after.time if after.step > marcher.step else self.clock.direction * math.inf  # nothing attracts
        start = marcher if after.met is None else self._again(now)
        return Ahead(start, after, end, self._impacts(start, after) if after.met is not None else [], passed)

    def _impacts(self, start: Marcher, after: Marcher) -> list[Impact]:
        """Return the collisions in the step between two states of a march, in the order of time."""
        q, v = self._whole(start.state(), start.time), self._whole(after.state(), start.time)

        def at(time: float) -> tuple[Array, Array]:
            return self._whole(self._partial(start, time), start.time)

        massive = np.flatnonzero(self._present_massive())
        step = Step(start.time, after.time, q, v, at, massive, start.parameters[: 1 + len(massive)])
        assert self._collisions is not None
        if not start.clock.changes or self._massive.all():
            return impacts(step, self.bodies.radii, self._collisions.seeks, self.integrator.order)
        for x in (*step.before, *step.after):
            x[~self._massive] = np.nan
        found = impacts(step, self.bodies.radii, self._collisions.seeks, self.integrator.order)
        numbers = np.flatnonzero(self._there)
        for particle in numbers[after.touching()].tolist():
            if self.bodies.present[particle]:
                found += self._impacts_of(particle, start, after.time)
        return sorted(found, key=lambda x: (x.time * self.clock.direction, x.first, x.second))

    def _impacts_of(self, particle: int, start: Marcher, end: float) -> list[Impact]:
        """Return the collisions of a massless body in its own steps within one of the massive bodies, up to the first
        after which it does not go on as before.
        """
        assert self._collisions is not None
        values, collisions = self.system.values, self._collisions
        some = self._present_massive()
        some[particle] = True
        system = of_bodies(self.system, self.bodies._replace(present=some))
        march = bound(system, self.integrator, self.clock, 1, state=(values.q[some], values.v[some]))
        number = int((~self._massive & self._there)[:particle].sum())
        march.restore(alone(start.checkpoint(), march.checkpoint(), number))
        return own_impacts(march, particle, some, end, self.bodies.radii, collisions)

    def _present_massive(self) -> NDArray[np.bool_]:
        return np.asarray(self._massive & self.bodies.present)

    def _is_known(self, impact: Impact) -> bool:
        """Return whether a collision is listed already, or a body of it is gone."""
        if not (self.bodies.present[impact.first] and self.bodies.present[impact.second]):
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
        q, v = self._whole(self._partial(start, impact.time), start.time)
        before = State(self.bodies.gm, self.bodies.radii, q, v)
        assert self._collisions is not None
        known = self._collisions.events(self._events.log.rows)
        try:
            done = self._collisions.act(self.system, self.bodies, before, impact, known, self.clock.direction)
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
        self.rows = np.concatenate([self.rows, done.rows])
        self.bodies = self.changes().bodies_after(len(self.rows))
        if done.vanished is not None:  # massless: nothing else changes by a bit
            numbers = np.cumsum(self._there) - 1
            for body in done.vanished:
                for march in (self._marcher, start):
                    march.retire(int(numbers[body]), IMPACT, start.step, impact.time, q[body], v[body])
            return
        if self._seeks:
            left = self._left(self.bodies, impact.time)
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
        there = self._present_massive()
        for motion, ends in stretches(*ahead.start.towards(time)):
            if ends:  # so that no zero falls between the motion before the collision and that after it
                motion.path[-1].reshape(2, -1)[:, : 3 * int(there.sum())] = q[there].T.ravel(), v[there].T.ravel()
            found = self._events.search(motion)
            if found is not None:
                return found
        return None

    def _left(self, bodies: Bodies, time: float) -> Left:
        return Left(bodies, self._massive & ~bodies.present, time)

    def follow_events(self) -> None:
        """Seek the events of the bodies that are there now, in a run that is resumed."""
        if self._seeks:
            known, direction = self.changes(), self.clock.direction
            of_massive = self._massive[self.rows[:, changes.BODY].astype(int)]
            for time in (np.unique(self.rows[of_massive, changes.TIME] * direction) * direction).tolist():
                self._events.go_on_with(self._left(known.bodies_at(time), time))
        elif self._events.interrupts:
            self._events.follow(self.now)

    def _begin_leg(self, start: Marcher, time: float, state: State) -> None:
        """Go on from a changed state at a time in the step that begins where the march `start` is."""
        self.changed, self._ahead = True, None
        clock: Clock = self.clock
        if not clock.changes:
            self._grid = self._grid if self._grid >= 0 else start.step
            rest = float(clock.time(self._grid + 1)) - time
            clock = ConstantSteps(rest)
            if rest * self.clock.direction <= 0.0:  # a collision at the very end of the step
                self._grid, clock = -1, self.clock
        old, lost, steps = self._marcher, self._marcher, start.step + (not clock.changes)
        if clock.changes and not self._massive.all():  # by then, not by the end of the step
            lost = self._again(ending(start.checkpoint()))
            lost.advance_to(Place(0, time))
        self._there, self._leg = self.bodies.present | ~self._massive, None
        self._marcher = self._made(state.q[self._there], state.v[self._there], clock, time)
        self._marcher.follow(lost)
        self._marcher.evaluations, self._marcher.particle_evaluations = old.evaluations, old.particle_evaluations
        self._marcher.block = FIRST_BLOCK
        if self._grid < 0:
            self._marcher.step = steps
        old.close()

    def _reach_grid(self) -> None:
        """Go on with whole steps from the end of the partial step with which a leg began."""
        old, step = self._marcher, self._grid + 1
        if self._seeks:
            self._events.flush()
        self._work = self._work + old.accounts()
        self._grid = -1
        q, v = old.state()
        self._marcher = self._made(q, v, self.clock)
        self._marcher.follow(old)
        self._marcher.step, self._marcher.block = step, FIRST_BLOCK
        old.close()

    def _partial(self, start: Marcher, time: float) -> tuple[Array, Array]:
        return start.state_at(Place(0, time)) if start.clock.changes else start.state_after(time - start.time)

    def _made(
        self, q: Array, v: Array, clock: Clock, time: float = 0.0, *, seek: bool = True, copy: bool = False
    ) -> Marcher:
        """Return a march of the bodies of this leg, of q and v (there, 3), from a time on.

        seek : whether it ends where bodies may touch; copy : whether it is a copy, for few steps, which is not closed
        """
        if self._leg is None:
            self._leg = of_bodies(self.system, self.bodies._replace(present=self._there))
        q, v = np.where(np.isnan(q), NOWHERE, q), np.where(np.isnan(v), 0.0, v)
        seek = seek and self._collisions is not None
        radii = self._collisions.sought(self.bodies.radii)[self._there] if seek and self._collisions else None
        threads = 1 if copy else self._threads
        made = bound(
            self._leg,
            self.integrator,
            clock,
            threads,
            state=(q, v),
            start=0.0 if clock.changes else time,  # such a clock reads the time since the start of the run
            radii=radii,
            dense=bool(self._events),
            approaches=self._approaches,
        )
        if clock.changes and time != 0.0:
            now = made.checkpoint()
            now["clock"][[clocks.TIME, clocks.NEXT]] = time
            made.restore(now)
        return made

    def _again(self, checkpoint: Mapping[str, NDArray[Any]], seek: bool = False) -> Marcher:
        """Return a march of this leg at one of its checkpoints, without a goal."""
        known = dict(checkpoint)
        if self.clock.changes:
            known["clock"] = known["clock"].copy()
            known["clock"][clocks.LIMIT] = np.copysign(clocks.FARTHEST, self.clock.direction)
        values, there = self.system.values, self._there
        begun = 0.0 if self._grid < 0 else self._marcher.start
        again = self._made(values.q[there], values.v[there], self._marcher.clock, begun, seek=seek, copy=True)
        again.restore(known)
        again.block = FIRST_BLOCK
        return again

    def _whole(self, state: tuple[Array, Array], time: float) -> tuple[Array, Array]:
        """Return a state of all bodies of the run, NaN for those that are gone at a time."""
        q, v = np.full((2, len(self._there), 3), np.nan)
        q[self._there], v[self._there] = state
        gone = ~self.changes().bodies_at(time).present
        q[gone] = v[gone] = np.nan
        return q, v

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
        out[COUNTS] = np.array([len(self.rows), int(self._grid >= 0), self._steps], dtype=np.int64)
        out[CHANGES] = np.zeros((self._room(), changes.COLUMNS))
        if len(self.rows) > len(out[CHANGES]):
            raise StorageError(
                f"bodies have changed more than {len(out[CHANGES]):,} times, for which an archive has room. End the "
                "run before, or omit archive=...; the samples so far stay readable."
            )
        out[CHANGES][: len(self.rows)] = self.rows
        if self._work.size:
            out[WORK] = self._work.copy()
        return out

    def restore(self, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Restore a checkpoint of a march of the same run. Raises InputError or ArchiveError if it is not one."""
        rows, within, steps = (int(x) for x in checkpoint[COUNTS])
        if not (0 <= rows <= self._room() and within in (0, 1) and steps >= 0 and (rows or not within)):
            raise ArchiveError(f"the changes in its checkpoint are counted as {checkpoint[COUNTS].tolist()}.")
        self.rows = checked_rows(checkpoint, self.system)
        self.bodies = self.changes().bodies_after(rows)
        self._work = checkpoint[WORK].copy() if self._work.size else self._work
        self._there, self._leg = self.bodies.present | ~self._massive, None
        self.changed = self.changes().begin_legs
        self._steps, self._grid = steps, int(checkpoint["counts"][0]) if within else -1
        values, there, clock, begun = self.system.values, self._there, self.clock, 0.0
        if within:
            begun = float(self.rows[-1, changes.TIME])
            clock = ConstantSteps(float(self.clock.time(self._grid + 1)) - begun)
        self._marcher.close()
        self._marcher = self._made(values.q[there], values.v[there], clock, begun)
        known: dict[str, NDArray[Any]] = {}
        for name, array in self._marcher.checkpoint().items():
            known[name] = checkpoint[name][_corner(array.shape)]
        if within:
            known["counts"] = np.concatenate([[0], known["counts"][1:]])
        self._marcher.restore(known)

    def _room(self) -> int:
        return 2 * len(self.system) if self._collisions is not None and self._collisions.only_merges else ROOM


March = Marcher | ChangingMarch
"""What marches a run."""


def of_this_leg(march: March) -> Marcher:
    """Return the march of the bodies that are there now."""
    return march.current if isinstance(march, ChangingMarch) else march


def march_of_run(
    system: System,
    integrator: Integrator,
    clock: Clock,
    threads: int | None,
    events: Seeking,
    conditions: Conditions | None = None,
    approaches: bool | None = None,
) -> March:
    """Return the march of a run of a system. Raises InputError for what cannot be sought together.

    approaches : as in `propagate`
    """
    if not events.touching and not events.act:
        stops = None if events.stops is None else events.stops.rows
        march = bound(
            system, integrator, clock, threads, conditions, dense=bool(events), stops=stops, approaches=approaches
        )
        events.check(march)
        return march
    if conditions is not None and conditions.distances:
        kind = type(conditions.distances[0]).__name__
        raise InputError(
            f"stop={kind}(...) looks at bodies that stay the same, but events may change them. Give it in events=, "
            "with then='stop', where any body means any with mass; or leave one of the two out."
        )
    if conditions is not None and conditions.energy < np.inf:
        raise InputError(
            "stop=EnergyErrorAbove(...) is tested in steps of the same bodies, but events may change them. End the run "
            "from callback=..., which has the state at each sample, or leave one of the two out."
        )
    if not isinstance(clock, Adaptive | ConstantSteps):
        raise InputError(
            "the bodies of a run change in the time of the system, not in transformed time: leave dt out, or give a "
            "step."
        )
    if events.touching and integrator.follows_kepler:
        raise InputError(
            f"collisions are sought, but {integrator.label} cannot follow bodies that come close to each other. Use "
            "Gauss(stages=8), the default, without dt: steps are then chosen one by one."
        )
    march_on = ChangingMarch(system, integrator, clock, threads, events, approaches)
    events.check(march_on.current)
    return march_on


def _part(motion: Motion, steps: slice) -> Motion:
    """Return the motion in some of the steps."""
    ends = slice(steps.start, steps.stop + 1)
    return motion.with_steps(motion.times[ends], motion.path[ends], motion.kicks[steps], motion.lengths[steps])


def _radii(system: System) -> Array:
    return np.zeros(len(system)) if system.radii is None else np.asarray(system.radii.value)


def _corner(shape: tuple[int, ...]) -> tuple[slice, ...]:
    return tuple(slice(0, length) for length in shape)

