"""The compiled loops bound to a problem, with the memory that they use: they march a state by a block of steps."""

from __future__ import annotations

import math
from operator import is_
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form, coefficients_of, padded
from orbits.kernels.binding import Tag
from orbits.kernels.lanes import WIDTH
from orbits.kernels.state import Columns
from orbits.kernels.steps import NOWHERE
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.step_times import Behind
from orbits.marching.following.contract import NO_SAMPLES, Block, Followers, SamplesInBlock
from orbits.marching.following.excursion_rules import OwnSteps, follower_of
from orbits.marching.following.follower import Follower
from orbits.marching.following.own_clocks import COLUMNS
from orbits.marching.stepping import driver
from orbits.marching.stepping.alignment import aligned, unwritten
from orbits.marching.stepping.parallel import Parallel, shares
from orbits.marching.stepping.pool import Helpers, Pool
from orbits.marching.watching.leg_observers import Observers

STAGES_BYTES = 1024 * 1024
"""Size of the recorded stages and of the states of eight particles, about that of a second-level cache: where this has
half as much, they are read in order and take no longer, and blocks of half the size take 1 to 4 % longer.
"""

PATH_BYTES = 4 * 1024 * 1024
"""Size of the recorded states of massive bodies without particles, which are written once and read sparsely."""

LEAST_BLOCK = 16
"""The fewest steps per kernel call, for any number of bodies: the search for close approaches examines its ends."""

KEPT = 1024
"""The most steps of a block after each of which the carry is recorded, for samples within them: they stay in the cache.
"""

_NOTHING = np.zeros(0)

BLOCK_WORK = 20_000_000
"""The pairs times steps per kernel call: a fraction of a second, after which signals are handled."""


