"""Thousands of bodies: the march of a method of kicks and drifts, and the look for closest approaches, by a team of
threads.

The bits do not depend on the number of threads, and those of the states are those of the method's own compiled loop.
The records of closest approaches are those of that loop as long as the steps resolve the passages.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from itertools import pairwise
from typing import Any, cast

import numpy as np

from orbits.integrators.base import NOT_FINITE, OK, Array, Integrator, padded
from orbits.integrators.watcher import Watcher
from orbits.kernels.approach_search import follow_row, longest_way
from orbits.kernels.binding import Tag, accelerate_some, bodies, dimension
from orbits.kernels.compile import kernel
from orbits.kernels.encounters import COLUMNS, QUANTITIES, enter_record, note_rows
from orbits.kernels.lanes import WIDTH
from orbits.kernels.paths import record_strip
from orbits.kernels.state import all_finite, copy, drift, kick
from orbits.kernels.team import ABANDONED, COUNTERS, claim, meet
from orbits.kernels.watch import Contexts, watch_at

LEAST_CROWD = 1000
"""Bodies from which on a force evaluation outlasts the meetings of threads by far."""

PIECE = 64
"""Bodies whose accelerations a thread takes at once: whole pairs of registers."""

PARTS = 32
"""Into how many parts the looking at pairs is divided: each has a record of its own, whoever fills it."""

PART_ROOM = 64
"""Passages that a part can list in a block."""


@kernel
def accelerate_together(counters, team, round_, tag, parameters, q, g):
    """Write the accelerations of all bodies, each of a team some of them; rounds count from 0."""
    n = bodies(tag, parameters)
    pieces = (n + PIECE - 1) // PIECE
    meet(counters, team, 2 * round_ + 1)
    piece = claim(counters, team, round_, pieces)
    while piece < pieces:
        accelerate_some(tag, parameters, q, g, PIECE * piece, min(PIECE * (piece + 1), n))
        piece = claim(counters, team, round_, pieces)
    meet(counters, team, 2 * round_ + 2)


@kernel
def march_together(
    counters, team, member, tag, parameters, kicks, drifts, q, q_lo, v, v_lo, g, field_record, path, steps, fresh
):
    """March the bodies by `steps` steps, as one of a team: each moves a strip of the coordinates.

    fresh : whether g holds the accelerations at q
    """
    size = dimension(tag, parameters)
    groups = (size + WIDTH - 1) // WIDTH
    start, stop = WIDTH * (groups * member // team), min(WIDTH * (groups * (member + 1) // team), size)
    x, x_lo, w, w_lo, a = q[start:], q_lo[start:], v[start:], v_lo[start:], g[start:]
    round_ = 0
    if kicks[0] != 0.0 and not fresh:
        accelerate_together(counters, team, round_, tag, parameters, q, g)
        round_ += 1
    for step in range(steps):
        record_strip(path, step, q, v, start, stop)
        record = field_record[step % field_record.shape[0]]
        copy(q, start, stop, record[0])
        if kicks[0] != 0.0:
            kick(w, w_lo, kicks[0], a, stop - start)
        for i in range(drifts.shape[0]):
            drift(x, x_lo, drifts[i], w, w_lo, stop - start)
            copy(q, start, stop, record[i + 1])
            if kicks[i + 1] != 0.0:
                accelerate_together(counters, team, round_, tag, parameters, q, g)
                round_ += 1
                kick(w, w_lo, kicks[i + 1], a, stop - start)


@kernel
def follow_together(counters, team, member, context, h, steps, parts):
    """Look for closest approaches among the bodies, as one of a team.

    parts : addresses of PARTS contexts, each with a record and a list of its own
    """
    watch = watch_at(context)
    n = watch.bodies
    rows = (n + PARTS - 1) // PARTS
    if watch.first == 0:
        part = claim(counters, team, 0, PARTS)
        while part < PARTS:
            note_rows(context, min(rows * part, n), min(rows * (part + 1), n))
            part = claim(counters, team, 0, PARTS)
        meet(counters, team, 1)
    way = longest_way(context, h, steps)
    round_ = 1 if watch.first == 0 else 0
    part = claim(counters, team, round_, PARTS)
    while part < PARTS:
        follow_part(context, parts[part], h, steps, way, part)
        part = claim(counters, team, round_, PARTS)
    meet(counters, team, round_ + 1)
    if member == 0:
        for part in range(PARTS):
            enter_record(watch.record, watch_at(parts[part]).record, n)


@kernel
def follow_part(context, own, h, steps, way, part):
    """Look at each PARTS-th body from `part` on and those behind it, into a record that begins as the whole one, and
    into an empty list: those of the context `own`.
    """
    whole, record, listed = watch_at(context).record, watch_at(own).record, watch_at(own).listed
    for quantity in range(record.shape[0]):
        for column in range(record.shape[1]):
            copy(whole[quantity, column], 0, record.shape[2], record[quantity, column])
    listed[0], listed[1] = 0, 0
    for i in range(part, watch_at(context).bodies - 1, PARTS):
        follow_row(own, h, steps, way, i)


class Team:
    """Threads that run one compiled function together; of one, the caller's own.

    pool : at least as many workers as there are threads, or None for one alone
    """

    def __init__(self, threads: int, pool: Executor | None) -> None:
        self._threads = threads if pool else 1
        self._pool = pool
        self._counters = np.zeros(COUNTERS, dtype=np.int64)

    def run(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call function(counters, team, member, *arguments) in all threads; raise what any of them raises."""
        counters = self._counters
        counters[:] = 0
        if self._pool is None:
            function(counters, 1, 0, *arguments)
            return

        def work(member: int) -> None:
            try:
                function(counters, self._threads, member, *arguments)
            except BaseException:
                counters[ABANDONED] = 1
                raise

        members: list[Future[None]] = []
        try:
            for member in range(self._threads):
                members.append(self._pool.submit(work, member))
            wait(members)
        except BaseException:
            # Members that wait for one that never comes are let go, and end; only then may others use the arrays.
            counters[ABANDONED] = 1
            for future in members:
                future.cancel()
            wait(members)
            raise
        for future in members:
            future.result()


