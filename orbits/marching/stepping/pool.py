"""The threads of a march."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from orbits.errors import InputError


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
