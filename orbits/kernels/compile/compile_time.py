"""How long this process has compiled kernels, and who is told when it begins and ends."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from numba.core import event

from orbits.kernels.compile.dispatcher import Compiled


class CompileTime(event.Listener):
    """Measures the compiling of kernels, but for what is found in the cache.

    A kernel is compiled within the kernel that calls it: only the outermost counts.

    told : called with True when compiling begins, and with False when it ends
    """

    def __init__(self) -> None:
        self.told: list[Callable[[bool], None]] = []
        self._within, self._total, self._begun = 0, 0.0, 0.0

    def seconds(self) -> float:
        """Return the seconds so far."""
        return self._total + (time.perf_counter() - self._begun if self._within else 0.0)

    def on_start(self, event: Any) -> None:
        """Take note that a kernel is being compiled."""
        if not isinstance(event.data["dispatcher"], Compiled):
            return
        self._within += 1
        if self._within == 1:
            self._begun = time.perf_counter()
            self._tell(True)

    def on_end(self, event: Any) -> None:
        """Take note that a kernel is compiled, or cannot be."""
        if not isinstance(event.data["dispatcher"], Compiled):
            return
        self._within -= 1
        if self._within == 0:
            self._total += time.perf_counter() - self._begun
            self._tell(False)

    def _tell(self, begins: bool) -> None:
        for told in self.told:
            told(begins)


compile_time = CompileTime()
event.register("numba:compile", compile_time)
