"""Where blocks are integrated: threads of this process, or other processes of this machine."""

from __future__ import annotations

import importlib
import multiprocessing
import pickle
import queue
import signal
import threading
import warnings
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from orbits.ensemble.tasks import Outcome, Task, integrate, warm
from orbits.errors import InputError, IntegrationError, OrbitsWarning, StepWarning

Result = tuple[int, Outcome | BaseException | None]
"""The number of a block, and its outcome; or what was raised; or None if its worker was lost."""


class Workers(Protocol):
    """Workers that integrate blocks.

    slots : how many blocks they integrate at the same time;  ahead : how many more wait for them
    what : what they are, in words;  remote : whether their files come with the outcome
    """

    slots: int
    ahead: int
    what: str
    remote: bool

    def warm(self, task: Task) -> None:
        """Compile what blocks need, once, while the workers wait. Raises InputError for wrong options."""

    def submit(self, task: Task) -> None:
        """Begin a block as soon as a worker is free."""

    def result(self, timeout: float) -> Result | None:
        """Return a block that is done, or None after a while."""

    def fractions(self) -> float:
        """Return how many blocks the begun ones amount to, as far as that is known."""

    def stop(self, why: str) -> None:
        """Stop the blocks that are being integrated, at the end of their chunks of steps."""

    def close(self) -> None:
        """Release the workers; those that are still busy are not waited for."""


class _Here:
    """What workers on this machine have in common."""

    remote = False
    ahead = 1  # while results are written

    def __init__(self) -> None:
        self._done: queue.Queue[Result] = queue.Queue()

    def warm(self, task: Task) -> None:
        """Compile what blocks need, into the cache on disk. Raises InputError for wrong options."""
        with suppress(IntegrationError, StepWarning):  # the blocks will say so
            warm(task)

    def result(self, timeout: float) -> Result | None:
        """Return a block that is done, or None after a while."""
        try:
            return self._done.get(timeout=timeout)
        except queue.Empty:
            return None


class Threads(_Here):
    """Threads of this process: kernels run side by side, and Python between them in turn."""

    def __init__(self, count: int, folder: Path) -> None:
        super().__init__()
        self.slots, self.what = count, f"{count} thread{'s' * (count > 1)}"
        self._folder, self._pool = folder, ThreadPoolExecutor(count, thread_name_prefix="orbits")
        self._why = ""
        self._reached: dict[int, float] = {}

    def submit(self, task: Task) -> None:
        """Begin a block."""

        def work() -> Outcome:
            name = threading.current_thread().name.replace("orbits_", "thread ")
            return integrate(task, self._folder, name, lambda: self._why, told)

        def told(fraction: float) -> None:
            self._reached[task.number] = fraction

        def done(future: Future[Outcome]) -> None:
            self._reached.pop(task.number, None)
            self._done.put((task.number, _of(future)))

        self._pool.submit(work).add_done_callback(done)

    def fractions(self) -> float:
        """Return how many blocks the begun ones amount to."""
        return sum(list(self._reached.values()))

    def stop(self, why: str) -> None:
        """Stop the blocks that are being integrated."""
        self._why = why

    def close(self) -> None:
        """Release the threads."""
        self._why = self._why or "the end"
        self._pool.shutdown(wait=True, cancel_futures=True)


class Processes(_Here):
    """Processes of this machine, started afresh; if one is killed, the blocks of all of them are done again."""

    def __init__(self, count: int, folder: Path) -> None:
        super().__init__()
        self.slots, self.what = count, f"{count} process{'es' * (count > 1)}"
        self._context = multiprocessing.get_context("spawn")
        self._asked = self._context.Event()
        self._folder = folder
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, task: Task) -> None:
        """Begin a block. Raises InputError for members that cannot be sent to another process."""
        try:
            data = _dumps(task)
        except Exception as error:
            raise InputError(
                f"the members cannot be sent to other processes ({error}); write the functions of the campaign in a "
                "file, with def at its top level, or use threads: processes=False."
            ) from error

        def done(future: Future[Outcome]) -> None:
            self._done.put((task.number, _of(future)))

        for _ in range(2):
            if self._pool is None:
                self._pool = ProcessPoolExecutor(self.slots, self._context, _begin, (self._asked,))
            try:
                self._pool.submit(_in_process, data, self._folder).add_done_callback(done)
                return
            except BrokenProcessPool:  # a worker was killed since
                self._pool = None

    def fractions(self) -> float:
        """Return 0: what processes have reached is not known before they are done."""
        return 0.0

    def stop(self, why: str) -> None:
        """Stop the blocks that are being integrated."""
        self._asked.set()

    def close(self) -> None:
        """Release the processes."""
        self._asked.set()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)


def _dumps(task: Task) -> bytes:
    """Return a task as bytes; with Dask's cloudpickle, if it is there, functions typed into a session too."""
    try:
        dumps = importlib.import_module("cloudpickle").dumps
    except ImportError:
        dumps = pickle.dumps
    return bytes(dumps(task))


def _of(future: Future[Outcome]) -> Outcome | BaseException | None:
    """Return the outcome, or what was raised, or None if the worker was lost."""
    try:
        return future.result()
    except BrokenProcessPool:
        return None
    except BaseException as error:
        return error


_ASKED: Any = None


def _begin(asked: Any) -> None:
    """Prepare a process: Ctrl-C in the terminal reaches it too, but the campaign tells it when to stop."""
    global _ASKED
    _ASKED = asked
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore", OrbitsWarning)


def _in_process(data: bytes, folder: Path) -> Outcome:
    task: Task = pickle.loads(data)
    name = multiprocessing.current_process().name
    return integrate(task, folder, name, lambda: "a request of the campaign" if _ASKED.is_set() else "")
