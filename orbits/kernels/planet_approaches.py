"""The search for closest approaches among a star and up to eight planets: all pairs at the same steps.

The steps of a map on Kepler orbits resolve the fastest pericentre, so that all pairs can be sampled at equal intervals,
and with the pairs formed by turning a register of eight planets. What is found is examined and recorded as in
`approach_search.py`, and is the same.
"""

from __future__ import annotations

from orbits.kernels.approach_search import FRACTION, SLACK, estimate, is_near_or_fast
from orbits.kernels.compile import kernel
from orbits.kernels.encounters import DISTANCE2, DOMINANT, OTHER, note_rows
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, largest, load, maximum, select, sqrt, turned, unit
from orbits.kernels.observing import call_enter
from orbits.kernels.watch import no_particles, watch_at

MOST_APART = 8
"""The most steps between two samples."""


@kernel
def follow_planets(context, h, steps):
    """Search for closest approaches in a block of `steps` steps of h, all of that length, among 2 to 9 massive bodies
    without particles, the first of which dominates.
    """
    watch = watch_at(context)
    if watch.first == 0:
        note_rows(context, 0, watch.bodies)
    there = full(0.0)
    for k in range(watch.bodies - 1):
        there = there + unit(k)
    # Of the pairs of planets four lanes apart each is met twice.
    half = unit(0) + unit(1) + unit(2) + unit(3)
    with1, with2, with3, with4 = (
        there * turned(there, 1),
        there * turned(there, 2),
        there * turned(there, 3),
        there * turned(there, 4) * half,
    )
    place, velocity = _relative(watch, 0)
    apart = _steps_apart(watch, there, place, velocity, h)
    k = last = 0
    before0 = before1 = before2 = before3 = before4 = full(0.0)
    while True:
        place, velocity = _relative(watch, k)
        (x, y, z), (u, v, w) = place, velocity
        now0 = (x * u + y * v + z * w) * h
        now1, now2 = _opening(place, velocity, h, 1), _opening(place, velocity, h, 2)
        now3, now4 = _opening(place, velocity, h, 3), _opening(place, velocity, h, 4)
        turned0 = there * (before0 < 0.0) * (now0 >= 0.0)
        turned1, turned2 = with1 * (before1 < 0.0) * (now1 >= 0.0), with2 * (before2 < 0.0) * (now2 >= 0.0)
        turned3, turned4 = with3 * (before3 < 0.0) * (now3 >= 0.0), with4 * (before4 < 0.0) * (now4 >= 0.0)
        if any_lane((turned0 + turned1) + (turned2 + turned3) + turned4):
            if any_lane(turned0):
                _examine_star(context, h, last, k, turned0)
            if any_lane(turned1):
                _examine_planets(context, h, last, k, turned1, 1)
            if any_lane(turned2):
                _examine_planets(context, h, last, k, turned2, 2)
            if any_lane(turned3):
                _examine_planets(context, h, last, k, turned3, 3)
            if any_lane(turned4):
                _examine_planets(context, h, last, k, turned4, 4)
        if k == steps:
            break
        before0, before1, before2, before3, before4 = now0, now1, now2, now3, now4
        last = k
        k = min(k + apart, steps)


@kernel(inline=True)
def _relative(watch, step):
    """Return positions and velocities relative to the star at the beginning of a step."""
    n, path, a = watch.bodies, watch.path, 2 * step * watch.stride
    b = a + watch.stride
    return (
        load(path, a + 1) - path[a],
        load(path, a + n + 1) - path[a + n],
        load(path, a + 2 * n + 1) - path[a + 2 * n],
    ), (
        load(path, b + 1) - path[b],
        load(path, b + n + 1) - path[b + n],
        load(path, b + 2 * n + 1) - path[b + 2 * n],
    )


@kernel(inline=True)
def _turned(place, count):
    """Return the place relative to each planet of the one `count` lanes on."""
    x, y, z = place
    if count == 1:
        return turned(x, 1) - x, turned(y, 1) - y, turned(z, 1) - z
    if count == 2:
        return turned(x, 2) - x, turned(y, 2) - y, turned(z, 2) - z
    if count == 3:
        return turned(x, 3) - x, turned(y, 3) - y, turned(z, 3) - z
    return turned(x, 4) - x, turned(y, 4) - y, turned(z, 4) - z


