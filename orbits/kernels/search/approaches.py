"""The search for closest approaches in the states at the beginning of each step of a block.

Between two states that are close in time, the relative motion of a pair is approximated by a cubic Hermite polynomial;
a closest approach is where its distance stops falling. A pair is sampled often enough that neither its distance nor its
direction changes much in between, and an approach is then located in a single step: if the steps resolve the passages,
the record depends on the states alone, not on the sampling.

Eight pairs are sampled together: one body, and eight massive bodies or eight particles.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, largest, load, maximum, minimum, select, sqrt, unit
from orbits.kernels.search.apsides import apsides
from orbits.kernels.search.context import no_particles, watch_at
from orbits.kernels.search.cubics import distance2_at
from orbits.kernels.search.observers import call_enter, call_observer, call_search
from orbits.kernels.search.paths import eight_relative, steps_between, steps_within
from orbits.kernels.search.record import DISTANCE2, DOMINANT, FAR, NEAR, OTHER, REACH, note_particle, note_rows

FRACTION = 0.8
"""The longest time between two samples, as a fraction of the time in which the relative speed or acceleration of a pair
covers its distance."""

MARGIN = 1.05
"""The factor by which the apsides of a particle may change within a block."""

MANY_BODIES = 64
"""The number of bodies from which on pairs that stay far apart are excluded beforehand."""

DETOUR = 1.25
"""The factor by which a body may be faster between samples than at them."""

SLACK = 0.995
"""The factor by which an approach may be closer than estimated (in squared distance)."""

CAUTION = 0.5
"""The fraction of a limit above which a passage, whose speed and distance are only estimated, is examined closely."""

MANY = 1e18


@kernel(inline=True)
def estimate(h, before, now, first, second):
    """Return the least squared distance between two samples that are h apart, by two secants; `before` < 0 <= `now`.

    first, second : relative positions and velocities, six numbers each
    """
    s = before / (before - now)
    _, middle, _, _ = distance2_at(s, h, first, second)
    s = select(middle < 0.0, s + (1.0 - s) * middle / (middle - now), s * before / (before - middle))
    return distance2_at(s, h, first, second)[0]


@kernel(inline=True)
def is_near_or_fast(passage_angle, h, reach, d2, first, second):
    """Return for eight pairs whether the passage may have to be listed, from the velocities at two samples and an
    estimate of the least squared distance.
    """
    (u0, v0, w0), (u, v, w) = first, second
    speed2 = maximum(u * u + v * v + w * w, u0 * u0 + v0 * v0 + w0 * w0)
    angle = CAUTION * passage_angle
    return (h * h * speed2 > angle * angle * SLACK * d2) + (SLACK * d2 < reach * reach)


@kernel(inline=True)
def _is_low_or_sharp(watch, h, known, first, second):
    """Return for eight pairs with the dominant body whether the pericentre of the osculating orbit at either of two
    samples is closer than known, or may have to be listed, as the orbit is eccentric. (Over several steps, a polynomial
    does not describe such a pericentre.)
    """
    one, other = apsides(watch.mu, *first), apsides(watch.mu, *second)
    angle2 = CAUTION * watch.pericentre_angle * one.least * one.least
    sharp = (one.e > CAUTION * watch.least_eccentricity) * (h * h * one.swept2 > angle2 * angle2)
    least = minimum(one.least, other.least)
    return sharp + (SLACK * least * least < known)


@kernel(inline=True)
def _steps_until(watch, valid, reach, place, velocity, change, h, k, steps):
    """Return the number of steps to the next sample of pairs whose velocities change by `change` in step k of a
    block: one for those within `reach`, where the distance may hardly change between two passages.
    """
    (x, y, z), (u, v, w), (du, dv, dw) = place, velocity, change
    h = h * steps_between(watch, h, k, k + 1)
    r2, speed2 = x * x + y * y + z * z, u * u + v * v + w * w
    # distance / speed, or the time in which the acceleration covers the distance, whichever is shorter
    fall = sqrt(r2 * (du * du + dv * dv + dw * dw)) / abs(h)
    way = maximum(sqrt(r2) - reach, full(0.0))
    time2 = -largest(select(valid > 0.0, -(way * way) / (maximum(speed2, fall) + 1e-300 * r2), full(-MANY)))
    return steps_within(watch, h, k, steps, FRACTION * math.sqrt(time2) / abs(h))


@kernel
def longest_way(context, h, steps):
    """Return an upper bound of the distance that any body travels in a block of `steps` steps of h, or in a step
    divided by the passage angle. For few bodies it is infinite: computing a bound would cost more than it saves.
    """
    watch = watch_at(context)
    n, P, path = watch.bodies, watch.stride, watch.path
    if n < MANY_BODIES:
        return math.inf
    fastest2 = 0.0
    for step in range(steps + 1):
        first = (2 * step + 1) * P
        for i in range(n):
            u, v, w = path[first + i], path[first + n + i], path[first + 2 * n + i]
            fastest2 = max(fastest2, u * u + v * v + w * w)
    return DETOUR * abs(h) * max(steps_between(watch, h, 0, steps), 1.0 / watch.passage_angle) * math.sqrt(fastest2)


@kernel
def search(context, track, h, steps, j, row, valid):
    """Search for closest approaches of body j with those of the eight rows from `row` on whose lane is 1 in `valid`.

    The rows are massive bodies after j, or the particles whose states are in `track`.
    """
    watch = watch_at(context)
    n, record, dominant = watch.bodies, watch.record, watch.dominant
    reach = full(watch.reaches[j])
    if row < n:
        reach = maximum(load(watch.reaches, row), reach)
    column = DOMINANT if j == dominant else OTHER
    central = j == dominant or row <= dominant < row + WIDTH
    k = last = 0
    before = x0 = y0 = z0 = u0 = v0 = w0 = full(0.0)
    while True:
        x, y, z, u, v, w = eight_relative(watch, track, j, row, k)
        now = (x * u + y * v + z * w) * h
        turned = valid * (before < 0.0) * (now >= 0.0)
        if any_lane(turned):
            many = steps_between(watch, h, last, k)
            d2 = estimate(h * many, before * many, now * many, (x0, y0, z0, u0, v0, w0), (x, y, z, u, v, w))
            if row < n:
                nearest = record[DISTANCE2, OTHER, j]
                if row <= dominant < row + WIDTH:
                    nearest = max(nearest, record[DISTANCE2, DOMINANT, j])
                known = maximum(load(record[DISTANCE2, column], row), full(nearest))
            elif j == dominant or dominant < 0:
                known = load(record[DISTANCE2, column], row)
            else:
                known = full(watch.annuli[j, REACH] * watch.annuli[j, REACH])
            wanted = (SLACK * d2 < known) + is_near_or_fast(
                watch.passage_angle, h, reach, d2, (u0, v0, w0), (u, v, w)
            )
            if k - last > 1 and dominant < 0:
                wanted = full(1.0)
            elif central:
                wanted = wanted + _is_low_or_sharp(
                    watch, h, known, (x0, y0, z0, u0, v0, w0), (x, y, z, u, v, w)
                )
            turned = turned * wanted
            for i in range(WIDTH):
                if lane(turned, i) != 0.0:
                    one, other = (j, row + i) if row < n else (row + i, j)
                    call_enter(watch.enter, context, track, one, other, last, k, h)
        if k == steps:
            break
        before, last = now, k
        x0, y0, z0, u0, v0, w0 = x, y, z, u, v, w
        if watch.every != 0 and row < n:
            k += 1
            continue
        _, _, _, u, v, w = eight_relative(watch, track, j, row, k + 1)
        change = u - u0, v - v0, w - w0
        k += _steps_until(watch, valid, reach, (x, y, z), (u0, v0, w0), change, h, k, steps)


@kernel
def follow_bodies(context, h, steps):
    """Search for closest approaches among the massive bodies in a block of `steps` steps of h."""
    watch = watch_at(context)
    if watch.first == 0:
        note_rows(context, 0, watch.bodies)
    way = longest_way(context, h, steps)
    for i in range(watch.bodies - 1):
        follow_row(context, h, steps, way, i)


@kernel
def follow_row(context, h, steps, way, i):
    """Search among the pairs of body i with those after it; `way` is an upper bound of the distance any body
    travels.
    """
    watch = watch_at(context)
    n, reaches = watch.bodies, watch.reaches
    closest = watch.record[DISTANCE2, OTHER]
    for start in range(i + 1, n, WIDTH):
        valid = full(1.0)
        for j in range(n, start + WIDTH):
            valid = valid - unit(j - start)
        if i != watch.dominant and not start <= watch.dominant < start + WIDTH:
            # Pairs that stay farther apart in this block than their closest approaches so far, and than their reaches,
            # are skipped: two bodies approach by at most twice the way, and (a + b)^2 <= 2 (a^2 + b^2).
            x, y, z, _, _, _ = eight_relative(watch, no_particles(), i, start, 0)
            reach = maximum(load(reaches, start), full(reaches[i]))
            known = maximum(maximum(load(closest, start), full(closest[i])), reach * reach)
            if not any_lane(valid * (x * x + y * y + z * z <= 2.0 * (known + 4.0 * way * way))):
                continue
        call_search(watch.search, context, no_particles(), h, steps, i, start, valid)


@kernel
def note_annuli(context, steps):
    """Note between which distances from the dominant body each massive one is in a block of `steps` steps."""
    watch = watch_at(context)
    n, stride, path, annuli, dominant = watch.bodies, watch.stride, watch.path, watch.annuli, watch.dominant
    for j in range(n):
        low, high = math.inf, 0.0
        for k in range(steps + 1):
            at = 2 * k * stride
            x, y = path[at + j] - path[at + dominant], path[at + n + j] - path[at + n + dominant]
            z = path[at + 2 * n + j] - path[at + 2 * n + dominant]
            distance2 = x * x + y * y + z * z
            low, high = min(low, distance2), max(high, distance2)
        annuli[j, NEAR], annuli[j, FAR] = math.sqrt(low), math.sqrt(high)


@kernel
def follow_particles(context, track, h, steps, start, stop):
    """Search for closest approaches of particles start ... start + 7, if below `stop`, whose states are in `track`;
    those whose x is NaN are skipped. Then call the observers of conditions and of collisions, if there are any.

    track : (6 (steps + 1), 8), x, y, z and their velocities at the beginning of each step and at the end
    """
    watch = watch_at(context)
    n, annuli, dominant = watch.bodies, watch.annuli, watch.dominant
    stop = min(start + WIDTH, stop)
    if watch.first == 0:
        for p in range(start, stop):
            note_particle(context, track, n + p)
    valid = full(0.0)
    for p in range(start, stop):
        valid = valid + unit(p - start)
    valid = valid * (load(track, 0) * 0.0 == 0.0)
    lowest, highest = full(0.0), full(MANY)
    if dominant >= 0:
        orbit = apsides(watch.mu, *eight_relative(watch, track, dominant, n, 0))
        lowest, highest = orbit.least, orbit.largest
    for j in range(n):
        if dominant >= 0 and j != dominant:
            reach = annuli[j, REACH]
            meets = (lowest < MARGIN * annuli[j, FAR] + reach) * (MARGIN * highest > annuli[j, NEAR] - reach)
            if not any_lane(meets * valid):
                continue
        call_search(watch.search, context, track, h, steps, j, n + start, valid)
    call_observer(watch.then, context, track, h, steps, start, stop)
    call_observer(watch.collide, context, track, h, steps, start, stop)
