"""Stopping a run between blocks of steps: Ctrl-C, SIGTERM and SIGHUP are recorded instead of acting immediately."""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # `signal` makes enums of numbers and handlers, in 50 microseconds
import signal
import threading
from types import FrameType, TracebackType
from typing import Any

CAUGHT = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class StopRequest:
    """A context in which the first of the signals sets `name`; a second SIGINT interrupts immediately.

    Signals that the process ignores, such as SIGHUP under nohup, stay ignored. Outside the main thread, where Python
    delivers no signals, the context does nothing.
    """

    def __init__(self) -> None:
        self.name = ""
        self._before: dict[int, Any] = {}

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            # A handler that was not installed from Python reads as None, and could not be restored.
            for number in CAUGHT:
                if _signal.getsignal(number) not in (None, _signal.SIG_IGN):
                    self._before[number] = _signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            _signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.name and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
