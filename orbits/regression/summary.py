"""A summary of many errors in a few numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def summarize(positions: Mapping[str, float], names: Sequence[str]) -> dict[str, Any]:
    """Return median, 99th percentile and maximum of the errors of `names`, with the name of the maximum."""
    values = np.array([positions[name] for name in names])
    worst = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
    return {
        "median": float(np.median(values)),
        "p99": float(np.percentile(values, 99)),
        "worst": float(values[worst]),
        "name": names[worst],
    }
