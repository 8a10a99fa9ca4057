"""What is said while kernels are compiled: on a terminal, a line that counts the seconds; in the log of a command, one
line.
"""

from __future__ import annotations

import sys
import threading
from typing import Protocol

from orbits.kernels.compile.compile_time import compile_time

PATIENCE = 0.5
"""Seconds of compiling before anything is said: what is compiled in less needs no words."""

PAUSE = 0.25
"""Seconds from one look at the clock to the next."""

ERASED = "\r\033[K"
"""What erases a line of a terminal."""


class Shown(Protocol):
    """A progress bar, which shows the words instead of a line of their own."""

    def say(self, text: str) -> None:
        """Show a text until the bar is updated."""


class Words:
    """Says how long this process has compiled so far.

    bar : the progress bar that is on the terminal, or None
    in_logs : whether a line is said where there is no terminal
    """

    def __init__(self) -> None:
        self.bar: Shown | None = None
        self.in_logs = False
        self._speaking = threading.Lock()
        self._ended = threading.Event()
        self._line, self._logged = False, False

    def told(self, begins: bool) -> None:
        """Begin to look at the clock when compiling begins, and erase the line when it ends."""
        import multiprocessing

        if multiprocessing.parent_process() is not None:
            return
        if begins:
            self._ended = threading.Event()
            threading.Thread(target=self._look, args=(self._ended,), daemon=True).start()
            return
        with self._speaking:
            self._ended.set()
            if self._line:
                sys.stderr.write(ERASED)
                sys.stderr.flush()
            self._line = False

    def _look(self, ended: threading.Event) -> None:
        while not ended.wait(PAUSE):
            with self._speaking:
                if not ended.is_set() and compile_time.seconds() >= PATIENCE:
                    self._say()

    def _say(self) -> None:
        if self.bar is not None:
            self.bar.say(so_far())
        elif sys.stderr.isatty():
            self._line = True
            sys.stderr.write(ERASED + so_far())
            sys.stderr.flush()
        elif self.in_logs and not self._logged:
            self._logged = True
            print("compiling for this machine, once; later runs find it in the cache", file=sys.stderr, flush=True)


def so_far() -> str:
    """Return the words, with the seconds so far."""
    return f"compiling for this machine, once: {compile_time.seconds():.0f} s so far …"


words = Words()
compile_time.told.append(words.told)
