"""Zeros of functions along the motion within steps, from the brackets of the recorded motion to the exact one.

A change of sign between two checks brackets a zero. Without one, slopes towards zero at both checks bracket an
extremum, which is found; if the function has the other sign there, it brackets two zeros. A function with at most one
extremum between two checks therefore has all its zeros found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.marching.roots import newton
from orbits.propagation.events.base import Array, Bound, Whole
from orbits.propagation.events.search.brackets import (
    APART,
    Brackets,
    NotFiniteError,
    Stretch,
    brackets_of,
    check_finite,
)

ROUGHLY = 1e-8
"""How close an extremum is found, as a fraction of a step, whose value is then known to the square of that; and a zero
beside one, on the rough motion."""

CLOSE = 1e-15
"""How close a zero is found, as a fraction of a step."""

NEAR_ZERO = 0.5
"""An extremum of the rough motion below this share of the function at the checks around it is sought again in the exact
one, which may come to zero where the rough one does not."""

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


def zeros_of(bounds: Sequence[Bound], stretch: Stretch) -> list[tuple[Zeros, NotFiniteError | None]]:
    """Return the zeros of each function in a stretch, in the order of steps; each counts once, also one at a check. And
    where a function is not finite: its zeros are then those in the steps before.
    """
    answers: list[tuple[Zeros, NotFiniteError | None]] = []
    for bound, (found, failure) in zip(bounds, brackets_of(bounds, stretch), strict=True):
        try:
            answers.append((_zeros(bound, stretch, found), failure))
        except NotFiniteError as error:
            answers.append((_zeros(bound, stretch, []), failure or error))
    return answers


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
    refined = [_refined(along, exact, p) for along, p in parts]
    some = Brackets.joined([each for _, each in parts])
    whole = _whole_steps(bound, stretch, some, np.concatenate([there for _, there in refined]))
    whole = whole.of(words[_rises(whole, stretch).astype(int)])
    refined.append(_refined(exact, exact, whole))
    at, there = (np.concatenate(each) for each in zip(*refined, strict=True))
    some = Brackets.joined([some, whole])
    rising, k, c = _rises(some, stretch), some.steps, some.columns
    sizes = NEAR_BY * np.abs(some.g_high - some.g_low) / (some.high - some.low)
    every = np.flatnonzero(there)
    order = every[np.lexsort((c[there], at[there], k[there]))]
    return Zeros(k[order], at[order], c[order], rising[order], sizes[order])


def _whole_steps(bound: Bound, stretch: Stretch, some: Brackets, there: NDArray[np.bool_]) -> Brackets:
    """Return the steps at whose ends, as they were marched, a function has different signs, but in which no zero of the
    rough motion led to one: that may be off by more than what the function changes in the step.

    there : which brackets led to zeros
    """
    keys = some.steps * len(bound.pairs) + some.columns
    k, c = np.divmod(np.setdiff1d(keys, keys[there]), len(bound.pairs))
    if not len(k):
        return some.of(k)
    t, q, v = stretch.ends()
    g, g_end = (bound.at(t[i], q[i], v[i], c) for i in (k, k + 1))
    changes = (g >= 0.0) != (g_end >= 0.0)
    k, c, g, g_end = k[changes], c[changes], g[changes], g_end[changes]
    if not len(k):
        return some.of(k)
    exact, low, high = _along(bound, stretch, False), np.zeros(len(k)), np.ones(len(k))
    first, last = (exact(k, x + APART, c) - exact(k, x, c) for x in (low, high - APART))
    return Brackets(k, c, low, high, g, g_end, first, last, np.zeros(len(k), dtype=bool))


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
    middle, g_middle = _extrema(along, around)
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
        rises = np.where(own.g_low >= 0.0, -1.0, 1.0)

        def along(x: Array, which: Whole) -> tuple[Array, Array]:
            k, c, ahead = own.steps[which], own.columns[which], np.where(x < 0.5, APART, -APART)
            g = rough(k, x, c)
            slope[turns[which]] = found = (rough(k, x + ahead, c) - g) / ahead
            return rises[which] * g, rises[which] * found

        _, at[turns] = newton(along, own.low, own.high, 0.5 * (own.low + own.high), ROUGHLY)
    return at, slope


def _zeros_of_cubics(some: Brackets) -> tuple[Array, Array]:
    """Return the zeros of cubics through functions and their slopes at both ends of brackets, and the slopes there."""
    width = some.high - some.low
    a, b = some.slope_low * (width / APART), some.slope_high * (width / APART)
    rise = some.g_high - some.g_low
    bend, twist = 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise
    rises = np.where(some.g_low >= 0.0, -1.0, 1.0)

    def slopes(x: Array, i: Whole) -> Array:
        return np.asarray(a[i] + x * (2.0 * bend[i] + 3.0 * x * twist[i]))

    def cubics(x: Array, i: Whole) -> tuple[Array, Array]:
        g = some.g_low[i] + x * (a[i] + x * (bend[i] + x * twist[i]))
        return rises[i] * g, rises[i] * slopes(x, i)

    _, x = newton(cubics, np.zeros(len(width)), np.ones(len(width)), np.full(len(width), 0.5))
    return some.low + x * width, slopes(x, np.arange(len(x))) / width


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
        check_finite(np.where(np.isinf(g), 1.0, g), t)  # a search may meet a pole
        return g

    return along


def _extrema(along: Along, some: Brackets) -> tuple[Array, Array]:
    """Return where functions are least in brackets, or largest if they are negative, and their values there.

    The search for one ends early at a place where the function has the other sign.
    """
    low, high, sign = some.low, some.high, np.where(some.g_low >= 0.0, 1.0, -1.0)
    best, g_best = low.copy(), np.abs(some.g_low)

    def slopes(x: Array, which: Whole) -> tuple[Array, Array]:
        apart = APART * (high - low)[which]
        three = np.concatenate([x - apart, x, x + apart])
        k, c = np.tile(some.steps[which], 3), np.tile(some.columns[which], 3)
        g = along(k, three, c).reshape(3, -1) * sign[which]
        lower = g[1] < g_best[which]
        best[which[lower]], g_best[which[lower]] = x[lower], g[1][lower]
        slope, bend = g[2] - g[0], g[2] - 2.0 * g[1] + g[0]
        slope[g[1] < 0.0] = 0.0  # the other sign: an answer
        return slope, 2.0 * bend / apart

    newton(slopes, low, high, 0.5 * (low + high), ROUGHLY)
    return best, sign * g_best
