"""The search for closest approaches among a star and up to eight planets, in the trace of a map on Kepler orbits.

The steps of such a map resolve the fastest pericentre, so that all pairs can be sampled at equal intervals, with the
pairs formed by turning a register of eight planets. Pairs whose orbits lie too far apart for an approach that would be
recorded are left out as long as the planets stay between the apsides from which that was concluded. Neighbours, and
approaches to the star, are looked for in the coordinates that are marched, which bound the distances; others are
computed from the trace only where an approach may have to be recorded. It is then located and recorded as in
`approaches.py`, and is the same.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
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
from orbits.kernels.maps.jacobi import TRACE_ROWS, place_planets
from orbits.kernels.search.approaches import CAUTION, SLACK
from orbits.kernels.search.apsides import OPEN, apsides
from orbits.kernels.search.context import no_particles, set_first, watch_at
from orbits.kernels.search.cubics import distance2_at
from orbits.kernels.search.observers import call_enter
from orbits.kernels.search.record import DISTANCE2, DOMINANT, OTHER, note_rows

FRACTION, MOST_APART = 1.6, 16
"""The time between two samples, as a fraction of distance / speed at the fastest pericentre; and the most steps."""

WANDERING, BOUND = 1.03, 1.06
"""Factors by which planets may leave their apsides of the beginning of a block until all pairs are looked at, and by
which the apsides of pairs that are left out are wider."""

SHARE, BODY = 0, 1
"""Rows of `lanes`."""

SHOWN = 2
"""The states behind those of a block in the path: those between which an approach is located."""

STEEPER = 1.25
"""The factor by which squared distances may change faster between two samples than tangents at these tell."""

EVEN, CLOSE = 0.25, 1.0 - 1e-6
"""The fraction of its mean that the second derivative of a squared distance has at least where it is even; and the
factor by which rounding may make an approach closer than that tells, also far from the origin."""


@kernel
def show_trace(context, track, h, steps, start, stop):
    """Write the states in the trace of the last `stop` steps of the first `steps` of a block into the path."""
    _show(context, 0, stop, steps - stop)


@kernel
def _show(context, begin, end, place):
    """Write the states at rows begin ... end of the trace into the path, from that of the step `place` on."""
    watch = watch_at(context)
    n, path, share, in_order = watch.bodies, watch.path, load(watch.lanes, SHARE), watch.dominant == 0
    for k in range(n - 1):
        in_order = in_order and watch.lanes[BODY, k] == k + 1
    for step in range(begin, end + 1):
        row = TRACE_ROWS * WIDTH * step
        for component in range(6):
            first = (2 * (place + step - begin) + component // 3) * watch.stride + component % 3 * n
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
        _show(context, 0, stop, base)
    if watch.first + base == 0:
        _show(context, 0, 0, 0)
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
    # Of those one lane apart the outermost and the innermost of eight planets are no neighbours.
    with0, with1 = with1 * unit(WIDTH - 1), with1 * (1.0 - unit(WIDTH - 1))
    place, velocity = _all_from_star(watch, 0)
    lowest, highest, time = apsides_and_time(watch.mu, place, velocity)
    apart, share = _steps_apart(there, time, h), load(watch.lanes, SHARE)
    known2, of_star2, reach = _known2(watch)
    known = sqrt(known2)
    every0 = _meet(known, lowest, highest, with0, 1)
    every1, every2 = _meet(known, lowest, highest, with1, 1), _meet(known, lowest, highest, with2, 2)
    every3, every4 = _meet(known, lowest, highest, with3, 3), _meet(known, lowest, highest, with4, 4)
    with0 = _within(known2, with0, 1)
    with1, with2 = _within(known2, with1, 1), _within(known2, with2, 2)
    with3, with4 = _within(known2, with3, 3), _within(known2, with4, 4)
    reach0, reach1, reach2 = _reach2(reach, with0, 1), _reach2(reach, with1, 1), _reach2(reach, with2, 2)
    reach3, reach4 = _reach2(reach, with3, 3), _reach2(reach, with4, 4)
    near, far, limit, turning2, of_star2 = _limits(watch, h, there, lowest, highest, of_star2)
    wander = close = False
    k = last = 0
    r2_before = before0 = before1 = before2 = before3 = before4 = before5 = full(0.0)
    while True:
        place, velocity = _marched(watch, k)
        r2, now0 = length2(place), _opening(place, velocity, h)
        turned0 = select(before0 < 0.0, now0, -1.0) >= 0.0
        if close or any_lane(turned0 + (r2 < limit) + (r2 > far)):
            if not wander and any_lane((r2 < near) + (r2 > far)):
                # Look at all pairs in all steps from the sample before on: also pericentres may be faster.
                wander = close = every0 = every1 = every2 = every3 = every4 = True
                k, apart, before0, limit = last, 1, full(0.0), full(math.inf)
                continue
            draws_near = any_lane(r2 < limit)
            if k > last and (close or draws_near):
                _look_at_star(context, base, h, last, k, of_star2)
            elif k > last:
                least = _least2(r2_before, before0, r2, now0, 1.0 * (k - last))
                turned0 = turned0 * (least < turning2)
                if any_lane(turned0):
                    _examine(context, base, h, last, k, turned0, before0 / (before0 - now0), 0)
            close = draws_near
        r2_before, before0 = r2, now0
        met0 = met1 = met2 = met3 = met4 = False
        if every1:
            before1, met1 = _met(
                context, base, h, last, k, apart, with1, reach1, before1, _outwards(place, velocity, share), 1
            )
        if every0 or every2 or every3 or every4:
            seen = _from_star(place, share), _from_star(velocity, share)
            before5, met0 = _met(context, base, h, last, k, apart, with0, reach0, before5, _apart(seen, 1), 1)
            before2, met2 = _met(context, base, h, last, k, apart, with2, reach2, before2, _apart(seen, 2), 2)
            before3, met3 = _met(context, base, h, last, k, apart, with3, reach3, before3, _apart(seen, 3), 3)
            before4, met4 = _met(context, base, h, last, k, apart, with4, reach4, before4, _apart(seen, 4), 4)
        if k == stop:
            break
        if met0 or met1 or met2 or met3 or met4:
            apart = 1  # planets that deflect each other may meet twice before the next sample
        last = k
        k = min(k + apart, stop)


@kernel(inline=True)
def _limits(watch, h, there, lowest, highest, of_star2):
    """Return squared lengths of r': those below and above which planets may leave their apsides, and that below which
    they may approach the star as one looks for, while r' does not turn, and where it does; and the squared distances of
    these approaches.

    What is between r' and the place relative to the star is at most as long as the sum of all further in.
    """
    inside = sums_before(load(watch.lanes, SHARE) * highest) * WANDERING
    near = select(there, lowest / WANDERING + inside, 0.0)
    far = select(there, maximum(highest * WANDERING - inside, full(0.0)), OPEN)
    # An approach that a step may not resolve is looked for at any distance: a bound planet is too slow for it further
    # out, and even one of twice the energy.
    angle = SLACK * min(watch.pericentre_angle, 1.0)
    fast = (4.0 * watch.mu * h * h / (angle * angle)) ** (1.0 / 3.0)
    of_star2 = maximum(of_star2, select(highest < OPEN, fast * fast, math.inf))
    reach = sqrt(of_star2) + inside
    # The innermost planet turns where r' does.
    limit = maximum(near, select(inside > 0.0, reach, 0.0))
    return near * near, far * far, limit * limit, reach * reach / SLACK, select(there, of_star2 / SLACK, 0.0)


@kernel(inline=True)
def _least2(r2, before, r2_now, now, steps):
    """Return what squared distances do not fall below between two samples: where their tangents meet.

    before, now : half of their changes in a step; they are taken to be larger, as their growth may not be steady
    """
    before, now = 2.0 * STEEPER * before, 2.0 * STEEPER * now
    return r2 + before * (r2_now - r2 - now * steps) / (before - now)


@kernel(inline=True)
def _met(context, base, h, last, k, apart, pairs, reach2, before, relative, count):
    """Examine the pairs that no longer draw nearer; return whether they draw apart, for the next sample, and whether
    some may come within their reach until that one, `apart` steps on.

    pairs : see `_within`; reach2 : their squared reaches; relative : the place and the velocity of the other one
        relative to the first
    """
    now, r2 = _opening(relative[0], relative[1], h), length2(relative[0])
    # While it grows, the squared distance grows by at most 2 now in a step; 3, as its growth may not be steady.
    met = select(before < 0.0, select(now >= 0.0, pairs - (r2 - 3.0 * (k - last) * now), 0.0), 0.0) > 0.0
    if any_lane(met):
        _examine(context, base, h, last, k, met, before / (before - now), count)
    return now, any_lane(r2 + 3.0 * apart * minimum(now, full(0.0)) < reach2)


@kernel
def _look_at_star(context, base, h, last, k, limit):
    """Examine the approaches to the star between two samples, which may come within the squared distances `limit`."""
    watch = watch_at(context)
    place, velocity = _all_from_star(watch, last)
    before = _opening(place, velocity, h)
    place, velocity = _all_from_star(watch, k)
    now = _opening(place, velocity, h)
    least = length2(place) - 3.0 * (k - last) * now  # as for planets
    met = select(before < 0.0, select(now >= 0.0, limit - least, 0.0), 0.0) > 0.0
    if any_lane(met):
        _examine(context, base, h, last, k, met, before / (before - now), 0)


@kernel(inline=True)
def _marched(watch, step):
    """Return r' and its velocity at the beginning of a step."""
    trace, first = watch.trace, TRACE_ROWS * WIDTH * step
    return (load(trace, first), load(trace, first + WIDTH), load(trace, first + 2 * WIDTH)), (
        load(trace, first + 3 * WIDTH),
        load(trace, first + 4 * WIDTH),
        load(trace, first + 5 * WIDTH),
    )