@kernel(inline=True)
def _opening(place, velocity, h, count):
    """Return whether the pairs draw apart: half of the change of the squared distance in a step."""
    (x, y, z), (u, v, w) = _turned(place, count), _turned(velocity, count)
    return (x * u + y * v + z * w) * h


@kernel(inline=True)
def _steps_apart(watch, there, place, velocity, h):
    """Return the number of steps from sample to sample: `FRACTION` of distance / speed at the fastest pericentre."""
    (x, y, z), (u, v, w) = place, velocity
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    swept2 = cx * cx + cy * cy + cz * cz
    parameter = swept2 / watch.mu
    inverse_a = 2.0 / sqrt(x * x + y * y + z * z) - (u * u + v * v + w * w) / watch.mu
    least = parameter / (1.0 + sqrt(maximum(1.0 - parameter * inverse_a, full(0.0))))
    time = least * least / sqrt(swept2)
    shortest = -largest(select(there > 0.0, -time, full(-1e300)))
    count = FRACTION * shortest / abs(h)
    return int(count) if 1.0 <= count < MOST_APART else 1 if not count >= 1.0 else MOST_APART


@kernel
def _examine_star(context, h, last, k, met):
    """Enter the approaches to the star between two samples of the planets for which `met` is not 0."""
    watch = watch_at(context)
    (x0, y0, z0), (u0, v0, w0) = _relative(watch, last)
    (x, y, z), (u, v, w) = _relative(watch, k)
    known = maximum(load(watch.record[DISTANCE2, DOMINANT], 1), full(watch.record[DISTANCE2, OTHER, 0]))
    reach = maximum(load(watch.reaches, 1), full(watch.reaches[0]))
    wanted = _wanted(watch, h, k - last, (x0, y0, z0), (u0, v0, w0), (x, y, z), (u, v, w), known, reach)
    wanted = wanted * met
    if any_lane(wanted):
        for i in range(WIDTH):
            if lane(wanted, i) != 0.0:
                call_enter(watch.enter, context, no_particles(), 0, 1 + i, last, k, h)


@kernel
def _examine_planets(context, h, last, k, met, count):
    """Enter the approaches between two samples of the planets for which `met` is not 0 and those `count` lanes on."""
    watch = watch_at(context)
    place, velocity = _relative(watch, last)
    first, speed = _turned(place, count), _turned(velocity, count)
    place, velocity = _relative(watch, k)
    second, other_speed = _turned(place, count), _turned(velocity, count)
    closest, reaches = load(watch.record[DISTANCE2, OTHER], 1), load(watch.reaches, 1)
    known = maximum(closest, _onwards(closest, count))
    reach = maximum(reaches, _onwards(reaches, count))
    wanted = met * _wanted(watch, h, k - last, first, speed, second, other_speed, known, reach)
    if any_lane(wanted):
        for i in range(WIDTH):
            if lane(wanted, i) != 0.0:
                j = (i + count) % WIDTH
                call_enter(watch.enter, context, no_particles(), 1 + min(i, j), 1 + max(i, j), last, k, h)


@kernel(inline=True)
def _onwards(value, count):
    if count == 1:
        return turned(value, 1)
    if count == 2:
        return turned(value, 2)
    if count == 3:
        return turned(value, 3)
    return turned(value, 4)


@kernel(inline=True)
def _wanted(watch, h, many, place, velocity, place1, velocity1, known, reach):
    """Return which pairs may have come closer than before, or within their reach."""
    (x0, y0, z0), (u0, v0, w0), (x, y, z), (u, v, w) = place, velocity, place1, velocity1
    before, now = (x0 * u0 + y0 * v0 + z0 * w0) * h, (x * u + y * v + z * w) * h
    # While it grows, the squared distance grows by less than this.
    least = x * x + y * y + z * z - 2.0 * many * now
    limit = maximum(known, reach * reach)
    if not any_lane(SLACK * least < limit):
        return full(0.0)
    d2 = estimate(h * many, before * many, now * many, (x0, y0, z0, u0, v0, w0), (x, y, z, u, v, w))
    near = is_near_or_fast(watch.passage_angle, h, reach, d2, (u0, v0, w0), (u, v, w))
    return (SLACK * d2 < known) + near
