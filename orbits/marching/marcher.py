"""A system bound to an integrator and a clock: floats in, floats out.

The massive bodies march a block of steps; the massless particles then follow through the recorded stages, divided among
threads in groups of whole lanes, so that the bits depend neither on the number of threads nor on the size of the block.
Closest approaches are recorded after each block, and conditions end the march at the step at which they first hold.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, IntegrationError
from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.collocation.given_bodies import GivenBodies
from orbits.integrators.forms import Array
from orbits.kernels.dense import times_reached
from orbits.kernels.gravity.terms_and_forces import FIGURES, acted_on
from orbits.kernels.search.record import COLUMNS
from orbits.kernels.steps import NOWHERE
from orbits.lagrangians.base import GIVEN, NEWTONIAN, SEPARABLE, Lagrangian
from orbits.marching.clocks import variable_steps
from orbits.marching.clocks.adaptive import ALONE, LONGEST, LONGEST_OF_GIVEN, Adaptive
from orbits.marching.clocks.constant import Clock, ConstantSteps, Place, clock_of
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.marching.following.excursion_rules import OwnSteps
from orbits.marching.following.own_clocks import REACHED
from orbits.marching.following.particle_excursions import parts_taken
from orbits.marching.following.retirement import Lost, Retired, Retirement, retirements
from orbits.marching.stepping.blocks import APART, Blocks, steps_apart
from orbits.marching.stepping.bound_loops import BoundLoops
from orbits.marching.stepping.choice_of_form import form_of_bodies
from orbits.marching.stepping.failures import failure_of_bodies
from orbits.marching.stepping.motion import Motion
from orbits.marching.stepping.partial_steps import PartialSteps
from orbits.marching.watching import kepler_passages
from orbits.marching.watching.passage_list import PassageList
from orbits.marching.watching.watcher import Watcher, empty_record, thresholds

T = TypeVar("T")

UNLIMITED = 1 << 62
"""The number of steps of a block that nothing limits."""


def available_threads() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Marcher(Blocks):
    """The state of a run between two calls of its kernels.

    lagrangian, integrator : the problem and the method
    parameters : vector of the Lagrangian's kernels, for the massive bodies; for a sum of terms a tuple, Newton's first
    massive : (n,) bool; which bodies are massive
    q, v : (n, 3) float64 in the order of the caller
    clock : the times of the steps (see `orbits.marching.clocks.constant`); a number h is the clock of constant steps h
    names : (n,) names for messages
    threads : how many threads massless particles, and thousands of massive bodies, may use
    stops : (conditions, 4), see `orbits.kernels.search.stopping`, with rows numbered in the order of the caller: the
        march stops after each step in which a pair may come to its bound, until it is told to `pass_by`
    energy_bound : relative energy error that ends the march, or None
    retire : whether a massless particle that cannot be stepped is retired alone; otherwise it is an error
    forces : the forces without a Lagrangian, bound to these bodies
    start : the time at which the march begins; with a clock whose steps differ, which counts from 0, that which terms
        and forces see when it reads 0
    radii : (n,), of the bodies: a march then ends after a step in which two may have come closer than their sum
    dense : whether each step is recorded for `motion`
    surfaces : (n,), radii of the bodies: massless particles that are followed in encounters, or by chosen steps, are
        retired if they hit one
    underway : whether it begins in a state of a run that is over, which decided which particles are retired before
        encounters: here they are not, and may be in one
    approaches : whether closest approaches are looked for; passages that the steps may not resolve are in any case

    After `advance`, `met` is why it stopped, `SUSPECT`, `ENERGY` or `TOUCHED` of `orbits.marching.watching.watcher`, or
    None.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        integrator: Integrator,
        parameters: Array | tuple[Array, ...],
        massive: NDArray[np.bool_],
        q: Array,
        v: Array,
        clock: Clock | float,
        *,
        names: Sequence[str] = (),
        threads: int = 1,
        stops: Array | None = None,
        energy_bound: float | None = None,
        retire: bool = False,
        forces: Sequence[BoundForce] = (),
        start: float = 0.0,
        dense: bool = False,
        radii: Array | None = None,
        surfaces: Array | None = None,
        underway: bool = False,
        approaches: bool = True,
    ) -> None:
        self.lagrangian = lagrangian
        self.integrator = integrator
        self.model, self._forces = parameters, tuple(forces)
        self._tag, self._vectors = lagrangian.tag, parameters
        self.parameters = np.ascontiguousarray(parameters[0] if isinstance(parameters, tuple) else parameters)
        self.clock = clock_of(clock)
        self.clock.check(integrator)
        self.names = tuple(names)
        self.looks_for_approaches = approaches
        self.step = 0
        self._start = float(start)
        self.evaluations = 0
        self.particle_evaluations = 0
        self._massive = np.asarray(massive).nonzero()[0]
        self._particles = (~np.asarray(massive)).nonzero()[0]
        self._counts, self._apart = (0, 0), steps_apart(integrator, np.asarray(massive))
        n, m = len(self._massive), len(self._particles)
        self._bodies = n
        form = form_of_bodies(integrator, lagrangian, self.clock, with_particles=m > 0, forces=forces)
        self._form = form.for_bodies(n)
        if isinstance(self._form, GivenBodies) and self.clock.changes and m and self._form.held(parameters) < n:
            raise InputError(
                "massless bodies take steps of their own among bodies of an ephemeris, but not if others with a mass "
                "are integrated along: give dt=..., or set the GM of these to 0."
            )
        if forces or SEPARABLE not in lagrangian.traits:
            self._tag, self._vectors = acted_on(lagrangian.tag, parameters, forces)
        followed = None
        if m and integrator.follows_encounters:
            gm = self.parameters[1 : 1 + n]
            own = None if surfaces is None else np.asarray(surfaces, dtype=np.float64)[self._massive]
            followed = OwnSteps.of(lagrangian, gm, int(gm.argmax()), own, integrator.least_steps)
        self._surfaces = None if followed is None else followed.radii
        if surfaces is not None and self.clock.changes and retire:
            self._surfaces = np.asarray(surfaces, dtype=np.float64)[self._massive]
        self._deep = np.zeros((0, COLUMNS))
        self._loops = BoundLoops(self._form, self._tag, self._vectors, self.clock, n, m, threads, dense, followed)
        self._loops.begin(q, v, self._massive, self._particles)
        begun = [force.inner for force in forces]
        self._form.set_inner(self._loops.state, np.concatenate([np.zeros(0), *begun]))
        if self._form.transforms:
            self._form.check_start(self.model, q[self._massive], v[self._massive])
            self._loops.enter(self._loops.state, self.clock)
        self.block = self._loops.steps
        self._state = self._loops.state
        if isinstance(self.clock, ChangingSteps):
            self._state["clock"] = self.clock.numbers_for(integrator)
            self._loops.times[variable_steps.since(self._loops.steps)] = self._start
        if isinstance(self.clock, Adaptive) and n == 1 and (m or forces):
            self._state["clock"][LONGEST] = ALONE
        elif isinstance(self.clock, Adaptive) and GIVEN in lagrangian.traits:
            self._state["clock"][LONGEST] = LONGEST_OF_GIVEN
        self._state["approaches"] = empty_record(n + m, approaches)
        self._arrived = False
        self._dense = dense
        self._block, self._begun_lo, self._lengths = (0, 0.0), 0.0, np.zeros(0)
        self._partial: PartialSteps | None = None
        self._keep: Callable[[Array, Array, Array], None] | None = None
        self._backup: dict[str, Array] = {}
        self._nothing = np.zeros(0)
        self._seen = self._state
        self._retire, self._retired = retire, Retired(m)
        if energy_bound is not None and self._form.transforms:
            raise InputError(
                f"{integrator.label} marches other coordinates than those seen, whose energy oscillates: the condition "
                "EnergyErrorAbove cannot be watched. Use a method such as Gauss(stages=8), or look at run.drift()."
            )
        self._energy_bound = energy_bound
        self.met: int | None = None
        self._stopped = self._passes = False
        self._cautious = UNLIMITED
        limits = (math.inf, 1.0, math.inf) if self.clock.changes else thresholds(integrator.order)
        if self._surfaces is not None and self.clock.changes and self._surfaces[self.parameters[1 : 1 + n].argmax()]:
            limits = (math.inf, 0.0, 0.0)  # to see all pericentres about it
        if integrator.follows_kepler:
            limits = kepler_passages.listed(integrator.least_steps)
        self._watcher = Watcher(
            self.parameters,
            self._massive,
            self._particles,
            self._state["q"],
            self._state["v"],
            stops,
            energy_bound,
            *limits,
            self._loops.times,
            len(self._loops.tasks),
            radii,
            integrator.follows_kepler,
            order=integrator.order,
            notes_nearest=self._form.notes_nearest(3 * n) and not approaches,
            whole_path=dense or integrator.follows_meetings,
        )
        self._watcher.given = isinstance(self._form, GivenBodies) and self._form.held(self.model) == n
        self._gm = np.concatenate([self.parameters[1 : 1 + n], np.zeros(m)])
        self._starts_close = np.zeros(0, dtype=np.intp)
        exact = n == 1 and NEWTONIAN in lagrangian.traits  # about a body that is alone
        self._judges_encounters = retire and integrator.retires_in_encounters and not (underway or exact)
        if self._judges_encounters and m:
            sun, x = self._watcher.dominant, q[self._massive]
            planets = np.arange(n) != sun
            close = kepler_passages.near_a_planet(
                q[self._particles] - x[sun], (x - x[sun])[planets], self._gm[:n][planets], float(self._gm[sun])
            )
            self._starts_close = np.flatnonzero(close >= 0)
        self._encountered: Lost | None = None
        self._meeting_of_planets: kepler_passages.Meeting | None = None
        self._passages = PassageList(self._gm, self._watcher.dominant, limits[0], self.clock)
        self._overflowed = self._sees_more = False

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return float(self._state["clock"][variable_steps.TIME]) if self.clock.changes else self._time_of(self.step)

    @property
    def reading(self) -> float:
        """The reading of the clock: whole steps, or the time."""
        return self.time if self.clock.changes else self.step

    def _time_of(self, step: int) -> float:
        return self._start + float(self.clock.time(step))

    def is_before(self, place: Place) -> bool:
        """Return whether there may be whole steps left before a place."""
        if self.clock.changes:
            now = self._state["clock"]
            at_limit = self._arrived and now[variable_steps.LIMIT] == place.rest
            arrived = place.rest == now[variable_steps.TIME] or at_limit
            return not arrived and (place.rest - now[variable_steps.NEXT]) * self.clock.direction >= 0.0
        return self.step < place.steps

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place. Raises what `advance` raises."""
        if self.clock.changes:
            self._state["clock"][variable_steps.LIMIT] = place.rest
        self._stopped = self._arrived = False
        try:
            self._one_block(self.next_block(place))
        finally:
            self._passes = False
        if self.met is None:
            self._cautious = min(2 * self._cautious, UNLIMITED)

    def next_block(self, place: Place) -> int:
        """Return the most steps of the next block on the way to a place."""
        most = 1 if self._passes else min(self.block, self._cautious)
        return most if self.clock.changes else min(most, self._most(), place.steps - self.step)

    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""
        count = self._block[0]
        if steps < count:
            if self._keep is not None:
                self._take_back(int(self.step % APART == 0) if self._apart > 1 else count - steps)
            self.step -= count
            self._retired.return_to(self.step + steps)
            self._replay(steps)
            self.step += steps

    def step_back(self) -> None:
        """Return to the state before the last step of the last block, in which a pair may come to its bound."""
        self.met, self._cautious = None, 1  # the next steps may be alike: no long block is marched in vain
        self.go_back(self._block[0] - 1)

    def pass_by(self) -> None:
        """Take the next step whatever pairs come to their bounds in it."""
        self._passes = True

    def after_next_step(self, read: Callable[[], T]) -> T:
        """Return what a function returns after the next step; the march does not change. Raises what `advance`
        raises.
        """
        kept, block, keep, self._keep = self.checkpoint(), self.block, self._keep, None
        try:
            self.pass_by()
            self.approach(Place(self.step + 1, math.inf * self.clock.direction if self.clock.changes else 0.0))
            return read()
        finally:
            self.restore(kept)
            self.block, self._keep, self.met = block, keep, None

    def advance_to(self, place: Place) -> None:
        """March on by all whole steps before a place, which must lie ahead. Raises what `advance` raises."""
        while self.is_before(place):
            self.approach(place)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced; computed on a copy, without changing the
        march.
        """
        if not self.clock.changes:
            return self.state_after(place.rest)
        if place.rest == self.time:
            return self.state()
        copy, before = self._copied(), (self.evaluations, self.particle_evaluations)
        self._seen = copy
        copy["clock"][[variable_steps.LIMIT, variable_steps.EXACT]] = place.rest, 1.0
        self._retired.begin()
        try:
            while self._march_block(copy, self.clock, self.block, goes_on=True) == self.block:
                pass
            self._raise_for_lost()
        finally:
            self.evaluations, self.particle_evaluations = before
        return self._gather(copy)

    def states_before_next(self, times: Array) -> list[tuple[Array, Array]]:
        """Return (q, v) at the first of these ascending times, up to which the march has advanced, and at those of the
        others that lie before the next step: the states of `state_at`. Raises what it raises, for the first time.
        """
        whole = not len(self._particles) and not self._forces  # no more than the states of the bodies is asked for
        if isinstance(self.clock, Adaptive) and whole and len(times) > 1 and times[0] != self.time:
            now = self._state["clock"]
            beyond = (times[1:] - now[variable_steps.NEXT]) * self.clock.direction >= 0.0
            count = 1 + (int(beyond.argmax()) if beyond.any() else len(beyond))
            found = self._loops.march_to_each(self._state, self._loops.bound(self.clock, now), times[:count])
            if len(found):
                return [(self._in_order(q, self._nothing), self._in_order(v, self._nothing)) for q, v in found]
        return [self.state_at(self.clock.place(times[0]))]

    def _raise_for_lost(self) -> None:
        """Raise the error for a particle that was lost on a copy of the state, if `retire` is not set."""
        lost = self._retired.lost()
        failure = None if lost is None or self._retire else self._lose(lost, {}, self.step)
        if failure is not None:
            raise failure

    def ended_at(self, time: float) -> Marcher:
        """Return a marcher that has marched on from here to end exactly at a time; for clocks whose steps differ."""
        end = self._like_this(*self.state(), self.clock, start=self._start, energy_bound=self._energy_bound)
        end.restore(self.checkpoint())
        end.end_at(time)
        return end

    def end_at(self, time: float) -> None:
        """March on to end exactly at a time less than a step ahead, from which no march can go on; for clocks whose
        steps differ. No more states are passed on to be kept. Raises what `advance` raises.
        """
        self._keep, self._arrived = None, False
        self._state["clock"][[variable_steps.EXACT, variable_steps.NEXT]] = 1.0, self.time
        self.advance_to(Place(0, time))

    def towards(self, time: float) -> tuple[Marcher, Place]:
        """Return a march of the massive bodies from here that ends exactly at a time less than a step ahead, with dense
        output, and the place of that time in it.
        """
        seen = self._as_seen()
        q, v = (seen[name][: 3 * self._bodies].reshape(3, -1).T for name in "qv")
        clock: Clock = self.clock
        place = Place(0, time)
        if not self.clock.changes:
            clock, place = ConstantSteps(time - self.time), Place(1, 0.0)
        end = self._like_this(q, v, clock, start=self._start if self.clock.changes else self.time, dense=True)
        if self.clock.changes:
            for name in ("q", "q_lo", "v", "v_lo", "memory", "clock"):
                end._state[name][...] = self._state[name]
            end._state["clock"][[variable_steps.EXACT, variable_steps.NEXT]] = 1.0, end.time
        return end, place

    def _like_this(self, q: Array, v: Array, clock: Clock | float, **options: Any) -> Marcher:
        """Return a march of the same bodies, or of the massive ones if q, v are theirs, with other options."""
        massive = np.ones(len(q), dtype=bool)
        if len(q) > self._bodies:
            massive[self._particles] = False
        options = {"names": self.names, "retire": self._retire, "forces": self._forces_now(), **options}
        options = {"approaches": self.looks_for_approaches, **options}
        if self._surfaces is not None:
            surfaces = np.zeros(len(q))
            surfaces[massive] = self._surfaces
            options = {"surfaces": surfaces, **options}
        return Marcher(self.lagrangian, self.integrator, self.model, massive, q, v, clock, **options)

    def _forces_now(self) -> tuple[BoundForce, ...]:
        """Return the forces with their internal variables as they are now."""
        ends = np.cumsum([len(force.inner) for force in self._forces], dtype=int)
        parts = np.split(self._form.inner_values(self._state), ends[:-1])
        return tuple(replace(force, inner=y) for force, y in zip(self._forces, parts, strict=False))

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller, rounded to float64; NaN for retired particles."""
        self._retired.begin()
        self._seen = self._state
        return self._gather(self._as_seen())

    def _as_seen(self, particles: NDArray[np.intp] | None = None) -> dict[str, Array]:
        """Return the state as it is seen: a copy, unless it is what is marched.

        particles : those of which it is wanted; all by default
        """
        if not (self._form.transforms and self.step):
            return self._state
        copy = self._copied()
        self._loops.leave(copy, self.clock, self._retired.block, particles)
        return copy

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) after a partial step of `offset`; computed on a copy, without changing the march."""
        if offset == 0.0:
            return self.state()
        if self.clock.changes:
            return self.state_at(Place(0, self.time + offset))
        copy, part = {name: array.copy() for name, array in self._as_seen().items()}, ConstantSteps(offset)
        copy.pop("approaches", None)
        # The carry belongs to steps of h; a partial step has a cold start.
        self._form.forget(copy["memory"])
        if self._form.transforms:
            self._loops.enter(copy, part, self._retired.block)
        elif not self._form.keeps_particles:
            copy["particle_memory"][:] = 0.0
        self._seen = copy
        before = self.evaluations, self.particle_evaluations
        try:
            self._march_block(copy, part, 1)
            self._raise_for_lost()
        finally:
            self.evaluations, self.particle_evaluations = before
        if self._form.transforms:
            self._loops.leave(copy, part, self._retired.block)
        return self._gather(copy)

    def part_of_a_step(self, offset: float) -> Marcher:
        """Return a marcher that has taken a partial step of `offset` from here in several parts, with observers: its
        record covers this step alone.
        """
        q, v = self.state()
        gone = self._particles[self._retired.gone()]
        q[gone], v[gone] = NOWHERE, 0.0
        part = self._like_this(q, v, offset, start=self.time)
        part._retired.take(self._retired)
        part.advance(1)
        return part

    def approaches(self) -> Array:
        """Return the closest approaches so far, (4, 2, rows + padding), in a march that looks for them; see
        `orbits.kernels.search.record`.
        """
        self._retired.begin()
        q = self._state["particle_q"].copy()
        q[:, : len(self._particles)][:, self._retired.gone()] = np.nan
        state = {**self._state, "particle_q": q}
        now = self.time if self.clock.changes else 0.0
        return self._watcher.approaches(self._state["approaches"], self.step, now, self._loops.tracks[0], state)

    def checkpoint(self, *, seen: bool = False) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit; the arrays are copies.

        seen : with q, v and their low parts as they are seen, for methods that march other variables
        """
        counts = np.array([self.step, self.evaluations, self.particle_evaluations], dtype=np.int64)
        whole = {**self._state, **self._as_seen()} if seen else self._state
        state = {name: array.copy() for name, array in whole.items()}
        return {"counts": counts, **state, **self._passages.checkpoint(), **self._retired.checkpoint()}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]], *, seen: bool = False) -> None:
        """Restore a checkpoint of a marcher bound in the same way. Raises InputError if it belongs to another
        problem.

        seen : whether to go on from q, v and their low parts as they are seen, whatever was marched
        """
        for name, array in self._state.items():
            if name not in checkpoint or checkpoint[name].shape != array.shape:
                got = checkpoint[name].shape if name in checkpoint else "nothing"
                raise InputError(f"the checkpoint does not fit this run: {name} is {got}, expected {array.shape}")
            if name != "approaches" and not np.isfinite(checkpoint[name]).all():
                raise InputError(f"its checkpoint holds {name} that is not finite.")
            array[...] = checkpoint[name]
        self.step, self.evaluations, self.particle_evaluations = (int(x) for x in checkpoint["counts"])
        self._passages.restore(checkpoint)
        self._retired.restore(checkpoint.get("retired"), self.step)
        if seen and self._form.transforms:
            self._loops.enter(self._state, self.clock, self._retired.block)

    def retired(self) -> list[Retirement]:
        """Return the particles that were retired, in the order of the caller's bodies."""
        q, v = self._state["particle_q"], self._state["particle_v"]
        parts = None
        if self.integrator.follows_encounters and len(self._particles):
            parts = parts_taken(self._state["particle_memory"])
        names = [self.names[k] if self.names else f"body {k}" for k in self._massive.tolist()]
        clocks = self._state.get("particle_clock")
        return retirements(self._retired.table(), q, v, self._particles, clocks, parts, names)

    def retired_by(self, time: float) -> list[Retirement]:
        """Return the particles that are retired, or cannot be followed up to a time less than a step ahead, in the
        order of the caller's bodies. The march does not change: its next step may lose them a rounding error away.
        """
        if time == self.time:
            return self.retired()
        end = self.ended_at(time) if self.clock.changes else self.part_of_a_step(time - self.time)
        known = {one.body: one for one in self.retired()}
        share = 1.0 if self.clock.changes else (time - self.time) / self.clock.h
        begun = 0 if self.clock.changes else self.step
        lost = [one._replace(step=self.step, reading=begun + share * one.reading) for one in end.retired()]
        return [known.get(one.body, one) for one in lost]

    def touching(self) -> NDArray[np.intp]:
        """Return massless particles, in the numbers of the caller, among which are all that may have touched a body in
        the last block.
        """
        return self._watcher.touching(self._block[0])

    def retire(self, body: int, status: int, step: int, time: float, q: Array, v: Array) -> None:
        """Retire a massless particle, numbered as by the caller, after `step` steps, with its last q and v, (3,), at a
        time within the next step.
        """
        k = int(np.searchsorted(self._particles, body))
        if self.clock.changes:
            self._state["particle_clock"][k, REACHED] = time
        self._state["particle_q"][:, k], self._state["particle_v"][:, k] = q, v
        self._retired.add(Lost(0, np.array([k]), np.array([status])), step)

    def follow(self, other: Marcher) -> None:
        """Take over the retired particles of another march of the same particles, and its numbers of evaluations."""
        self._retired.follow(other._retired)
        gone = np.flatnonzero(self._retired.gone())
        for name in ("particle_q", "particle_v"):
            self._state[name][:, gone] = other._state[name][:, gone]
        if "particle_clock" in self._state:
            self._state["particle_clock"][gone] = other._state["particle_clock"][gone]
        self.evaluations, self.particle_evaluations = other.evaluations, other.particle_evaluations

    @property
    def start(self) -> float:
        """The time at which the march began, since the start of the run."""
        return self._start

    @property
    def tells_motion(self) -> bool:
        """Whether the motion within steps can be told: of any method, but not of thousands of bodies on threads."""
        return self._loops.parallel is None

    def motion(self) -> Motion:
        """Return the motion of the massive bodies within the steps of the last block, for a marcher with `dense`."""
        count, begun = self._block
        if self.clock.changes:
            times, lengths = np.full((count + 1, 2), (begun, self._begun_lo)), self._lengths[:count]
            times_reached(lengths, times)
            reached = times[:, 0]
        else:
            step = self.step - count
            reached, lengths = self._start + self.clock.time(step + np.arange(count + 1.0)), self._loops.lengths(count)
        path, kicks = self._watcher.recorded(count), self._loops.kicks[:count]
        if self._form.transforms:  # observers see states that are good enough for them, but not to step on from
            path, kicks = self._loops.seen(self._backup["memory"], count), kicks[:0]
        return Motion(self._form, reached, lengths, path, kicks, self.partial_steps())

    def partial_steps(self) -> PartialSteps:
        """Return what takes partial steps of the massive bodies by this method."""
        if self._partial is None:
            self._partial = PartialSteps(self._form, self._tag, self._vectors, self._bodies, self._partial_failure)
        return self._partial

    def _partial_failure(self, status: int, time: float) -> IntegrationError:
        momenta = SEPARABLE not in self.lagrangian.traits
        return failure_of_bodies(status, self.step, time, self.clock, self.integrator, [], momenta=momenta)

    def accounts(self) -> Array:
        """Return what is known of each force at the state returned last, (forces, 7 + most internal variables): its
        time integrals on the massive bodies, work, torque about the origin and impulse, times G; then its internal
        variables.
        """
        most = max((len(force.inner) for force in self._forces), default=0)
        out = np.zeros((len(self._forces), FIGURES + most))
        out[:, :FIGURES] = self._form.accounts(self._seen["memory"])
        inner, at = self._form.inner_values(self._seen), 0
        for row, force in zip(out, self._forces, strict=True):
            row[FIGURES : FIGURES + len(force.inner)] = inner[at : at + len(force.inner)]
            at += len(force.inner)
        return out

    @property
    def dominant(self) -> int:
        """The row, in the kernels' order, of the body that dominates the others, or -1."""
        return self._watcher.dominant

    @property
    def reaches(self) -> Array:
        """The distance from each massive body, in the kernels' order, below which flybys are listed; 0 if none
        dominates.
        """
        return self._watcher.listed_within[: self._bodies]

    def passages(self) -> tuple[Array, int]:
        """Return the passages listed so far, in the kernels' rows and columns (see `orbits.kernels.search.record`), and
        the number of those left out: `UNKNOWN` for a march that was restored from a checkpoint without a list.
        """
        return self._passages.passages, self._passages.left_out

    def compile(self) -> None:
        """Compile, or load from the cache, all that `advance` needs, by one step on a copy; its result is ignored."""
        kind = self._loops.kind
        if kind not in _COMPILED:
            before = self.evaluations, self.particle_evaluations
            listed = self._passages.keep()
            with suppress(IntegrationError):
                self._march_block({name: array.copy() for name, array in self._state.items()}, self.clock, 1)
            self.evaluations, self.particle_evaluations = before
            self._passages.put_back(listed)
            _COMPILED.add(kind)

    def close(self) -> None:
        """Release the threads."""
        self._loops.close()

    def _gather(self, state: dict[str, Array]) -> tuple[Array, Array]:
        return self._in_order(state["q"], state["particle_q"]), self._in_order(state["v"], state["particle_v"])

    def _in_order(self, bodies: Array, particles: Array) -> Array:
        """Combine vectors of the massive bodies and of the particles into (n, 3), in the order of the caller."""
        n, m = self._bodies, len(self._particles)
        columns = bodies[: 3 * n].reshape(3, n)
        if not m:
            return columns.T.copy()
        x = np.empty((n + m, 3))
        x[self._massive] = columns.T
        x[self._particles] = particles[:, :m].T
        x[self._particles[self._retired.gone()]] = np.nan
        return x


_COMPILED: set[tuple[Any, ...]] = set()
"""The combinations of method, Lagrangian, particles or none, and few or many bodies compiled in this process."""