@kernel(inline=True)
def _from_star(vector, share):
    """Return the place or velocity relative to the star for r' or its velocity."""
    x, y, z = vector
    return x + sums_before(share * x), y + sums_before(share * y), z + sums_before(share * z)


@kernel(inline=True)
def _all_from_star(watch, step):
    """Return places and velocities relative to the star at the beginning of a step."""
    (place, velocity), share = _marched(watch, step), load(watch.lanes, SHARE)
    return _from_star(place, share), _from_star(velocity, share)


@kernel(inline=True)
def _outwards(place, velocity, share):
    """Return place and velocity relative to each planet of the next one, from r' and its velocity."""
    (x, y, z), (u, v, w), rest = place, velocity, 1.0 - share
    return (turned(x, 1) - rest * x, turned(y, 1) - rest * y, turned(z, 1) - rest * z), (
        turned(u, 1) - rest * u,
        turned(v, 1) - rest * v,
        turned(w, 1) - rest * w,
    )


@kernel(inline=True)
def _apart(seen, count):
    """Return place and velocity relative to each planet of the one `count` lanes on."""
    return _turned(seen[0], count), _turned(seen[1], count)


@kernel(inline=True)
def length2(vector):
    x, y, z = vector
    return x * x + y * y + z * z


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
def _opening(place, velocity, h):
    """Return half of the change of the squared distance in a step: whether pairs draw apart."""
    (x, y, z), (u, v, w) = place, velocity
    return (x * u + y * v + z * w) * h


