"""Closest approaches, read off the states at the beginning of each step of a block.

Between two states that are close in time, the relative motion of a pair is a cubic Hermite polynomial; where its
distance stops falling lies a closest approach. A pair is looked at often enough for neither its distance nor its
direction to change much in between, and what was found is narrowed down to the step where it is: where the steps
resolve the passages, a record depends on the states alone, not on when they were looked at.

Rows of a record are the massive bodies, then the massless particles. Column 0 is the closest approach to the dominant
body, column 1 that to any other; for a particle the one that is the smallest share of the reach of the partner.

Beside the record stands a list of passages: all within the reach of a body that the dominant one rules, and all that a
step may be too long for, each with the state at the beginning of the step where it is.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, largest, load, maximum, select, sqrt, unit
from orbits.kernels.paths import hermite, least_distance, relative

DISTANCE2, TIME, SPEED2, PARTNER = 0, 1, 2, 3
QUANTITIES = 4
DOMINANT, OTHER = 0, 1

NEAR, FAR, REACH = 0, 1, 2
"""Columns of `annuli`: the least and largest distance of a body from the dominant one in this block; how close to it
a massless particle must come to be recorded."""

FRACTION = 0.8
"""How much of the time in which a pair's speed or acceleration covers its distance may pass between two looks."""

MARGIN = 1.05
"""By how much the apsides of a particle may move within a block."""

CROWD = 64
"""Bodies from which on pairs that stay far apart are told beforehand."""

DETOUR = 1.25
"""How much faster than at the looks a body may be in between."""

SLACK = 0.995
"""How much smaller than estimated an approach may turn out."""

CAUTION = 0.5
"""The share of a limit at which a passage is looked at closely, its speed and distance being only estimated."""

BLIND = 2.0
"""Angle of a step from which on a passage is listed whatever its orbit: it may be a fall into the centre."""

MANY = 1e18

ROW, MATE, STEP, WHEN, LEAST2, FASTEST2, STATE, ABOUT = 0, 1, 2, 3, 4, 5, 6, 12
COLUMNS = 18
"""Columns of the list of passages: row, partner, step at whose beginning the state is, time in steps, squared distance
and speed; then (from STATE on) position and velocity relative to the partner, and (from ABOUT on) to the dominant body.
"""


@kernel(inline=True)
def _estimate(h, before, now, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1):
    """Return the squared least distance between two looks that are h apart, by two secants; `before` < 0 <= `now`."""
    s = before / (before - now)
    x, u, _ = hermite(s, h, x0, u0, x1, u1)
    y, v, _ = hermite(s, h, y0, v0, y1, v1)
    z, w, _ = hermite(s, h, z0, w0, z1, w1)
    middle = (x * u + y * v + z * w) * h
    s = select(middle < 0.0, s + (1.0 - s) * middle / (middle - now), s * before / (before - middle))
    x, _, _ = hermite(s, h, x0, u0, x1, u1)
    y, _, _ = hermite(s, h, y0, v0, y1, v1)
    z, _, _ = hermite(s, h, z0, w0, z1, w1)
    return x * x + y * y + z * z


@kernel
def _note(watch, row, j, d2, time, speed2):
    """Enter the approach of a row to body j, if it is the closest of its kind so far."""
    record, annuli = watch.record, watch.annuli
    column = DOMINANT if j == watch.dominant else OTHER
    rank = d2
    if column == OTHER and row >= watch.bodies:
        reach = annuli[j, REACH]
        if not d2 <= reach * reach:
            return
        if watch.dominant >= 0 and record[DISTANCE2, column, row] < math.inf:
            rank = d2 * (annuli[int(record[PARTNER, column, row]), REACH] / reach) ** 2
    if rank < record[DISTANCE2, column, row]:
        record[DISTANCE2, column, row] = d2
        record[TIME, column, row] = time
        record[SPEED2, column, row] = speed2
        record[PARTNER, column, row] = j


