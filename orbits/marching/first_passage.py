"""Where within a step the distance of two bodies first passes a bound, on the motion of the run itself.

A step is halved again and again until the pair cannot come to its bound within a part, or the part is so short that the
distance has at most one extremum in it; then a zero is found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.marching.roots import newton

Array = NDArray[np.float64]
State = tuple[Array, Array]

ROUNDINGS = 16.0
"""The units in the last place of the coordinate farthest from the origin to which a distance is exact."""

DETOUR = 2.0
"""How much longer the way of a pair in a part of a step may be than by its speed at the faster end; a parabolic fall
onto a mass needs 1.5."""

STRAIGHT = 0.5
"""The way of a pair in a part of a step, as a share of its distance, in which this has at most one extremum."""

SHORTEST = 2.0**-50
"""The shortest part of a step that is halved, as a fraction of the step up to its end: what a massless body does may
take any fraction of a step of massive ones."""

SPACING = 2.0**-14
"""The fraction of a step between positions of which differences are taken."""

SETTLED = 1e-9
"""The step of Newton's method, as a fraction of a part in which a pair moves by at most half its distance, after which
none is needed. What is left is the square of it: below round-off, also where a pair only just passes its bound.
"""


def rounding_of(distance: float, q: Array) -> float:
    """Return by how much the distance of bodies at q, (n, 3), must differ from another one to be told from it."""
    return ROUNDINGS * float(np.finfo(np.float64).eps) * (distance + float(np.abs(q).max()))


def may_pass(distances: Array, speeds: Array, length: float, bound: float) -> Array:
    """Return whether distances may come to a bound in a part of a step of this length, by their ways at most.

    distances, speeds : (2, ...), at both ends
    """
    way = DETOUR * abs(length) * np.maximum(*speeds)
    return np.asarray(np.abs(0.5 * (distances[0] + distances[1]) - bound) <= way)


class Within:
    """The motion of bodies in a step, by partial steps, each of which is computed once.

    length : of the step; before, after : q and v at its ends, (n, 3) each
    at : returns them at a fraction of it; NaN where they are not known
    moves_otherwise : whether partial steps move bodies otherwise than by their velocities
    """

    def __init__(
        self, length: float, before: State, after: State, at: Callable[[float], State], moves_otherwise: bool = False
    ) -> None:
        self.length, self._at, self._moves_otherwise = length, at, moves_otherwise
        self._states = {0.0: before, 1.0: after}

    def state(self, part: float) -> State:
        """Return q and v at a fraction of the step."""
        if part not in self._states:
            self._states[part] = self._at(part)
        return self._states[part]

    def motion(self, part: float) -> State:
        """Return q and its rate at a fraction of the step."""
        q, v = self.state(part)
        if not self._moves_otherwise or part == 0.0:
            return q, v
        middle = min(max(part, SPACING), 1.0 - SPACING)
        first, second, third = (self.state(middle + k * SPACING)[0] for k in (-1, 0, 1))
        bend = (part - middle) / SPACING * (third - 2.0 * second + first)
        return q, (0.5 * (third - first) + bend) / (SPACING * self.length)

    def first_passage(self, one: int, other: int, bound: float, **how: Any) -> float | None:
        """Return where the distance of two bodies first passes a bound; see `first_passage`."""

        def apart(part: float) -> State:
            q, v = self.motion(part)
            return q[other] - q[one], v[other] - v[one]

        return first_passage(apart, self.length, bound, **how)


def first_passage(
    apart: Callable[[float], tuple[Array, Array]],
    length: float,
    bound: float,
    *,
    sign: float = 1.0,
    part: tuple[float, float] = (0.0, 1.0),
    noise: float = 0.0,
    waits: bool = False,
) -> float | None:
    """Return the fraction of a step at which a distance less its bound, times a sign, first falls through zero, and by
    more than `noise`; None if it does not.

    apart : returns the relative position and velocity at a fraction, (3,) each; NaN where they are not known
    length : of the step; part : of it that is searched
    waits : whether the pair begins at its bound, and must have left it before
    """

    def of(s: float) -> tuple[float, float, float]:
        """Return the distance, half the slope of its square along the step, and the speed."""
        q, v = apart(s)
        return float(np.linalg.norm(q)), float(q @ v) * length, float(np.linalg.norm(v))

    parts = [part]
    while parts:
        low, high = parts.pop()
        (d, rate, speed), (d_end, rate_end, speed_end) = of(low), of(high)
        is_known, way = not math.isnan(d_end), (high - low) * abs(length) * max(speed, speed_end)
        if math.isnan(d) or (is_known and not abs(0.5 * (d + d_end) - bound) <= DETOUR * way):
            continue
        if not (is_known and way <= STRAIGHT * min(d, d_end)) and high - low > SHORTEST * high:
            middle = 0.5 * (low + high)
            parts += [(middle, high), (low, middle)]
            continue
        above, above_end = sign * (d - bound), sign * (d_end - bound)
        if sign * rate < 0.0 < sign * rate_end and (above >= 0.0) and above_end >= 0.0:
            high = _extremum(of, low, high)
        elif sign * rate > 0.0 > sign * rate_end and above <= 0.0 and above_end < 0.0:
            low = _extremum(of, low, high)
        above, above_end = (sign * (of(s)[0] - bound) for s in (low, high))
        if waits:
            waits = abs(above_end) <= noise
        elif above >= -noise and above_end < -noise:
            return _passage(of, bound, low, high) if above > 0.0 else low
    return None


def _passage(of: Callable[[float], tuple[float, float, float]], bound: float, low: float, high: float) -> float:
    """Return where a distance is a bound, between two places on both sides of it."""
    (d, _, _), (d_end, _, _) = of(low), of(high)
    rises = -1.0 if d > bound else 1.0

    def beyond(s: float) -> tuple[float, float]:
        d, rate, _ = of(s)
        return rises * (d * d - bound * bound), rises * 2.0 * rate

    return _zero(beyond, low, high, low + (high - low) * (d - bound) / (d - d_end))


def _extremum(of: Callable[[float], tuple[float, float, float]], low: float, high: float) -> float:
    """Return where a distance is least or largest, between two places of which it falls at one and rises at the other,
    with secants as slopes.
    """
    (_, rate, _), (_, rate_end, _) = of(low), of(high)
    rises, before = math.copysign(1.0, rate_end), [low, rate]

    def falls(s: float) -> tuple[float, float]:
        rate, way = of(s)[1], s - before[0]
        slope = (rate - before[1]) / way if way else 0.0
        before[:] = s, rate
        return rises * rate, rises * slope

    return _zero(falls, low, high, low + (high - low) * rate / (rate - rate_end))


def _zero(function: Callable[[float], tuple[float, float]], low: float, high: float, start: float) -> float:
    """Return the zero of a function that rises between two places, which returns its slope as well."""

    def along(s: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
        value, slope = function(float(s[0]))
        return np.array([value]), np.array([slope])

    ends = np.array([low]), np.array([high]), np.array([start])
    return float(newton(along, *ends, SETTLED * (high - low))[1][0])
