"""Where within a step the distance of two bodies first passes a bound, on the motion of the run itself.

A step is halved again and again until the pair cannot come to its bound within a part, or the part is so short that the
distance has at most one extremum in it; then a zero is found.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from orbits.marching.roots import newton, root

Array = NDArray[np.float64]

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
            high = _zero(lambda s: of(s)[1], low, high)
        elif sign * rate > 0.0 > sign * rate_end and above <= 0.0 and above_end < 0.0:
            low = _zero(lambda s: of(s)[1], low, high)
        above, above_end = (sign * (of(s)[0] - bound) for s in (low, high))
        if waits:
            waits = abs(above_end) <= noise
        elif above >= -noise and above_end < -noise:
            return _passage(of, bound, low, high) if above > 0.0 else low
    return None


def _passage(of: Callable[[float], tuple[float, float, float]], bound: float, low: float, high: float) -> float:
    """Return where a distance is a bound, between two places on both sides of it, by Newton's method within these."""
    (d, _, _), (d_end, _, _) = of(low), of(high)
    rises = -1.0 if d > bound else 1.0

    def beyond(s: Array, _: NDArray[np.intp]) -> tuple[Array, Array]:
        d, rate, _speed = of(float(s[0]))
        return np.array([rises * (d * d - bound * bound)]), np.array([rises * 2.0 * rate])

    start = low + (high - low) * (d - bound) / (d - d_end)
    ends = np.array([low]), np.array([high]), np.array([start])
    return float(newton(beyond, *ends, SETTLED * (high - low))[1][0])


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Return a zero between two places, where the signs differ."""
    values = (np.array([function(s)]) for s in (low, high))
    along = root(lambda x, _: np.array([function(low + float(x[0]) * (high - low))]), np.zeros(1), np.ones(1), *values)
    return low + float(along[0]) * (high - low)
