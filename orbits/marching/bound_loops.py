"""The compiled loops bound to a problem, with the memory that they use: they march a state by a block of steps."""

from __future__ import annotations

from concurrent.futures import Future, wait
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form, coefficients_of, padded
from orbits.kernels.binding import Tag
from orbits.kernels.lanes import WIDTH
from orbits.marching import adaptive, driver
from orbits.marching.alignment import aligned
from orbits.marching.clocks import Clock, ConstantSteps
from orbits.marching.driver import NOWHERE
from orbits.marching.parallel import Parallel, shares
from orbits.marching.pool import Pool
from orbits.marching.watcher import Watcher

STAGES_BYTES = 512 * 1024
"""Size of the recorded stages and of the states of eight particles: they should stay in the second-level cache."""

PATH_BYTES = 4 * 1024 * 1024
"""Size of the recorded states of massive bodies without particles, which are written once and read sparsely."""

LEAST_BLOCK = 16
"""The fewest steps per kernel call, for any number of bodies: the search for close approaches examines its ends."""

BLOCK_WORK = 20_000_000
"""The pairs times steps per kernel call: a fraction of a second, after which signals are handled."""


class BoundLoops:
    """What marches a block of steps of n massive bodies and m massless particles.

    form : of the method; tag, vectors : of what acts on the bodies, and its parameters
    clock : of the march
    threads : how many threads particles, and thousands of massive bodies, may use
    dense : whether the kicks of each step are recorded, for dense output

    steps : the most steps of a block; kicks : (steps, rows, 8), those of a block, with no steps if not `dense`
    state : the arrays that a march changes, by the names that archives have for them; see `Marcher`
    """

    def __init__(
        self, form: Form, tag: Tag, vectors: Any, clock: Clock, n: int, m: int, threads: int, dense: bool = False
    ) -> None:
        self._form, self._tag, self._vectors = form, tag, vectors
        # Coefficients of steps of different lengths are written before each step, others made for each length.
        self._usual = form.coefficients(1.0, 1.0) if clock.changes else coefficients_of(form, clock.h)
        self._clock, self._other = clock, (clock, self._usual)
        shape = form.stages_shape(3 * n)
        least = 1 if m else LEAST_BLOCK
        room = STAGES_BYTES // (8 * shape[0] * shape[1] + 48 * WIDTH) if m else PATH_BYTES // (16 * padded(3 * n))
        self.steps = max(least, min(room, BLOCK_WORK // (max(m, n) * n)))
        self.tasks = shares(m, threads)
        vector, columns, scratch = (padded(3 * n),), (3, padded(m)), form.scratch_shape(3 * n)
        shapes: dict[str, tuple[int, ...]] = {
            "q": vector,
            "q_lo": vector,
            "v": vector,
            "v_lo": vector,
            "memory": (form.carry_rows(3 * n), WIDTH),
            "particle_q": columns,
            "particle_q_lo": columns,
            "particle_v": columns,
            "particle_v_lo": columns,
            "particle_memory": (m, form.particle_carry_rows, WIDTH),
        }
        self._stages, self._scratch, *arrays = aligned(
            (self.steps if m else 1, *shape), scratch, *shapes.values(), *(scratch for _ in self.tasks)
        )
        self.state: dict[str, Array] = dict(zip(shapes, arrays, strict=False))
        self._task_scratch = arrays[len(shapes) :]
        rows = 12 * (self.steps + 1) if m else 0
        self.tracks = [np.empty((rows, WIDTH)) for _ in range(max(1, len(self.tasks)))]
        self.times = np.zeros(clock.room(self.steps, sum(x.size for x in self.state.values())))
        many = Parallel.serves(form, tag, n)
        self._pool = Pool(threads) if threads > 1 and (many or len(self.tasks) > 1) else None
        self.parallel = Parallel(n, threads, self._pool) if many else None
        self.kicks = np.empty((self.steps if dense else 0, form.carry_rows(3 * n), WIDTH))
        self._march = driver.march if self.parallel is None else self.parallel.march

    @property
    def kind(self) -> tuple[Any, ...]:
        """What is compiled for it: the same for those that need the same."""
        return self._form.tag.name, self._tag.name, bool(self.tasks), self.parallel is None

    def begin(self, q: Array, v: Array, massive: NDArray[np.intp], particles: NDArray[np.intp]) -> None:
        """Write the initial state; q, v : (n + m, 3), with the numbers of the massive bodies and of the particles."""
        n, m = len(massive), len(particles)
        for name, x in (("q", q), ("v", v)):
            self.state[name][: 3 * n] = x[massive].T.ravel()
            self.state[f"particle_{name}"][...] = NOWHERE
            self.state[f"particle_{name}"][:, :m] = x[particles].T

    def bound(self, clock: Clock, now: Array) -> tuple[Any, ...]:
        """Return the first arguments of the compiled loops: the method, the model and the clock with its numbers."""
        coefficients = self._usual
        if clock != self._clock:  # a partial step
            if clock != self._other[0]:
                self._other = clock, coefficients_of(self._form, clock.h)
            coefficients = self._other[1]
        return self._form.tag, coefficients, self._tag, self._vectors, clock.timing, now, self.times

    def march(self, state: dict[str, Array], bound: tuple[Any, ...], path: Array, count: int) -> tuple[int, ...]:
        """March the massive bodies by `count` steps, recorded in `path` unless it is empty.

        Returns (status, steps done, body, evaluations); see `orbits.marching.driver`.
        """
        vectors = (state["q"], state["q_lo"], state["v"], state["v_lo"], state["memory"])
        kicks = self.kicks if path.size else self.kicks[:0]  # of a copy of the state, nothing is recorded
        room = (self._scratch, self._stages)
        status, done, body, evaluations = self._march(*bound, *vectors, *room, path, 1, kicks, count)
        return status, done, body, evaluations

    def enter(self, state: dict[str, Array], clock: Clock) -> None:
        """Compute what is marched with this clock from what is seen, for a form that `transforms`."""
        driver.enter_march(*self._transformation(state, clock))

    def leave(self, state: dict[str, Array], clock: Clock) -> None:
        """Compute what is seen from what is marched with this clock, in a copy of a state that is not marched on."""
        driver.leave_march(*self._transformation(state, clock))

    def _transformation(self, state: dict[str, Array], clock: Clock) -> tuple[Any, ...]:
        vectors = (state["q"], state["q_lo"], state["v"], state["v_lo"], state["memory"])
        return *self.bound(clock, self.times)[:4], clock.h, *vectors, self._scratch, self._stages

    def march_particles(
        self,
        state: dict[str, Array],
        bound: tuple[Any, ...],
        retired: NDArray[np.int64],
        watcher: Watcher | None,
        count: int,
    ) -> int:
        """March the massless particles through the `count` steps that the bodies have just taken; return how many
        evaluations there were.

        retired : see `Retired.block`; watcher : what observes them, or None
        """
        particles = tuple(state[f"particle_{name}"] for name in ("q", "q_lo", "v", "v_lo", "memory"))
        observer = 0 if watcher is None else watcher.observer

        def share(task: int) -> int:
            start, stop = self.tasks[task]
            context = 0 if watcher is None else watcher.contexts.addresses[1 + task]
            room = (self._task_scratch[task], self._stages, retired)
            watched = (observer, context, self.tracks[task])
            return int(driver.march_particles(*bound, *particles, *room, count, start, stop, *watched))

        if self._pool is None:
            return sum(map(share, range(len(self.tasks))))
        running: list[Future[int]] = []
        try:
            for task in range(len(self.tasks)):
                running.append(self._pool.submit(share, task))
        finally:
            wait(running)  # also after an interrupt: the arrays may be used only afterwards
        return sum(future.result() for future in running)

    def close(self) -> None:
        """Release the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def numbers_of(clock: Clock, state: dict[str, Array], start: float, steps: int) -> tuple[Array, float]:
    """Return what compiled code needs to know of a clock, and the length of its steps, or about that.

    start, steps : of clocks of constant steps, the time at which they began and how many were taken since
    """
    if isinstance(clock, ConstantSteps):
        return clock.numbers(start, steps), clock.h
    now = state["clock"]
    now[adaptive.ORIGIN] = now[adaptive.TIME]
    return now, float(now[adaptive.LENGTH] or clock.direction)