@kernel(inline=True)
def apsides_and_time(mu, place, velocity):
    """Return the least and largest distances on the osculating orbits, and distance / speed at the least."""
    orbit = apsides(mu, *place, *velocity)
    return orbit.least, orbit.largest, orbit.least * orbit.least / sqrt(orbit.swept2)


@kernel(inline=True)
def _steps_apart(there, time, h):
    """Return the number of steps from sample to sample: `FRACTION` of distance / speed at the fastest pericentre."""
    shortest = -largest(select(there > 0.0, -time, full(-1e300)))
    count = FRACTION * shortest / abs(h)
    return int(count) if 1.0 <= count < MOST_APART else 1 if not count >= 1.0 else MOST_APART


@kernel(inline=True)
def _known2(watch):
    """Return the squared distances below which the approaches of the planet in each lane to others are looked at, the
    least ones from the star, and the reaches.
    """
    among = of_star = reaches = full(0.0)
    for k in range(watch.bodies - 1):
        body, here = _body(watch, k), unit(k)
        closest, reach = watch.record[DISTANCE2], watch.reaches[body]
        among = select(here, max(closest[OTHER, body], reach * reach), among)
        of_star = select(here, max(closest[DOMINANT, body], closest[OTHER, 0]), of_star)
        reaches = select(here, reach, reaches)
    return among, of_star, reaches


@kernel(inline=True)
def _within(known2, pairs, count):
    """Return the squared distances below which approaches to the planets `count` lanes on are looked at; less than any
    in lanes without a pair.
    """
    return select(pairs, maximum(known2, _onwards(known2, count)) / SLACK, -math.inf)


@kernel(inline=True)
def _reach2(reach, within, count):
    """Return the squared reaches of the pairs with the planets `count` lanes on, from those `_within` which they are
    looked at; 0 in lanes without a pair.
    """
    longer = maximum(reach, _onwards(reach, count))
    return select(within >= 0.0, longer * longer, 0.0)


@kernel(inline=True)
def _meet(known, lowest, highest, pairs, count):
    """Return whether pairs with the planets `count` lanes on may come closer than the known distance of one of them."""
    low, high = lowest / BOUND, highest * BOUND
    apart = maximum(_onwards(low, count) - high, low - _onwards(high, count))
    return any_lane(pairs * (apart < maximum(known, _onwards(known, count))))


