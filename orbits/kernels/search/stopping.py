"""What may end a run in a block of steps: pairs that may come to a bound within one, and the energy after it."""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.gravity.pair_sums import pair_potential
from orbits.kernels.lanes import (
    WIDTH,
    any_lane,
    full,
    lane,
    largest,
    load,
    maximum,
    minimum,
    select,
    sqrt,
    store,
    unit,
)
from orbits.kernels.search.context import watch_at
from orbits.kernels.search.paths import eight_relative, least_distance, relative, steps_between, steps_within

ANY, TINY, LONG = -1, 1e-300, 1e18
CLOSER, FARTHER = 0, 1
KIND, FIRST, SECOND, BOUND2 = 0, 1, 2, 3
"""Columns of `stops`: CLOSER or FARTHER, two rows (or ANY of them), the distance squared."""

BENT, COARSE, MOST = 1.0 / 48.0, 1e-3, 0.5
"""The error of the cubic as a share of the way in a step: at least `COARSE`, and `BENT` times the cube of the angle by
which the motion turns, eight times that on a circle; at most `MOST`, with which no step is passed over by a pair that
goes astray in it."""


DETOUR = 2.0
"""How much farther a body may move than by the largest of its speeds at the ends of the steps on its way; a parabolic
fall onto a mass needs 1.5."""


@kernel(inline=True)
def _concerns(stops, c, rows, j):
    """Return to which of eight rows and body j condition c applies."""
    a, b = stops[c, FIRST], stops[c, SECOND]
    every, none = full(1.0), full(0.0)
    one = (every if a == ANY else 1.0 * (rows == a)) * (every if b in (ANY, j) else none)
    other = (every if b == ANY else 1.0 * (rows == b)) * (every if a in (ANY, j) else none)
    return one + other > 0.0


@kernel(inline=True)
def _stays_away(closer, bound2, h, first, second):
    """Return which of eight pairs are too far from a bound to come to it between two states that are h apart; see
    `_may_cross`. Their distances change by their ways, and (a + b)^2 <= 2 (a^2 + b^2).
    """
    x, y, z, u, v, w = first
    d2, speed2 = x * x + y * y + z * z, u * u + v * v + w * w
    x, y, z, u, v, w = second
    e2, speed2 = x * x + y * y + z * z, maximum(speed2, u * u + v * v + w * w)
    reach2 = (1.0 + MOST) ** 2 * h * h * speed2
    if closer:
        return minimum(d2, e2) > 2.0 * (bound2 + reach2)
    return 2.0 * (maximum(d2, e2) + reach2) < bound2


@kernel(inline=True)
def _may_cross(watch, track, closer, bound, row, j, step, h):
    """Return whether a pair may come to a bound in a step of h."""
    first, second = relative(watch, track, row, j, step), relative(watch, track, row, j, step + 1)
    (x, y, z, u, v, w), (x1, y1, z1, u1, v1, w1) = first, second
    begin, end = math.sqrt(x * x + y * y + z * z), math.sqrt(x1 * x1 + y1 * y1 + z1 * z1)
    before, now = (x * u + y * v + z * w) * h, (x1 * u1 + y1 * v1 + z1 * w1) * h
    speed2, other2 = u * u + v * v + w * w, u1 * u1 + v1 * v1 + w1 * w1
    turn2 = ((u1 - u) ** 2 + (v1 - v) ** 2 + (w1 - w) ** 2) / (min(speed2, other2) + TINY)
    share = min(COARSE + BENT * turn2 * math.sqrt(turn2), MOST)
    margin = share * abs(h) * math.sqrt(max(speed2, other2))
    if closer:
        nearest = min(begin, end)
        if before < 0.0 <= now:
            nearest = math.sqrt(least_distance(watch, track, row, j, step, h)[0])
        return nearest - margin < bound and bound <= max(begin, end) + margin
    farthest = max(begin, end)
    if now < 0.0 < before:  # to where the tangents of the distance at both ends meet
        rise, fall = before / begin, now / end
        farthest += max(begin + rise * (end - begin - fall) / (rise - fall) - farthest, 0.0)
    return bound < farthest + margin and min(begin, end) - margin <= bound


