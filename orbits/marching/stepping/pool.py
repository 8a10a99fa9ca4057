"""The threads of a march."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from orbits.errors import InputError


class Pool(ThreadPoolExecutor):
    """Threads, with a clear error if the system does not grant as many as requested."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a function in a thread. Raises InputError if no further thread can be started."""
        try:
            return super().submit(fn, *args, **kwargs)
        except RuntimeError as error:
            if self._shutdown:
                raise
            raise InputError(
                f"threads = {self._max_workers}: the system grants this process no more than {len(self._threads)} "
                f"({error}); expected that many or fewer, or None for one on each processor."
            ) from error
