"""Which steps of a map on Kepler orbits lead massless particles through passages that it cannot follow.

A step is one of an encounter with a planet if the straight line along the relative velocity, from the state at its
beginning forwards or from that at its end backwards, comes within the larger of two distances: four Hill radii, and
`ways` times the way in a step relative to the planet. The second is where kicks at the ends of steps are too far apart
to add up to the attraction on the way past it: the sum over points in distances of L, of the attraction in a straight
passage at a distance b, is off by about exp(-2 pi b / L) of itself.

A step is one of a pericentre if h v / r, about the dominant body, is above a part of its bound at either end, and at
the pericentre of the osculating orbit above the bound.

Everything depends on the states at the ends of a step alone, to the last bit, wherever this is compiled: no sum of
products here can be rounded in two ways.

Source: Rauch & Holman (1999), AJ 117, 1087; Chambers (1999), MNRAS 304, 793; Wisdom (2015), AJ 150, 127.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import any_lane, fma, full, lane, load, maximum, minimum, sqrt
from orbits.kernels.search.apsides import apsides

HILL2, WAYS2 = 0, 1
"""Rows of `Rules.near`: (four Hill radii / distance from the dominant body)^2 of each body, and `ways`^2."""

LEAST2, MOST2, FASTEST2 = 0, 1, 2
"""Rows of `Rules.extent`: the squares of the least and largest distance of each body from the dominant one in a block,
and of its largest speed relative to it."""

EARLY = 0.5
"""The fraction of the bound at which a particle leaves the map before a pericentre that the step does not resolve."""

AWAY_AGAIN = 1.1
"""The factor by which distances must be larger for a particle to come back."""

TINY = 1e-300


class Rules(NamedTuple):
    """What decides about a step.

    near : (2, n), see `HILL2`; a body with zeros has no encounters
    extent : (3, n), see `LEAST2`, of the block at hand
    path : flat, the states of the n bodies at the beginning of each step of a block and at its end, each vector padded
        to `stride`
    dominant : the number of the dominant body; mu : its GM; h : length of a step; angle : the bound of h v / r
    """

    near: Any
    extent: Any
    path: Any
    stride: Any
    dominant: Any
    mu: Any
    h: Any
    angle: Any


class Seen(NamedTuple):
    """Positions and velocities of eight particles, as observers see them."""

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any


@kernel(inline=True)
def seen_at(track, k):
    """Return the particles that a track has at the beginning of step k."""
    row = 6 * k
    return Seen(
        load(track, row), load(track, row + 1), load(track, row + 2),
        load(track, row + 3), load(track, row + 4), load(track, row + 5),
    )  # fmt: skip


@kernel(inline=True)
def squared(x, y, z):
    """Return the square of a vector's length."""
    return fma(z, z, fma(y, y, x * x))


@kernel(inline=True)
def _relative(rules, k, j, seen):
    """Return position and velocity of eight particles relative to body j at the beginning of step k."""
    n, a = rules.near.shape[1], 2 * k * rules.stride + j
    b = a + rules.stride
    return (
        seen.x - rules.path[a], seen.y - rules.path[a + n], seen.z - rules.path[a + 2 * n],
        seen.vx - rules.path[b], seen.vy - rules.path[b + n], seen.vz - rules.path[b + 2 * n],
    )  # fmt: skip


@kernel(inline=True)
def _distance2(rules, k, j):
    """Return the squared distance of body j from the dominant one at the beginning of step k."""
    n, a, c = rules.near.shape[1], 2 * k * rules.stride + j, 2 * k * rules.stride + rules.dominant
    x, y, z = (
        rules.path[a] - rules.path[c],
        rules.path[a + n] - rules.path[c + n],
        rules.path[a + 2 * n] - rules.path[c + 2 * n],
    )
    return squared(x, y, z)


@kernel(inline=True)
def meets(rules, k, j, seen, ahead, margin):
    """Return in which lanes the straight line from the states at the beginning of step k, through a step forwards for
    `ahead` = 1 or backwards for -1, comes too close to planet j; margin : a factor of the distances, squared.
    """
    x, y, z, u, v, w = _relative(rules, k, j, seen)
    d2, fall = squared(x, y, z), ahead * rules.h * fma(z, w, fma(y, v, x * u))
    way2 = rules.h * rules.h * squared(u, v, w)
    near2 = maximum(full(rules.near[HILL2, j] * _distance2(rules, k, j)), rules.near[WAYS2, j] * way2)
    s = minimum(maximum(-fall / (way2 + TINY), full(0.0)), full(1.0))
    return fma(s, fma(s, way2, 2.0 * fall), d2) < margin * near2