@kernel(inline=True)
def _first_of_eight(context, track, h, found, c, j, row, valid, fastest):
    """Return `found`, a number of steps, or an earlier one in the last of which body j and one of the eight rows from
    `row` on whose lane is 1 in `valid` may first come to the bound of condition c.

    fastest : the largest speeds of the rows in this block, in lanes, in the frame of `_speeds_of_bodies`
    """
    watch = watch_at(context)
    bound2 = watch.stops[c, BOUND2]
    closer, bound = watch.stops[c, KIND] == CLOSER, math.sqrt(bound2)
    way = DETOUR * abs(h) * (fastest + watch.speeds[j]) + TINY
    k = 0
    while k < found - 1:
        first = eight_relative(watch, track, j, row, k)
        x, y, z, _, _, _ = first
        gap = sqrt(x * x + y * y + z * z) - bound
        gap = maximum(gap, -gap)
        # The time, in steps of h, in which none of the pairs comes to the bound, by their ways at most.
        ahead = -largest(-select(valid * (gap >= 0.0) > 0.0, gap / way, full(LONG)))
        if steps_between(watch, h, k, k + 1) <= ahead:
            k += steps_within(watch, h, k, found - 1, ahead)
            continue
        second = eight_relative(watch, track, j, row, k + 1)
        length = h * steps_between(watch, h, k, k + 1)
        close = valid * (1.0 - _stays_away(closer, bound2, length, first, second))
        k += 1
        if any_lane(close):
            for i in range(WIDTH):
                if lane(close, i) != 0.0 and _may_cross(watch, track, closer, bound, row + i, j, k - 1, length):
                    return k
    return found


@kernel
def _speeds_of_bodies(watch, steps):
    """Write the largest speeds of the massive bodies at the ends of the steps of a block into `watch.speeds`, in the
    frame of one of them, and of the dominant one if there is one: they are bounds of relative speeds in any frame.
    """
    n, P, path, speeds, centre = watch.bodies, watch.stride, watch.path, watch.speeds, max(watch.dominant, 0)
    for first in range(0, n, WIDTH):
        most2 = full(0.0)
        for step in range(steps + 1):
            a = (2 * step + 1) * P
            b, a = a + first, a + centre
            u, v, w = load(path, b) - path[a], load(path, b + n) - path[a + n], load(path, b + 2 * n) - path[a + 2 * n]
            most2 = maximum(most2, u * u + v * v + w * w)
        store(speeds, first, sqrt(most2))


@kernel(inline=True)
def _speeds_of_particles(watch, track, steps):
    """Return the largest speeds of eight particles at the ends of the steps of a block, in the same frame."""
    n, P, path, most2, centre = watch.bodies, watch.stride, watch.path, full(0.0), max(watch.dominant, 0)
    for step in range(steps + 1):
        a, d = (2 * step + 1) * P + centre, 6 * step + 3
        u, v, w = load(track, d) - path[a], load(track, d + 1) - path[a + n], load(track, d + 2) - path[a + 2 * n]
        most2 = maximum(most2, u * u + v * v + w * w)
    return sqrt(most2)


@kernel
def find_suspect(context, track, h, steps, start, stop):
    """Find the first step in which a pair may come to a bound: of massive bodies start ... stop - 1, or of each of the
    particles start ... start + 7 and a massive body if `track` is not empty. This only excludes: where the bound is
    passed is found on the motion itself.

    The number of steps after it, or steps + 1, is written into `watch.hits`.
    """
    watch = watch_at(context)
    n, found, numbers = watch.bodies, steps + 1, full(0.0)
    for i in range(WIDTH):
        numbers = numbers + 1.0 * i * unit(i)
    _speeds_of_bodies(watch, steps)
    if track.shape[0] > 0:
        fastest, rows = _speeds_of_particles(watch, track, steps), numbers + (n + start)
        for c in range(watch.stops.shape[0]):
            for j in range(n):
                valid = _concerns(watch.stops, c, rows, j) * (rows < n + min(stop, start + WIDTH))
                if any_lane(valid):
                    found = _first_of_eight(context, track, h, found, c, j, n + start, valid, fastest)
        watch.hits[start // WIDTH] = found
        return
    for c in range(watch.stops.shape[0]):
        for i in range(start, stop - 1):
            for first in range(i + 1, stop, WIDTH):
                rows, fastest = numbers + first, load(watch.speeds, first)
                valid = _concerns(watch.stops, c, rows, i) * (rows < stop)
                if any_lane(valid):
                    found = _first_of_eight(context, track, h, found, c, i, first, valid, fastest)
    watch.hits[watch.hits.shape[0] - 1] = found


@kernel
def path_energy(context, strength, step):
    """Return G times the energy of the massive bodies at the beginning of a step."""
    watch = watch_at(context)
    n, P, path = watch.bodies, watch.stride, watch.path
    first = 2 * step * P
    value = pair_potential(strength, path[first : first + P])
    for i in range(n):
        u, v, w = path[first + P + i], path[first + P + n + i], path[first + P + 2 * n + i]
        value += 0.5 * strength[1 + i] * (u * u + v * v + w * w)
    return value


@kernel
def first_energy_error(context, strength, steps, reference, bound):
    """Return the number of steps after which |E - reference| first exceeds `bound`, or steps + 1."""
    for step in range(1, steps + 1):
        if not abs(path_energy(context, strength, step) - reference) <= bound:
            return step
    return steps + 1