class Crowd:
    """Marches as `integrator.advance` does, for a method of kicks and drifts, and looks for closest approaches."""

    def __init__(self, integrator: Integrator, bodies: int, team: Team) -> None:
        self._integrator = integrator
        self._team = team
        self._size = 3 * bodies
        self._at = np.zeros(0)
        self._records = np.zeros((PARTS, QUANTITIES, 2, padded(bodies)))
        self._lists = np.empty((PARTS, PART_ROOM, COLUMNS))
        self._listed = np.zeros((PARTS, 2), dtype=np.int64)
        self._parts = Contexts(PARTS)
        for name, arrays in (("record", self._records), ("passages", self._lists), ("listed", self._listed)):
            self._parts.enter_each(name, list(arrays))
        self._addresses = np.array(self._parts.addresses)

    @staticmethod
    def serves(integrator: Integrator, tag: Tag, bodies: int) -> bool:
        """Whether the bodies are that many, and method and Lagrangian can be shared out."""
        return (
            bodies >= LEAST_CROWD and tag.provides("accelerate_some") and integrator.kicks_and_drifts(1.0) is not None
        )

    def advance(
        self,
        tag: Tag,
        parameters: Array,
        coefficients: Array,
        h: float,
        q: Array,
        q_lo: Array,
        v: Array,
        v_lo: Array,
        memory: Array,
        work: Array,
        field_record: Array,
        path: Array,
        steps: int,
    ) -> tuple[int, int, int, int]:
        """March the bodies by `steps` steps of h. Returns (status, steps done, body, evaluations)."""
        size = self._size
        kicks, drifts = cast(tuple[Array, Array], self._integrator.kicks_and_drifts(h))
        fresh = bool(np.array_equal(q[:size], self._at))
        self._at = np.zeros(0)
        self._team.run(
            march_together, tag, parameters, kicks, drifts, q, q_lo, v, v_lo, work[0], field_record, path, steps, fresh
        )
        if kicks[-1] != 0.0:
            self._at = q[:size].copy()
        evaluations = steps * int(np.count_nonzero(kicks[1:]))
        return (OK if all_finite(q, v, size) else NOT_FINITE), steps, 0, evaluations

    def follow(self, watcher: Watcher, h: float, steps: int) -> None:
        """Look for closest approaches among the bodies, as `Watcher.follow` does."""
        self._parts.share(watcher.contexts, own=("record", "passages", "listed"))
        self._team.run(follow_together, watcher.contexts.addresses[0], h, steps, self._addresses)
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