@kernel
def _pericentre(watch, track, row, j, step):
    """Return squared distance and speed at the pericentre of the osculating orbit about the dominant body, which is one
    of the two.
    """
    x, y, z, u, v, w = relative(watch, track, row, j, step)
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    parameter = (cx * cx + cy * cy + cz * cz) / watch.mu
    inverse_a = 2.0 / math.sqrt(x * x + y * y + z * z) - (u * u + v * v + w * w) / watch.mu
    e = math.sqrt(max(1.0 - parameter * inverse_a, 0.0))
    least = parameter / (1.0 + e)
    return least * least, watch.mu * (1.0 + e) / max(least, 1e-300)


@kernel
def _passage(watch, track, row, j, begin, end, h, both):
    """Enter the closest approach of a row to body j that lies between two looks at them: in the step where it is."""
    while end - begin > 1:
        middle = (begin + end) // 2
        x, y, z, u, v, w = relative(watch, track, row, j, middle)
        if (x * u + y * v + z * w) * h < 0.0:
            begin = middle
        else:
            end = middle
    d2, s, speed2 = least_distance(watch, track, row, j, begin, h)
    if (j == watch.dominant or row == watch.dominant) and h * h * speed2 > d2:
        # A step is too long here for a polynomial.
        d2, speed2 = _pericentre(watch, track, row, j, begin)
    _note(watch, row, j, d2, watch.first + begin + s, speed2)
    if both:
        _note(watch, j, row, d2, watch.first + begin + s, speed2)
    if _is_listed(watch, row, j, h, d2, speed2):
        _list(watch, track, row, j, begin, s, d2, speed2)


@kernel
def _is_listed(watch, row, j, h, d2, speed2):
    """Return whether a passage goes into the list: one in the reach of a body, one that is fast for the step, or the
    pericentre of an eccentric orbit about the dominant body.
    """
    angle2 = h * h * speed2 / max(d2, 1e-300)
    if watch.dominant >= 0 and (j == watch.dominant or row == watch.dominant):
        sharp = math.sqrt(d2) * speed2 > (1.0 + watch.mild) * watch.mu and angle2 > watch.keen * watch.keen
        return sharp or angle2 > BLIND * BLIND
    if angle2 > watch.bold * watch.bold:
        return True
    if watch.dominant < 0:
        return False
    reach = watch.reaches[j]
    if row < watch.bodies:
        reach = max(reach, watch.reaches[row])
    return d2 <= reach * reach


@kernel(inline=True)
def _is_near_or_fast(bold, h, reach, d2, x0, y0, z0, u0, v0, w0, u, v, w):
    """Return for eight pairs, of which the velocities at two looks and an estimate of the squared least distance are
    known, whether the passage may be one for the list.
    """
    speed2 = maximum(u * u + v * v + w * w, u0 * u0 + v0 * v0 + w0 * w0)
    angle = CAUTION * bold
    return (h * h * speed2 > angle * angle * SLACK * d2) + (SLACK * d2 < reach * reach)


@kernel(inline=True)
def _is_sharp(watch, h, x, y, z, u, v, w):
    """Return for eight pairs with the dominant body whether the osculating orbit is eccentric, its pericentre one for
    the list. (Between looks that are several steps apart, a sharp one makes a polynomial useless.)
    """
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    swept2 = cx * cx + cy * cy + cz * cz
    parameter = swept2 / watch.mu
    inverse_a = 2.0 / sqrt(x * x + y * y + z * z) - (u * u + v * v + w * w) / watch.mu
    e2 = 1.0 - parameter * inverse_a
    least = parameter / (1.0 + sqrt(maximum(e2, full(0.0))))
    least2, angle, mild = least * least, CAUTION * watch.keen, CAUTION * watch.mild
    return (e2 > mild * mild) * (h * h * swept2 > angle * angle * least2 * least2)


@kernel
def _list(watch, track, row, j, begin, s, d2, speed2):
    """Enter a passage into the list, if there is room."""
    k = watch.listed[0]
    watch.listed[1] += 1
    if k >= watch.passages.shape[0]:
        return
    watch.listed[0] = k + 1
    line = watch.passages[k]
    line[ROW], line[MATE], line[STEP], line[WHEN] = row, j, watch.first + begin, watch.first + begin + s
    line[LEAST2], line[FASTEST2] = d2, speed2
    line[STATE], line[7], line[8], line[9], line[10], line[11] = relative(watch, track, row, j, begin)
    for i in range(ABOUT, COLUMNS):
        line[i] = 0.0
    if watch.dominant >= 0 and row != watch.dominant:
        line[ABOUT], line[13], line[14], line[15], line[16], line[17] = relative(
            watch, track, row, watch.dominant, begin
        )


