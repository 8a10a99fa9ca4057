"""Workers of a Dask cluster: they need not see the folder of the campaign, as their files come with the outcome."""

from __future__ import annotations

import importlib
import queue
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from orbits.ensemble.tasks import Outcome, Task, remote, said, warm
from orbits.ensemble.workers import Result
from orbits.errors import (
    InputError,
    IntegrationError,
    MissingPackageError,
    OrbitsError,
    OrbitsWarning,
    StepWarning,
    shown,
)

BETWEEN, ABSENCE = 5.0, 120.0
"""Seconds between two looks at the cluster, and after which a cluster without workers is given up."""

PATIENCE = 5.0
"""Seconds in which a scheduler has to answer."""

ARRIVAL = 15.0
"""Seconds in which the first worker has to be there."""

QUESTION = (
    "{**__import__('orbits.propagation.marchers', fromlist=['provenance']).provenance(), "
    "'host': __import__('socket').gethostname(), "
    "'ensemble': bool(__import__('importlib.util').util.find_spec('orbits.ensemble'))}"
)
"""What each worker is asked: an expression, as functions of this package may not be there, or be others."""

SAME = "orbits", "kernel_sources", "python", "numpy", "numba", "llvmlite", "cpu_features"
"""What has to be the same on all workers."""

LOST_TOO_OFTEN = "KilledWorker"

_STOPPED: dict[str, str] = {}
"""In a worker: the runs that were stopped, and why."""


class Dask:
    """The workers of a Dask cluster.

    client : a `distributed.Client`, or the address of a scheduler
    run : a name for the keys of the tasks, different in each run

    Raises MissingPackageError without `distributed`; InputError if no scheduler or no worker answers, or if workers
    have other versions than this process.
    """

    remote = True

    def __init__(self, client: Any, run: str, made_by: Mapping[str, str]) -> None:
        self._distributed = distributed_package()
        self._client: Any
        self._client, self._own = _client(self._distributed, client)
        self._run, self._made_by, self._sent = run, dict(made_by), 0
        self._done: queue.Queue[Any] = queue.Queue()
        self._futures: dict[int, Any] = {}
        self._looked = self._seen = time.monotonic()
        try:
            self.hosts = self._checked()
        except BaseException:
            self.close()
            raise
        count = len(self._workers())
        self.slots = sum(self._workers().values())
        self.ahead = self.slots
        self.what = f"{count} Dask worker{'s' * (count > 1)} at {self._client.scheduler.address}"

    def warm(self, task: Task) -> None:
        """Compile what blocks need, on one worker of each machine, while the others wait. Raises as the task does."""
        submit = self._client.submit
        for each in self.hosts.values():
            name = f"orbits-{self._run}-compile-{each}"
            made: Any = submit(warm, task, workers=[each], allow_other_workers=True, pure=False, key=name)
            with suppress(IntegrationError, StepWarning):  # the blocks will say so
                made.result()

    def submit(self, task: Task) -> None:
        """Begin a block as soon as a worker is free."""
        self._sent += 1
        key = f"orbits-{self._run}-{task.stem}-{self._sent}"
        future: Any = self._client.submit(_work, task, pure=False, key=key)
        self._futures[task.number] = future
        future.add_done_callback(lambda done: self._done.put((task.number, done)))

    def result(self, timeout: float) -> Result | None:
        """Return a block that is done, or None after a while. Raises OrbitsError if the cluster is gone."""
        try:
            number, future = self._done.get(timeout=timeout)
        except queue.Empty:
            self._require_scheduler()
            return None
        if number not in self._futures or self._futures[number] is not future:
            return None
        try:
            outcome = future.result(timeout=1.0)
        except (TimeoutError, self._distributed.TimeoutError):  # lost with its worker, and computed again
            self._done.put((number, future))
            self._require_scheduler()
            return None
        except Exception as error:
            del self._futures[number]
            if type(error).__name__ == LOST_TOO_OFTEN:
                return number, None
            if "Cancelled" in type(error).__name__:
                self._require_scheduler()
                return number, None
            return number, error
        del self._futures[number]
        return number, outcome

    def fractions(self) -> float:
        """Return 0: what workers have reached is not known before a block is done."""
        return 0.0

    def stop(self, why: str) -> None:
        """Stop the blocks that are being integrated; those that wait are withdrawn."""
        with suppress(Exception):  # workers may be gone
            self._client.run(_note_stop, self._run, why, on_error="return")

    def close(self) -> None:
        """Withdraw what is left, and leave the cluster as it was."""
        futures, self._futures = list(self._futures.values()), {}
        with suppress(Exception):
            self._client.cancel(futures)
        if self._own:
            with suppress(Exception):
                self._client.close(timeout=2)

    def _workers(self) -> dict[str, int]:
        """Return the addresses of the workers with their threads."""
        return dict(self._client.nthreads())

    def _require_scheduler(self) -> None:
        """Raise OrbitsError if the scheduler is gone, or all workers for a while."""
        now = time.monotonic()
        if now - self._looked < BETWEEN and self._client.status == "running":
            return
        self._looked, there = now, False
        with suppress(Exception):  # a scheduler that does not answer
            there = self._client.status == "running" and bool(self._workers())
        if there:
            self._seen = now
        elif self._client.status == "running" and now - self._seen < ABSENCE:
            return
        elif self._client.status == "running":
            raise OrbitsError(
                f"no Dask worker has been there for {ABSENCE:g} s. All blocks that were done are kept; start workers, "
                "and the same call goes on with the others."
            )
        else:
            raise OrbitsError(
                "the Dask scheduler is gone. All blocks that were done are kept; start a cluster, and the same call "
                "goes on with the others."
            )

    def _checked(self) -> dict[str, str]:
        """Return a worker of each machine. Raises InputError unless there are workers, of the same versions as here."""
        try:
            self._client.wait_for_workers(1, timeout=ARRIVAL)
        except (TimeoutError, self._distributed.TimeoutError):
            address = self._client.scheduler.address
            raise InputError(
                f"the Dask scheduler at {address} has no workers; start some: dask worker {address}"
            ) from None
        found = self._client.run(eval, QUESTION, on_error="return")
        hosts: dict[str, str] = {}
        wrong: list[str] = []
        for worker, known in found.items():
            if isinstance(known, BaseException):
                wrong.append(f"{worker} cannot load orbits ({type(known).__name__}: {known})")
                continue
            for key in SAME:
                if known.get(key) != self._made_by[key]:
                    wrong.append(f"{worker} has {said(key, known.get(key), self._made_by[key])}")
            if not known["ensemble"]:
                wrong.append(f"{worker} has orbits {known.get('orbits')} without orbits.ensemble")
            hosts.setdefault(known["host"], worker)
        if wrong:
            more = f"; and {len(wrong) - 4} more" if len(wrong) > 4 else ""
            raise InputError(
                f"workers differ from this process, so that their results would too: {'; '.join(wrong[:4])}{more}. "
                "Install the same versions on all of them."
            )
        return hosts


