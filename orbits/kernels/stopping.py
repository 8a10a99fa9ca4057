"""Conditions that end a run, tested after each step of a block."""

from __future__ import annotations

import math

from orbits.kernels.approach_search import longest_way
from orbits.kernels.compile import kernel
from orbits.kernels.gravity import pair_potential
from orbits.kernels.lanes import WIDTH
from orbits.kernels.paths import least_distance, relative, steps_between
from orbits.kernels.watch import watch_at

ANY = -1
CLOSER, FARTHER = 0, 1
KIND, FIRST, SECOND, BOUND2 = 0, 1, 2, 3
"""Columns of `stops`: CLOSER or FARTHER, two rows (or ANY of them), the distance squared."""


@kernel(inline=True)
def _concerns(stops, c, row, j):
    """Return whether condition c applies to a row and body j."""
    a, b = stops[c, FIRST], stops[c, SECOND]
    return (a in (ANY, row) and b in (ANY, j)) or (a in (ANY, j) and b in (ANY, row))


@kernel
def first_met(context, track, h, steps, start, stop):
    """Return the number of steps after which a condition first holds (steps + 1: never), the condition, row and body.

    Rows start ... stop - 1 are tested. "Closer" also holds after a step within which the pair came closer than at
    either end.
    """
    watch = watch_at(context)
    stops, n = watch.stops, watch.bodies
    found = (steps + 1, 0, 0, 0)
    way = longest_way(context, h, steps) if start < n else math.inf
    for c in range(stops.shape[0]):
        bound2 = stops[c, BOUND2]
        closer = stops[c, KIND] == CLOSER
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
                before = 0.0
                for step in range(found[0]):
                    x, y, z, u, v, w = relative(watch, track, row, j, step)
                    d2, now = x * x + y * y + z * z, (x * u + y * v + z * w) * h
                    if step > 0:
                        met = d2 < bound2 if closer else d2 > bound2
                        if closer and before < 0.0 <= now:
                            length = h * steps_between(watch, h, step - 1, step)
                            met = met or least_distance(watch, track, row, j, step - 1, length)[0] < bound2
                        if met:
                            found = (step, c, row, j)
                            break
                    before = now
    return found


@kernel(inline=True)
def _enter(hits, row, found):
    hits[row, 0], hits[row, 1], hits[row, 2], hits[row, 3] = found


@kernel
def find_met(context, track, h, steps, start, stop):
    """Find conditions that are met, for massive bodies start ... stop - 1, or for particles if `track` is not empty."""
    watch = watch_at(context)
    group, row = watch.hits.shape[0] - 1, 0
    if track.shape[0] > 0:
        group, row = start // WIDTH, watch.bodies
    _enter(watch.hits, group, first_met(context, track, h, steps, row + start, row + stop))


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