@kernel(inline=True)
def falls(rules, k, seen, margin):
    """Return in which lanes a step from or to the states at the beginning of step k is one of a pericentre that it does
    not resolve; margin : a factor of the square of the bound.
    """
    x, y, z, u, v, w = _relative(rules, k, rules.dominant, seen)
    r2, v2 = squared(x, y, z), squared(u, v, w)
    h2, angle2 = rules.h * rules.h, rules.angle * rules.angle * margin
    near = h2 * v2 > EARLY * EARLY * angle2 * r2
    if any_lane(near):
        orbit = apsides(rules.mu, x, y, z, u, v, w)
        # v / r at the pericentre is swept / least^2.
        near = near * (h2 * orbit.swept2 > angle2 * orbit.least * orbit.least * orbit.least * orbit.least)
    return near


@kernel
def measure_bodies(rules, steps):
    """Write `extent`, of the states of a block of `steps` steps."""
    n, path, out = rules.near.shape[1], rules.path, rules.extent
    for j in range(n):
        least, most, fastest = 1e300, 0.0, 0.0
        for k in range(steps + 1):
            r2 = _distance2(rules, k, j)
            a = (2 * k + 1) * rules.stride + j
            c = a - j + rules.dominant
            u, v, w = path[a] - path[c], path[a + n] - path[c + n], path[a + 2 * n] - path[c + 2 * n]
            least, most, fastest = min(least, r2), max(most, r2), max(fastest, squared(u, v, w))
        out[LEAST2, j], out[MOST2, j], out[FASTEST2, j] = least, most, fastest


@kernel
def _may_meet(rules, j, track, steps):
    """Return whether any of eight particles may come too close to planet j in a block, as none does whose distance at
    the ends of all steps is large enough: with a, b the two parts of the least one, (a + b)^2 <= 7/5 a^2 + 7/2 b^2.
    """
    hill2, more = 1.4 * rules.near[HILL2, j] * rules.extent[MOST2, j], 1.0 + rules.near[WAYS2, j] ** 0.5
    part, found = 3.5 * (rules.h * more) * (rules.h * more), full(0.0)
    for k in range(steps + 1):
        x, y, z, u, v, w = _relative(rules, k, j, seen_at(track, k))
        found = found + (squared(x, y, z) < fma(full(part), squared(u, v, w), full(hill2)))
    return any_lane(found)


@kernel
def encountering(rules, track, steps):
    """Return in which lanes a block of steps of eight particles has one of an encounter or of a pericentre that is not
    resolved; NaN, of particles that are not there, has none.
    """
    least, most, fastest, sharp = full(1e300), full(0.0), full(0.0), full(0.0)
    h2, bound = rules.h * rules.h, (EARLY * rules.angle) ** 2
    for k in range(steps + 1):
        seen = seen_at(track, k)
        x, y, z, u, v, w = _relative(rules, k, rules.dominant, seen)
        r2, v2 = squared(x, y, z), squared(u, v, w)
        least, most, fastest = minimum(least, r2), maximum(most, r2), maximum(fastest, v2)
        sharp = sharp + (h2 * v2 > 0.999 * bound * r2)
    found = full(0.0)
    if any_lane(sharp):
        for k in range(steps + 1):
            found = found + falls(rules, k, seen_at(track, k), 1.0)
    least, most, fastest = sqrt(least), sqrt(most), sqrt(fastest)
    for j in range(rules.near.shape[1]):
        hill2, ways2 = rules.near[HILL2, j], rules.near[WAYS2, j]
        if hill2 == 0.0 and ways2 == 0.0:
            continue
        inner, outer = rules.extent[LEAST2, j] ** 0.5, rules.extent[MOST2, j] ** 0.5
        # No line of a step from where a particle is leads further than its way in it.
        way = abs(rules.h) * (fastest + rules.extent[FASTEST2, j] ** 0.5)
        reach = 1.001 * ((1.0 + ways2**0.5) * way + hill2**0.5 * outer)
        if not any_lane((least < outer + reach) * (most > inner - reach)):
            continue
        if not _may_meet(rules, j, track, steps):
            continue
        for k in range(steps + 1):
            seen = seen_at(track, k)
            if k < steps:
                found = found + meets(rules, k, j, seen, 1.0, 1.0)
            if k > 0:
                found = found + meets(rules, k, j, seen, -1.0, 1.0)
    return found > 0.0


@kernel
def encounters_in(rules, k, before, after):
    """Return in which lanes step k, which led from one state to another, is one that the map cannot follow."""
    found = falls(rules, k, before, 1.0) + falls(rules, k + 1, after, 1.0)
    for j in range(rules.near.shape[1]):
        if rules.near[HILL2, j] != 0.0 or rules.near[WAYS2, j] != 0.0:
            found = found + meets(rules, k, j, before, 1.0, 1.0) + meets(rules, k + 1, j, after, -1.0, 1.0)
    return found > 0.0


@kernel
def may_return(rules, k, seen, slot):
    """Return whether the map can take the particle in a lane from the beginning of step k on."""
    margin = AWAY_AGAIN * AWAY_AGAIN
    found = falls(rules, k, seen, 1.0 / margin)
    for j in range(rules.near.shape[1]):
        if rules.near[HILL2, j] != 0.0 or rules.near[WAYS2, j] != 0.0:
            found = found + meets(rules, k, j, seen, 1.0, margin)
    return lane(found, slot) == 0.0
