"""The record of closest approaches, and the list of the passages for which a step may be too long.

The rows of a record are the massive bodies, then the massless particles. Column 0 has the closest approach to the
dominant body, column 1 the closest to any other body; for a particle, the smallest as a fraction of that body's reach.

The list of passages has all those within the reach of a body other than the dominant one, and all for which a step may
be too long, each with the state at the beginning of its step.

`approaches.py` selects the pairs and the times at which they are sampled.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, lane
from orbits.kernels.search.apsides import apsides
from orbits.kernels.search.context import no_particles, watch_at
from orbits.kernels.search.observers import call_enter
from orbits.kernels.search.paths import eight_relative, least_distance, reading, relative, steps_between

DISTANCE2, TIME, SPEED2, PARTNER = 0, 1, 2, 3
QUANTITIES = 4
DOMINANT, OTHER = 0, 1

NEAR, FAR, REACH = 0, 1, 2
"""Columns of `annuli`: the least and largest distance of a body from the dominant one in this block, and the distance
within which passages of massless particles are recorded."""

BLIND = 2.0
"""Angle of a step above which a passage is listed for any orbit: it may be a fall into the centre."""

ROW, MATE, STEP, WHEN, LEAST2, FASTEST2, STATE, ABOUT = 0, 1, 2, 3, 4, 5, 6, 12
COLUMNS = 18
"""Columns of the list of passages: row, partner, step at the beginning of which the state is, time in steps, squared
distance and speed; then (from STATE on) position and velocity relative to the partner, and (from ABOUT on) to the
dominant body.
"""


@kernel(inline=True)
def _note(watch, row, j, d2, time, speed2):
    """Record the approach of a row to body j, if it is the closest of its kind so far."""
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


@kernel(inline=True)
def _pericentre(watch, track, row, j, step):
    """Return squared distance and speed at the pericentre of the osculating orbit of a pair that includes the dominant
    body.
    """
    orbit = apsides(watch.mu, *relative(watch, track, row, j, step))
    return orbit.least * orbit.least, watch.mu * (1.0 + orbit.e) / max(orbit.least, 1e-300)


@kernel(inline=True)
def _is_listed(watch, row, j, h, d2, speed2):
    """Return whether a passage is listed: within the reach of a body, too fast for the step, or at the pericentre of an
    eccentric orbit about the dominant body.
    """
    angle2 = h * h * speed2 / max(d2, 1e-300)
    if watch.dominant >= 0 and (j == watch.dominant or row == watch.dominant):
        eccentric = math.sqrt(d2) * speed2 > (1.0 + watch.least_eccentricity) * watch.mu
        return (eccentric and angle2 > watch.pericentre_angle * watch.pericentre_angle) or angle2 > BLIND * BLIND
    if angle2 > watch.passage_angle * watch.passage_angle:
        return True
    if watch.dominant < 0:
        return False
    reach = watch.reaches[j]
    if row < watch.bodies:
        reach = max(reach, watch.reaches[row])
    return d2 <= reach * reach


@kernel(inline=True)
def _list(watch, track, row, j, begin, s, d2, speed2):
    """Add a passage to the list, if there is room."""
    k = watch.listed[0]
    watch.listed[1] += 1
    if k >= watch.passages.shape[0]:
        return
    watch.listed[0] = k + 1
    line = watch.passages[k]
    line[ROW], line[MATE], line[STEP], line[WHEN] = row, j, reading(watch, begin, 0.0), reading(watch, begin, s)
    line[LEAST2], line[FASTEST2] = d2, speed2
    line[STATE], line[7], line[8], line[9], line[10], line[11] = relative(watch, track, row, j, begin)
    for i in range(ABOUT, COLUMNS):
        line[i] = 0.0
    if watch.dominant >= 0 and row != watch.dominant:
        line[ABOUT], line[13], line[14], line[15], line[16], line[17] = relative(
            watch, track, row, watch.dominant, begin
        )


@kernel
def enter_passage(context, track, row, j, begin, end, h):
    """Locate the step of the closest approach of a row to body j between two samples of the pair, and record the
    approach.

    If begin = end, record the distance at the beginning of that step.
    """
    watch = watch_at(context)
    both = row < watch.bodies and begin < end
    while end - begin > 1:
        middle = (begin + end) // 2
        x, y, z, u, v, w = relative(watch, track, row, j, middle)
        if (x * u + y * v + z * w) * h < 0.0:
            begin = middle
        else:
            end = middle
    if begin == end:
        x, y, z, u, v, w = relative(watch, track, row, j, begin)
        d2, s, speed2 = x * x + y * y + z * z, 0.0, u * u + v * v + w * w
    else:
        h = h * steps_between(watch, h, begin, begin + 1)
        d2, s, speed2 = least_distance(watch, track, row, j, begin, h)
        if (j == watch.dominant or row == watch.dominant) and h * h * speed2 > d2:
            # Here a step is too long for the polynomial.
            d2, speed2 = _pericentre(watch, track, row, j, begin)
        if _is_listed(watch, row, j, h, d2, speed2):
            _list(watch, track, row, j, begin, s, d2, speed2)
    for _ in range(2 if both else 1):
        _note(watch, row, j, d2, reading(watch, begin, s), speed2)
        row, j = j, row


@kernel
def enter_record(record, other, rows):
    """Merge another record into a record, keeping the closer approaches; of equal ones, that to the lower body
    number.
    """
    for column in range(record.shape[1]):
        for row in range(rows):
            old, new = record[DISTANCE2, column, row], other[DISTANCE2, column, row]
            if new < old or (new == old and other[PARTNER, column, row] < record[PARTNER, column, row]):
                for k in range(QUANTITIES):
                    record[k, column, row] = other[k, column, row]


@kernel
def note_rows(context, start, stop):
    """Record the distances of massive bodies start ... stop - 1 from the nearest and the dominant body when a
    block begins.
    """
    watch = watch_at(context)
    n, closest = watch.bodies, watch.record[DISTANCE2, OTHER]
    for i in range(start, stop):
        for first in range(0, n, WIDTH):
            x, y, z, _, _, _ = eight_relative(watch, no_particles(), i, first, 0)
            nearer = x * x + y * y + z * z < closest[i]
            if any_lane(nearer) or first <= watch.dominant < first + WIDTH:
                for j in range(first, min(first + WIDTH, n)):
                    if j != i and (lane(nearer, j - first) != 0.0 or j == watch.dominant):
                        call_enter(watch.enter, context, no_particles(), i, j, 0, 0, 1.0)


@kernel
def note_particle(context, track, row):
    """Record the distances of a particle from all bodies at the beginning of a block."""
    watch = watch_at(context)
    for j in range(watch.bodies):
        call_enter(watch.enter, context, track, row, j, 0, 0, 1.0)


@kernel
def note_end(context, track, q, v, particles):
    """Record all distances at the end of a run; the first state of `path` is the bodies', q and v are the
    particles'.
    """
    watch = watch_at(context)
    note_rows(context, 0, watch.bodies)
    for p in range(particles):
        for k in range(3):
            track[k, p % WIDTH], track[3 + k, p % WIDTH] = q[k, p], v[k, p]
        note_particle(context, track, watch.bodies + p)
