"""Bodies whose motion is given: positions and velocities from Chebyshev series, as ephemeris files have them.

A series is a row of a table, of `COLUMNS` numbers, and belongs to a coordinate triple: in record r, which covers the
time from (START_HI + START_LO) + (r - FIRST) SPAN on, for SPAN,

    q_a = sum_k c_ak T_k(x) / SCALE,     x in [-1, 1]

The series of a body is that of its centre, in rows before, or a body placed before, plus its own. Times are split into
the beginning of a step, which is exact, and the rest: a record is found, and x computed, without the rounding of a time
of ten thousand days, in which the Earth moves by a millimetre.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from orbits.kernels.binding import kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import full, largest, load, select, store
from orbits.kernels.sums.summation import two_sum

FILE, ROW, BASE, ADDS, WORDS, SIZE, COUNT, RECORDS, FIRST, START_HI, START_LO, SPAN, SCALE = range(13)
"""The columns of a table: which of the two files; the body, and the one to which this series is added, or -1; whether
it is added to what the body has; where its records begin, how many numbers each has and how many of these are
coefficients of a coordinate; how many records there are, which one has the epoch and where it begins, in days since the
epoch; the length of a record; and the length in the file of the unit of length.
"""

COLUMNS = 13

BEFORE_COEFFICIENTS = 2
"""A record begins with its middle and half of its length."""

EDGE = 1.0 + 1e-9
"""A record holds for |x| up to this: to a rounding error beyond its ends."""


class Given(NamedTuple):
    """Where massive bodies 0 ... n - 1 are, as a function of time.

    table : (series, COLUMNS); words, more : the numbers of one or two files
    """

    table: Any
    words: Any
    more: Any


@verb
def given_in(lagrangian, parameters):
    """Return what gives the motion of bodies, of a sum with a term that does."""
    place = next(k for k, term in enumerate(lagrangian.terms) if kernel_of(term, "given"))
    return lambda lagrangian, parameters: Given(parameters[place][0], parameters[place][1], parameters[place][2])


@kernel(inline=True)
def held_by(given):
    """Return the number of bodies whose motion is given."""
    return int(given.table[given.table.shape[0] - 1, ROW]) + 1


@kernel(inline=True)
def series_at(words, first, count, x):
    """Return sum_k c_k T_k(x) and its derivative, for the `count` > 1 coefficients from `first` on, by Clenshaw's
    recurrence; x : `Lanes`.
    """
    twice = x + x
    one = two = slope = before = full(0.0)
    for k in range(count - 1, 0, -1):
        slope, before = (one + one) + (twice * slope - before), slope
        one, two = words[first + k] + (twice * one - two), one
    return words[first] + (x * one - two), one + (x * slope - before)


@kernel(inline=True)
def place_series(series, words, t, ahead, n, Q, V):
    """Write, or add, what a series gives of the positions and velocities of its body at the times t + ahead.

    series : (COLUMNS,), a row of the table; words : of its file
    t : float64; ahead : `Lanes`, ascending or descending from lane to lane
    Q, V : (3n and more, 8)
    A time that the records do not cover gives NaN.
    """
    row, base, span = int(series[ROW]), int(series[BASE]), series[SPAN]
    size, count, first = int(series[SIZE]), int(series[COUNT]), int(series[FIRST])
    since, since_lo = two_sum(t, -series[START_HI])
    rest = full(since_lo - series[START_LO]) + ahead
    begin, end = -largest(-1.0 * rest) + since, largest(rest) + since
    lowest, highest = math.floor(begin / span), math.floor(end / span)
    least, most = -first, int(series[RECORDS]) - 1 - first
    x = y = z = vx = vy = vz = full(math.nan)
    for k in range(max(lowest - 1, least), min(highest + 1, most) + 1):
        s = ((since - (k + 0.5) * span) + rest) / (0.5 * span)
        # Records meet at their ends, where rounding must leave no gap: the later one holds there.
        inside = (s >= -EDGE) * (s <= EDGE)
        if largest(inside) == 0.0:
            continue
        at = int(series[WORDS]) + (first + k) * size + BEFORE_COEFFICIENTS
        a, va = series_at(words, at, count, s)
        b, vb = series_at(words, at + count, count, s)
        c, vc = series_at(words, at + 2 * count, count, s)
        here = inside > 0.5
        x, y, z = select(here, a, x), select(here, b, y), select(here, c, z)
        vx, vy, vz = select(here, va, vx), select(here, vb, vy), select(here, vc, vz)
    scale, speed = series[SCALE], series[SCALE] * (0.5 * span)
    x, y, z, vx, vy, vz = x / scale, y / scale, z / scale, vx / speed, vy / speed, vz / speed
    if series[ADDS] != 0.0:
        base = row
    if base >= 0:
        x, y, z = x + load(Q, base), y + load(Q, n + base), z + load(Q, 2 * n + base)
        vx, vy, vz = vx + load(V, base), vy + load(V, n + base), vz + load(V, 2 * n + base)
    store(Q, row, x)
    store(Q, n + row, y)
    store(Q, 2 * n + row, z)
    store(V, row, vx)
    store(V, n + row, vy)
    store(V, 2 * n + row, vz)


@kernel
def place_given(given, t, ahead, n, Q, V):
    """Write positions and velocities of the given bodies, among n massive ones, at the times t + ahead.

    t : the time since the epoch, days; ahead : `Lanes`; Q, V : (3n and more, 8), a row for each coordinate
    """
    table = given.table
    for k in range(table.shape[0]):
        if table[k, FILE] == 0.0:
            place_series(table[k], given.words, t, ahead, n, Q, V)
        else:
            place_series(table[k], given.more, t, ahead, n, Q, V)


@kernel
def given_states(table, words, more, times, bodies, room, out):
    """Write the states of given bodies at times since the epoch.

    times : (m,); bodies : their number n; room : (6n, 8), workspace; out : (m, 2, n, 3), positions and velocities
    """
    Q, V = room[: 3 * bodies], room[3 * bodies :]
    for i in range(times.shape[0]):
        place_given(Given(table, words, more), times[i], full(0.0), bodies, Q, V)
        for j in range(bodies):
            for a in range(3):
                out[i, 0, j, a], out[i, 1, j, a] = Q[a * bodies + j, 0], V[a * bodies + j, 0]