@kernel
def _examine(context, base, h, last, k, met, guess, count):
    """Enter the approaches between two samples of the planets for which `met` is not 0 and those `count` lanes on, or
    the star for 0: those that are closer than known ones or within a reach, and those that a step may not resolve.

    guess : the fraction of the time between the samples after which distances no longer fall
    """
    watch = watch_at(context)
    while any_lane(met):
        i = first_lane(met)
        met = met * (1.0 - unit(i))
        one, two = (-1, i) if count == 0 else (min(i, (i + count) % WIDTH), max(i, (i + count) % WIDTH))
        begin, sure = last + min(max(int(lane(guess, i) * (k - last)), 0), k - last - 1), False
        while True:
            least, speed2, turns = _estimated(
                h, _relative(watch, begin, one, two), _relative(watch, begin + 1, one, two)
            )
            if sure or turns:
                break
            begin, sure = _last_falling(watch, h, last, k, one, two), True
        if not turns:  # it is r' that turned there
            continue
        two, closest = _body(watch, two), watch.record[DISTANCE2]
        if one < 0:
            one = 0
            known, angle = max(closest[DOMINANT, two], closest[OTHER, 0]), SLACK * min(watch.pericentre_angle, 1.0)
        else:
            one = _body(watch, one)
            reach = max(watch.reaches[one], watch.reaches[two])
            known, angle = max(closest[OTHER, one], closest[OTHER, two], reach * reach), CAUTION * watch.passage_angle
        # Above an angle of 1, what is recorded of the star is the osculating pericentre.
        if least < known or h * h * speed2 > angle * angle * least:
            _enter(context, base, begin, min(one, two), max(one, two), h)


@kernel(inline=True)
def _last_falling(watch, h, begin, end, one, two):
    """Return the last step at whose beginning a distance falls."""
    while end - begin > 1:
        middle = (begin + end) // 2
        x, y, z, u, v, w = _relative(watch, middle, one, two)
        if (x * u + y * v + z * w) * h < 0.0:
            begin = middle
        else:
            end = middle
    return begin


@kernel(inline=True)
def _relative(watch, step, one, two):
    """Return place and velocity of the planet in lane `two` relative to that in lane `one` < two, or to the star for
    one = -1.
    """
    trace, a = watch.trace, TRACE_ROWS * WIDTH * step + two
    x, y, z = trace[a], trace[a + WIDTH], trace[a + 2 * WIDTH]
    u, v, w = trace[a + 3 * WIDTH], trace[a + 4 * WIDTH], trace[a + 5 * WIDTH]
    for k in range(max(one, 0), two):
        b, share = a - two + k, watch.lanes[SHARE, k] if k > one else watch.lanes[SHARE, k] - 1.0
        x, y, z = x + share * trace[b], y + share * trace[b + WIDTH], z + share * trace[b + 2 * WIDTH]
        b += 3 * WIDTH
        u, v, w = u + share * trace[b], v + share * trace[b + WIDTH], w + share * trace[b + 2 * WIDTH]
    return x, y, z, u, v, w


@kernel
def _enter(context, base, begin, one, two, h):
    """Enter the approach of two bodies in the step at row `begin` of the trace. Its states are shown in the last two
    places of the path, where they stay in the cache.
    """
    watch = watch_at(context)
    place, first = watch.path.shape[0] // (2 * watch.stride) - SHOWN, watch.first
    _show(context, begin, begin + 1, place)
    set_first(context, first + base + begin - place)
    call_enter(watch.enter, context, no_particles(), one, two, place, place + 1, h)
    set_first(context, first)


@kernel(inline=True)
def _estimated(h, first, second):
    """Return a lower bound of the least squared distance in a step, the largest squared speed at its ends, and whether
    the distance stops falling in it; first, second : place and velocity at both.
    """
    (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = first, second
    before, now = (x0 * u0 + y0 * v0 + z0 * w0) * h, (x1 * u1 + y1 * v1 + z1 * w1) * h
    mean, s = now - before, before / (before - now)
    _, slope, bend, _ = distance2_at(s, h, first, second)
    s -= slope / bend if bend > EVEN * mean else 0.0
    d2, slope, bend, _ = distance2_at(min(max(s, 0.0), 1.0), h, first, second)
    bend0, bend1 = distance2_at(0.0, h, first, second)[2], distance2_at(1.0, h, first, second)[2]
    # Where the squared distance bends alike all along the step, what is left of its slope takes it but little further
    # down; elsewhere it may have another minimum.
    least = CLOSE * d2 - slope * slope / (0.4 * EVEN * mean) if min(bend, bend0, bend1) > EVEN * mean else -1.0
    speed2 = max(u0 * u0 + v0 * v0 + w0 * w0, u1 * u1 + v1 * v1 + w1 * w1)
    return least, speed2, before < 0.0 and now >= 0.0
