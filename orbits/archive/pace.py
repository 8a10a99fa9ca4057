"""How fast a run goes, as an array of its checkpoints: from it readers know when the run will be done."""

from __future__ import annotations

import math
import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

PACE = "pace"
"""The array of a checkpoint, (4,) float64, with the fields of `Pace`; zeros in the checkpoint of a start."""


class Pace(NamedTuple):
    """When a run was begun or resumed last, and how far it was then and at the commit with this checkpoint.

    begun, committed : seconds since 1970, by the clock of the machine
    start, reached : times since the epoch of the run, in its unit
    """

    begun: float = 0.0
    start: float = 0.0
    committed: float = 0.0
    reached: float = 0.0

    @classmethod
    def from_now(cls, start: float) -> Pace:
        """Return that of a run that is begun, or resumed, at this moment and at this time of it."""
        return cls(time.time(), start, 0.0, start)

    def now(self, reached: float) -> Pace:
        """Return that of a commit at this moment."""
        return self._replace(committed=time.time(), reached=reached)

    def encoded(self) -> NDArray[np.float64]:
        """Return the array for the checkpoint."""
        return np.array(self, dtype="<f8")

    @property
    def rate(self) -> float:
        """The time that the run covers in a second of wall time, > 0; NaN where that is not known."""
        seconds, covered = self.committed - self.begun, abs(self.reached - self.start)
        return covered / seconds if seconds > 0.0 and covered > 0.0 else math.nan


def pace_in(checkpoint: dict[str, NDArray[Any]] | None) -> Pace:
    """Return the pace in a checkpoint; that of nothing, for one of an earlier version or without a meaning."""
    data = None if checkpoint is None else checkpoint.get(PACE)
    if data is None or data.dtype != np.float64 or data.shape != (4,) or not np.isfinite(data).all():
        return Pace()
    return Pace(*data.tolist())
