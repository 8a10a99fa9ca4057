"""The search for closest approaches among a star and up to eight planets, in the trace of a map on Kepler orbits.

The steps of such a map resolve the fastest pericentre, so that all pairs can be sampled at equal intervals, with the
pairs formed by turning a register of eight planets. Pairs whose orbits lie too far apart for an approach that would be
recorded are left out as long as the planets stay between the apsides from which that was concluded. States are computed
from the trace where they are looked at: few approaches are closer than all before. What is found is examined and
recorded as in `approach_search.py`, and is the same.
"""

from __future__ import annotations

from orbits.kernels.approach_search import CAUTION, SLACK, estimate
from orbits.kernels.compile import kernel
from orbits.kernels.encounters import DISTANCE2, DOMINANT, OTHER, note_rows
from orbits.kernels.jacobi import TRACE_ROWS, place_planets
from orbits.kernels.lanes import (
    WIDTH,
    any_lane,
    first_lane,
    full,
    lane,
    largest,
    load,
    maximum,
    minimum,
    select,
    sqrt,
    store_some,
    sums_before,
    turned,
    unit,
)
from orbits.kernels.observing import call_enter
from orbits.kernels.watch import no_particles, watch_at

FRACTION, MOST_APART = 1.6, 16
"""The time between two samples, as a fraction of distance / speed at the fastest pericentre; and the most steps."""

WANDERING, BOUND = 1.03, 1.06
"""Factors by which planets may leave their apsides of the beginning of a block until all pairs are looked at, and by
which the apsides of pairs that are left out are wider."""

SHARE, BODY = 0, 1
"""Rows of `lanes`."""

CLOSE = 0.9999
"""The factor by which an approach to the star may be closer than estimated within a step that resolves it (in squared
distance)."""


@kernel
def show_trace(context, track, h, steps, start, stop):
    """Write the states in the trace of the last `stop` steps of the first `steps` of a block into the path."""
    _show(context, steps - stop, 0, stop)


