"""Zeros of functions along the motion within steps.

A function is checked at both ends of each step and at eight nodes between them, with its slope. A change of sign
between two checks brackets a zero. Without one, slopes towards zero at both checks bracket an extremum, which is found;
if the function has the other sign there, it brackets two zeros. A function with at most one extremum between two checks
therefore has all its zeros found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.search.zeros import brackets_of_pairs
from orbits.marching.roots import root
from orbits.marching.stepping.motion import Motion
from orbits.propagation.events.base import NOBODY, Array, Bound, Whole

NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(8)[0]

APART = 1e-5
"""The distance of two checks that give a slope, as a fraction of a step."""

CLOSE = 1e-15
"""How close a zero is found, as a fraction of a step."""

NEAR_ZERO = 0.5
"""An extremum of the rough motion below this share of the function at the checks around it is sought again in the exact
one, which may come to zero where the rough one does not."""

ROUGH_ROUNDS = 10
"""The steps to the zero of a cubic, from which the search begins."""

REFINEMENTS, MISSED = 24, 1e-6
"""The most secants from the rough motion to the exact one, and the step of the last one, as a fraction of a step of the
march, from which on there is no zero.
"""

NEAR_BY = 0.1
"""About how far apart the checks are, as a fraction of a step."""

SETTLED = 1e-9
"""The secant, as a fraction of a step, from which on one that is not half as long as the last is due to rounding."""

STEEP, BISECTIONS = 1e-2, 60
"""A function larger than this share of those at the checks around it, where its zero should be, jumps there; and the
number of bisections after which the place of the jump is known to the last digit."""

POLE = 100.0
"""A function that is so many times as large on both sides of a change of sign as at the checks around it has a pole
there, and no zero: it passes through infinity."""

BESIDE = 0.5
"""How far from its bracket, in units of its width, a zero of the exact motion may lie."""

CHECKS = np.concatenate([[0.0], NODES])

PLACES = np.concatenate([NODES, NODES + APART, [APART, 1.0 - APART, 1.0], np.ones(5)])
"""The same for functions that compiled code computes: see `orbits.kernels.search.zeros.PLACES`."""

FRACTIONS = np.concatenate([CHECKS, CHECKS + APART, [1.0 - APART, 1.0]])
"""Where functions are computed in each step: at its begin and the nodes, a little later, and at its end."""

BRACKETS_AT_ONCE = 1024
"""The brackets for which there is room in a call of compiled code."""

STEPS_AT_ONCE, POINTS = 256, 2_000_000
"""The most steps that are searched at a time, and the most numbers that a function has in them."""


class NotFiniteError(ArithmeticError):
    """A function is not finite: its value, and the time of the state."""

    def __init__(self, time: float, value: float) -> None:
        super().__init__(time, value)
        self.time, self.value = time, value


class Zeros(NamedTuple):
    """Zeros: the number and the fraction of the step of each, its column, whether the function rises in time, and how
    large it is `NEAR_BY`, a fraction of the step away.
    """

    steps: Whole
    fractions: Array
    columns: Whole
    rising: NDArray[np.bool_]
    sizes: Array


Along = Callable[[Whole, Array, Whole], Array]
"""Returns functions at fractions of steps: numbers of the steps, fractions, and columns, (m,) each."""


class Stretch:
    """The motion of all bodies in consecutive steps.

    motion : of the massive bodies; massive : (n,), which of the bodies these are
    needed : (n,), those that matter
    """

    def __init__(self, motion: Motion, massive: NDArray[np.bool_], needed: NDArray[np.bool_]) -> None:
        self._motion, self._massive = motion, massive
        self._rows = np.flatnonzero(needed & massive)
        self._needed = (np.cumsum(massive) - 1)[self._rows]
        self.times = motion.times

    def __len__(self) -> int:
        return len(self._motion)

    def at(self, steps: Whole, fractions: Array, rough: bool = False) -> tuple[Array, Array, Array]:
        """Return t (m,), q and v (m, n, 3) at fractions of steps; see `Motion.roughly_at`."""
        lengths = self._motion.lengths[steps]
        states = self._motion.roughly_at(steps, fractions) if rough else self._motion.at(steps, fractions)
        return self.times[steps] + fractions * lengths, *self._of_all(*states)

    @property
    def backwards(self) -> bool:
        """Whether the steps go back in time."""
        return bool(self.times[-1] < self.times[0])

    def at_checks(self, steps: slice, fractions: Array) -> tuple[Array, Array, Array]:
        """Return t (m,), q and v (m, n, 3) of the bodies that matter at the same fractions of these steps, roughly; NaN
        for those that do not move here.
        """
        begin, length = self.times[:-1][steps], self._motion.lengths[steps]
        t = (begin[:, None] + fractions * length[:, None]).ravel()
        q, v = self._motion.at_checks(steps, fractions, self._needed, self._rows, len(self._massive))
        q[:, ~self._massive] = v[:, ~self._massive] = np.nan
        return t, q, v

    def polynomials(self, steps: slice, fractions: Array) -> tuple[Array, tuple[Array, Array, Array, Array], int]:
        """Return the lengths of these steps, what `Motion.polynomials` returns, and the number of bodies there."""
        return self._motion.lengths[steps], self._motion.polynomials(steps, fractions), int(self._massive.sum())

    def numbers(self, pairs: Whole) -> Whole:
        """Return the numbers of bodies among those that move here, from those in the system."""
        return np.where(pairs == NOBODY, NOBODY, (np.cumsum(self._massive) - 1)[pairs])

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


def zeros_of(bounds: Sequence[Bound], stretch: Stretch, first: bool) -> list[tuple[Zeros, NotFiniteError | None]]:
    """Return the zeros of each function in a stretch, in the order of steps; each counts once, also one at a check. And
    where a function is not finite: its zeros are then those in the steps before.

    first : whether the stretch is at the start of a run, where a zero does not count
    """
    compiled = {number: how for number, bound in enumerate(bounds) if (how := bound.of_pairs()) is not None}
    found = [
        _brackets_of_pairs(bound, compiled[number], stretch, first) if number in compiled else []
        for number, bound in enumerate(bounds)
    ]
    others = {k: bound for k, bound in enumerate(bounds) if bound.sought and k not in compiled}
    failed = _add_brackets(others, stretch, first, found) if others else {}
    answers: list[tuple[Zeros, NotFiniteError | None]] = []
    for number, bound in enumerate(bounds):
        try:
            answers.append((_zeros(bound, stretch, found[number]), failed.get(number)))
        except NotFiniteError as error:
            answers.append((_zeros(bound, stretch, []), failed.get(number, error)))
    return answers


def _add_brackets(
    bounds: Mapping[int, Bound], stretch: Stretch, first: bool, found: list[list[Brackets]]
) -> dict[int, NotFiniteError]:
    """Add the brackets of functions of any kind, and return where any is not finite, by their numbers."""
    t, q, v = stretch.ends()
    failed: dict[int, NotFiniteError] = {}
    most = max(len(bound.pairs) for bound in bounds.values())
    at_once = max(1, min(STEPS_AT_ONCE, POINTS // (len(FRACTIONS) * most)))
    for begin in range(0, len(stretch), at_once):
        steps = slice(begin, min(begin + at_once, len(stretch)))
        states = stretch.at_checks(steps, FRACTIONS)
        start, last = ((t[k : k + 1], q[k : k + 1], v[k : k + 1]) for k in (steps.start, steps.stop))
        for number, bound in bounds.items():
            if number in failed:
                continue
            columns = np.arange(len(bound.pairs))
            g, g_start, g_last = (bound.values(*some, columns) for some in (states, start, last))
            g[:1] = g_start  # as it was marched, and as what is before ends
            finite, failure = _finite_steps(g, g_last, states[0], last[0])
            if failure is not None:
                failed[number] = failure
                g_last, g = g[finite * len(FRACTIONS) :][:1], g[: finite * len(FRACTIONS)]
            if finite:
                where = columns, slice(begin, begin + finite), stretch.backwards, first and begin == 0
                found[number].append(_brackets(bound.words, g, g_last, *where))
    return failed


def _finite_steps(g: Array, g_last: Array, t: Array, t_last: Array) -> tuple[int, NotFiniteError | None]:
    """Return in how many steps from the first on a function is finite, also at their ends, and where it is not.

    g : (steps * fractions, columns) at times t; g_last : (1, columns) at the end of the last step
    """
    try:
        _check_finite(g, t)
        _check_finite(g_last, t_last)
    except NotFiniteError as error:
        rows = np.isfinite(g).all(axis=1).reshape(-1, len(FRACTIONS))
        whole, begins = rows.all(axis=1), rows[:, 0]
        ends = np.append(begins[1:], np.isfinite(g_last).all())
        return int(np.argmin(np.append(whole & ends, False))), error
    return len(g) // len(FRACTIONS), None


class Brackets(NamedTuple):
    """Where zeros, or extrema with two zeros about them, are between two checks: steps and columns, (m,); the fractions
    of both checks, the function there, and what it gains there in `APART`; and whether it is an extremum.
    """

    steps: Whole
    columns: Whole
    low: Array
    high: Array
    g_low: Array
    g_high: Array
    slope_low: Array
    slope_high: Array
    turns: NDArray[np.bool_]

    def of(self, which: NDArray[Any]) -> Brackets:
        """Return some of them, by their numbers or a mask."""
        return Brackets(*(np.asarray(x)[which] for x in self))

    @classmethod
    def joined(cls, parts: Sequence[Brackets]) -> Brackets:
        """Return those of several parts."""
        return cls(*(np.concatenate(some) for some in zip(*parts, strict=True)))


def _brackets_of_pairs(bound: Bound, how: tuple[int, Array], stretch: Stretch, start: bool) -> list[Brackets]:
    """Return the brackets in all steps of a function that compiled code computes, in parts.

    how : as `Bound.of_pairs` returns it; start : whether the first step is that of a run
    """
    words = bound.words[::-1] if stretch.backwards else bound.words
    wanted, pairs = np.array([word is not None for word in words]), stretch.numbers(bound.pairs)
    lengths, (path, kicks, once, twice), size = stretch.polynomials(slice(0, len(stretch)), PLACES)
    # No more than is needed: a large array is not made at once.
    most = max(BRACKETS_AT_ONCE, (len(NODES) + 1) * len(pairs))
    numbers, places = np.empty((most, 6)), np.empty((most, 3), dtype=np.int64)
    room, apart = np.zeros((3, len(PLACES))), np.zeros((3, len(once)))
    found: list[Brackets] = []
    step = 0
    while step < len(stretch):
        motion = lengths, path, kicks, size, pairs, start, room, apart
        count, step = brackets_of_pairs(*how, wanted, once, twice, PLACES, *motion, step, numbers, places)
        which = places[:count].copy()
        low, high, g_low, g_high, slope_low, slope_high = numbers[:count].T.copy()
        turns = which[:, 2] > 0
        found.append(Brackets(which[:, 0], which[:, 1], low, high, g_low, g_high, slope_low, slope_high, turns))
    return found


def _brackets(
    words: tuple[str | None, str | None],
    g: Array,
    g_last: Array,
    columns: Whole,
    steps: slice,
    backwards: bool,
    start: bool,
) -> Brackets:
    """Return the brackets in consecutive steps.

    g : (steps * fractions, columns), at `FRACTIONS`; g_last : (1, columns), at the end of the last step, as marched
    start : whether the first step is that of a run
    """
    size, count = len(CHECKS), steps.stop - steps.start
    g = np.ascontiguousarray(g.T).reshape(len(columns), count, -1)
    before = g[:, :, :size]
    # The end of a step is the begin of the next one, as it was marched: no zero falls in between, or counts twice.
    end = np.concatenate([before[:, 1:, 0], g_last.T], axis=1)
    after = np.concatenate([before[:, :, 1:], end[:, :, None]], axis=2)
    slope = g[:, :, size : 2 * size] - before
    slope_after = np.concatenate([slope[:, :, 1:], (g[:, :, -1] - g[:, :, -2])[:, :, None]], axis=2)
    positive = before >= 0.0
    if start:
        at_zero = before[:, 0, 0] == 0.0
        positive[at_zero, 0, 0] = g[at_zero, 0, size] >= 0.0
    changes = positive != (after >= 0.0)
    turns = ~changes & np.where(positive, (slope < 0.0) & (slope_after > 0.0), (slope > 0.0) & (slope_after < 0.0))
    for word, falling in zip(words, (True, False), strict=True):
        if word is None:
            changes &= positive != (falling != backwards)
    c, k, i = np.nonzero(changes | turns)
    edges = np.append(CHECKS, 1.0)
    ends = edges[i], edges[i + 1], before[c, k, i], after[c, k, i], slope[c, k, i], slope_after[c, k, i]
    return Brackets(steps.start + k, columns[c], *ends, turns[c, k, i])


def _zeros(bound: Bound, stretch: Stretch, found: list[Brackets]) -> Zeros:
    """Return the zeros in brackets. Raises NotFiniteError."""
    if not sum(len(some.steps) for some in found):
        nothing = np.zeros(0, dtype=np.int64)
        return Zeros(nothing, np.zeros(0), nothing, np.zeros(0, dtype=bool), np.zeros(0))
    rough, exact = _along(bound, stretch), _along(bound, stretch, False)
    single, near = _parted(rough, Brackets.joined(found))
    parts = [(rough, single)]
    if len(near.steps):
        parts.append((exact, _parted(exact, near)[0]))
    words = np.array([word is not None for word in bound.words])
    parts = [(along, some.of(words[_rises(some, stretch).astype(int)])) for along, some in parts]
    at, there = (np.concatenate(each) for each in zip(*(_refined(along, exact, p) for along, p in parts), strict=True))
    some = Brackets.joined([each for _, each in parts])
    rising, k, c = _rises(some, stretch), some.steps, some.columns
    sizes = NEAR_BY * np.abs(some.g_high - some.g_low) / (some.high - some.low)
    every = np.flatnonzero(there)
    order = every[np.lexsort((c[there], at[there], k[there]))]
    return Zeros(k[order], at[order], c[order], rising[order], sizes[order])


def _rises(some: Brackets, stretch: Stretch) -> NDArray[np.bool_]:
    """Return whether functions rise in time at their zeros in brackets."""
    return np.asarray((some.g_low < 0.0) != stretch.backwards)


def _parted(along: Along, some: Brackets) -> tuple[Brackets, Brackets]:
    """Return brackets of single zeros: two for each extremum at which a function has the other sign, which are still
    marked as its: the slope at their common end is not known. And those of extrema near zero without another sign.
    """
    around, single = some.of(some.turns), some.of(~some.turns)
    if not len(around.steps):
        return single, around
    where = around.steps, around.columns, around.low, around.high, around.g_low, around.g_high
    middle, g_middle = _extrema(along, *where)
    two = np.where(around.g_low >= 0.0, g_middle < 0.0, g_middle > 0.0)
    near = ~two & (np.abs(g_middle) < NEAR_ZERO * np.minimum(np.abs(around.g_low), np.abs(around.g_high)))
    middle, g_middle = middle[two], g_middle[two]
    left = around.of(two)._replace(high=middle, g_high=g_middle)
    right = around.of(two)._replace(low=middle, g_low=g_middle)
    return Brackets.joined([single, left, right]), around.of(near)


def _rough_zeros(rough: Along, some: Brackets) -> tuple[Array, Array]:
    """Return where functions are about zero in brackets, and their slopes there: from cubics, and about an extremum
    from the rough motion.
    """
    at, slope = _zeros_of_cubics(some)
    turns = np.flatnonzero(some.turns)
    if len(turns):
        own = some.of(turns)
        k, c = own.steps, own.columns
        at[turns] = x = root(lambda x, which: rough(k[which], x, c[which]), own.low, own.high, own.g_low, own.g_high)
        ahead = np.where(x < 0.5, APART, -APART)
        slope[turns] = (rough(k, x + ahead, c) - rough(k, x, c)) / ahead
    return at, slope


def _zeros_of_cubics(some: Brackets) -> tuple[Array, Array]:
    """Return the zeros of cubics through the functions and their slopes at both ends of brackets, and the slopes there.

    By bisection, each step of which is replaced by one of Newton's method if that stays in the bracket.
    """
    width = some.high - some.low
    a, b = some.slope_low * (width / APART), some.slope_high * (width / APART)
    rise = some.g_high - some.g_low
    bend, twist = 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise
    x, below, above = np.full(len(width), 0.5), np.zeros(len(width)), np.ones(len(width))
    slope = rise
    with np.errstate(all="ignore"):
        for _ in range(ROUGH_ROUNDS):
            g = some.g_low + x * (a + x * (bend + x * twist))
            same = (g >= 0.0) == (some.g_low >= 0.0)
            below, above = np.where(same, x, below), np.where(same, above, x)
            slope = a + x * (2.0 * bend + 3.0 * x * twist)
            following = x - g / slope
            x = np.where((following >= below) & (following <= above), following, 0.5 * (below + above))
    return some.low + x * width, slope / width


def _refined(rough: Along, exact: Along, some: Brackets) -> tuple[Array, NDArray[np.bool_]]:
    """Return the zeros of functions of the exact motion in brackets of the rough one, and which there are.

    By Newton's method, and then by secants, from rough zeros and slopes. Functions that jump, or are flat at
    their zero, do not converge: their change of sign is found by bisection. There is no zero where it is a pole.
    """
    if not len(some.steps):
        return np.zeros(0), np.ones(0, dtype=bool)
    k, c, g_low, g_high = some.steps, some.columns, some.g_low, some.g_high
    room = BESIDE * (some.high - some.low)
    low, high = np.maximum(some.low - room, 0.0), np.minimum(some.high + room, 1.0)
    at, slope = _rough_zeros(rough, some)
    g = exact(k, at, c)
    with np.errstate(all="ignore"):
        last = np.where(g == 0.0, 0.0, -g / slope)
    going = np.flatnonzero(np.abs(last) > CLOSE)
    for done in range(REFINEMENTS):
        if not len(going):
            break
        moved = np.clip(at[going] + last[going], low[going], high[going])
        way, before, previous = moved - at[going], g[going], np.abs(last[going])
        at[going], g[going] = moved, exact(k[going], moved, c[going])
        with np.errstate(all="ignore"):
            change = g[going] - before
            slope[going] = np.where((change != 0.0) & (way != 0.0), change / way, slope[going])
            last[going] = np.where(g[going] == 0.0, 0.0, -g[going] / slope[going])
        size = np.abs(last[going])
        # Two zeros beside an extremum may be so close that the first slope is a poor one.
        settled = (size <= SETTLED) & (size >= 0.5 * previous) & (~some.turns[going] | (done > 1))
        going = going[(size > CLOSE) & ~settled]
    # A zero at the end of a step may lie behind it by the difference of the two motions.
    there = np.abs(last) < MISSED
    doubtful = np.flatnonzero(~there | (np.abs(g) > STEEP * np.minimum(np.abs(g_low), np.abs(g_high))))
    if len(doubtful):
        ends = [exact(k[doubtful], x[doubtful], c[doubtful]) for x in (low, high)]
        changes = (ends[0] >= 0.0) != (ends[1] >= 0.0)
        doubtful, positive = doubtful[changes], ends[0][changes] >= 0.0
    if len(doubtful):
        below, above = low[doubtful], high[doubtful]
        for _ in range(BISECTIONS):
            middle = 0.5 * (below + above)
            same = (exact(k[doubtful], middle, c[doubtful]) >= 0.0) == positive
            below, above = np.where(same, middle, below), np.where(same, above, middle)
        sides = [np.abs(exact(k[doubtful], x, c[doubtful])) for x in (below, above)]
        around = np.maximum(np.abs(g_low[doubtful]), np.abs(g_high[doubtful]))
        at[doubtful], there[doubtful] = above, ~(np.minimum(*sides) > POLE * around)
    return at, there


def _along(bound: Bound, stretch: Stretch, rough: bool = True) -> Along:
    """Return the function of a column at a fraction of a step. It raises NotFiniteError where that is no number."""

    def along(steps: Whole, fractions: Array, columns: Whole) -> Array:
        t, q, v = stretch.at(steps, fractions, rough)
        g = bound.at(t, q, v, columns)
        _check_finite(np.where(np.isinf(g), 1.0, g), t)  # a search may meet a pole
        return g

    return along


def _check_finite(g: Array, t: Array) -> None:
    if not np.isfinite(g).all():
        rows = ~np.isfinite(g.reshape(len(t), -1)).all(axis=1)
        row = int(np.argmax(rows))
        value = g.reshape(len(t), -1)[row]
        raise NotFiniteError(float(t[row]), float(value[~np.isfinite(value)][0]))


def _extrema(
    along: Along,
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

    root(slope, low, high, -np.ones(len(low)), np.ones(len(low)))
    return best, sign * g_best
