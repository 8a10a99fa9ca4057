"""Zeros of functions along the motion within steps.

A function is checked at both ends of each step and at eight nodes between them, with its slope. A change of sign
between two checks brackets a zero. Without one, slopes towards zero at both checks bracket an extremum, which is found;
if the function has the other sign there, it brackets two zeros. A function with at most one extremum between two checks
therefore has all its zeros found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.marching.motion import Motion
from orbits.propagation.events.base import Array, Bound, Whole

NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(8)[0]

APART = 1e-5
"""The distance of two checks that give a slope, as a fraction of a step."""

CLOSE = 1e-15
"""The width of a bracket at which a zero is found, as a fraction of a step."""

CLOSE_EXTREMUM = 1e-8
"""The same for an extremum, of whose square the value is off."""

ROUNDS = 200

POINTS = 2_000_000
"""The most numbers that the function has at a time."""


class NotFiniteError(ArithmeticError):
    """A function is not finite: its value, and the time of the state."""

    def __init__(self, time: float, value: float) -> None:
        super().__init__(time, value)
        self.time, self.value = time, value


class Zeros(NamedTuple):
    """Zeros: the number and the fraction of the step of each, its column, and whether the function rises in time."""

    steps: Whole
    fractions: Array
    columns: Whole
    rising: NDArray[np.bool_]


States = Callable[[Whole, Array], tuple[Array, Array, Array]]
"""Returns t (m,), q and v (m, n, 3) of all bodies at fractions of steps."""


class Stretch:
    """The motion of all bodies in consecutive steps.

    motion : of the massive bodies; massive : (n,), which of the bodies these are
    """

    def __init__(self, motion: Motion, massive: NDArray[np.bool_]) -> None:
        self._motion, self._massive = motion, massive
        self.times = motion.times

    def __len__(self) -> int:
        return len(self._motion)

    def at(self, steps: Whole, fractions: Array) -> tuple[Array, Array, Array]:
        """Return t (m,), q and v (m, n, 3) at fractions of steps."""
        lengths = self.times[steps + 1] - self.times[steps]
        return self.times[steps] + fractions * lengths, *self._of_all(*self._motion.at(steps, fractions))

    def ends(self) -> tuple[Array, Array, Array]:
        """Return t (steps + 1,), q and v at the ends of the steps, as they were marched."""
        n = int(self._massive.sum())
        path = self._motion.path[:, :, : 3 * n].reshape(-1, 2, 3, n).transpose(0, 1, 3, 2)
        return self.times, *self._of_all(path[:, 0], path[:, 1])

    def _of_all(self, q: Array, v: Array) -> tuple[Array, Array]:
        if self._massive.all():
            return q, v
        every = np.full((2, len(q), len(self._massive), 3), np.nan)
        every[0][:, self._massive], every[1][:, self._massive] = q, v
        return every[0], every[1]


def zeros(bound: Bound, stretch: Stretch, first: bool) -> Zeros:
    """Return the zeros of a function in a stretch, in the order of steps; each counts once, also one at a check.

    first : whether the stretch is at the start of a run, where a zero does not count
    Raises NotFiniteError.
    """
    backwards = bool(stretch.times[-1] < stretch.times[0])
    ends = stretch.ends()
    columns = bound.near(*ends)
    steps_at_once = max(1, POINTS // (20 * max(1, len(columns))))
    found = []
    for begin in range(0, len(stretch) if len(columns) else 0, steps_at_once):
        steps = np.arange(begin, min(begin + steps_at_once, len(stretch)))
        found.append(_in_steps(bound, stretch, ends, steps, columns, backwards, first and begin == 0))
    if not found:
        nothing = np.zeros(0, dtype=np.int64)
        return Zeros(nothing, np.zeros(0), nothing, np.zeros(0, dtype=bool))
    return Zeros(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _in_steps(
    bound: Bound,
    stretch: Stretch,
    ends: tuple[Array, Array, Array],
    steps: Whole,
    columns: Whole,
    backwards: bool,
    first: bool,
) -> Zeros:
    """Return the zeros of these columns in these steps."""
    # The checks of each step: its begin and the nodes, the same a little later, and its end.
    checks = np.concatenate([[0.0], NODES])
    fractions = np.concatenate([checks, checks + APART, [1.0 - APART, 1.0]])
    count, each = len(steps), len(fractions)
    t, q, v = stretch.at(np.repeat(steps, each), np.tile(fractions, count))
    g = bound.values(t, q, v, columns).reshape(count, each, -1)
    t_end, q_end, v_end = (x[steps[-1] + 1 :][:1] for x in ends)
    last = bound.values(t_end, q_end, v_end, columns)
    _check_finite(bound, np.concatenate([g.reshape(-1, len(columns)), last]), np.concatenate([t, t_end]))

    size = len(checks)
    before = g[:, :size]
    # The end of a step is the begin of the next one, as it was marched: no zero falls in between, or counts twice.
    after = np.concatenate([before[:, 1:], np.concatenate([before[1:, 0], last])[:, None]], axis=1)
    slope = g[:, size : 2 * size] - before
    slope_after = np.concatenate([slope[:, 1:], (g[:, -1] - g[:, -2])[:, None]], axis=1)
    positive, positive_after = before >= 0.0, after >= 0.0
    if first:
        start = before[0, 0] == 0.0
        positive[0, 0, start] = g[0, size, start] >= 0.0
    falls, rises = positive & ~positive_after, ~positive & positive_after
    turns = positive & positive_after & (slope < 0.0) & (slope_after > 0.0)
    turns |= ~positive & ~positive_after & (slope > 0.0) & (slope_after < 0.0)
    if backwards:
        falls, rises = rises, falls
    crossings = (falls if bound.words[0] is not None else False) | (rises if bound.words[1] is not None else False)

    edges = np.append(checks, 1.0)

    def brackets(where: NDArray[np.bool_]) -> tuple[Whole, Whole, Array, Array, Array, Array]:
        k, i, c = np.nonzero(where)
        return steps[k], columns[c], edges[i], edges[i + 1], before[k, i, c], after[k, i, c]

    k, c, low, high, g_low, g_high = brackets(crossings)
    turn_k, turn_c, *limits = brackets(turns)
    if len(turn_k):
        middle, g_middle = _extrema(_along(bound, stretch), turn_k, turn_c, *limits)
        two = (g_middle >= 0.0) != (limits[2] >= 0.0)
        (low2, high2, g_low2, g_high2), middle, g_middle = (x[two] for x in limits), middle[two], g_middle[two]
        both = np.concatenate([turn_k[two]] * 2), np.concatenate([turn_c[two]] * 2)
        k, c = np.concatenate([k, both[0]]), np.concatenate([c, both[1]])
        low, high = np.concatenate([low, low2, middle]), np.concatenate([high, middle, high2])
        g_low, g_high = np.concatenate([g_low, g_low2, g_middle]), np.concatenate([g_high, g_middle, g_high2])
    rising = (g_low < 0.0) != backwards
    wanted = np.array([word is not None for word in bound.words])[rising.astype(int)]
    k, c, rising = k[wanted], c[wanted], rising[wanted]
    low, high, g_low, g_high = low[wanted], high[wanted], g_low[wanted], g_high[wanted]
    along = _along(bound, stretch)
    at = _root(lambda x, which: along(k[which], x, c[which]), low, high, g_low, g_high, CLOSE)
    order = np.lexsort((c, at, k))
    return Zeros(k[order], at[order], c[order], rising[order])


def _along(bound: Bound, stretch: Stretch) -> Callable[[Whole, Array, Whole], Array]:
    """Return the function of a column at a fraction of a step."""

    def along(steps: Whole, fractions: Array, columns: Whole) -> Array:
        t, q, v = stretch.at(steps, fractions)
        g = bound.at(t, q, v, columns)
        _check_finite(bound, g, t)
        return g

    return along


def _check_finite(bound: Bound, g: Array, t: Array) -> None:
    if not np.isfinite(g).all():
        rows = ~np.isfinite(g.reshape(len(t), -1)).all(axis=1)
        row = int(np.argmax(rows))
        value = g.reshape(len(t), -1)[row]
        raise NotFiniteError(float(t[row]), float(value[~np.isfinite(value)][0]))


def _extrema(
    along: Callable[[Whole, Array, Whole], Array],
    steps: Whole,
    columns: Whole,
    low: Array,
    high: Array,
    g_low: Array,
    g_high: Array,
) -> tuple[Array, Array]:
    """Return where functions are least, or largest if they are negative, and their values there.

    The search for one ends early at a place where the function has the other sign.
    """
    sign = np.where(g_low >= 0.0, 1.0, -1.0)
    best, g_best = low.copy(), np.abs(g_low)

    def slope(x: Array, which: Whole) -> Array:
        apart = APART * (high - low)[which]
        three = np.concatenate([x - apart, x, x + apart])
        g = along(np.tile(steps[which], 3), three, np.tile(columns[which], 3)).reshape(3, -1) * sign[which]
        lower = g[1] < g_best[which]
        best[which[lower]], g_best[which[lower]] = x[lower], g[1][lower]
        found = g[2] - g[0]
        found[g[1] < 0.0] = 0.0  # the other sign: an answer
        return np.asarray(found)

    _root(slope, low, high, -np.ones(len(low)), np.ones(len(low)), CLOSE_EXTREMUM)
    return best, sign * g_best


def _root(
    function: Callable[[Array, Whole], Array], low: Array, high: Array, f_low: Array, f_high: Array, close: float
) -> Array:
    """Return a zero of each function in its bracket, all at once.

    function : of places and of the numbers of the functions; f_low, f_high : at the ends, of different signs
    Source: Chandrupatla (1997), Adv. Eng. Software 28, 145: inverse quadratic interpolation where it is safe, else
    bisection.
    """
    a, b, fa, fb = high.copy(), low.copy(), f_high.copy(), f_low.copy()
    c, fc = a.copy(), fa.copy()
    fraction = np.full(len(a), 0.5)
    found = np.where(np.abs(fa) < np.abs(fb), a, b)
    going = np.flatnonzero((fa != 0.0) & (fb != 0.0))
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
        tolerance = 2.0 * np.finfo(np.float64).eps * np.abs(least) + close
        going = i[(fa[i] != 0.0) & (width > tolerance)]
        j = going
        with np.errstate(all="ignore"):
            xi, phi = (a[j] - b[j]) / (c[j] - b[j]), (fa[j] - fb[j]) / (fc[j] - fb[j])
            alpha = (c[j] - a[j]) / (b[j] - a[j])
            step = fa[j] / (fb[j] - fa[j]) * fc[j] / (fb[j] - fc[j])
            step += alpha * fa[j] / (fc[j] - fa[j]) * fb[j] / (fc[j] - fb[j])
            safe = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(step)
            least_step = 0.5 * close / np.abs(b[j] - a[j])
        fraction[j] = np.clip(np.where(safe, step, 0.5), least_step, 1.0 - least_step)
    return found
