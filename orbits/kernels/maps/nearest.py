"""Whether planets in registers may have passed each other or the dominant body too closely in a block of steps.

Before the block, the osculating orbits bound the speeds of the planets, and with them the ways between two kicks. The
distances at the kicks, which the interaction has at hand, then tell whether anything came so close that all states of
the block have to be looked at: two planets within `HILL_RADII` mutual Hill radii, or a turn about the dominant body by
too large an angle in a step. A planet that comes closer to the dominant body than was assumed counts as well.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    first_lane,
    fma,
    full,
    halves,
    joined,
    lane,
    load,
    load_like,
    maximum,
    pair,
    select,
    store,
    store_like,
    turned,
    unit,
)
from orbits.kernels.maps.interaction import interaction
from orbits.kernels.maps.layout import (
    ATTRACTING,
    CENTRAL,
    INNER,
    MASS,
    MOVED,
    NEAREST,
    ROWS,
    STATE_ROWS,
    masses_of,
)
from orbits.kernels.maps.orbits import orbits_of
from orbits.kernels.search.apsides import apsides

HILL_RADII = 3.0
"""Mutual Hill radii within which two planets disturb each other as much as a few steps can follow."""

CLOSER, BETWEEN, FASTER = 0.97, 0.97, 1.02
"""How much closer than its osculating pericentre a planet may come to the dominant body in the block; how much closer
between two kicks, at steps that resolve its pericentre; and how much faster it may then be."""

WAY = 0.55
"""The way of two planets towards each other from one of two kicks, of that in a step at their largest speeds."""

CENTRE, CLOSEST, REACH = NEAREST + 4, NEAREST + 5, NEAREST + 6
"""Rows after the squared distances that count as close for pairs 1, 2, 3 and 4 lanes on, in the first register: those
from the dominant body; the largest ratio of any to the squared distance at a kick, above 1 if one was as close; and for
pairs with a planet of the second register, the two parts of a distance that counts as close."""

FAR = 1e300
"""The square of a distance that is never close."""


@kernel
def begin_nearest(like, planets, room, h, angle):
    """Begin a block of steps of h of planets in as many registers as `like` has. The rows MOVED are workspace.

    angle : the largest turn in a step at a pericentre
    """
    central, all_in, registers = room[CENTRAL, 0] / room[INNER, 0], 0.0, room.shape[0] // ROWS
    heaviest, numbers = 0.0, STATE_ROWS * registers + 2
    for register in range(registers):
        for i in range(WIDTH):
            all_in += room[ROWS * register + MASS, i]
            heaviest = max(heaviest, room[ROWS * register + MASS, i])
    faster = FASTER + 2.0 * all_in / central  # Jacobi coordinates and places differ by the share of the planets
    alone = max(1.0 - 2.0 * _hill(heaviest, central), 1e-150)
    for register in range(registers):
        state, first = STATE_ROWS * register, ROWS * register
        for i in range(WIDTH):
            gm = room[first + ATTRACTING, i]
            x, y, z = planets[state, i], planets[state + 1, i], planets[state + 2, i]
            orbit = apsides(gm, x, y, z, planets[state + 3, i], planets[state + 4, i], planets[state + 5, i])
            least = CLOSER * orbit.least
            between = max(BETWEEN * least, 1e-150)
            speed2 = gm * (2.0 / between - orbit.inverse_a)
            way = abs(h) * faster * math.sqrt(max(speed2, 0.0))
            there = planets[numbers + register, i] >= 0.0
            room[first + CENTRE, i] = least * least if there else 0.0
            room[first + CLOSEST, i] = math.inf if there and not way <= angle * between else 0.0
            farthest = faster * orbit.largest
            room[first + MOVED, i], room[first + MOVED + 1, i] = way, farthest
            reach = farthest * _hill(room[first + MASS, i], central) / alone + WAY * way
            room[first + REACH, i] = reach if there else 0.0
    for places in range(1, 5):
        for i in range(WIDTH):
            k = (i + places) % WIDTH
            hill = _hill(room[MASS, i] + room[MASS, k], central)
            # Both are as far from the dominant body as the nearer one ever is, and from each other.
            within = min(room[MOVED + 1, i], room[MOVED + 1, k]) * hill / max(1.0 - hill, 1e-150)
            apart = within + WAY * (room[MOVED, i] + room[MOVED, k])
            both = planets[numbers, i] >= 0.0 and planets[numbers, k] >= 0.0
            room[NEAREST + places - 1, i] = apart * apart if both else 0.0
    now = orbits_of(like, planets)
    note_nearest(room, interaction(now.place, masses_of(like, room))[2])


@kernel(inline=True)
def _hill(mass, central):
    return HILL_RADII * (mass / (3.0 * central)) ** (1.0 / 3.0)


@verb
def note_nearest(room, pairs):
    """Take note of the distances at a kick; pairs : of `interaction`."""
    return _note_two if pairs.types[1].types[1] == pair else _note_one


def _note_one(room, pairs):
    closest = maximum(_ratio_within(room, pairs.among), pairs.inwards.squared * load(room, CENTRE))
    store(room, CLOSEST, maximum(closest, load(room, CLOSEST)))


def _note_two(room, pairs):
    (x, y, z), near = pairs.inwards.apart, pairs.inwards.squared
    reach = load_like(x, room, REACH, ROWS)
    closest = maximum(joined(_ratio_within(room, pairs.among), full(0.0)), load_like(x, room, CLOSEST, ROWS))
    closest = maximum(closest, near * load_like(x, room, CENTRE, ROWS))
    (_, X), (_, Y), (_, Z), (_, other) = halves(x), halves(y), halves(z), halves(reach)
    here = unit(0)
    while first_lane(other > 0.0) < 1:  # planets fill a register from its first lane on
        dx, dy, dz, near = lane(X, 0) - x, lane(Y, 0) - y, lane(Z, 0) - z, lane(other, 0) + reach
        apart = fma(dx, dx, fma(dy, dy, fma(dz, dz, joined(full(0.0), FAR * here))))
        closest = maximum(closest, select(apart < near * near, 2.0, 0.0))
        other = other - other * unit(0)
        X, Y, Z, other, here = turned(X, 1), turned(Y, 1), turned(Z, 1), turned(other, 1), turned(here, 7)
    store_like(room, CLOSEST, ROWS, closest)


@kernel(inline=True)
def _ratio_within(room, among):
    """Return the largest ratios of pairs of planets of the first register."""
    one, two, three, four = among
    near = maximum(one.squared * load(room, NEAREST), two.squared * load(room, NEAREST + 1))
    return maximum(near, maximum(three.squared * load(room, NEAREST + 2), four.squared * load(room, NEAREST + 3)))


def closest_in(room: NDArray[np.float64]) -> float:
    """Return the largest ratio that was noted since the beginning of the block; room : the scratch of a march"""
    registers = len(room) // ROWS
    return float(room[[ROWS * register + CLOSEST for register in range(registers)]].max())
