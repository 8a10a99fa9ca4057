"""Distances at which a run ends, found where the march stops as a pair of bodies may come to one within a step.

Compiled code looks at all pairs after each block, and only excludes (`orbits.kernels.search.stopping`). A step that is
left is halved again and again, on the motion of the run itself, until no pair can come to its bound within a part, or
the part is so short that the distance has at most one extremum in it; then a zero is found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orbits.kernels.search.stopping import ANY, CLOSER, KIND
from orbits.propagation.events.base import Array, Sample, Whole
from orbits.propagation.events.kinds.of_pairs import Distance, rounding_of
from orbits.propagation.events.search import root

if TYPE_CHECKING:
    from orbits.marching.marcher import Marcher
    from orbits.system import System

DETOUR = 2.0
"""How much longer the way of a pair in a part of a step may be than by its speed at the faster end; a parabolic fall
onto a mass needs 1.5."""

STRAIGHT = 0.5
"""The way of a pair in a part of a step, as a share of its distance, in which this has at most one extremum."""

SHORTEST = 2.0**-50
"""The shortest part of a step that is halved, as a fraction of the step."""

POLISHED = 2
"""The steps of Newton's method from a zero that is known to 1e-9 of its bracket, to one that is known to round-off."""


class Passed(NamedTuple):
    """Where a pair passes its bound: the number of the function, its column, and the time."""

    number: int
    column: int
    time: float


class Stops:
    """The pairs of bodies whose distances end a run.

    bounds : the functions, by their numbers
    sought : (kind, first body, second body) of each, with `ANY` for a body without a name

    rows : as the march looks for them, (functions, 4); see `orbits.kernels.search.stopping`
    """

    def __init__(self, bounds: Mapping[int, Distance], sought: Mapping[int, tuple[int, int, int]]) -> None:
        self.bounds = bounds
        self.rows = np.array([[*sought[k], bound.distance**2] for k, bound in bounds.items()], dtype=np.float64)

    def may_end(self, marcher: Marcher, end: Sample) -> bool:
        """Return whether a pair may pass its bound between the state of the march and another."""
        within = _Within(marcher, end, -math.inf)
        return any(within.may_reach(bound).any() for bound in self.bounds.values())

    def first(self, marcher: Marcher, end: Sample, known: float) -> Passed | None:
        """Return where a pair first passes its bound between the state of the march and another, less than a step
        ahead; None if none does.

        known : the time up to which this is known, in the direction of the run
        """
        within = _Within(marcher, end, known)
        found: list[Passed] = []
        for (number, bound), kind in zip(self.bounds.items(), self.rows[:, KIND], strict=True):
            sign = 1.0 if kind == CLOSER else -1.0
            for column in np.flatnonzero(within.may_reach(bound)):
                fraction = within.first(bound.pairs[column], bound.distance, sign)
                if fraction is not None:
                    found.append(Passed(number, int(column), within.time(fraction)))
        return min(found, key=lambda one: abs(one.time - marcher.time), default=None)


