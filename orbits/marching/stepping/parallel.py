"""Thousands of bodies: the march of a splitting, and the search for closest approaches, by several threads.

The bits do not depend on the number of threads, and the states are bit for bit those of the method's own loop. So are
the records of closest approaches as long as the steps resolve the passages.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from itertools import pairwise
from typing import Any

import numpy as np

from orbits.integrators.forms import Form, padded
from orbits.kernels.barrier import ABANDONED, COUNTERS, PIECE, claim, meet
from orbits.kernels.binding import Tag
from orbits.kernels.clocks import Clock
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.approaches import follow_row, longest_way
from orbits.kernels.search.context import Contexts, watch_at
from orbits.kernels.search.record import COLUMNS, QUANTITIES, enter_record, note_rows
from orbits.kernels.state import all_finite, copy
from orbits.kernels.steps import NOT_FINITE, OK, Method, Model, State
from orbits.marching.stepping.driver import march_together
from orbits.marching.watching.leg_observers import Observers

LEAST_BODIES = 1000
"""The number of bodies above which synchronizing threads is much faster than a force evaluation."""

PARTS = 32
"""Number of parts of the search among pairs: each has its own record, whichever thread fills it."""

PART_ROOM = 64
"""Number of passages that a part can list in a block."""


@kernel
def follow_together(counters, threads, member, context, h, steps, parts):
    """Search for closest approaches among the bodies, as one of several threads.

    parts : addresses of PARTS contexts, each with a record and a list of its own
    """
    watch = watch_at(context)
    n = watch.bodies
    rows = (n + PARTS - 1) // PARTS
    if watch.first == 0:
        part = claim(counters, threads, 0, PARTS)
        while part < PARTS:
            note_rows(context, min(rows * part, n), min(rows * (part + 1), n))
            part = claim(counters, threads, 0, PARTS)
        meet(counters, threads, 1)
    way = longest_way(context, h, steps)
    round_ = 1 if watch.first == 0 else 0
    part = claim(counters, threads, round_, PARTS)
    while part < PARTS:
        follow_part(context, parts[part], h, steps, way, part)
        part = claim(counters, threads, round_, PARTS)
    meet(counters, threads, round_ + 1)
    if member == 0:
        for part in range(PARTS):
            enter_record(watch.record, watch_at(parts[part]).record, n)


@kernel
def follow_part(context, own, h, steps, way, part):
    """Search among every PARTS-th body from `part` on and the bodies after it. The context `own` has the record, which
    starts as a copy of the whole record, and an empty list.
    """
    whole, record, listed = watch_at(context).record, watch_at(own).record, watch_at(own).listed
    for quantity in range(record.shape[0]):
        for column in range(record.shape[1]):
            copy(whole[quantity, column], 0, record.shape[2], record[quantity, column])
    listed[0], listed[1] = 0, 0
    for i in range(part, watch_at(context).bodies - 1, PARTS):
        follow_row(own, h, steps, way, i)


class Threads:
    """Threads that run one compiled function together; a single one is the caller's own, which otherwise waits, as it
    alone can be interrupted.

    pool : at least as many workers as there are threads, or None for a single thread
    """

    def __init__(self, count: int, pool: Executor | None) -> None:
        self.count = count if pool else 1
        self._pool = pool
        self._counters = np.zeros(COUNTERS, dtype=np.int64)

    def run(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call function(counters, threads, member, *arguments) in all threads; raise what any of them raises."""
        counters = self._counters
        counters[:] = 0
        if self._pool is None:
            function(counters, 1, 0, *arguments)
            return

        def work(member: int) -> None:
            try:
                function(counters, self.count, member, *arguments)
            except BaseException:
                counters[ABANDONED] = 1
                raise

        members: list[Future[None]] = []
        try:
            for member in range(self.count):
                members.append(self._pool.submit(work, member))
            wait(members)
        except BaseException:
            # Threads waiting for one that was never started are released and end; only then may the arrays be used.
            counters[ABANDONED] = 1
            for future in members:
                future.cancel()
            wait(members)
            raise
        for future in members:
            future.result()


class Parallel:
    """The march of the massive bodies, as by `driver.march`, and the search for closest approaches, by several
    threads.
    """

    def __init__(self, bodies: int, threads: int, pool: Executor | None) -> None:
        self._threads = Threads(min(threads, PARTS, (bodies + PIECE - 1) // PIECE), pool)
        self._size = 3 * bodies
        self._at = np.zeros(0)
        self._rounds = np.zeros((self._threads.count, WIDTH), dtype=np.int64)
        self._listed = np.zeros((PARTS, 2), dtype=np.int64)
        self._lists = np.empty((PARTS, PART_ROOM, COLUMNS))
        self._parts = Contexts(PARTS)
        self._parts.enter_each("record", [np.zeros((QUANTITIES, 2, padded(bodies))) for _ in range(PARTS)])
        self._parts.enter_each("passages", list(self._lists))
        self._parts.enter_each("listed", list(self._listed))
        self._addresses = np.array(self._parts.addresses)

    @staticmethod
    def serves(form: Form, tag: Tag, bodies: int) -> bool:
        """Whether there are enough bodies, and the method and the Lagrangian can be divided among threads."""
        return bodies >= LEAST_BODIES and tag.provides("accelerate_some") and form.shared

    def march(self, *arguments: Any) -> tuple[int, int, int, int]:
        """March the bodies; the arguments and the result are those of `driver.march`."""
        *flat, path, lows, _, _, steps = arguments
        method, model, clock, state = Method(*flat[:2]), Model(*flat[2:4]), Clock(*flat[4:7]), State(*flat[7:11])
        fresh = bool(np.array_equal(state.q[: self._size], self._at))
        self._at = np.zeros(0)
        records = method, model, clock, state, tuple(flat[11:])
        self._threads.run(march_together, self._rounds, fresh, *records, path, lows, steps)
        self._at = state.q[: self._size].copy()
        status = OK if all_finite(state.q, state.p, self._size) else NOT_FINITE
        return status, steps, 0, int(self._rounds[0, 1])

    def follow(self, watcher: Observers, h: float, steps: int) -> None:
        """Search for closest approaches among the bodies, as `Observers.follow` does."""
        self._parts.share(watcher.contexts, own=("record", "passages", "listed"))
        self._threads.run(follow_together, watcher.contexts.addresses[0], h, steps, self._addresses)
        whole = watcher.lists[0]
        for (kept, seen), passages in zip(self._listed, self._lists, strict=True):
            start = whole.listed[0]
            count = min(kept, len(whole.passages) - start)
            whole.passages[start : start + count] = passages[:count]
            whole.listed[:] += count, seen


def shares(bodies: int, threads: int) -> list[tuple[int, int]]:
    """Split bodies or particles into contiguous shares of whole lanes, a few for each thread."""
    groups = (bodies + WIDTH - 1) // WIDTH
    count = min(groups, 4 * threads if threads > 1 else 1)
    edges = [WIDTH * (groups * k // count) for k in range(count + 1)] if count else [0]
    return [(a, min(b, bodies)) for a, b in pairwise(edges)]