@kernel
def _note_pair(watch, track, row, j, time):
    """Enter the distance of a row from body j at the beginning of a block."""
    x, y, z, u, v, w = relative(watch, track, row, j, 0 * row)
    _note(watch, row, j, x * x + y * y + z * z, time, u * u + v * v + w * w)


@kernel
def note_rows(watch, track, time, start, stop):
    """Enter how far massive bodies start ... stop - 1 are from the nearest and the dominant one when a block begins."""
    n, path, closest = watch.bodies, watch.path, watch.record[DISTANCE2, OTHER]
    for i in range(start, stop):
        for first in range(0, n, WIDTH):
            x = load(path, first) - path[i]
            y = load(path, n + first) - path[n + i]
            z = load(path, 2 * n + first) - path[2 * n + i]
            nearer = x * x + y * y + z * z < closest[i]
            if any_lane(nearer) or first <= watch.dominant < first + WIDTH:
                for j in range(first, min(first + WIDTH, n)):
                    if j != i and (lane(nearer, j - first) != 0.0 or j == watch.dominant):
                        _note_pair(watch, track, i, j, time)


@kernel
def _note_particle(watch, track, row, time):
    """Enter the distances of a particle from all bodies at the beginning of a block."""
    for j in range(watch.bodies):
        _note_pair(watch, track, row, j, time)


@kernel
def note_end(watch, track, q, v, particles):
    """Enter all distances where a run ends: the bodies' state is the first of `path`, q and v are the particles'."""
    note_rows(watch, track, 1.0 * watch.first, 0, watch.bodies)
    for p in range(particles):
        for k in range(3):
            track[k, p % WIDTH], track[3 + k, p % WIDTH] = q[k, p], v[k, p]
        _note_particle(watch, track, watch.bodies + p, 1.0 * watch.first)


@kernel(inline=True)
def _steps_until(valid, x, y, z, u, v, w, du, dv, dw, h, left):
    """Return after how many of the steps that are left to look again at pairs whose velocities change by (du, dv, dw)
    in one step.
    """
    r2, speed2 = x * x + y * y + z * z, u * u + v * v + w * w
    # distance / speed, or what it takes the acceleration to cover the distance, whichever is shorter
    fall = sqrt(r2 * (du * du + dv * dv + dw * dw)) / abs(h)
    time2 = -largest(select(valid > 0.0, -r2 / (maximum(speed2, fall) + 1e-300 * r2), full(-MANY)))
    count = min(FRACTION * math.sqrt(time2) / abs(h), 1.0 * left)
    return int(count) if count >= 1.0 else 1


@kernel
def longest_way(watch, h, steps):
    """Return more than any body travels in a block of `steps` steps of h, or in a step divided by the bold angle; for
    a few bodies, no bound: it costs more than what it saves.
    """
    n, P, path = watch.bodies, watch.stride, watch.path
    if n < CROWD:
        return math.inf
    fastest2 = 0.0
    for step in range(steps + 1):
        first = (2 * step + 1) * P
        for i in range(n):
            u, v, w = path[first + i], path[first + n + i], path[first + 2 * n + i]
            fastest2 = max(fastest2, u * u + v * v + w * w)
    return DETOUR * abs(h) * max(1.0 * steps, 1.0 / watch.bold) * math.sqrt(fastest2)


@kernel
def follow_bodies(watch, track, h, steps):
    """Look for closest approaches among the massive bodies in a block of `steps` steps of h. `track` is not read."""
    if watch.first == 0:
        note_rows(watch, track, 0.0, 0, watch.bodies)
    way = longest_way(watch, h, steps)
    for i in range(watch.bodies - 1):
        follow_row(watch, track, h, steps, way, i)


