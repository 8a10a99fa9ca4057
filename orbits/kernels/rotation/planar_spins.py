"""The spins of moons in the plane of an orbit that they do not change: 32 starts at once, in lanes.

An orbit comes as a table (intervals, flows, 5), the same for each revolution. Each of its flows is a drift by a time,
then a kick at the place of the orbit that is reached then. Columns: the time, as an angle over pi; the direction of the
orbit, in half turns; the torque's strength; the fraction by which tides lessen the difference of the rates of spin and
orbit; the rate of the orbit. Angles are in half turns, so that whole ones are taken off without an error.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, fma, halves, joined, lane, load, rint, sqrt, store
from orbits.kernels.lanes.functions import log

TOGETHER = 4 * WIDTH
"""How many spins are marched at once: their instructions alternate, so that latencies overlap."""

TIME, DIRECTION, STRENGTH, LOST, RATE = range(5)


@kernel(inline=True)
def sine_of_turns(y, y2):
    """Return sin(2 pi y) for |y| <= 1/2 and y2 = y^2, with an error of 2e-16.

    y (1 - 4 y^2) has its zeros; what is left is a polynomial of y^2 with an error of 4e-17.
    """
    y4 = y2 * y2
    even = fma(fma(fma(fma(
        y4, 0.0029250372437149134, 0.1731992146544334), y4, 3.545738597119717), y4, 16.769405229345555),
        y4, 6.283185307179586,
    )  # fmt: skip
    odd = fma(fma(fma(fma(
        y4, -0.0002514267825648394, -0.025318698603408372), y4, -0.9116880912078065), y4, -9.628238835467018),
        y4, -16.208961011681385,
    )  # fmt: skip
    return y * fma(y2, -4.0, 1.0) * fma(odd, y2, even)


@kernel(inline=True)
def cosine_of_turns(y2):
    """Return cos(2 pi y) for |y| <= 1/2 and y2 = y^2, with an error of 8e-16."""
    y4 = y2 * y2
    even = fma(fma(fma(fma(fma(
        y4, 0.003758590561310354, 0.28200407958316315), y4, 7.903536340077173), y4, 60.24464137178173),
        y4, 64.93939402266825), y4, 1.0,
    )  # fmt: skip
    odd = fma(fma(fma(fma(fma(
        y4, -0.0002900600501912893, -0.03637490036340231), y4, -1.7143904138098518), y4, -26.42625678121189),
        y4, -85.45681720669127), y4, -19.739208802178716,
    )  # fmt: skip
    return fma(odd, y2, even)


@kernel(inline=True)
def _load(row, first):
    """Return sixteen lanes of a row."""
    return joined(load(row, first), load(row, first + WIDTH))


@kernel(inline=True)
def _store(row, first, values):
    one, two = halves(values)
    store(row, first, one)
    store(row, first + WIDTH, two)


@kernel(inline=True)
def _write(values, scale, out, first, column):
    """Write those of sixteen lanes that there are rows for, multiplied, into a column."""
    one, two = halves(values)
    for i in range(min(WIDTH, out.shape[0] - first)):
        out[first + i, column] = scale * lane(one, i)
    for i in range(min(WIDTH, out.shape[0] - first - WIDTH)):
        out[first + WIDTH + i, column] = scale * lane(two, i)


@kernel(inline=True)
def _moved(table, interval, k, x, w):
    """Return angles and rates after a drift and a kick."""
    x = fma(w, table[interval, k, TIME], x)
    y = x - table[interval, k, DIRECTION]
    y = y - rint(y)
    lag = fma(w, -1.0, table[interval, k, RATE])
    pull = sine_of_turns(y, y * y) * table[interval, k, STRENGTH]
    return x, w + fma(lag, table[interval, k, LOST], -pull)


@kernel
def march_spins(table, starts, first, revolutions, every, column, theta, rate):
    """March 32 spins for some revolutions of the orbit.

    starts : (3, padded), angles in half turns, whole half turns taken off, and rates; receives the ends
    first : the first of the 32; every : of so many revolutions the last one is recorded
    theta, rate : (starts, columns), receive angles in radians and rates after each interval, from `column` on
    """
    other = first + 2 * WIDTH
    x, turns, w = _load(starts[0], first), _load(starts[1], first), _load(starts[2], first)
    x_b, turns_b, w_b = _load(starts[0], other), _load(starts[1], other), _load(starts[2], other)
    for revolution in range(revolutions):
        for interval in range(table.shape[0]):
            for k in range(table.shape[1]):
                x, w = _moved(table, interval, k, x, w)
                x_b, w_b = _moved(table, interval, k, x_b, w_b)
            whole, whole_b = rint(x), rint(x_b)
            turns, x = turns + whole, x - whole
            turns_b, x_b = turns_b + whole_b, x_b - whole_b
            if (revolution + 1) % every == 0:
                _write(turns + x, math.pi, theta, first, column)
                _write(turns_b + x_b, math.pi, theta, other, column)
                _write(w, 1.0, rate, first, column)
                _write(w_b, 1.0, rate, other, column)
                column += 1
    for at, values, row in ((first, x, starts[0]), (first, turns, starts[1]), (first, w, starts[2])):
        _store(row, at, values)
    for at, values, row in ((other, x_b, starts[0]), (other, turns_b, starts[1]), (other, w_b, starts[2])):
        _store(row, at, values)


@kernel
def march_tangents(table, starts, tangents, first, revolutions, growth):
    """March sixteen spins, and a tangent vector of each, for some revolutions of the orbit.

    starts : as of `march_spins`; receives the ends
    tangents : (2, padded), changes of the angle in half turns, and of the rate; receives those at the end, of length 1
    growth : (padded,), receives the logarithm of the length that they had, with angles in radians
    """
    x, turns, w = _load(starts[0], first), _load(starts[1], first), _load(starts[2], first)
    dx, dw = _load(tangents[0], first), _load(tangents[1], first)
    grown = 0.0 * x
    for _ in range(revolutions):
        for interval in range(table.shape[0]):
            for k in range(table.shape[1]):
                dx = fma(dw, table[interval, k, TIME], dx)
                y = fma(w, table[interval, k, TIME], x) - table[interval, k, DIRECTION]
                y = y - rint(y)
                stiff = cosine_of_turns(y * y) * (2.0 * math.pi * table[interval, k, STRENGTH])
                dw = dw - fma(dw, table[interval, k, LOST], stiff * dx)
                x, w = _moved(table, interval, k, x, w)
            whole = rint(x)
            turns, x = turns + whole, x - whole
        length = sqrt(fma(dx * dx, math.pi * math.pi, dw * dw))
        one, two = halves(length)
        grown = grown + joined(log(one), log(two))
        dx, dw = dx / length, dw / length
    for values, row in ((x, starts[0]), (turns, starts[1]), (w, starts[2])):
        _store(row, first, values)
    for values, row in ((dx, tangents[0]), (dw, tangents[1]), (grown, growth)):
        _store(row, first, values)
