"""What may end a run in a block of steps: pairs that may come to a bound within one, and the energy after it."""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.gravity.pair_sums import pair_potential
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.approaches import longest_way
from orbits.kernels.search.context import watch_at
from orbits.kernels.search.paths import least_distance, relative, steps_between

ANY, TINY = -1, 1e-300
CLOSER, FARTHER = 0, 1
KIND, FIRST, SECOND, BOUND2 = 0, 1, 2, 3
"""Columns of `stops`: CLOSER or FARTHER, two rows (or ANY of them), the distance squared."""

BENT, COARSE, MOST = 1.0 / 48.0, 1e-3, 0.5
"""The error of the cubic as a share of the way in a step: at least `COARSE`, and `BENT` times the cube of the angle by
which the motion turns, eight times that on a circle; at most `MOST`, with which no step is passed over by a pair that
goes astray in it."""


@kernel(inline=True)
def _concerns(stops, c, row, j):
    """Return whether condition c applies to a row and body j."""
    a, b = stops[c, FIRST], stops[c, SECOND]
    return (a in (ANY, row) and b in (ANY, j)) or (a in (ANY, j) and b in (ANY, row))


@kernel(inline=True)
def _stays_away(closer, bound2, h, first, second):
    """Return whether a pair is too far from a bound to come to it between two states that are h apart; see
    `_may_cross`. Its distance changes by the way, and (a + b)^2 <= 2 (a^2 + b^2).
    """
    d2, _, u, v, w = first
    e2, _, x, y, z = second
    reach2 = (1.0 + MOST) ** 2 * h * h * max(u * u + v * v + w * w, x * x + y * y + z * z)
    if closer:
        return min(d2, e2) > 2.0 * (bound2 + reach2)
    return 2.0 * (max(d2, e2) + reach2) < bound2


@kernel(inline=True)
def _may_cross(closer, bound, h, first, second, nearest2):
    """Return whether a pair may come to a bound between two states that are h apart.

    first, second : d^2, q.v h, and the velocity (three numbers) at both
    nearest2 : the least squared distance on the cubic between them
    """
    d2, before, u, v, w = first
    e2, now, x, y, z = second
    speed2, other2 = u * u + v * v + w * w, x * x + y * y + z * z
    turn2 = ((x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2) / (min(speed2, other2) + TINY)
    share = min(COARSE + BENT * turn2 * math.sqrt(turn2), MOST)
    margin = share * abs(h) * math.sqrt(max(speed2, other2))
    begin, end = math.sqrt(d2), math.sqrt(e2)
    if closer:
        return math.sqrt(nearest2) - margin < bound and bound <= max(begin, end) + margin
    farthest = max(begin, end)
    if now < 0.0 < before:  # to where the tangents of the distance at both ends meet
        rise, fall = before / begin, now / end
        farthest += max(begin + rise * (end - begin - fall) / (rise - fall) - farthest, 0.0)
    return bound < farthest + margin and min(begin, end) - margin <= bound


@kernel
def first_suspect(context, track, h, steps, start, stop):
    """Return the number of steps in the last of which a pair may first come to its bound; steps + 1: never.

    Rows start ... stop - 1 are looked at. This only excludes: where the bound is passed is found on the motion itself.
    """
    watch = watch_at(context)
    stops, n = watch.stops, watch.bodies
    found = steps + 1
    way = longest_way(context, h, steps) if start < n else math.inf
    for c in range(stops.shape[0]):
        bound2 = stops[c, BOUND2]
        closer, bound = stops[c, KIND] == CLOSER, math.sqrt(bound2)
        for row in range(start, stop):
            for j in range(min(row, n)):
                if not _concerns(stops, c, row, j):
                    continue
                # Two bodies approach by at most twice the way, and (a + b)^2 <= 2 (a^2 + b^2).
                x, y, z, u, v, w = relative(watch, track, row, j, 0 * steps)
                d2 = x * x + y * y + z * z
                if (closer and d2 > 2.0 * (bound2 + 4.0 * way * way)) or (
                    not closer and 2.0 * (d2 + 4.0 * way * way) < bound2
                ):
                    continue
                first = (d2, (x * u + y * v + z * w) * h, u, v, w)
                for step in range(1, found):
                    x, y, z, u, v, w = relative(watch, track, row, j, step)
                    d2, length = x * x + y * y + z * z, h * steps_between(watch, h, step - 1, step)
                    second = (d2, (x * u + y * v + z * w) * h, u, v, w)
                    if not _stays_away(closer, bound2, length, first, second):
                        nearest2 = min(first[0], d2)
                        if closer and first[1] < 0.0 <= second[1]:
                            nearest2 = least_distance(watch, track, row, j, step - 1, length)[0]
                        if _may_cross(closer, bound, length, first, second, nearest2):
                            found = step
                            break
                    first = second
    return found


@kernel
def find_suspect(context, track, h, steps, start, stop):
    """Look for pairs that may come to their bounds: of massive bodies start ... stop - 1, or of particles if `track` is
    not empty.
    """
    watch = watch_at(context)
    group, row = watch.hits.shape[0] - 1, 0
    if track.shape[0] > 0:
        group, row = start // WIDTH, watch.bodies
    watch.hits[group] = first_suspect(context, track, h, steps, row + start, row + stop)


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
