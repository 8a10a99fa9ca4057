"""The stages of a comparison: told before they begin, with a bar on terminals or lines in logs, and kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.propagation.control.heartbeat import Heartbeat, Pulse
from orbits.propagation.control.progress import Progress

Array = NDArray[np.float64]
Arrays = Mapping[str, NDArray[Any]]


def _anew(name: str, compute: Callable[[], Arrays]) -> Arrays:
    return compute()


@dataclass
class Stages:
    """The stages of a comparison.

    say : called with what comes next; progress, heartbeat : as in `propagate`; unit : of time
    keep : called with a name and a function that returns arrays; returns these, or the same of an interrupted run
    now : what is under way
    """

    say: Callable[[str], None] = lambda text: None
    progress: bool | None = False
    heartbeat: Heartbeat | None = None
    unit: Any = ""
    keep: Callable[[str, Callable[[], Arrays]], Arrays] = _anew
    now: str = ""

    def begin(self, what: str) -> None:
        """Say what comes next."""
        self.now = what
        self.say(what)

    def of_run(self, what: str) -> dict[str, Any]:
        """Say which run of this package comes next, and return its options `progress` and `heartbeat`."""
        self.begin(what)
        return {"progress": self.progress, "heartbeat": self.heartbeat}

    @contextmanager
    def under_way(self, what: str, times: Array) -> Iterator[Callable[[float, int], None]]:
        """Say what comes next; what is yielded is to be called with the time reached and the steps so far."""
        self.begin(what)
        end = float(times[-1])
        wanted = self.progress if self.heartbeat is None else False
        bar = Progress(wanted, label=what.partition(":")[0], total=end, unit=self.unit)
        pulse, steps_so_far = Pulse(self.heartbeat, self.unit, end), 0

        def reached(time: float, steps: int) -> None:
            nonlocal steps_so_far
            steps_so_far = steps
            bar.update(time, steps)
            if time and pulse.due:  # nothing is left to be estimated from the start
                pulse.beat(time, steps, ())

        try:
            yield reached
        finally:
            bar.close()
        if pulse.beaten:
            pulse.beat(end, steps_so_far, (), last=True)


QUIET = Stages()
"""Says nothing, and keeps nothing."""


def as_array(text: str) -> NDArray[np.uint8]:
    """Return a text as an array, which is kept as those of numbers are."""
    return np.frombuffer(text.encode(), dtype=np.uint8)


def as_text(array: NDArray[Any]) -> str:
    """Return the text of `as_array`."""
    return array.tobytes().decode()