class BoundLoops:
    """What marches a block of steps of n massive bodies and m massless particles.

    form : of the method; tag, vectors : of what acts on the bodies, and its parameters
    clock : of the march
    threads : how many threads particles, and thousands of massive bodies, may use
    dense : whether the carry after each step is recorded, for the dense output of methods with a polynomial, whose
        kicks it holds, and of those that march other variables than those seen
    followed : the passages in which massless particles take steps of their own, of a map that cannot follow them

    steps : the most steps of a block; kicks : (steps, rows, 8), the carries of a block, with no steps if not `dense`
    state : the arrays that a march changes, by the names that archives have for them; see `Leg`
    follower : what marches massless particles, if there are any
    shows_samples : whether they are shown at samples within a block
    """

    def __init__(
        self,
        form: Form,
        tag: Tag,
        vectors: Any,
        clock: Clock,
        n: int,
        m: int,
        threads: int,
        dense: bool = False,
        followed: OwnSteps | None = None,
    ) -> None:
        self._form, self._tag, self._vectors = form, tag, vectors
        # Coefficients of steps of different lengths are written before each step, others made for each length.
        self._usual = clock.coefficients(form)
        self._clock, self._other = clock, (clock, self._usual)
        shape = form.stages_shape(3 * n)
        least = 1 if m else LEAST_BLOCK
        room = PATH_BYTES // (16 * padded(3 * n))
        if m:
            room = STAGES_BYTES // (8 * form.stages_read(3 * n) + 48 * WIDTH)
        self.steps = max(least, min(room, BLOCK_WORK // (max(m, n) * n)))
        self._n, self._shares = n, shares(m, threads)
        many = Parallel.serves(form, tag, n)
        others = max(min(threads, len(self._shares)) - 1, 0)
        workers = threads if many and threads > 1 else others
        self._pool = Pool(workers, own=int(not many)) if workers else None
        self.parallel = Parallel(n, threads, self._pool) if many else None
        self._helpers = Helpers(self._pool, others, lingers=not many)
        self.follower: Follower | None = None
        if m:
            of_bodies = form, n, self.steps, self._helpers
            self.follower = follower_of(clock, *of_bodies, self._usual, vectors, followed)
        vector, columns = (padded(3 * n),), (3, padded(m))
        rows = 0 if self.follower is None else self.follower.memory_rows(form)
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
            "particle_memory": (m, rows, WIDTH),
        }
        if self.follower is not None:
            shapes |= self.follower.more_arrays(m)
        stages, begun = (self.steps if m else 1, *shape), shapes["memory"] if m else (0, WIDTH)
        (self._stages,) = unwritten(stages)
        self._scratch, *arrays, self._begun = aligned(form.scratch_shape(3 * n), *shapes.values(), begun)
        self.state: dict[str, Array] = dict(zip(shapes, arrays, strict=True))
        self.times = np.zeros(clock.room(self.steps, 4 * vector[0] + math.prod(shapes["memory"])))
        self._reads_path = self.follower is not None and self.follower.reads_path
        self.shows_samples = self.follower is not None and self.follower.shows_samples
        recorded = self._reads_path or self.records_carries(dense)
        self.kicks = np.empty((self.steps if recorded else 0, form.carry_rows(3 * n), WIDTH))
        self._keeps, self._keeps_lows, self._lows = False, False, _NOTHING
        self._record = _NOTHING, self.kicks  # the path and kicks of the block marched last
        self._of_copies: tuple[Array, Array] | None = None
        self._march = driver.march if self.parallel is None else self.parallel.march
        self._now, self._count = _NOTHING, np.zeros(1, dtype=np.int64)
        # What the records for particles were made of, and these: of the march itself, and of copies, not observed.
        self._bound_to: dict[bool, tuple[Any, Any]] = dict.fromkeys((False, True), ([None] * 8, None))
        self.tasks = range(self._helpers.members if m else 0)
        self.tracks = [np.zeros((0, WIDTH))] if self.follower is None else [self.follower.track]

    @property
    def kind(self) -> tuple[Any, ...]:
        """What is compiled for it: the same for those that need the same."""
        following = "" if self.follower is None else self.follower.following.name
        return self._form.tag.name, self._tag.name, following, self.parallel is None

    @property
    def scratch(self) -> Array:
        """The workspace of the massive bodies."""
        return self._scratch

    def begin(self, q: Array, v: Array, massive: NDArray[np.intp], particles: NDArray[np.intp]) -> None:
        """Write the initial state; q, v : (n + m, 3), with the numbers of the massive bodies and of the particles."""
        n, m = len(massive), len(particles)
        for name, x in (("q", q), ("v", v)):
            self.state[name][: 3 * n].reshape(3, n)[...] = x[massive].T
            self.state[f"particle_{name}"][...] = NOWHERE
            if m:
                self.state[f"particle_{name}"][:, :m] = x[particles].T

    def bound(self, clock: Clock, now: Array) -> tuple[Any, ...]:
        """Return the first arguments of the compiled loops: the method, the model and the clock with its numbers."""
        coefficients = self._usual
        if clock is not self._clock and clock != self._clock:  # a partial step
            if clock != self._other[0]:
                self._other = clock, coefficients_of(self._form, clock.h)
            coefficients = self._other[1]
        return self._form.tag, coefficients, self._tag, self._vectors, clock.timing, now, self.times

    def march(
        self,
        state: dict[str, Array],
        bound: tuple[Any, ...],
        path: Array,
        count: int,
    ) -> tuple[int, ...]:
        """March the massive bodies by `count` steps, recorded in `path` unless it is empty.

        Returns (status, steps done, body, evaluations); see `orbits.marching.stepping.driver`.
        """
        vectors = (state["q"], state["q_lo"], state["v"], state["v_lo"], state["memory"])
        of_march = path.size or (self._keeps and state is self.state)  # of a copy of the state, nothing is recorded
        kicks = self.kicks if of_march else self.kicks[:0]
        lows = self._lows[:0]
        if self._keeps_lows and path.size and state is self.state:
            if len(self._lows) < path.size:
                (self._lows,) = unwritten((path.size,))
            lows = self._lows
        if self._reads_path:
            self._begun[...] = state["memory"]
            if not path.size:  # but for its own particles
                if self._of_copies is None:
                    self._of_copies = np.zeros(2 * (self.steps + 1) * len(state["q"])), np.empty_like(self.kicks)
                path, kicks = self._of_copies
            self._record = path, kicks
        room = (self._scratch, self._stages)
        status, done, body, evaluations = self._march(*bound, *vectors, *room, path, lows, 1, kicks, count)
        return status, done, body, evaluations

    def is_seen(self, steps: int) -> bool:
        """Whether what is marched is what is seen, after so many steps."""
        return True

    def enter(self, state: dict[str, Array], clock: Clock, retired: NDArray[np.int64] | None = None) -> None:
        """Compute what is marched with this clock from what is seen: the same.

        retired : see `Retired.block`; these particles are left alone
        """

    def leave(
        self,
        state: dict[str, Array],
        clock: Clock,
        retired: NDArray[np.int64] | None = None,
        particles: NDArray[np.intp] | None = None,
    ) -> None:
        """Compute what is seen from what is marched with this clock, in a copy of a state that is not marched on.

        particles : those of which it is wanted; all by default
        """

    def leave_particles(
        self,
        state: dict[str, Array],
        clock: Clock,
        retired: NDArray[np.int64] | None = None,
        particles: NDArray[np.intp] | None = None,
    ) -> None:
        """Compute what is seen of particles alone; the arguments are those of `leave`."""

    def records_carries(self, dense: bool) -> bool:
        """Whether the carries of all steps are recorded, of a march that is `dense` or not."""
        return dense and self._form.is_dense

    def tells_beginnings(self, recorded: bool) -> bool:
        """Whether the states at the beginnings of steps are known after a block; recorded : if they were as seen."""
        return recorded

    def beginnings(self, observers: Observers, count: int, behind: Behind) -> Array:
        """Return the states at the beginnings of the steps of some places in the block of `count` steps that was
        marched last, (m, 2, padded), or (m, 4, padded) with their low parts.
        """
        path = observers.recorded(count)[behind.steps]
        if not behind.parts.any():
            return path
        lows = self._lows[: 2 * (count + 1) * len(self.state["q"])].reshape(count + 1, 2, -1)
        return np.concatenate([path, lows[behind.steps]], axis=1)

    def seen(self, path: Array, carries: Array | None) -> Array:
        """Return states as they are seen; path : of `beginnings`; carries : those there, (m, rows, 8), if known."""
        return path

    def motion(self, observers: Observers, count: int, begun: Array) -> tuple[Array, Array]:
        """Return the states at the ends of the `count` steps of the last block, (count + 1, 2, padded), and what else
        is known of the motion within these: the carries after them, of a polynomial; begun : the carry before them
        """
        return observers.recorded(count), self.kicks[: count if self._form.is_dense else 0]

    @property
    def most_kept(self) -> int:
        """The most steps of a block after each of which the carry can be recorded."""
        return len(self.kicks) or min(self.steps, KEPT)

    def keep_carries(self, wanted: bool) -> None:
        """Record the carry after each step of the next blocks, or no longer, of a march that is not `dense`."""
        self._keeps = wanted
        if wanted and not len(self.kicks):
            self.kicks = np.empty((self.most_kept, *self.state["memory"].shape))

    def keep_lows(self, wanted: bool) -> None:
        """Record the low parts of the states of the next blocks that are recorded, or no longer."""
        self._keeps_lows = wanted

    def march_particles(
        self,
        state: dict[str, Array],
        bound: tuple[Any, ...],
        retired: NDArray[np.int64],
        watcher: Observers | None,
        count: int,
        samples: SamplesInBlock = NO_SAMPLES,
    ) -> int:
        """March the massless particles through the `count` steps that the bodies have just taken; return how many
        evaluations there were.

        retired : see `Retired.block`; watcher : what observes them, or None; samples : within the block, to be shown
        """
        if self.follower is None:
            return 0
        form, coefficients, tag, parameters, timing, now, times = bound
        if len(self._now) != len(now):
            self._now = np.empty_like(now)
        self._now[:], self._count[0] = now, count
        sources = state, coefficients, *self._record, retired, watcher, samples, self._now
        known, records = self._bound_to[watcher is None]
        if not all(map(is_, sources, known)):
            columns = particles_in(state)
            clocks = state.get("particle_clock", np.zeros((0, COLUMNS)))
            records = (
                Block(
                    coefficients, parameters, self._now, times, self._count, self._stages, self._begun, *self._record
                ),
                Followers(columns, state["particle_memory"], clocks, retired, samples),
            )
            self._bound_to[watcher is None] = sources, records
        block, particles = records
        return self.follower.follow((form, tag, timing), block, particles, watcher)

    def close(self) -> None:
        """Release the threads; what is still asked for is computed by the caller's."""
        self._helpers.close()
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None


def particles_in(state: dict[str, Array]) -> Columns:
    """Return the positions and velocities of the massless particles in a state."""
    return Columns(*[state[f"particle_{name}"] for name in ("q", "q_lo", "v", "v_lo")])
