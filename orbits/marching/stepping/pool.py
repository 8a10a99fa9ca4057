"""The threads of a march."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from orbits.errors import InputError
from orbits.kernels.rounds import COUNTERS, DISMISSED, Turns

PATIENCE = 6000
"""How often a thread looks for the next block before it leaves: a millisecond or two."""

WORTHWHILE = 1e-4
"""The work on a block, in seconds, from which on other threads are asked to take part in it: waking one takes a third
of that."""

WORTH_A_CHANGE = 1e-3
"""The same for work on other arrays than those of the block before, for which they have to leave and come back."""

WORTH_WAITING = 3e-3
"""The same for work that they share once, and that ends when all who were asked have come and gone: on a busy machine
one may come a millisecond later.
"""


class Pool(ThreadPoolExecutor):
    """Threads, with a clear error if the system does not grant as many as requested.

    others : how many threads there are
    own : how many of those requested are the caller's own, which takes part in the work
    """

    def __init__(self, others: int, own: int = 0) -> None:
        super().__init__(others)
        self._own = own

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a function in a thread. Raises InputError if no further thread can be started."""
        try:
            return super().submit(fn, *args, **kwargs)
        except RuntimeError as error:
            if self._shutdown:
                raise
            raise InputError(
                f"threads = {self._max_workers + self._own}: the system grants this process no more than "
                f"{len(self._threads) + self._own} "
                f"({error}); expected that many or fewer, or None for one on each processor."
            ) from error


def _processor() -> int:
    """Return the number of the processor that runs this thread, or -1 if that cannot be told."""
    return int(_NUMBER()) if _NUMBER else -1


def _move_from(processor: int) -> None:
    """Move this thread to another processor than that one; from there it may be moved to any."""
    if processor >= 0:
        allowed = os.sched_getaffinity(0)
        if allowed - {processor}:
            os.sched_setaffinity(0, allowed - {processor})
            os.sched_setaffinity(0, allowed)


_NUMBER = getattr(ctypes.CDLL(None), "sched_getcpu", None) if hasattr(os, "sched_setaffinity") else None
"""The function of the system that tells it, on Linux, where a thread can be moved."""


def _take_part(kernel: Callable[..., None], turns: Turns, arguments: tuple[Any, ...], processor: int) -> None:
    """Call a kernel in a thread that was woken by one on that processor, with which it would take turns there."""
    _move_from(processor)
    kernel(turns, *arguments)


class Helpers:
    """Threads that take part in the calls of a kernel, block after block, if they come in time; see
    `orbits.kernels.rounds`.

    pool : with a worker for each, or None for the caller's thread alone; others : how many there are
    lingers : whether they watch for the next block, and not leave at once, as where others need them in between

    members : how many threads there are, with the caller's
    """

    def __init__(self, pool: Executor | None, others: int, *, lingers: bool) -> None:
        self._pool, self._others = pool, others if pool else 0
        self.members, patience = 1 + self._others, PATIENCE if lingers else 0
        self._alone = Turns(np.zeros(COUNTERS, dtype=np.int64), 0, 0)
        self._counters = np.zeros(COUNTERS, dtype=np.int64)
        self._turns = [Turns(self._counters, member, patience) for member in range(self.members)]
        self._running: dict[int, Future[None]] = {}
        self._arguments: Sequence[tuple[Any, ...]] = ()
        self._pace = self._whole = 0.0  # seconds for a step of the last block, and for all that was shared last

    def run(self, kernel: Callable[..., None], arguments: Sequence[tuple[Any, ...]], steps: int) -> None:
        """Call kernel(turns, *arguments[k]), in the caller's thread with k = 0, on a block of `steps` steps. Others
        take part if the work on the steps before was enough for that; it is over when all have finished.
        """
        if not self._others:
            kernel(self._alone, *arguments[0])
            return
        busy = arguments is not self._arguments and not all(one.done() for one in self._running.values())
        least = WORTH_A_CHANGE if busy else WORTHWHILE
        together = self._pace * steps > least
        begun = time.perf_counter()
        if together:
            self._ask(kernel, arguments)
        kernel(self._turns[0] if together else self._alone, *arguments[0])
        if steps:
            self._pace = (time.perf_counter() - begun) * (self.members if together else 1) / steps

    def _ask(self, kernel: Callable[..., None], arguments: Sequence[tuple[Any, ...]]) -> None:
        """Wake the threads that have left."""
        assert self._pool is not None
        if arguments is not self._arguments:
            self.dismiss()
            self._arguments = arguments
        for member in range(1, self.members):
            running = self._running.get(member)
            if running is None or running.done():
                if running is not None:
                    running.result()
                now = kernel, self._turns[member], arguments[member], _processor()
                self._running[member] = self._pool.submit(_take_part, *now)

    def each(self, work: Callable[[int, int], None], shares: Sequence[tuple[int, int]]) -> None:
        """Call work(start, stop) for contiguous shares: for all at once in the caller's thread, or, if that took long
        enough the last time, for one after another in all threads, each of which takes the next one when it is free.
        """
        begun, together = time.thread_time(), self._others > 0 and self._whole > WORTH_WAITING
        if together:
            self._share(work, iter(shares))
        elif shares:
            work(shares[0][0], shares[-1][1])
        self._whole = (time.thread_time() - begun) * (self.members if together else 1)

    def _share(self, work: Callable[[int, int], None], rest: Iterator[tuple[int, int]]) -> None:
        def take(processor: int) -> None:
            _move_from(processor)
            for start, stop in rest:
                work(start, stop)

        self.dismiss()
        try:
            for member in range(1, self.members):
                assert self._pool is not None
                self._running[member] = self._pool.submit(take, _processor())
            take(-1)
        finally:
            self.dismiss()  # also after an interrupt: the arrays may be used only afterwards

    def dismiss(self) -> None:
        """Let the threads leave, and wait until they have."""
        self._arguments = ()
        if not self._running:
            return
        self._counters[DISMISSED] = 1
        wait(self._running.values())
        self._counters[DISMISSED] = 0
        running, self._running = self._running, {}
        for future in running.values():
            future.result()

    def close(self) -> None:
        """Let the threads leave for good; what is still asked for is computed by the caller's."""
        self.dismiss()
        self._others = 0
