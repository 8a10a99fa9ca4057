"""The first collision within a step, to the accuracy of the orbit, by partial steps of the method.

Kernels find steps in which two bodies may touch (`orbits.kernels.collisions`); here the pairs are found, and the time
at which the distance of each falls below the sum of its radii.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.collisions import CONTACT, MARGIN

Array = NDArray[np.float64]
State = tuple[Array, Array]

GRID = np.linspace(0.0, 1.0, 65)
"""Where the cubic between the ends of a step is looked at for a first estimate."""

ITERATIONS = 80


class Impact(NamedTuple):
    """A collision: its time, and the two bodies, the lower number first."""

    time: float
    first: int
    second: int


class Step(NamedTuple):
    """A step of a march: the times and the states at its ends, and `at`, which returns the state at a time within."""

    begin: float
    end: float
    before: State
    after: State
    at: Callable[[float], State]


def impacts(
    step: Step, radii: Array, massive: NDArray[np.bool_], seeks: Callable[[int, int], bool]
) -> list[Impact]:
    """Return the collisions in a step, in the order of time; of those at the same time that of the first bodies first.

    radii : (n,), of all bodies; seeks : whether the collision of two bodies is looked for
    A pair that overlaps at the beginning of the step does not collide in it.
    """
    known: dict[float, State] = {}

    def at(time: float) -> State:
        if time not in known:
            known[time] = step.at(time)
        return known[time]

    found = []
    for i, j in candidates(step, radii, massive):
        time = _time_of(step._replace(at=at), i, j, float(radii[i] + radii[j])) if seeks(i, j) else None
        if time is not None:
            found.append(Impact(time, i, j))
    direction = math.copysign(1.0, step.end - step.begin)
    return sorted(found, key=lambda impact: (impact.time * direction, impact.first, impact.second))


def candidates(step: Step, radii: Array, massive: NDArray[np.bool_]) -> Iterable[tuple[int, int]]:
    """Yield the pairs, the lower number first, that may touch within a step, by the cubic between its ends."""
    h = step.end - step.begin
    (q0, v0), (q1, v1) = step.before, step.after
    numbers = np.arange(len(q0))
    found: set[tuple[int, int]] = set()
    for i in np.flatnonzero(massive).tolist():
        x0, x1, u0, u1 = q0 - q0[i], q1 - q1[i], v0 - v0[i], v1 - v1[i]
        reach = radii + radii[i]
        # As in `orbits.kernels.collisions`: the cubic lies within the hull of its control points.
        after = _squares(u1) * (h * h / 9.0)
        way = np.maximum(_squares(u0) * (h * h / 9.0), 2.0 * _squares(x1 - x0) + 2.0 * after)
        close = ((numbers > i) | ~massive) & (_squares(x0) < 2.0 * reach * reach + 4.0 * way)
        others = numbers[close]
        if not others.size:
            continue
        x0, x1, u0, u1, reach = x0[close], x1[close], u0[close], u1[close], reach[close]
        limit = reach + MARGIN * np.linalg.norm(x1 - x0 - 0.5 * h * (u0 + u1), axis=1)
        outside = np.linalg.norm(x0, axis=1) >= (1.0 - CONTACT) * reach
        ends_inside = np.linalg.norm(x1, axis=1) < limit
        turns = (np.sum(x0 * u0, axis=1) * h < 0.0) & (np.sum(x1 * u1, axis=1) * h >= 0.0)
        for k in np.flatnonzero(outside & (reach > 0.0) & (ends_inside | turns)).tolist():
            j = int(others[k])
            if j != i and (ends_inside[k] or _cubic(x0[k], u0[k], x1[k], u1[k], h).min() < limit[k]):
                found.add((min(i, j), max(i, j)))
    return sorted(found)


def _squares(x: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", x, x))


def _cubic(x0: Array, u0: Array, x1: Array, u1: Array, h: float) -> Array:
    """Return the distances on the cubic between two relative states, at the fractions `GRID`."""
    s = GRID[:, None]
    a, b = x1 - x0 - h * u0, h * (u1 - u0)
    return np.asarray(np.linalg.norm(x0 + s * (h * u0 + s * ((3.0 * a - b) + s * (b - 2.0 * a))), axis=1))


def _time_of(step: Step, i: int, j: int, reach: float) -> float | None:
    """Return the time at which a pair first touches within a step, or None if it does not."""
    begin, end = step.begin, step.end
    h = end - begin

    def gap(s: float) -> tuple[float, float]:
        """Return the distance between the surfaces at a fraction of the step, and how fast it grows."""
        q, v = step.before if s == 0.0 else step.after if s == 1.0 else step.at(begin + s * h)
        x, w = q[j] - q[i], v[j] - v[i]
        d = math.sqrt(float(x @ x))
        return d - reach, float(x @ w) / d * h if d > 0.0 else -math.inf

    (q0, v0), (q1, v1) = step.before, step.after
    shape = _cubic(q0[j] - q0[i], v0[j] - v0[i], q1[j] - q1[i], v1[j] - v1[i], h) - reach
    resolution = 4.0 * float(np.spacing(max(abs(begin), abs(end)))) / abs(h)
    rounding = 4.0 * float(np.spacing(max(np.abs(q1[i]).max(), np.abs(q1[j]).max(), reach)))
    at_begin, at_end = gap(0.0), gap(1.0)
    if at_begin[0] < 0.0 and at_begin[1] < 0.0:
        return None  # it overlapped before
    outside, inside = 0.0, 1.0
    if at_end[0] >= 0.0:
        if not (at_begin[1] < 0.0 <= at_end[1]):
            return None
        nearest = _nearest(gap, float(GRID[int(np.argmin(shape))]), resolution)
        if nearest is None:
            return None
        inside = nearest
    if at_begin[1] > 0.0:  # it leaves first, as after a bounce, and comes back
        while outside == 0.0:
            if inside <= resolution:
                return begin
            if gap(0.5 * inside)[0] > 0.0:
                outside = 0.5 * inside
            else:
                inside *= 0.5
    crossing = np.flatnonzero((shape[:-1] >= 0.0) & (shape[1:] < 0.0) & (GRID[:-1] >= outside))
    guess = float(GRID[crossing[0]]) if crossing.size else 0.5 * (outside + inside)
    return begin + _root(gap, outside, inside, guess, resolution, rounding) * h


def _nearest(gap: Callable[[float], tuple[float, float]], guess: float, resolution: float) -> float | None:
    """Return a fraction of the step at which the pair overlaps, or None if it does not at its closest approach."""
    low, high, s = 0.0, 1.0, min(max(guess, 0.01), 0.99)
    slope_low, slope_high = gap(0.0)[1], gap(1.0)[1]
    for _ in range(ITERATIONS):
        distance, slope = gap(s)
        if distance < 0.0:
            return s
        if slope < 0.0:
            low, slope_low = s, slope
        else:
            high, slope_high = s, slope
        if high - low <= resolution or slope == 0.0:
            return None
        if distance > (high - low) * max(-slope_low, slope_high):  # it falls no faster than at these ends
            return None
        following = low - slope_low * (high - low) / (slope_high - slope_low)
        middle = 0.5 * (low + high)
        narrow = min(following - low, high - following) < 0.01 * (high - low)
        s = middle if narrow or not low < following < high else following
    return None


def _root(
    gap: Callable[[float], tuple[float, float]],
    outside: float,
    inside: float,
    guess: float,
    resolution: float,
    rounding: float,
) -> float:
    """Return where the gap vanishes between a fraction outside and one inside, by Newton's method within bounds."""
    s = guess if outside < guess < inside else 0.5 * (outside + inside)
    for _ in range(ITERATIONS):
        distance, slope = gap(s)
        if distance >= 0.0:
            outside = s
        else:
            inside = s
        following = s - distance / slope if slope < 0.0 else math.nan
        if abs(distance) <= rounding or inside - outside <= resolution:
            return s
        if not outside < following < inside:
            following = 0.5 * (outside + inside)
        if abs(following - s) <= resolution:
            return following
        s = following
    return s


def overlapping(
    q: Array, radii: Array, massive: NDArray[np.bool_], share: float = 1.0, of: int | None = None
) -> Iterator[tuple[int, int]]:
    """Yield the pairs that are closer than `share` times the sum of their radii, (n, 3) and (n,), nearest first.

    of : a massive body, if only pairs with it are looked for
    """
    found = []
    numbers = np.arange(len(q)) if of is None else np.full(len(q), of + 1)
    for i in np.flatnonzero(massive).tolist() if of is None else [of]:
        distance, reach = np.linalg.norm(q - q[i], axis=1), radii + radii[i]
        others = ((numbers > i) | ~massive) & (distance < share * reach) & (reach > 0.0)
        near = [j for j in np.flatnonzero(others).tolist() if j != i]
        found += [(float(distance[j] / reach[j]), min(i, j), max(i, j)) for j in near]
    yield from ((i, j) for _, i, j in sorted(found))
