"""The stepper of a leg: its state, and the compiled code that moves it by a block of steps. It knows no watcher."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.forces.base import BoundForce
from orbits.integrators.forms import Array
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.kernels.steps import BEYOND, INNER_NOT_CONVERGED, NOT_CONVERGED, OK, TOO_SHORT
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.clocks.step_times import StepTimes
from orbits.marching.following.contract import NO_SAMPLES, SamplesInBlock
from orbits.marching.following.excursion_rules import OwnSteps
from orbits.marching.legs.problem import Problem
from orbits.marching.stepping.failures import failure_of_bodies, meeting
from orbits.marching.stepping.loops_of_maps import loops_of
from orbits.marching.stepping.partial_steps import PartialSteps

if TYPE_CHECKING:
    from orbits.marching.watching.leg_observers import Observers

State = dict[str, Array]

_NOTHING = np.zeros(0)


class Stepper:
    """What moves the state of a leg by steps of its method.

    problem : of the leg; times : of its steps
    followed : the passages in which massless particles take steps of their own, of a map that cannot follow them
    q, v : (n, 3), the initial state in the order of the caller

    state : the arrays that a leg changes, by the names that archives have for them
    evaluations, particle_evaluations : of the forces among massive bodies, and of the field at massless particles
    """

    def __init__(self, problem: Problem, times: StepTimes, followed: OwnSteps | None, q: Array, v: Array) -> None:
        self.problem, self.form, self.times = problem, problem.form, times
        n, m = len(problem.bodies), len(problem.particles)
        self._size = 3 * n
        acting, threads = problem.acting, problem.threads
        self.loops = loops_of(self.form, *acting, problem.clock, n, m, threads, problem.dense, followed)
        self.loops.begin(q, v, problem.bodies, problem.particles)
        self.state: State = self.loops.state
        if problem.forces:
            self.form.set_inner(self.state, np.concatenate([force.inner for force in problem.forces]))
        self.form.check_start(problem.parameters, q[problem.bodies], v[problem.bodies])
        self.loops.enter(self.state, problem.clock)
        alone = n == 1 and bool(m or problem.forces)
        self.state |= problem.clock.array(problem.integrator, alone=alone, given=problem.has_given)
        times.bind(self.state, self.loops.times, self.loops.steps)
        self.evaluations = self.particle_evaluations = 0
        self._partial: PartialSteps | None = None

    def counts(self) -> tuple[int, int]:
        """Return the numbers of evaluations so far."""
        return self.evaluations, self.particle_evaluations

    def take_counts(self, other: Stepper) -> None:
        """Go on with the numbers of evaluations of another leg."""
        self.evaluations, self.particle_evaluations = other.counts()

    def bodies(
        self, state: State, before: Mapping[str, Array], clock: Clock, numbers: Array, path: Array, count: int
    ) -> int:
        """March the massive bodies by at most `count` steps of a clock, recorded in `path` unless it is empty; return
        how many were taken before the clock's limit. Raises ConvergenceError or SingularityError.

        before : the state there, to tell which bodies met in a single step; numbers : see `StepTimes.numbers`
        """
        loops, times, own = self.loops, self.times, state is self.state
        status, done, body, evaluations = loops.march(state, loops.bound(clock, numbers), path, count)
        self.evaluations += evaluations
        if status == BEYOND:
            times.arrived = times.arrived or own
            return int(done)
        if status == OK:
            return count
        if status == INNER_NOT_CONVERGED:
            raise self.failure(status, done, [], numbers)
        if status in (NOT_CONVERGED, TOO_SHORT):
            raise self.failure(status, done, self._meeting(state, None if status == TOO_SHORT else body), numbers)
        raise self.failure(status, 0, self._met_in(state, before) if count == 1 else [], numbers)

    def particles(
        self,
        state: State,
        clock: Clock,
        numbers: Array,
        retired: NDArray[np.int64],
        observers: Observers | None,
        count: int,
        samples: SamplesInBlock = NO_SAMPLES,
    ) -> None:
        """Let the massless particles follow the `count` steps that the bodies have just taken.

        retired : see `Retired.block`; observers : what observes them, or None; samples : within the block, to be shown
        """
        if self.loops.tasks:
            bound = self.loops.bound(clock, numbers)
            self.particle_evaluations += self.loops.march_particles(state, bound, retired, observers, count, samples)

    def _met_in(self, state: State, before: Mapping[str, Array]) -> list[int]:
        """Return the bodies, numbered as by the caller, that met in the one step from a state to one that is not
        finite.
        """
        lost = np.flatnonzero(~np.isfinite(state["q"][: self._size] + state["v"][: self._size]))
        return self._meeting(before, int(lost[0]) % (self._size // 3) if lost.size else 0)

    def _meeting(self, state: Mapping[str, Array], body: int | None = None) -> list[int]:
        """Return two massive bodies, the lighter one first: `body` and its nearest neighbour, or the closest pair."""
        pair = meeting(state["q"][: self._size].reshape(3, -1), body)
        return [int(self.problem.bodies[b]) for b in sorted(pair, key=lambda b: self.problem.strength[1 + b])]

    def failure(
        self, status: int, done: int, bodies: Sequence[int], numbers: Array | None = None
    ) -> IntegrationError:
        """Return the error for bodies, numbered as by the caller, that cannot take the step after `done` of a block.

        numbers : of its clock there; None at the beginning of the block
        """
        problem = self.problem
        names = [problem.name(body) for body in bodies]
        time = self.times.time if numbers is None else self.times.failed_at(numbers, done)
        acting = {"momenta": problem.has_momenta, "forces": bool(problem.forces)}
        step = self.times.step + done
        return failure_of_bodies(status, step, time, problem.clock, problem.integrator, names, **acting)

    def copied(self) -> State:
        """Return a copy of the state, which is marched without observers."""
        return {name: array.copy() for name, array in self.state.items() if name != "approaches"}

    def as_seen(self, retired: NDArray[np.int64], particles: NDArray[np.intp] | None = None) -> State:
        """Return the state as it is seen: a copy, unless it is what is marched.

        retired : see `Retired.block`; particles : those of which it is wanted; all by default
        """
        return self.state if self.loops.is_seen(self.times.step) else self.seen_copy(retired, particles)

    def seen_copy(self, retired: NDArray[np.int64], particles: NDArray[np.intp] | None = None) -> State:
        """Return a copy of the state as it is seen; the arguments are those of `as_seen`."""
        copy = self.copied()
        if self.times.step:
            self.loops.leave(copy, self.problem.clock, retired, particles)
        return copy

    def take_part(self, seen: State, time: float, part: float, retired: NDArray[np.int64]) -> None:
        """March a copy of a state, which is seen at a time, by a part of a constant step, with a cold start: the carry
        belongs to whole steps. It is then what is seen. Raises an IntegrationError if that cannot be taken.

        retired : see `Retired.block`; receives the particles that are lost on the way
        """
        clock = ConstantSteps(part)
        numbers = clock.numbers(time, 0)
        self.form.forget(seen["memory"])
        self.form.forget_particles(seen["particle_memory"])
        self.loops.enter(seen, clock, retired)
        self.bodies(seen, self.state, clock, numbers, _NOTHING, 1)
        self.particles(seen, clock, numbers, retired, None, 1)
        self.loops.leave(seen, clock, retired)

    def gather(self, state: Mapping[str, Array], gone: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller; NaN for particles that are `gone`, (m,)."""
        q = self.in_order(state["q"], state["particle_q"], gone)
        return q, self.in_order(state["v"], state["particle_v"], gone)

    def in_order(self, bodies: Array, particles: Array, gone: NDArray[np.bool_]) -> Array:
        """Combine vectors of the massive bodies and of the particles into (n, 3), in the order of the caller."""
        of_bodies, of_particles = self.problem.bodies, self.problem.particles
        columns, m = bodies[: self._size].reshape(3, -1), len(of_particles)
        if not m:
            return columns.T.copy()
        x = np.empty((len(of_bodies) + m, 3))
        x[of_bodies] = columns.T
        x[of_particles] = particles[:, :m].T
        x[of_particles[gone]] = np.nan
        return x

    def forces_now(self) -> tuple[BoundForce, ...]:
        """Return the forces with their internal variables as they are now."""
        forces = self.problem.forces
        ends = np.cumsum([len(force.inner) for force in forces], dtype=int)
        parts = np.split(self.form.inner_values(self.state), ends[:-1])
        return tuple(replace(force, inner=y) for force, y in zip(forces, parts, strict=False))

    def accounts(self, state: State) -> Array:
        """Return what a state knows of each force, (forces, 7 + most internal variables): its time integrals on the
        massive bodies, work, torque about the origin and impulse, times G; then its internal variables.
        """
        forces = self.problem.forces
        most = max((len(force.inner) for force in forces), default=0)
        out = np.zeros((len(forces), FIGURES + most))
        out[:, :FIGURES] = self.form.accounts(state["memory"])
        inner, at = self.form.inner_values(state), 0
        for row, force in zip(out, forces, strict=True):
            row[FIGURES : FIGURES + len(force.inner)] = inner[at : at + len(force.inner)]
            at += len(force.inner)
        return out

    def partial_steps(self) -> PartialSteps:
        """Return what takes partial steps of the massive bodies by this method."""
        if self._partial is None:
            # No method of the stepper, which would keep its megabytes until Python looks for circles of references.
            failure = partial(_failure_of_part, self.problem, self.times)
            self._partial = PartialSteps(self.form, *self.problem.acting, self._size // 3, failure)
        return self._partial


def _failure_of_part(problem: Problem, times: StepTimes, status: int, time: float) -> IntegrationError:
    """Return the error for a partial step that cannot be taken from a time."""
    momenta = problem.has_momenta
    return failure_of_bodies(status, times.step, time, problem.clock, problem.integrator, [], momenta=momenta)
