"""Brackets of zeros in recorded steps: where a function changes its sign between two checks, or turns towards zero.

A function is checked at both ends of each step and at eight nodes between them, with its slope, on the motion as it was
recorded: functions of pairs by compiled code (`orbits.kernels.search.zeros`), all others here, in arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.search.zeros import Function, Recorded, Room, Weights, brackets_of_pairs
from orbits.marching.stepping.motion import Motion
from orbits.propagation.events.base import NOBODY, Array, Bound, Whole

NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(8)[0]

APART = 1e-5
"""The distance of two checks that give a slope, as a fraction of a step."""

CHECKS = np.concatenate([[0.0], NODES])

FRACTIONS = np.concatenate([CHECKS, CHECKS + APART, [1.0 - APART, 1.0]])
"""Where functions are computed in each step: at its begin and the nodes, a little later, and at its end."""

FASTER = 10.0
"""How many times faster two bodies may become between two checks in a step that resolves their passage."""

PLACES = np.concatenate([NODES, NODES + APART, [APART, 1.0 - APART, 1.0], np.ones(5)])
"""The same for functions that compiled code computes: see `orbits.kernels.search.zeros.PLACES`."""

BRACKETS_AT_ONCE = 1024
"""The brackets for which there is room in a call of compiled code."""

STEPS_AT_ONCE, POINTS = 256, 2_000_000
"""The most steps that are searched at a time, and the most numbers that a function has in them."""


class NotFiniteError(ArithmeticError):
    """A function is not finite: its value, and the time of the state."""

    def __init__(self, time: float, value: float) -> None:
        super().__init__(time, value)
        self.time, self.value = time, value


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


def brackets_of(bounds: Sequence[Bound], stretch: Stretch) -> list[tuple[list[Brackets], NotFiniteError | None]]:
    """Return the brackets of each function in a stretch, in parts, and where it is not finite: they are then those in
    the steps before.
    """
    compiled = {number: how for number, bound in enumerate(bounds) if (how := bound.of_pairs()) is not None}
    found = [
        _brackets_of_pairs(bound, compiled[number], stretch) if number in compiled else []
        for number, bound in enumerate(bounds)
    ]
    others = {k: bound for k, bound in enumerate(bounds) if k not in compiled}
    failed = _add_brackets(others, stretch, found) if others else {}
    return [(parts, failed.get(number)) for number, parts in enumerate(found)]


def _add_brackets(
    bounds: Mapping[int, Bound], stretch: Stretch, found: list[list[Brackets]]
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
                where = columns, slice(begin, begin + finite), stretch.backwards
                found[number].append(_brackets(bound.words, g, g_last, *where))
    return failed


def _finite_steps(g: Array, g_last: Array, t: Array, t_last: Array) -> tuple[int, NotFiniteError | None]:
    """Return in how many steps from the first on a function is finite, also at their ends, and where it is not.

    g : (steps * fractions, columns) at times t; g_last : (1, columns) at the end of the last step
    """
    try:
        check_finite(g, t)
        check_finite(g_last, t_last)
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


def may_come_within(bound: Bound, stretch: Stretch, some: Brackets) -> NDArray[np.bool_]:
    """Return between which checks two bodies may come as close as counts, even if they become `FASTER` in between."""
    may = np.ones(len(some.steps), dtype=bool)
    if bound.within < np.inf and len(may):
        rows, pair = np.arange(len(may)), bound.pairs[some.columns]
        durations = np.abs((some.high - some.low) * np.diff(stretch.times)[some.steps])
        for fractions in (some.low, some.high):
            _, *state = stretch.at(some.steps, fractions, rough=True)
            apart, speed = (np.linalg.norm(x[rows, pair[:, 0]] - x[rows, pair[:, 1]], axis=1) for x in state)
            may &= apart <= bound.within + FASTER * speed * durations
    return may


def _brackets_of_pairs(bound: Bound, how: tuple[int, Array], stretch: Stretch) -> list[Brackets]:
    """Return the brackets in all steps of a function that compiled code computes, in parts.

    how : as `Bound.of_pairs` returns it
    """
    words = bound.words[::-1] if stretch.backwards else bound.words
    wanted, pairs = np.array([word is not None for word in words]), stretch.numbers(bound.pairs)
    lengths, (path, kicks, once, twice), size = stretch.polynomials(slice(0, len(stretch)), PLACES)
    # No more than is needed: a large array is not made at once.
    most = max(BRACKETS_AT_ONCE, (len(NODES) + 1) * len(pairs))
    numbers, places = np.empty((most, 6)), np.empty((most, 3), dtype=np.int64)
    function, weights = Function(*how, wanted), Weights(once, twice, PLACES)
    motion, room = Recorded(lengths, path, kicks, size), Room(np.zeros((3, len(PLACES))), np.zeros((3, len(once))))
    found: list[Brackets] = []
    step = 0
    while step < len(stretch):
        count, step = brackets_of_pairs(function, weights, motion, pairs, step, room, numbers, places)
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
) -> Brackets:
    """Return the brackets in consecutive steps.

    g : (steps * fractions, columns), at `FRACTIONS`; g_last : (1, columns), at the end of the last step, as marched
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
    changes = positive != (after >= 0.0)
    turns = ~changes & np.where(positive, (slope < 0.0) & (slope_after > 0.0), (slope > 0.0) & (slope_after < 0.0))
    for word, falling in zip(words, (True, False), strict=True):
        if word is None:
            changes &= positive != (falling != backwards)
    c, k, i = np.nonzero(changes | turns)
    edges = np.append(CHECKS, 1.0)
    ends = edges[i], edges[i + 1], before[c, k, i], after[c, k, i], slope[c, k, i], slope_after[c, k, i]
    return Brackets(steps.start + k, columns[c], *ends, turns[c, k, i])


def check_finite(g: Array, t: Array) -> None:
    """Raise NotFiniteError, with the first time, if functions are not finite; g : (m, ...) at times t (m,)."""
    if not np.isfinite(g).all():
        rows = ~np.isfinite(g.reshape(len(t), -1)).all(axis=1)
        row = int(np.argmax(rows))
        value = g.reshape(len(t), -1)[row]
        raise NotFiniteError(float(t[row]), float(value[~np.isfinite(value)][0]))
