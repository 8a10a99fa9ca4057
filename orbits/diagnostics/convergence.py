"""Measured orders of convergence, with the round-off plateau and the steps before the asymptotic regime cut off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slope:
    """The slope of log(error) against log(h), and the points that it was fitted to.

    order : NaN where fewer than three points lie between the plateau and the regime of long steps
    """

    order: float
    h: tuple[float, ...]
    errors: tuple[float, ...]


def slope(h: Sequence[float], errors: Sequence[float], *, floor: float, ceiling: float, most: int = 5) -> Slope:
    """Fit the errors that lie between `floor` and `ceiling`, at most `most` of them, those of the shortest steps."""
    x, y = np.asarray(h, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    order = np.argsort(x)
    x, y = x[order], y[order]
    keep = np.flatnonzero(np.isfinite(y) & (y > floor) & (y < ceiling))[:most]
    if len(keep) < 3:
        return Slope(float("nan"), tuple(map(float, x[keep])), tuple(map(float, y[keep])))
    fitted = float(np.polyfit(np.log(x[keep]), np.log(y[keep]), 1)[0])
    return Slope(fitted, tuple(map(float, x[keep])), tuple(map(float, y[keep])))
