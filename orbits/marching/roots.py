"""The root finders of searches within a step: zeros of many functions at once, with their slopes and without."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROUGHLY = 1e-9
"""The width of a bracket in which a zero is known. An extremum is known to the square of that: in its value."""

ROUNDS, TINY = 200, np.finfo(np.float64).tiny
"""The most rounds of the search for a zero, and what a zero at the end of its bracket counts as."""

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


def root(
    function: Callable[[Array, NDArray[np.intp]], Array], low: Array, high: Array, f_low: Array, f_high: Array
) -> Array:
    """Return a zero of each function in its bracket, roughly, all at once.

    function : of places and of the numbers of the functions; f_low, f_high : at the ends, of different signs
    Source: Chandrupatla (1997), Adv. Eng. Software 28, 145: inverse quadratic interpolation where it is safe, else
    bisection.
    """
    # Zeros count as positive numbers, also at the ends: there may be another one between them.
    a, b, fa, fb = high.copy(), low.copy(), *(np.where(f == 0.0, TINY, f) for f in (f_high, f_low))
    c, fc = a.copy(), fa.copy()
    fraction = np.full(len(a), 0.5)
    found = np.where(np.abs(fa) < np.abs(fb), a, b)
    going = np.arange(len(a))
    for _ in range(ROUNDS):
        if not len(going):
            break
        i = going
        x = a[i] + fraction[i] * (b[i] - a[i])
        fx = function(x, i)
        same = (fx >= 0.0) == (fa[i] >= 0.0)
        c[i], fc[i] = np.where(same, a[i], b[i]), np.where(same, fa[i], fb[i])
        b[i], fb[i] = np.where(same, b[i], a[i]), np.where(same, fb[i], fa[i])
        a[i], fa[i] = x, fx
        width = np.abs(b[i] - a[i])
        least = np.where(np.abs(fa[i]) <= np.abs(fb[i]), a[i], b[i])
        found[i] = least
        going = i[(fa[i] != 0.0) & (width > ROUGHLY)]
        j = going
        with np.errstate(all="ignore"):
            xi, phi = (a[j] - b[j]) / (c[j] - b[j]), (fa[j] - fb[j]) / (fc[j] - fb[j])
            alpha = (c[j] - a[j]) / (b[j] - a[j])
            step = fa[j] / (fb[j] - fa[j]) * fc[j] / (fb[j] - fc[j])
            step += alpha * fa[j] / (fc[j] - fa[j]) * fb[j] / (fc[j] - fb[j])
            safe = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(step)
            least_step = 0.5 * ROUGHLY / np.abs(b[j] - a[j])
        fraction[j] = np.clip(np.where(safe, step, 0.5), least_step, 1.0 - least_step)
    return found