@kernel
def follow_row(watch, track, h, steps, way, i):
    """Look at body i and those behind it, eight at a time in lanes; `way` is more than any body travels."""
    n, P, path, record = watch.bodies, watch.stride, watch.path, watch.record
    closest, reaches, bold = record[DISTANCE2, OTHER], watch.reaches, watch.bold
    for start in range(i + 1, n, WIDTH):
        valid = full(1.0)
        for j in range(n, start + WIDTH):
            valid = valid - unit(j - start)
        reach = maximum(load(reaches, start), full(reaches[i]))
        if i != watch.dominant and not start <= watch.dominant < start + WIDTH:
            # Bodies that stay farther apart in this block than both have already been from another, and than any
            # reach, are not looked at: two bodies travel twice the way, and (a + b)^2 <= 2 (a^2 + b^2).
            x, y, z = (
                load(path, start) - path[i],
                load(path, n + start) - path[n + i],
                load(path, 2 * n + start) - path[2 * n + i],
            )
            known = maximum(maximum(load(closest, start), full(closest[i])), reach * reach)
            if not any_lane(valid * (x * x + y * y + z * z <= 2.0 * (known + 4.0 * way * way))):
                continue
        k = last = 0 * steps  # a literal 0 would compile `_passage` three times
        before = x0 = y0 = z0 = u0 = v0 = w0 = full(0.0)
        while True:
            a = 2 * k * P
            b = a + P
            x = load(path, a + start) - path[a + i]
            y = load(path, a + n + start) - path[a + n + i]
            z = load(path, a + 2 * n + start) - path[a + 2 * n + i]
            u = load(path, b + start) - path[b + i]
            v = load(path, b + n + start) - path[b + n + i]
            w = load(path, b + 2 * n + start) - path[b + 2 * n + i]
            now = (x * u + y * v + z * w) * h
            turned = valid * (before < 0.0) * (now >= 0.0)
            if any_lane(turned):
                d2 = _estimate(
                    h * (k - last), before * (k - last), now * (k - last), x0, y0, z0, u0, v0, w0, x, y, z, u, v, w
                )
                nearest = record[DISTANCE2, OTHER, i]
                if start <= watch.dominant < start + WIDTH:
                    nearest = max(nearest, record[DISTANCE2, DOMINANT, i])
                column = DOMINANT if i == watch.dominant else OTHER
                known = maximum(load(record[DISTANCE2, column], start), full(nearest))
                wanted = (SLACK * d2 < known) + _is_near_or_fast(bold, h, reach, d2, x0, y0, z0, u0, v0, w0, u, v, w)
                if k - last > 1 and watch.dominant < 0:
                    wanted = full(1.0)
                elif i == watch.dominant or start <= watch.dominant < start + WIDTH:
                    wanted = wanted + _is_sharp(watch, h, x0, y0, z0, u0, v0, w0)
                turned = turned * wanted
                for j in range(start, min(start + WIDTH, n)):
                    if lane(turned, j - start) != 0.0:
                        _passage(watch, track, i, j, last, k, h, True)
            if k == steps:
                break
            before, last = now, k
            x0, y0, z0, u0, v0, w0 = x, y, z, u, v, w
            c = b + 2 * P
            u = load(path, c + start) - path[c + i] - u
            v = load(path, c + n + start) - path[c + n + i] - v
            w = load(path, c + 2 * n + start) - path[c + 2 * n + i] - w
            k += _steps_until(valid, x, y, z, u0, v0, w0, u, v, w, h, steps - k)


@kernel
def enter_record(record, other, rows):
    """Enter into a record what is closer in another one; of two as close, that to the body of the lower number."""
    for column in range(record.shape[1]):
        for row in range(rows):
            old, new = record[DISTANCE2, column, row], other[DISTANCE2, column, row]
            if new < old or (new == old and other[PARTNER, column, row] < record[PARTNER, column, row]):
                for k in range(QUANTITIES):
                    record[k, column, row] = other[k, column, row]


