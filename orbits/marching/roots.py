"""The root finder of searches within a step: zeros of many functions at once, with rough slopes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROUNDS = 200
"""The most rounds of the search for a zero."""

PRECISION = 1e-13
"""The step of Newton's method, as a fraction of a step of the march, after which a zero is known."""

ROUNDED = 1e-11
"""Steps below this that do not become smaller from round to round are round-off: the zero is as good as it can be."""


def newton(
    function: Callable[[Array, NDArray[np.intp]], tuple[Array, Array]],
    low: Array,
    high: Array,
    start: Array,
    settled: float = PRECISION,
) -> tuple[Array, Array]:
    """Return the last places at which functions were computed on the way to their zeros, and the next ones, by Newton's
    method within brackets, which are halved where it leaves them.

    function : of places and of the numbers of the functions; returns values, which rise through zero between `low` and
        `high`, and slopes, which may be rough
    start : places to begin with; settled : the last step
    """
    low, high, at = low.copy(), high.copy(), start.copy()
    following, step, going = at.copy(), np.full(len(at), np.inf), np.arange(len(at))
    for _ in range(ROUNDS):
        i = going
        f, slope = function(at[i], i)
        low[i], high[i] = np.where(f < 0.0, at[i], low[i]), np.where(f < 0.0, high[i], at[i])
        middle = 0.5 * (low[i] + high[i])
        with np.errstate(all="ignore"):
            after = np.where(f == 0.0, at[i], np.where(slope > 0.0, at[i] - f / slope, middle))
        before, step[i] = step[i], np.abs(after - at[i])
        stalls = (step[i] >= before) & (step[i] < ROUNDED)
        done = (step[i] <= settled) | stalls
        inside = (low[i] < after) & (after < high[i])
        following[i] = np.where(done, np.clip(after, low[i], high[i]), np.where(inside, after, middle))
        going = i[~done & ~(high[i] - low[i] <= settled)]
        if not len(going):
            break
        at[going] = following[going]
    return at, following