def distributed_package() -> Any:
    """Return the package `distributed`. Raises MissingPackageError, saying how it is installed."""
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise MissingPackageError(
            f"client=... needs Dask's package distributed, which cannot be imported ({error}); install it with: "
            "pip install 'orbits[distributed]'. Threads and processes need nothing: leave client out."
        ) from error


def _client(distributed: Any, given: Any) -> tuple[Any, bool]:
    """Return a client, and whether it is to be closed. Raises InputError if there is none."""
    if isinstance(given, distributed.Client):
        if given.asynchronous:
            raise InputError("client is asynchronous; expected distributed.Client(...) without asynchronous=True.")
        if given.status != "running":
            raise InputError(f"client is {given.status}; expected one that is connected to a scheduler.")
        return given, False
    if isinstance(given, distributed.deploy.Cluster):
        given = given.scheduler_address
    if not isinstance(given, str):
        raise InputError(
            f"client is {shown(given)}; expected a distributed.Client, or the address of a scheduler: 'tcp://host:8786'."
        )
    try:
        return _connected(distributed, given), True
    except (OSError, TimeoutError, distributed.TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler answers at {given} (asked for {PATIENCE:g} s). Start one with 'dask scheduler', and "
            "workers with 'dask worker ADDRESS'; or leave client out, for threads of this machine."
        ) from error
    except (ValueError, TypeError) as error:
        raise InputError(f"client = {given!r} is no address ({error}); expected 'tcp://host:8786'.") from error


def _connected(distributed: Any, address: str) -> Any:
    """Return a client of the scheduler at an address; one that does not connect is closed here.

    Left to the garbage collector, it would be closed in whatever that interrupts: in the start of another client, it
    would wait forever for a lock that is held there.
    """
    made: Any = object.__new__(distributed.Client)
    try:
        made.__init__(address, timeout=PATIENCE, set_as_default=False)
    except BaseException:
        with suppress(Exception):
            made.close(timeout=2)
        raise
    return made


def _work(task: Task) -> Outcome:
    """Integrate a block, on a worker."""
    warnings.filterwarnings("ignore", category=OrbitsWarning)  # those of a block come with its outcome
    out = remote(task, lambda: _STOPPED.get(task.run, ""))
    with suppress(Exception):
        out.worker = _name_of_worker()
    return out


def _note_stop(run: str, why: str) -> None:
    """Note, on a worker, that a run was stopped."""
    _STOPPED[run] = why


def _name_of_worker() -> str:
    worker: Callable[[], Any] = importlib.import_module("distributed").get_worker
    return str(worker().address)