class _Within:
    """The motion of all bodies from the state of a march to another, computed by partial steps and kept."""

    def __init__(self, marcher: Marcher, end: Sample, known: float) -> None:
        self._marcher, self._begun, self._length = marcher, marcher.time, end.time - marcher.time
        self._states: dict[float, tuple[Array, Array]] = {1.0: (end.q, end.v)}
        passed = (known - self._begun * math.copysign(1.0, self._length)) / abs(self._length)
        self._from = min(max(passed, 0.0), 1.0)
        self._is_start = self._begun == 0.0

    def time(self, fraction: float) -> float:
        """Return a time."""
        return self._begun + fraction * self._length

    def may_reach(self, bound: Distance) -> Array:
        """Return which pairs may come to their bound, by their ways at most."""
        if self._from == 1.0:
            return np.zeros(len(bound.pairs), dtype=bool)
        distances, speeds = [], []
        for fraction in (self._from, 1.0):
            q, v = self._at(fraction)
            first, second = bound.pairs.T
            distances.append(np.linalg.norm(q[first] - q[second], axis=1))
            speeds.append(np.linalg.norm(v[first] - v[second], axis=1))
        way = DETOUR * abs(self._length) * (1.0 - self._from) * np.maximum(*speeds)
        return np.asarray(np.abs(0.5 * (distances[0] + distances[1]) - bound.distance) <= way)

    def first(self, pair: Whole, bound: float, sign: float) -> float | None:
        """Return where the distance of a pair less its bound, times a sign, first falls through zero, and beyond what
        rounding does. A pair that begins a run at its bound must have left it before.
        """
        parts = [(self._from, 1.0)]
        noise = rounding_of(bound, self._at(0.0)[0][pair])
        waits = self._is_start and self._from == 0.0 and abs(self._of(pair, 0.0)[0] - bound) <= noise
        while parts:
            low, high = parts.pop()
            (d, rate, speed), (d_end, rate_end, speed_end) = (self._of(pair, x) for x in (low, high))
            way = (high - low) * abs(self._length) * max(speed, speed_end)
            if not abs(0.5 * (d + d_end) - bound) <= DETOUR * way:
                continue
            if way > STRAIGHT * min(d, d_end) and high - low > SHORTEST:
                middle = 0.5 * (low + high)
                parts += [(middle, high), (low, middle)]
                continue
            above, above_end = sign * (d - bound), sign * (d_end - bound)
            if sign * rate < 0.0 < sign * rate_end and (above >= 0.0) and above_end >= 0.0:
                high = _zero(lambda x: self._of(pair, x)[1], low, high)
            elif sign * rate > 0.0 > sign * rate_end and above < 0.0 and above_end < 0.0:
                low = _zero(lambda x: self._of(pair, x)[1], low, high)
            above, above_end = (sign * (self._of(pair, x)[0] - bound) for x in (low, high))
            if waits:
                waits = abs(above_end) <= noise
            elif above >= -noise and above_end < -noise:
                return self._passage(pair, bound, low, high) if above > 0.0 else low
        return None

    def _passage(self, pair: Whole, bound: float, low: float, high: float) -> float:
        """Return where the distance is a bound, between two places on both sides of it."""
        x = _zero(lambda x: self._of(pair, x)[0] - bound, low, high)
        for _ in range(POLISHED):
            d, rate, _ = self._of(pair, x)
            step = (d * d - bound * bound) / (2.0 * rate) if rate else 0.0
            x = min(max(x - step, low), high)
        return x

    def _of(self, pair: Whole, fraction: float) -> tuple[float, float, float]:
        """Return the distance of a pair, half the slope of its square along the step, and its speed."""
        q, v = (x[pair[0]] - x[pair[1]] for x in self._at(fraction))
        return float(np.linalg.norm(q)), float(q @ v) * self._length, float(np.linalg.norm(v))

    def _at(self, fraction: float) -> tuple[Array, Array]:
        if fraction not in self._states:
            self._states[fraction] = self._marcher.state_after(fraction * self._length)
        return self._states[fraction]


def pairs_that_stop(system: System, one: int, two: int) -> Whole:
    """Return the pairs of bodies, one of them with mass, that two numbers mean, (pairs, 2); `ANY` for any body."""
    massive, everyone = np.flatnonzero(system.massive), np.arange(len(system))
    if ANY not in (one, two):
        return np.array([[one, two]] if system.massive[[one, two]].any() else [], dtype=np.intp).reshape(-1, 2)
    one, two = (one, two) if one != ANY else (two, one)
    if one == ANY:
        first, second = np.repeat(everyone, len(massive)), np.tile(massive, len(everyone))
        once = ~system.massive[first] | (first < second)
        first, second = first[once], second[once]
    else:
        others = everyone if two == ANY and system.massive[one] else massive if two == ANY else np.array([two])
        first, second = np.full(len(others), one), others
    wanted = (first != second) & (system.massive[first] | system.massive[second])
    first, second = first[wanted], second[wanted]
    gm = system.values.gm
    lighter = gm[first] <= gm[second]
    return np.stack([np.where(lighter, first, second), np.where(lighter, second, first)], axis=1)


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Return a zero between two places, where the signs differ."""
    values = (np.array([function(x)]) for x in (low, high))
    along = root(lambda s, _: np.array([function(low + float(s[0]) * (high - low))]), np.zeros(1), np.ones(1), *values)
    return low + float(along[0]) * (high - low)
