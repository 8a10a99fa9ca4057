"""A leg: the march of the same bodies by one method and one clock. Its loop is the only one over blocks of steps.

The massive bodies march a block of steps; the massless particles then follow through the recorded stages, divided among
threads in groups of whole lanes, so that the bits depend neither on the number of threads nor on the size of the block.
Watchers look at each block, and the earliest of what they find ends it: the block is then marched again, from its
beginning, up to that step.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, IntegrationError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.lagrangians.base import Lagrangian
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.constant import clock_of
from orbits.marching.clocks.step_times import Place, Places
from orbits.marching.following.excursion_rules import OwnSteps
from orbits.marching.following.lost_particles import LostParticles
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs import within_step
from orbits.marching.legs.block_loop import BlockLoop
from orbits.marching.legs.interruptions import LegWatcher
from orbits.marching.legs.lists_and_bounds import Bounds, Listing, Refusals, energy_bound_of
from orbits.marching.legs.march import March
from orbits.marching.legs.particle_losses import ParticleLosses
from orbits.marching.legs.problem import Problem
from orbits.marching.legs.record import Record, record
from orbits.marching.legs.samples_of_particles import samples_of
from orbits.marching.legs.stepper import State, Stepper
from orbits.marching.stepping.motion import Motion
from orbits.marching.watching.leg_observers import Observers, empty_record, limits_of
from orbits.marching.watching.passage_list import PassageList


def available_threads() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Leg(March):
    """A march of fixed bodies: floats in, floats out.

    problem : what is marched, and what is asked for along the way
    q, v : (n, 3) float64, the initial state in the order of the caller
    encounters : the watcher for encounters of massive bodies at which all of them leave, or None

    stepper, times, follower, observers, listing, losses, bounds, samples : its parts
    block : the most steps of a block
    """

    def __init__(self, problem: Problem, q: Array, v: Array, encounters: LegWatcher | None = None) -> None:
        self.problem, self.clock = problem, problem.clock
        self.times = problem.clock.step_times(problem.start)
        gm, m = problem.gm[: len(problem.bodies)], len(problem.particles)
        surfaces, followed = problem.surfaces_of_bodies, None
        if m and problem.integrator.in_encounters.follow_particles:
            followed = OwnSteps.of(problem.lagrangian, gm, int(gm.argmax()), surfaces, problem.integrator.least_steps)
        self.stepper = Stepper(problem, self.times, followed, q, v)
        form, loops = self.stepper.form, self.stepper.loops
        self.follower: LostParticles = loops.follower or LostParticles()
        self.block = loops.steps
        state = self.stepper.state
        state["approaches"] = empty_record(len(problem.gm), problem.approaches)
        falls = surfaces is not None and self.follower.sees_falls(surfaces[int(gm.argmax())])
        limits = limits_of(problem.integrator, self.clock, falls)
        self.observers = Observers(problem, form, state, loops.times, len(loops.tasks), limits)
        passages = PassageList(problem.gm, self.observers.dominant, limits[0], self.clock)
        self.listing = Listing(passages, [] if surfaces is None else self.follower.lists(self.observers))
        self.losses = ParticleLosses(self, q, surfaces, self.observers.dominant)
        self.bounds, self.energy = Bounds(), energy_bound_of(self)
        refusals = Refusals() if problem.integrator.in_encounters.refuse_planets else None
        self.samples, losses = samples_of(self), self.losses if m else None
        watchers = encounters, losses, refusals, self.listing, self.energy, self.bounds, self.samples
        self.loop = BlockLoop(self, [watcher for watcher in watchers if watcher is not None])
        self.shown = [state]

    @classmethod
    def of(
        cls,
        lagrangian: Lagrangian,
        integrator: Integrator,
        parameters: Array | tuple[Array, ...],
        massive: NDArray[np.bool_],
        q: Array,
        v: Array,
        clock: Clock | float,
        **options: Any,
    ) -> Leg:
        """Return the leg of a problem with these options; a number h is the clock of constant steps h."""
        return cls(Problem(lagrangian, integrator, parameters, massive, clock_of(clock), **options), q, v)

    # ------------------------------------------------------------------------------------------- where it is

    @property
    def step(self) -> int:
        """Whole steps taken."""
        return self.times.step

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return self.times.time

    @property
    def home(self) -> Leg:
        """The leg itself, whose clock the march has, which marches now, and marched the last block."""
        return self

    leg = last = home

    def is_before(self, place: Place) -> bool:
        """Return whether there may be whole steps left before a place."""
        return self.times.most(place) > 0

    # ---------------------------------------------------------------------------------------------- the march

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place. Raises what `advance` raises."""
        self.times.aim(place)
        self.times.arrived = False
        try:
            self.loop.one_block(min(self.times.most(place), self.block, self.loop.most()))
        finally:
            self.bounds.passes = False
        if self.bounds.met is None:
            self.bounds.relax()

    def advance(self, steps: int) -> None:
        """March on by `steps` >= 0 steps, or by those before the place that it approaches.

        Raises ConvergenceError or SingularityError; the state is then that before the step that failed.
        """
        self.times.arrived = False
        while steps > 0:
            steps -= self.loop.one_block(min(steps, self.block, self.loop.most()))
            if self.loop.was_interrupted or self.times.arrived:
                return

    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""
        self.loop.go_back(steps)

    def begun_within(self, clock: Clock, step: int, time: float) -> tuple[Clock, float, int]:
        """Return how a march of changed bodies goes on from a time in a step; see `Clock.begun_within`."""
        return clock.begun_within(step, time)

    def go_on_from(self, old: Any, step: int, time: float) -> None:
        """Follow a march of bodies that change at a time, with what outlives them: what was retired, and counts.

        step : whole steps taken, of this march
        """
        self.losses.go_on_from(self, old.home)
        self.stepper.take_counts(old.home.stepper)
        self.times.step = step
        self.bounds.beware()

    # ------------------------------------------------------------------------------------------- what it shows

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller, rounded to float64; NaN for retired particles."""
        self.losses.retired.begin()
        self.shown = [self.stepper.state]
        return self.stepper.gather(self.as_seen(), self.losses.retired.gone())

    def as_seen(self, particles: NDArray[np.intp] | None = None) -> State:
        """Return the state as it is seen, see `Stepper.as_seen`."""
        return self.stepper.as_seen(self.losses.retired.block, particles)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the leg has advanced; see `orbits.marching.legs.samples`."""
        q, v = self.samples.ahead(Places(np.array([place.steps]), np.array([place.rest])))
        self.shown = self.shown[:1]
        return q[0], v[0]

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) at a time less than a step ahead."""
        return self.state_at(self.times.ahead(offset))

    def ended_at(self, time: float) -> Leg:
        """Return a leg that has marched on to end at a time less than a step ahead; see `within_step.ended_at`."""
        return within_step.ended_at(self, time)

    def retired(self, by: float | None = None) -> list[Retirement]:
        """Return the particles that were retired, in the order of the caller's bodies; by : see `March.retired`."""
        return self.losses.listed(self) if by is None or by == self.time else within_step.retired_by(self, by)

    def motion(self) -> Motion:
        """Return the motion of the massive bodies within the steps of the last block, for a leg with `dense`."""
        path, kicks = self.stepper.loops.motion(self.observers, self.loop.taken, self.loop.begun["memory"])
        times = self.times.ends(), self.times.lengths()
        return Motion(self.stepper.form, *times, path, kicks, self.stepper.partial_steps())

    def accounts(self) -> Array:
        """Return what is known of each force at the state returned last; see `Stepper.accounts`."""
        return self.stepper.accounts(self.shown[-1])

    def record(self, end: float) -> Record:
        """Return what was seen of passages up to a time; see `orbits.marching.legs.record`."""
        return record(self, end)

    # ----------------------------------------------------------------------------------------- checkpoints, end

    def checkpoint(self, *, seen: bool = False) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit; the arrays are copies.

        seen : with q, v and their low parts as they are seen, for methods that march other variables
        """
        whole = {**self.stepper.state, **self.as_seen()} if seen else self.stepper.state
        return _with_passages(_arrays(self, whole), self.listing.passages)

    def checkpoint_at_end(self) -> Callable[[], dict[str, NDArray[np.generic]]]:
        """Return what returns the checkpoint of a leg that is marched no more: few ask for it, and putting passages in
        order takes longer than copies.
        """
        return partial(_with_passages, _arrays(self, self.stepper.state), self.listing.passages)

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]], *, seen: bool = False) -> None:
        """Restore a checkpoint of a leg of the same problem. Raises InputError if it belongs to another one.

        seen : whether to go on from q, v and their low parts as they are seen, whatever was marched
        """
        for name, array in self.stepper.state.items():
            if name not in checkpoint or checkpoint[name].shape != array.shape:
                got = checkpoint[name].shape if name in checkpoint else "nothing"
                raise InputError(f"the checkpoint does not fit this run: {name} is {got}, expected {array.shape}")
            if name != "approaches" and not np.isfinite(checkpoint[name]).all():
                raise InputError(f"its checkpoint holds {name} that is not finite.")
            array[...] = checkpoint[name]
        self.times.step, *counts = (int(x) for x in checkpoint["counts"])
        self.stepper.evaluations, self.stepper.particle_evaluations = counts
        self.listing.passages.restore(checkpoint)
        self.losses.retired.restore(checkpoint.get("retired"), self.step)
        if seen:
            self.stepper.loops.enter(self.stepper.state, self.clock, self.losses.retired.block)

    def compile(self) -> None:
        """Compile, or load from the cache, all that `advance` needs, by one step on a copy; its result is ignored."""
        kind = self.stepper.loops.kind
        if kind not in _COMPILED:
            with suppress(IntegrationError):
                self.loop.try_out()
            _COMPILED.add(kind)

    def close(self) -> None:
        """Release the threads."""
        self.stepper.loops.close()


def _arrays(leg: Leg, state: State) -> dict[str, NDArray[np.generic]]:
    """Return copies of all that the checkpoint of a leg holds, but for the passages."""
    counts = np.array([leg.step, *leg.stepper.counts()], dtype=np.int64)
    copies = {name: array.copy() for name, array in state.items()}
    return {"counts": counts, **copies, **leg.losses.retired.checkpoint()}


def _with_passages(
    known: dict[str, NDArray[np.generic]], passages: PassageList
) -> dict[str, NDArray[np.generic]]:
    return {**known, **passages.checkpoint()}


_COMPILED: set[tuple[Any, ...]] = set()
"""The combinations of method, Lagrangian, particles or none, and few or many bodies compiled in this process."""
