"""How a run ended, as text in a checkpoint: finished, stopped by an event, a condition or a callback, or failed."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

ENDED = "ended"
"""The array of a checkpoint with this text, as JSON in UTF-8; zeros while the run goes on."""

BYTES = 1024
STOPPED, FAILED, INTERRUPTED = "stopped", "failed", "interrupted"


@dataclass(frozen=True)
class Ended:
    """How a run ended; by default it has not.

    finished : whether it came to its end; time : at which it ended, since the epoch
    how : "stopped", "failed" or "interrupted", if it was; why : in words
    """

    finished: bool = False
    time: float | None = None
    how: str = ""
    why: str = ""

    def encoded(self) -> NDArray[np.uint8]:
        """Return it as an array of a checkpoint; a long text is cut."""
        text, why = json.dumps(asdict(self)), self.why
        while len(text) > BYTES:
            why = why[: -max(1, len(why) // 8)]
            text = json.dumps(asdict(replace(self, why=f"{why}...")))
        data = np.zeros(BYTES, dtype=np.uint8)
        data[: len(text)] = np.frombuffer(text.encode(), dtype=np.uint8)
        return data


def ended_in(checkpoint: dict[str, NDArray[Any]] | None) -> Ended:
    """Return how the run of a checkpoint ended; not at all, for one of an earlier version or without a meaning."""
    data = None if checkpoint is None else checkpoint.get(ENDED)
    if data is None or data.dtype != np.uint8 or not data.any():
        return Ended()
    try:
        found = Ended(**json.loads(data.tobytes().rstrip(b"\0").decode()))
    except (ValueError, TypeError, RecursionError):
        return Ended()
    texts = isinstance(found.how, str) and isinstance(found.why, str) and isinstance(found.finished, bool)
    timed = found.time is None or (isinstance(found.time, float) and math.isfinite(found.time))
    return found if texts and timed else Ended()
