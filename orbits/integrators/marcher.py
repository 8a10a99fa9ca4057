"""A system bound to an integrator and a step: floats in, floats out, marching on the grid t = step * h.

The massive bodies march a block of steps; then the massless particles follow through the recorded field, shared among
threads in groups of whole lanes, so that the bits do not depend on the number of threads nor on the size of the block.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import pairwise
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, InputError, IntegrationError, SingularityError
from orbits.integrators.base import NOT_CONVERGED, OK, Array, Integrator, padded
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import Lagrangian

FIELD_BYTES = 512 * 1024
"""Size of the recorded field: it should stay in the second-level cache."""

BLOCK_WORK = 20_000_000
"""Pairs times steps in one call of a kernel: a fraction of a second, after which a signal is seen."""


def available_threads() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Marcher:
    """The state of a run between two calls of its kernels.

    lagrangian, integrator : what is solved and how
    parameters : vector of the Lagrangian's kernels, for the massive bodies
    massive : (n,) bool; which bodies are massive
    q, v : (n, 3) float64 in the order of the caller
    h : step, not 0; its sign is the direction of time
    names : (n,) names for messages
    threads : how many threads the massless particles may use
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        integrator: Integrator,
        parameters: Array,
        massive: NDArray[np.bool_],
        q: Array,
        v: Array,
        h: float,
        *,
        names: Sequence[str] = (),
        threads: int = 1,
    ) -> None:
        self.lagrangian = lagrangian
        self.integrator = integrator
        self.parameters = np.ascontiguousarray(parameters, dtype=np.float64)
        self.h = float(h)
        self.names = tuple(names)
        self.step = 0
        self.evaluations = 0
        self.particle_evaluations = 0
        self._massive = np.flatnonzero(massive)
        self._particles = np.flatnonzero(~np.asarray(massive))
        n, m = len(self._massive), len(self._particles)
        self._bodies = n
        self._coefficients = {self.h: integrator.coefficients(self.h)}
        self._state = {
            "q": _vector(q[self._massive]),
            "q_lo": np.zeros(padded(3 * n)),
            "v": _vector(v[self._massive]),
            "v_lo": np.zeros(padded(3 * n)),
            "memory": np.zeros((integrator.memory_rows(3 * n), WIDTH)),
            "particle_q": _columns(q[self._particles]),
            "particle_q_lo": np.zeros((3, padded(m))),
            "particle_v": _columns(v[self._particles]),
            "particle_v_lo": np.zeros((3, padded(m))),
            "particle_memory": np.zeros((m, integrator.particle_memory_rows, WIDTH)),
        }
        self._backup = {name: array.copy() for name, array in self._state.items()}
        shape = integrator.field_shape(3 * n)
        slots = 1
        if m:
            slots = int(np.clip(FIELD_BYTES // (8 * shape[0] * shape[1]), 1, max(1, BLOCK_WORK // (m * n))))
        self.block = slots if m else max(1, BLOCK_WORK // (n * n))
        self._field = np.zeros((slots, *shape))
        self._work = np.zeros(integrator.work_shape(3 * n))
        self._tasks = _shares(m, threads)
        self._task_work = [np.zeros(integrator.work_shape(3 * n)) for _ in self._tasks]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 and len(self._tasks) > 1 else None

    def advance(self, steps: int) -> None:
        """March on by `steps` >= 0 steps.

        Raises ConvergenceError or SingularityError; the state is then the one before the step that failed.
        """
        while steps > 0:
            count = min(steps, self.block)
            for name, array in self._state.items():
                np.copyto(self._backup[name], array)
            failure: IntegrationError | None = None
            try:
                self._march_block(self._state, self.h, count)
            except IntegrationError as error:
                failure = error
            if failure is not None:
                count = self._steps_before_failure(count)
                self._replay(count)
                self.step += count
                trial = {name: array.copy() for name, array in self._state.items()}
                self._march_block(trial, self.h, 1)  # raises, with the step and the time of the step that failed
                raise failure
            self.step += count
            steps -= count

    def _steps_before_failure(self, count: int) -> int:
        """Return how many steps of the block of `count` that has just failed can be taken, by bisection."""
        good, bad = 0, count
        while bad - good > 1:
            middle = (good + bad) // 2
            try:
                self._replay(middle)
            except IntegrationError:
                bad = middle
            else:
                good = middle
        return good

    def _replay(self, count: int) -> None:
        """March `count` steps from the state at the beginning of the block."""
        for name, array in self._state.items():
            np.copyto(array, self._backup[name])
        if count:
            self._march_block(self._state, self.h, count)

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller, rounded to float64."""
        return self._gather(self._state)

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) a partial step `offset` later, by a step on a copy: the march itself does not notice."""
        if offset == 0.0:
            return self.state()
        copy = {name: array.copy() for name, array in self._state.items()}
        # What is carried from step to step belongs to steps of h; a partial step starts cold.
        copy["memory"][:] = 0.0
        copy["particle_memory"][:] = 0.0
        before = self.evaluations, self.particle_evaluations
        self._march_block(copy, offset, 1)
        self.evaluations, self.particle_evaluations = before
        return self._gather(copy)

    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to go on bit for bit; the arrays are copies."""
        counts = np.array([self.step, self.evaluations, self.particle_evaluations], dtype=np.int64)
        return {"counts": counts, **{name: array.copy() for name, array in self._state.items()}}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]]) -> None:
        """Go back to a checkpoint of an equally bound marcher. Raises InputError if it belongs to another problem."""
        for name, array in self._state.items():
            if name not in checkpoint or checkpoint[name].shape != array.shape:
                got = checkpoint[name].shape if name in checkpoint else "nothing"
                raise InputError(f"the checkpoint does not fit this run: {name} is {got}, expected {array.shape}")
            array[...] = checkpoint[name]
        self.step, self.evaluations, self.particle_evaluations = (int(x) for x in checkpoint["counts"])

    def compile(self) -> None:
        """Compile, or load from the cache, all that `advance` needs: one step on a copy, whatever comes of it."""
        with suppress(IntegrationError):
            self.state_after(self.h)

    def close(self) -> None:
        """Release the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def _march_block(self, state: dict[str, Array], h: float, count: int) -> None:
        method = self.integrator
        if h not in self._coefficients:
            self._coefficients = {self.h: self._coefficients[self.h], h: method.coefficients(h)}
        arguments = (self.lagrangian.tag, self.parameters, self._coefficients[h], h)
        massive = (state["q"], state["q_lo"], state["v"], state["v_lo"], state["memory"])
        status, done, body, evaluations = method.advance(*arguments, *massive, self._work, self._field, count)
        self.evaluations += evaluations
        if status == NOT_CONVERGED:
            self._fail(status, done, self._meeting(state, body))
        if status != OK:
            # The state is spoilt; who met is seen in the one before the step, when the block is a single step.
            lost = np.flatnonzero(~np.isfinite(state["q"][: 3 * self._bodies] + state["v"][: 3 * self._bodies]))
            before = self._state if state is not self._state else self._backup
            body = int(lost[0]) % self._bodies if lost.size else 0
            self._fail(status, 0, self._meeting(before, body) if count == 1 else [])
        if not self._tasks:
            return
        particles = tuple(state[f"particle_{name}"] for name in ("q", "q_lo", "v", "v_lo", "memory"))

        def share(task: int) -> tuple[int, int, int, int]:
            start, stop = self._tasks[task]
            work = self._task_work[task]
            result: tuple[int, int, int, int] = method.advance_particles(
                *arguments, *particles, work, self._field, count, start, stop
            )
            return result

        tasks = range(len(self._tasks))
        outcomes = list(self._pool.map(share, tasks) if self._pool else map(share, tasks))
        self.particle_evaluations += sum(evaluations for *_, evaluations in outcomes)
        for status, done, particle, _ in outcomes:
            if status != OK:
                self._fail(status, done if status == NOT_CONVERGED else 0, [int(self._particles[particle])])

    def _meeting(self, state: dict[str, Array], body: int) -> list[int]:
        """Return two massive bodies: `body` and the one next to it, the lighter one first."""
        n = self._bodies
        q = state["q"][: 3 * n].reshape(3, n)
        distance = np.sum((q - q[:, [body]]) ** 2, axis=0)
        distance[body] = np.inf
        pair = [body] if n == 1 else sorted((body, int(np.argmin(distance))), key=lambda b: self.parameters[1 + b])
        return [int(self._massive[b]) for b in pair]

    def _fail(self, status: int, done: int, bodies: list[int]) -> NoReturn:
        step = self.step + done
        names = [self.names[b] if self.names else f"body {b}" for b in bodies]
        where = f"step {step + 1} (t = {step * self.h:.10g}, dt = {abs(self.h):.6g})"
        if status == NOT_CONVERGED:
            raise ConvergenceError(
                f"{where}: the stages of {self.integrator.name} did not converge for {', '.join(names)}; "
                "the result would not be symplectic. Use a smaller dt, or softening if bodies meet closely.",
                step=step,
                time=step * self.h,
                bodies=names,
            )
        whom = f" of {', '.join(names)}" if names else ""
        raise SingularityError(
            f"{where}: the state{whom} is no longer finite; two bodies met, or dt is far too long. "
            "Use a smaller dt, or softening.",
            step=step,
            time=step * self.h,
            bodies=names,
        )

    def _gather(self, state: dict[str, Array]) -> tuple[Array, Array]:
        n, m = self._bodies, len(self._particles)
        out = []
        for name in ("q", "v"):
            x = np.empty((n + m, 3))
            x[self._massive] = state[name][: 3 * n].reshape(3, n).T
            x[self._particles] = state[f"particle_{name}"][:, :m].T
            out.append(x)
        return out[0], out[1]


def _vector(x: Array) -> Array:
    """Return (n, 3) as one padded vector: all x, all y, all z."""
    out = np.zeros(padded(3 * len(x)))
    out[: 3 * len(x)] = x.T.ravel()
    return out


def _columns(x: Array) -> Array:
    """Return (m, 3) as (3, padded). What stands in the padding is finite and read by nobody."""
    out = np.full((3, padded(len(x))), 1e6)
    out[:, : len(x)] = x.T
    return out


def _shares(particles: int, threads: int) -> list[tuple[int, int]]:
    """Split the particles into contiguous shares of whole lanes, a few for each thread."""
    groups = (particles + WIDTH - 1) // WIDTH
    count = min(groups, 4 * threads if threads > 1 else 1)
    edges = [WIDTH * (groups * k // count) for k in range(count + 1)] if count else [0]
    return [(a, min(b, particles)) for a, b in pairwise(edges)]