@kernel
def _show(context, base, begin, end):
    """Write the states at rows begin ... end of the trace into the path; base : the step of row 0."""
    watch = watch_at(context)
    n, path, share, in_order = watch.bodies, watch.path, load(watch.lanes, SHARE), watch.dominant == 0
    for k in range(n - 1):
        in_order = in_order and watch.lanes[BODY, k] == k + 1
    for step in range(begin, end + 1):
        row = TRACE_ROWS * WIDTH * step
        for component in range(6):
            first = (2 * (base + step) + component // 3) * watch.stride + component % 3 * n
            outside = watch.trace[row + WIDTH * (TRACE_ROWS - 1) + component]
            places, inside = place_planets(load(watch.trace, row + WIDTH * component), share, outside)
            if in_order:
                store_some(path, first + 1, places, n - 1)
            else:
                for k in range(n - 1):
                    path[first + int(watch.lanes[BODY, k])] = lane(places, k)
            path[first + watch.dominant] = inside


@kernel
def follow_planets(context, track, h, steps, start, stop):
    """Search for closest approaches in the last `stop` steps of h of the first `steps` of a block, all of that length,
    among 2 to 9 massive bodies without particles, the first of which dominates.

    start, track : not used: the trace has all of them, and there are no particles
    """
    watch, base = watch_at(context), steps - stop
    if watch.stops.shape[0] > 0:  # conditions are sought in all states
        _show(context, base, 0, stop)
    if watch.first + base == 0:
        _show(context, base, 0, 0)
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
    lowest, highest, time = _apsides(watch, place, velocity)
    apart = _steps_apart(there, time, h)
    near, far = select(there, lowest / WANDERING, 0.0), select(there, highest * WANDERING, 1e150)
    near, far = near * near, far * far
    known = _known(watch)
    every1, every2 = _meet(known, lowest, highest, with1, 1), _meet(known, lowest, highest, with2, 2)
    every3, every4 = _meet(known, lowest, highest, with3, 3), _meet(known, lowest, highest, with4, 4)
    with1, with2 = with1 * _within(known, 1), with2 * _within(known, 2)
    with3, with4 = with3 * _within(known, 3), with4 * _within(known, 4)
    wander = False
    k = last = 0
    before0 = before1 = before2 = before3 = before4 = full(0.0)
    while True:
        place, velocity = _relative(watch, k)
        (x, y, z), (u, v, w) = place, velocity
        r2 = x * x + y * y + z * z
        if not wander and any_lane((r2 < near) + (r2 > far)):
            # Look at all pairs from the sample before on.
            wander = every1 = every2 = every3 = every4 = True
            k, before0 = last, full(0.0)
            continue
        now0 = (x * u + y * v + z * w) * h
        turned0 = there * (before0 < 0.0) * (now0 >= 0.0)
        if any_lane(turned0):
            _examine_star(context, base, h, last, k, turned0, before0 / (before0 - now0))
        before0 = now0
        if every1:
            before1 = _met(context, base, h, last, k, with1, before1, place, velocity, 1)
        if every2:
            before2 = _met(context, base, h, last, k, with2, before2, place, velocity, 2)
        if every3:
            before3 = _met(context, base, h, last, k, with3, before3, place, velocity, 3)
        if every4:
            before4 = _met(context, base, h, last, k, with4, before4, place, velocity, 4)
        if k == stop:
            break
        last = k
        k = min(k + apart, stop)


@kernel(inline=True)
def _met(context, base, h, last, k, pairs, before, place, velocity, count):
    """Examine the pairs that no longer draw nearer; return whether they draw apart, for the next sample.

    pairs : squared distances below which approaches are looked at; 0 in lanes without a pair
    """
    (x, y, z), (u, v, w) = _turned(place, count), _turned(velocity, count)
    now = (x * u + y * v + z * w) * h
    # While it grows, the squared distance grows by at most 2 now in a step; 3, as its growth may not be steady.
    least = x * x + y * y + z * z - 3.0 * (k - last) * now
    met = (pairs > 0.0) * (before < 0.0) * (now >= 0.0) * (least < pairs)
    if any_lane(met):
        _examine_planets(context, base, h, last, k, met, count)
    return now


@kernel(inline=True)
def _relative(watch, step):
    """Return positions and velocities relative to the star at the beginning of a step."""
    trace, share, first = watch.trace, load(watch.lanes, SHARE), TRACE_ROWS * WIDTH * step
    x, y, z = load(trace, first), load(trace, first + WIDTH), load(trace, first + 2 * WIDTH)
    u, v, w = load(trace, first + 3 * WIDTH), load(trace, first + 4 * WIDTH), load(trace, first + 5 * WIDTH)
    return (
        x + sums_before(share * x),
        y + sums_before(share * y),
        z + sums_before(share * z),
    ), (
        u + sums_before(share * u),
        v + sums_before(share * v),
        w + sums_before(share * w),
    )


@kernel(inline=True)
def _body(watch, i):
    """Return the body in a lane."""
    return int(watch.lanes[BODY, i])


@kernel(inline=True)
def _turned(place, count):
    """Return the place relative to each planet of the one `count` lanes on."""
    x, y, z = place
    return _onwards(x, count) - x, _onwards(y, count) - y, _onwards(z, count) - z


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
def _opening(place, velocity, h, count):
    """Return whether the pairs draw apart: half of the change of the squared distance in a step."""
    (x, y, z), (u, v, w) = _turned(place, count), _turned(velocity, count)
    return (x * u + y * v + z * w) * h


@kernel(inline=True)
def _apsides(watch, place, velocity):
    """Return the least and largest distances on the osculating orbits, and distance / speed at the least."""
    (x, y, z), (u, v, w) = place, velocity
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    swept2 = cx * cx + cy * cy + cz * cz
    parameter = swept2 / watch.mu
    inverse_a = 2.0 / sqrt(x * x + y * y + z * z) - (u * u + v * v + w * w) / watch.mu
    e = sqrt(maximum(1.0 - parameter * inverse_a, full(0.0)))
    least = parameter / (1.0 + e)
    highest = select(inverse_a > 0.0, (1.0 + e) / maximum(inverse_a, full(1e-300)), 1e150)
    return least, minimum(highest, full(1e150)), least * least / sqrt(swept2)


@kernel(inline=True)
def _steps_apart(there, time, h):
    """Return the number of steps from sample to sample: `FRACTION` of distance / speed at the fastest pericentre."""
    shortest = -largest(select(there > 0.0, -time, full(-1e300)))
    count = FRACTION * shortest / abs(h)
    return int(count) if 1.0 <= count < MOST_APART else 1 if not count >= 1.0 else MOST_APART


@kernel(inline=True)
def _known(watch):
    """Return the distances below which the approaches of the planet in each lane to others are looked at."""
    limit = full(0.0)
    for k in range(watch.bodies - 1):
        body = _body(watch, k)
        reach = watch.reaches[body]
        limit = limit + max(watch.record[DISTANCE2, OTHER, body], reach * reach) ** 0.5 * unit(k)
    return limit


@kernel(inline=True)
def _within(known, count):
    """Return the squared distances below which approaches to the planets `count` lanes on are looked at."""
    limit = maximum(known, _onwards(known, count))
    return limit * limit / SLACK


@kernel(inline=True)
def _meet(known, lowest, highest, pairs, count):
    """Return whether pairs with the planets `count` lanes on may come closer than the known distance of one of them."""
    low, high = lowest / BOUND, highest * BOUND
    apart = maximum(_onwards(low, count) - high, low - _onwards(high, count))
    return any_lane(pairs * (apart < maximum(known, _onwards(known, count))))


@kernel
def _examine_star(context, base, h, last, k, met, guess):
    """Enter the approaches to the star between two samples of the planets for which `met` is not 0: those that are
    closer than known ones, and those that a step may not resolve.

    guess : the fraction of the time between the samples after which distances no longer fall
    """
    watch = watch_at(context)
    while any_lane(met):
        i = first_lane(met)
        met = met * (1.0 - unit(i))
        begin, body = last + min(max(int(lane(guess, i) * (k - last)), 0), k - last - 1), _body(watch, i)
        place, velocity = _relative(watch, begin)
        after, velocity_after = _relative(watch, begin + 1)
        d2, speed2, turning = _estimated(h, place, velocity, after, velocity_after)
        if lane(turning, i) == 0.0:
            begin, end = last, k
            while end - begin > 1:
                middle = (begin + end) // 2
                (x, y, z), (u, v, w) = _relative(watch, middle)
                if lane((x * u + y * v + z * w) * h, i) < 0.0:
                    begin = middle
                else:
                    end = middle
            place, velocity = _relative(watch, begin)
            after, velocity_after = _relative(watch, end)
            d2, speed2, _ = _estimated(h, place, velocity, after, velocity_after)
        known = max(watch.record[DISTANCE2, DOMINANT, body], watch.record[DISTANCE2, OTHER, 0])
        least, angle = lane(d2, i), SLACK * min(watch.pericentre_angle, 1.0)
        # Above an angle of 1, what is recorded is the osculating pericentre.
        if CLOSE * least < known or h * h * lane(speed2, i) > angle * angle * least:
            _show(context, base, begin, begin + 1)
            call_enter(watch.enter, context, no_particles(), 0, body, base + begin, base + begin + 1, h)


@kernel
def _examine_planets(context, base, h, last, k, met, count):
    """Enter the approaches between two samples of the planets for which `met` is not 0 and those `count` lanes on."""
    watch = watch_at(context)
    while any_lane(met):
        i = first_lane(met)
        met = met * (1.0 - unit(i))
        begin, end = last, k
        while end - begin > 1:
            middle = (begin + end) // 2
            place, velocity = _relative(watch, middle)
            if lane(_opening(place, velocity, h, count), i) < 0.0:
                begin = middle
            else:
                end = middle
        place, velocity = _relative(watch, begin)
        after, velocity_after = _relative(watch, end)
        place, velocity = _turned(place, count), _turned(velocity, count)
        d2, speed2, _ = _estimated(h, place, velocity, _turned(after, count), _turned(velocity_after, count))
        one, two = _body(watch, i), _body(watch, (i + count) % WIDTH)
        known = max(watch.record[DISTANCE2, OTHER, one], watch.record[DISTANCE2, OTHER, two])
        reach = max(watch.reaches[one], watch.reaches[two])
        least, angle = SLACK * lane(d2, i), CAUTION * watch.passage_angle
        if least < max(known, reach * reach) or h * h * lane(speed2, i) > angle * angle * least:
            _show(context, base, begin, end)
            call_enter(watch.enter, context, no_particles(), min(one, two), max(one, two), base + begin, base + end, h)


@kernel(inline=True)
def _estimated(h, place, velocity, after, velocity_after):
    """Return estimates of the least squared distance in a step, and of the largest squared speed; and whether the
    distance stops falling in it.
    """
    (x0, y0, z0), (u0, v0, w0), (x, y, z), (u, v, w) = place, velocity, after, velocity_after
    before, now = (x0 * u0 + y0 * v0 + z0 * w0) * h, (x * u + y * v + z * w) * h
    d2 = estimate(h, before, now, (x0, y0, z0, u0, v0, w0), (x, y, z, u, v, w))
    return d2, maximum(u * u + v * v + w * w, u0 * u0 + v0 * v0 + w0 * w0), (before < 0.0) * (now >= 0.0)
