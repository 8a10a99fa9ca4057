"""The blocks of a march: so many steps of the massive bodies, and then of the particles that follow through them.

A block begins with a copy of the state. If a step fails, a particle is lost or a condition is met, the block is marched
again, from there, up to that step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, IntegrationError
from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form
from orbits.kernels.dense import times_reached
from orbits.kernels.maps.jacobi_particles import ELSEWHERE, NUMBER
from orbits.kernels.search.record import COLUMNS, MATE, ROW, WHEN
from orbits.kernels.steps import BEYOND, INNER_NOT_CONVERGED, NEAR_A_PLANET, NOT_CONVERGED, OK, TOO_SHORT
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.marching.clocks import variable_steps
from orbits.marching.clocks.constant import Clock
from orbits.marching.following import losses
from orbits.marching.following.losses import Contact, Suspect
from orbits.marching.following.own_clocks import REACHED
from orbits.marching.following.particle_excursions import PART
from orbits.marching.following.retirement import HIT, Lost, Retired, earlier, hit, kind_of
from orbits.marching.stepping.bound_loops import BoundLoops, numbers_of
from orbits.marching.stepping.failures import failure_of_bodies, last_good, meeting, refused_meeting
from orbits.marching.watching import kepler_passages
from orbits.marching.watching.passage_list import Kept, PassageList
from orbits.marching.watching.watcher import Watcher

SPAN, LEAST_SPAN = 3.0, 32
"""The length of a block in which particles may be retired, as a multiple of the square root of the number of steps from
one retirement to the next; and the least."""

APART = 64
"""The number of steps between the states that are kept of a run of which not all are; see `steps_apart`."""


def steps_apart(integrator: Integrator, massive: NDArray[np.bool_]) -> int:
    """Return the number of steps between the states that are kept of a run, for dense output: 1 if partial steps lead
    on from each. With massless particles, and for methods whose states are costly to see, a march does.
    """
    return 1 if massive.all() and not integrator.follows_kepler else APART


class Blocks:
    """The methods of `Marcher` that march a block of steps, and those that return to the beginning of one."""

    if TYPE_CHECKING:  # set by `Marcher`
        lagrangian: Lagrangian
        integrator: Integrator
        clock: Clock
        parameters: Array
        names: tuple[str, ...]
        step: int
        evaluations: int
        particle_evaluations: int
        block: int
        met: int | None
        _arrived: bool
        _apart: int
        _backup: dict[str, Array]
        _begun_lo: float
        _block: tuple[int, float]
        _bodies: int
        _counts: tuple[int, int]
        _deep: Array
        _dense: bool
        _encountered: Lost | None
        _starts_close: NDArray[np.intp]
        _forces: tuple[BoundForce, ...]
        _form: Form
        _gm: Array
        _judges_encounters: bool
        _keep: Callable[[Array, Array, Array], None] | None
        _lengths: Array
        _listed: Kept
        _loops: BoundLoops
        _massive: NDArray[np.intp]
        _meeting_of_planets: kepler_passages.Meeting | None
        _nothing: Array
        _overflowed: bool
        _passes: bool
        _particles: NDArray[np.intp]
        _passages: PassageList
        _retire: bool
        _sees_more: bool
        _retired: Retired
        _start: float
        _state: dict[str, Array]
        _stopped: bool
        _surfaces: Array | None
        _watcher: Watcher

        @property
        def time(self) -> float: ...
        def state(self) -> tuple[Array, Array]: ...
        def state_after(self, offset: float) -> tuple[Array, Array]: ...
        def _as_seen(self, particles: NDArray[np.intp] | None = None) -> dict[str, Array]: ...
        def _time_of(self, step: int) -> float: ...

    def advance(self, steps: int) -> None:
        """March on by `steps` >= 0 steps, or by those before the place that it approaches.

        Raises ConvergenceError or SingularityError; the state is then that before the step that failed.
        """
        self._stopped = self._arrived = False
        while steps > 0 and not (self._stopped or self._arrived):
            steps -= self._one_block(min(steps, self.block))

    def _one_block(self, most: int) -> int:
        """March on by a block of at most `most` steps, and return their number. Raises what `advance` raises."""
        self._back_up()
        before = self.step
        try:
            failure = self._advance_block(min(most, self._most()))
            self._pass_on(self.step - before)
        except BaseException:  # an interrupt: return to the state after the last complete block
            self._replay(0)
            self.step = before
            raise
        if failure is not None:
            raise failure
        return self.step - before

    def _most(self) -> int:
        """Return the number of steps up to the next state that is kept, if not all are; fewer while particles are
        retired often.
        """
        departs = len(self._particles) > 0 and self.integrator.departures != (None, None)
        every = (self._keep is not None and self._apart > 1) or departs
        most = APART - self.step % APART if every else self.block
        if not (len(self._particles) and self._judges_encounters):
            return most
        # A retirement costs a block, and a block about SPAN^2 steps: their sum is least for blocks of this length.
        between = self.step / (1 + int(self._retired.gone().sum()))
        return min(most, max(LEAST_SPAN, int(SPAN * math.sqrt(between))))

    def _advance_block(self, count: int) -> IntegrationError | None:
        """March on by at most `count` steps; return the error if the next step cannot be taken, else None."""
        failure: IntegrationError | None = None
        try:
            count = self._march_block(self._state, self.clock, count)
        except IntegrationError as error:
            failure = error
        if failure is not None:
            # Explicit methods look at the end of a block only; an iteration tells which step did not converge.
            known = isinstance(failure, ConvergenceError)
            count = failure.step - self.step if known else last_good(self._can_be_taken, count)
            self._replay(count)
        if self._sees_more:
            self._replay(count)
        followed = self._followed(count)
        if followed < count:
            count, failure = followed, None
            self._replay(count)
        hits, contacts = self._impacts(count)
        lost, reached, begun = earlier(hits, self._retired.lost_or(self._encountered)), {}, self.step
        if lost is not None:  # a particle: repeat up to the step that it cannot take, and go on without it
            within = self.clock.changes and self._watcher.touched_first_in(lost.steps + 1)
            count, reached = lost.steps + within, self._reached(lost)  # that step as well, if it may hit a body in it
            self._replay(count)
        if self._meeting_of_planets is not None and (lost is None or self._meeting_of_planets.steps <= lost.steps):
            steps, pair, distance = self._meeting_of_planets
            self._replay(steps)
            if self._stop(steps):
                return None
            self.step += steps
            names = [self.names[k] if self.names else f"body {k}" for k in self._massive[list(pair)].tolist()]
            return refused_meeting(self.step, self.time, names, distance, self.integrator)
        if self._overflowed and count > 1:  # more passages than the list of a block holds: repeat in shorter blocks
            self._replay(0)
            self.block = count // 2
            return None
        if self._stop(count):
            beyond = lost is not None and self.step > begun + lost.steps
            return self._lose(lost, reached, begun + lost.steps, contacts) if lost is not None and beyond else None
        self.step += count
        if lost is not None:
            return self._lose(lost, reached, begun + lost.steps, contacts)
        if failure is None:
            return None
        try:  # to find the number and the time of the step that failed
            self._march_block(self._copied(), self.clock, 1)
        except IntegrationError as error:
            return error
        return failure

    def _followed(self, count: int) -> int:
        """Return how many of the `count` steps of the block just marched are taken: here all."""
        return count

    def keep_steps(
        self, keep: Callable[[Array, Array, Array], None], take_back: Callable[[int], None] = lambda count: None
    ) -> None:
        """Call `keep` after each block with times, (k, 2), each as the sum of two numbers, and q and v, (k, n, 3), in
        the order of the caller: at the ends of all its steps, or of every `APART`-th; see `steps_apart`.

        take_back : called with a number of states passed last that are no longer of the run; see `go_back`
        """
        self._keep, self._take_back = keep, take_back

    def _pass_on(self, count: int) -> None:
        """Pass the states at the ends of the `count` steps of the last block to what keeps them."""
        if self._keep is None or not count:
            return
        times = np.zeros((count + 1, 2))
        if self.clock.changes:
            times[0] = self._backup["clock"][[variable_steps.TIME, variable_steps.TIME_LO]]
        else:
            times[0, 0] = self._time_of(self.step - count)
        times_reached(self._loops.lengths(count), times)
        if self._apart == 1:
            n = self._bodies
            states = self._watcher.recorded(count)[1:, :, : 3 * n].reshape(count, 2, 3, n).transpose(1, 0, 3, 2)
            self._keep(times[1:], *states)
        elif self.step % APART == 0:
            q, v = self.state()
            self._keep(times[-1:], q[None], v[None])

    def _reached(self, lost: Lost) -> dict[str, Array]:
        """Return where lost particles have got to by steps of their own, within a step of the bodies."""
        if self.integrator.follows_encounters:
            away = lost.particles[self._state["particle_memory"][lost.particles, 0, NUMBER] == ELSEWHERE]
            state = {name: self._state[f"particle_{name}"][:, away] for name in ("q", "v")}
            return {"away": away, **state, "memory": self._state["particle_memory"][away]}
        if not self.clock.changes:
            return {}
        reached = {f"particle_{name}": lost.particles for name in ("q", "q_lo", "v", "v_lo")}
        state = {name: self._state[name][:, which] for name, which in reached.items()}
        return {**state, "particle_clock": self._state["particle_clock"][lost.particles]}

    def _lose(
        self, lost: Lost, reached: Mapping[str, Array], step: int, contacts: Mapping[int, Contact] | None = None
    ) -> IntegrationError | None:
        """Retire particles after `step` steps, where they have got to; or return the error for the first one, if
        `retire` is not set.

        contacts : of those that hit a body
        """
        if not self._retire:
            return self._failure(int(lost.status[0]), 0, [int(self._particles[lost.particles[0]])])
        if self._form.transforms:  # what is left of them is what is seen
            seen, alone = self._as_seen(lost.particles), reached
            reached = {f"particle_{name}": seen[f"particle_{name}"][:, lost.particles] for name in ("q", "v")}
            parts = dict(zip(alone.get("away", np.zeros(0)).tolist(), alone.get("memory", np.zeros(0)), strict=True))
            for k, particle in enumerate(lost.particles.tolist()):
                memory, there = self._state["particle_memory"][particle], None
                if contacts and particle in contacts and kind_of(lost.status[k]) == HIT:
                    _, part, _, *there = contacts[particle]
                elif particle in parts:
                    at, part = list(parts).index(particle), parts[particle][0, PART]
                    there = [alone["q"][:, at], alone["v"][:, at]]
                if there is not None:
                    reached["particle_q"][:, k], reached["particle_v"][:, k] = there
                memory[:] = 0.0
                if there is not None:
                    memory[0, NUMBER], memory[0, PART] = ELSEWHERE, part
        elif self.clock.changes:
            for k, particle in enumerate(lost.particles.tolist()):
                if contacts and particle in contacts and kind_of(lost.status[k]) == HIT:
                    one = contacts[particle]
                    reached["particle_q"][:, k], reached["particle_v"][:, k] = one.q, one.v
                    reached["particle_q_lo"][:, k] = reached["particle_v_lo"][:, k] = 0.0
                    reached["particle_clock"][k, REACHED] = self.time + one.part * one.length
        self._retired.add(lost, step)
        for name, values in reached.items():
            if name == "particle_clock":
                self._state[name][lost.particles] = values
            else:
                self._state[name][:, lost.particles] = values
        return None

    def _impacts(self, count: int) -> tuple[Lost | None, dict[int, Contact]]:
        """Return the particles that hit a body first in the block of `count` steps just marched, and their contacts;
        None and {} if none does, or if the block is to be repeated.
        """
        suspects = [] if self._overflowed and count > 1 else self._suspects(count)
        if not suspects:
            return None, {}
        assert self._surfaces is not None
        begun, found = self.step, dict[int, tuple[int, Contact]]()
        surfaces = dict(zip(self._massive.tolist(), self._surfaces.tolist(), strict=True))
        lengths = self._loops.lengths(count).copy() if self.clock.changes else np.full(count, self.clock.h)
        for suspect in sorted(suspects):
            particle, body, _ = suspect
            own, other = int(self._particles[particle]), int(self._massive[body])

            def is_within(step: int, particle: int = particle, pair: tuple[int, int] = (own, other)) -> bool:
                self.step = begun
                self._replay(step)
                self.step += step
                is_own = self.clock.changes or self._state["particle_memory"][particle, 0, NUMBER] == ELSEWHERE
                q, _ = self.state()
                return bool(is_own and np.linalg.norm(q[pair[0]] - q[pair[1]]) < surfaces[pair[1]])

            step = losses.first_step_within(suspect, is_within)
            is_within(step)
            length = float(lengths[step])
            touched = losses.touching(self.state_after, length, surfaces[other], own, other)
            if touched is not None:
                now = step, Contact(body, touched[0], length, *touched[1:])
                known = found.setdefault(particle, now)
                found[particle] = min(known, now, key=lambda one: (one[0], one[1].part))
        self.step = begun
        self._replay(count)
        if not found:
            return None, {}
        first = min(step for step, _ in found.values())
        contacts = {particle: found[particle][1] for particle in sorted(found) if found[particle][0] == first}
        status = np.array([hit(contact.body) for contact in contacts.values()])
        return Lost(first, np.array(list(contacts)), status), contacts

    def _suspects(self, count: int) -> list[Suspect]:
        """Return what may hit a body in the block just marched: passages within radii, particles that are falling
        within one at its end, and those whose steps became too short.
        """
        if self._surfaces is None or not (self._retire and count and len(self._particles)):
            return []
        n, m, direction = self._bodies, len(self._particles), math.copysign(1.0, self._direction())
        if self.clock.changes:
            ends = self._block[1] + self._loops.times[1 : count + 1]
            steps = np.searchsorted(ends * direction, self._deep[:, WHEN] * direction)
        else:
            steps = self._deep[:, WHEN].astype(int) - self.step
        pairs = zip(self._deep[:, ROW].astype(int) - n, self._deep[:, MATE].astype(int), steps, strict=True)
        found = [Suspect(int(p), int(body), min(max(int(k), 0), count - 1)) for p, body, k in pairs]
        path = self._watcher.recorded(count)[:, :, : 3 * n].reshape(count + 1, 2, 3, n)
        own = np.ones(m, dtype=bool)
        if not self.clock.changes:
            own = self._state["particle_memory"][:m, 0, NUMBER] == ELSEWHERE
        own &= self._retired.table()[:, 0] == OK
        lost = own & self._retired.gone()
        q, v = self._state["particle_q"][:, :m], self._state["particle_v"][:, :m]
        there = np.flatnonzero(own & ~lost)
        bodies = path[count, 0], path[count, 1]
        close = losses.falling_within(q[:, there], v[:, there], bodies, self._surfaces, direction)
        found += [Suspect(int(there[k]), int(body), count - 1) for k, body in np.argwhere(close)]
        for particle in np.flatnonzero(lost):
            step = min(int(self._retired.block[particle, 1]), count - 1)
            nearest = int(np.linalg.norm(path[step, 0] - q[:, [particle]], axis=0).argmin())
            if self._surfaces[nearest] > 0.0:
                found.append(Suspect(int(particle), nearest, step))
        return found

    def _direction(self) -> float:
        """Return a number of the sign of the steps."""
        return float(self._state["clock"][variable_steps.DIRECTION]) if self.clock.changes else self.clock.h

    def _stop(self, count: int) -> bool:
        """Return whether something may end the march in the block of `count` steps just marched; if so, go back to
        that step.
        """
        found = self._watcher.met(count, not self._passes)
        if found is None:
            return False
        self._stopped, (steps, self.met) = True, found
        if steps < count:
            self._replay(steps)
        self.step += steps
        return True

    def _back_up(self) -> None:
        """Copy the state at the beginning of a block."""
        if self._backup:
            for name, array in self._state.items():
                self._backup[name][...] = array
        else:
            self._backup = {name: array.copy() for name, array in self._state.items()}
        self._counts = self.evaluations, self.particle_evaluations
        self._listed = self._passages.keep()

    def _can_be_taken(self, steps: int) -> bool:
        """Return whether `steps` steps of the block that has just failed can be taken, after taking them."""
        try:
            self._replay(steps)
        except IntegrationError:
            return False
        return True

    def _replay(self, count: int) -> None:
        """March `count` steps from the state at the beginning of the block."""
        for name, array in self._state.items():
            np.copyto(array, self._backup[name])
        self.evaluations, self.particle_evaluations = self._counts
        self._passages.put_back(self._listed)
        self._retired.begin()
        self._arrived, self._block = False, (0, self.time)
        self._encountered, self._meeting_of_planets, self._deep = None, None, np.zeros((0, COLUMNS))
        if count:
            self._march_block(self._state, self.clock, count)

    def _copied(self) -> dict[str, Array]:
        """Return a copy of the state, which is marched without observers."""
        return {name: array.copy() for name, array in self._state.items() if name != "approaches"}

    def _march_block(self, state: dict[str, Array], clock: Clock, count: int, *, goes_on: bool = False) -> int:
        """March `count` steps, or those before the goal of the clock; return their number.

        goes_on : without the particles that were lost in the block before
        """
        usual = clock == self.clock
        now, h = numbers_of(clock, state, self._start if usual else self.time, self.step if usual else 0)
        bound, self._sees_more = self._loops.bound(clock, now), False
        begun_lo = float(now[variable_steps.TIME_LO]) if self.clock.changes else 0.0
        record = state.get("approaches")  # a copy has none, and is marched without observers
        seen = record is not None and self._watcher.sees_path
        path = self._watcher.path(count) if seen else self._nothing
        status, done, body, evaluations = self._loops.march(state, bound, path, count)
        self.evaluations += evaluations
        if status == BEYOND:
            status, count, self._arrived = OK, done, self._arrived or state is self._state
        if status == INNER_NOT_CONVERGED:
            raise self._failure(status, done, [], now)
        if status in (NOT_CONVERGED, TOO_SHORT):
            raise self._failure(status, done, self._meeting(state, None if status == TOO_SHORT else body), now)
        if status != OK:
            # The state is invalid; the bodies that met are found in the previous state, if the block is a single step.
            lost = np.flatnonzero(~np.isfinite(state["q"][: 3 * self._bodies] + state["v"][: 3 * self._bodies]))
            before = self._state if state is not self._state else self._backup
            body = int(lost[0]) % self._bodies if lost.size else 0
            raise self._failure(status, 0, self._meeting(before, body) if count == 1 else [])
        if record is not None:
            self._block = count, float(now[variable_steps.ORIGIN]) if self.clock.changes else self._time_of(self.step)
            if self._dense and self.clock.changes:  # copies of the state use the same room
                self._begun_lo, self._lengths = begun_lo, self._loops.lengths(count).copy()
        if record is not None and count:
            self._watcher.begin(record, self.step, now[variable_steps.ORIGIN] if self.clock.changes else 0.0)
            self._sees_more = self._watcher.may_pass(self._loops.scratch)
            if seen:
                self._watcher.look(h, count, state["q"], state["v"], self._loops.parallel)
        if self._loops.tasks:
            if not goes_on:
                self._retired.begin()
            watcher = None if record is None else self._watcher
            self.particle_evaluations += self._loops.march_particles(state, bound, self._retired.block, watcher, count)
        if record is not None and count:
            self._overflowed = self._passages.overflows(self._watcher.lists)
            if self._surfaces is not None:
                lists = self._watcher.lists if self.clock.changes else self._watcher.own_lists
                self._overflowed = self._overflowed or self._passages.overflows(lists)
                self._deep = losses.passages_within(lists, self._surfaces)
                if self.clock.changes and self._surfaces[self._watcher.dominant] > 0.0:
                    losses.without_dominant(lists, self._bodies, self._watcher.dominant)
            self._encountered = self._meeting_of_planets = None
            if self.integrator.refuses_meetings and (count == 1 or not self._overflowed):
                listed, gm = self._watcher.lists[0], self._gm[: self._bodies]
                self._meeting_of_planets = kepler_passages.first_meeting(listed, gm, self._watcher.dominant, self.step)
            # Not from a list that is not complete: shorter blocks follow.
            if self._judges_encounters and (count == 1 or not self._overflowed):
                where = (self._bodies, self._watcher.dominant, h, self.step, self.integrator.least_steps)
                self._encountered = kepler_passages.lost_in(self._watcher.lists, self._gm, *where)
            if self._retire and len(self._particles):
                self._encountered = self._lost_anyhow(state, count)
            self._passages.add(self._watcher.lists)
        return count

    def _lost_anyhow(self, state: dict[str, Array], count: int) -> Lost | None:
        """Return the particles that are lost first in the block just marched, though they can be stepped."""
        found = self._encountered
        if not self.step and len(self._starts_close):  # most have no passage to be seen by
            known = self._retired.table()[self._starts_close, 0]
            begun = self._starts_close[known == OK]
            if len(begun):
                found = earlier(Lost(0, begun, np.full(len(begun), NEAR_A_PLANET)), found)
        limits = self.integrator.departures
        if limits != (None, None) and (self.step + count) % APART == 0:
            n, m, sun = self._bodies, len(self._particles), self._watcher.dominant
            centre = state["q"][: 3 * n].reshape(3, n)[:, sun], state["v"][: 3 * n].reshape(3, n)[:, sun]
            q, v = state["particle_q"][:, :m], state["particle_v"][:, :m]
            which, status = losses.departures(q, v, centre, float(self._gm[sun]), *limits)
            there = self._retired.block[which, 0] == OK
            if there.any():
                found = earlier(found, Lost(count, which[there], status[there]))
        return found

    def _meeting(self, state: dict[str, Array], body: int | None = None) -> list[int]:
        """Return two massive bodies, the lighter one first: `body` and its nearest neighbour, or the closest pair."""
        pair = meeting(state["q"][: 3 * self._bodies].reshape(3, -1), body)
        return [int(self._massive[b]) for b in sorted(pair, key=lambda b: self.parameters[1 + b])]

    def _failure(self, status: int, done: int, bodies: list[int], now: Array | None = None) -> IntegrationError:
        names = [self.names[b] if self.names else f"body {b}" for b in bodies]
        step = self.step + done
        time = self._time_of(step) if now is None or not self.clock.changes else float(now[variable_steps.TIME])
        momenta = SEPARABLE not in self.lagrangian.traits
        acting = {"momenta": momenta, "forces": bool(self._forces)}
        return failure_of_bodies(status, step, time, self.clock, self.integrator, names, **acting)