@kernel
def follow_particles(watch, track, h, steps, start, stop):
    """Look for closest approaches of particles start ... stop - 1, at most eight, whose states are in `track`.

    track : (6 (steps + 1), 8), x, y, z and their velocities at the beginning of each step and at the end
    """
    n, P, path, record = watch.bodies, watch.stride, watch.path, watch.record
    annuli, dominant, reaches, bold = watch.annuli, watch.dominant, watch.reaches, watch.bold
    if watch.first == 0:
        for p in range(start, stop):
            _note_particle(watch, track, n + p, 0.0)
    valid = full(0.0)
    for p in range(start, stop):
        valid = valid + unit(p - start)
    lowest, highest = full(0.0), full(MANY)
    if dominant >= 0:
        lowest, highest = _apsides(watch, track)
    for j in range(n):
        reach = annuli[j, REACH]
        if dominant >= 0 and j != dominant:
            meets = (lowest < MARGIN * annuli[j, FAR] + reach) * (MARGIN * highest > annuli[j, NEAR] - reach)
            if not any_lane(meets * valid):
                continue
        k = last = 0 * steps  # see above
        before = x0 = y0 = z0 = u0 = v0 = w0 = full(0.0)
        while True:
            a = 2 * k * P + j
            b = a + P
            x, y, z = (
                load(track, 6 * k) - path[a],
                load(track, 6 * k + 1) - path[a + n],
                load(track, 6 * k + 2) - path[a + 2 * n],
            )
            u, v, w = (
                load(track, 6 * k + 3) - path[b],
                load(track, 6 * k + 4) - path[b + n],
                load(track, 6 * k + 5) - path[b + 2 * n],
            )
            now = (x * u + y * v + z * w) * h
            turned = valid * (before < 0.0) * (now >= 0.0)
            if any_lane(turned):
                d2 = _estimate(
                    h * (k - last), before * (k - last), now * (k - last), x0, y0, z0, u0, v0, w0, x, y, z, u, v, w
                )
                known = full(reach * reach)
                if j == dominant or dominant < 0:
                    column = DOMINANT if j == dominant else OTHER
                    known = load(record[DISTANCE2, column], n + start)
                wanted = (SLACK * d2 < known) + _is_near_or_fast(
                    bold, h, full(reaches[j]), d2, x0, y0, z0, u0, v0, w0, u, v, w
                )
                if k - last > 1 and dominant < 0:
                    wanted = full(1.0)
                elif j == dominant:
                    wanted = wanted + _is_sharp(watch, h, x0, y0, z0, u0, v0, w0)
                turned = turned * wanted
                for p in range(start, stop):
                    if lane(turned, p - start) != 0.0:
                        _passage(watch, track, n + p, j, last, k, h, False)
            if k == steps:
                break
            before, last = now, k
            x0, y0, z0, u0, v0, w0 = x, y, z, u, v, w
            c = b + 2 * P
            u = load(track, 6 * k + 9) - path[c] - u
            v = load(track, 6 * k + 10) - path[c + n] - v
            w = load(track, 6 * k + 11) - path[c + 2 * n] - w
            k += _steps_until(valid, x, y, z, u0, v0, w0, u, v, w, h, steps - k)


@kernel
def _apsides(watch, track):
    """Return the osculating pericentre and apocentre distances of eight particles about the dominant body."""
    n, P, path, j = watch.bodies, watch.stride, watch.path, watch.dominant
    x, y, z = load(track, 0) - path[j], load(track, 1) - path[n + j], load(track, 2) - path[2 * n + j]
    u, v, w = load(track, 3) - path[P + j], load(track, 4) - path[P + n + j], load(track, 5) - path[P + 2 * n + j]
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    inverse_r = 1.0 / sqrt(x * x + y * y + z * z)
    parameter = (cx * cx + cy * cy + cz * cz) / watch.mu
    inverse_a = 2.0 * inverse_r - (u * u + v * v + w * w) / watch.mu
    e = sqrt(maximum(1.0 - parameter * inverse_a, full(0.0)))
    lowest = parameter / (1.0 + e)
    highest = select(inverse_a > 0.0, (1.0 + e) / maximum(inverse_a, full(1e-300)), full(MANY))
    return lowest, highest
