"""Whether planets of a single register may have passed each other or the dominant body too closely in a block of steps.

Before the block, the osculating orbits bound the speeds of the planets, and with them the ways between two kicks. The
distances at the kicks, which the interaction has at hand, then tell whether anything came so close that all states of
the block have to be looked at: two planets within `HILL_RADII` mutual Hill radii, or a turn about the dominant body by
too large an angle in a step. A planet that comes closer to the dominant body than was assumed counts as well.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full, load, maximum, pair, store
from orbits.kernels.maps.interaction import (
    ATTRACTING,
    CENTRAL,
    INNER,
    MASS,
    MOVED,
    NEAREST,
    STATE_ROWS,
    interaction,
    load_three,
    masses_of,
)
from orbits.kernels.search.apsides import apsides

HILL_RADII = 3.0
"""Mutual Hill radii within which two planets disturb each other as much as a few steps can follow."""

CLOSER, BETWEEN, FASTER = 0.97, 0.97, 1.02
"""How much closer than its osculating pericentre a planet may come to the dominant body in the block; how much closer
between two kicks, at steps that resolve its pericentre; and how much faster it may then be."""

WAY = 0.55
"""The way of two planets towards each other from one of two kicks, of that in a step at their largest speeds."""

CENTRE, CLOSEST = NEAREST + 4, NEAREST + 5
"""The row of the squared distances from the dominant body that count as close, after those of pairs of planets 1, 2, 3
and 4 lanes on; and that of the largest ratio of these to the squared distances at kicks: above 1 if any was as close.
"""


@kernel
def begin_nearest(planets, room, h, angle):
    """Begin a block of steps of h; angle : the largest turn in a step at a pericentre. The rows MOVED are workspace."""
    central, all_in = room[CENTRAL, 0] / room[INNER, 0], 0.0
    for i in range(WIDTH):
        all_in += room[MASS, i]
    faster = FASTER + 2.0 * all_in / central  # Jacobi coordinates and places differ by the share of the planets
    for i in range(WIDTH):
        gm, x, y, z = room[ATTRACTING, i], planets[0, i], planets[1, i], planets[2, i]
        orbit = apsides(gm, x, y, z, planets[3, i], planets[4, i], planets[5, i])
        least = CLOSER * orbit.least
        between = max(BETWEEN * least, 1e-150)
        speed2 = gm * (2.0 / between - orbit.inverse_a)
        way = abs(h) * faster * math.sqrt(max(speed2, 0.0))
        there = planets[STATE_ROWS + 2, i] >= 0.0
        room[CENTRE, i] = least * least if there else 0.0
        room[CLOSEST, i] = math.inf if there and not way <= angle * between else 0.0
        room[MOVED, i], room[MOVED + 1, i] = way, faster * orbit.largest
    for places in range(1, 5):
        for i in range(WIDTH):
            k = (i + places) % WIDTH
            hill = HILL_RADII * ((room[MASS, i] + room[MASS, k]) / (3.0 * central)) ** (1.0 / 3.0)
            # Both are as far from the dominant body as the nearer one ever is, and from each other.
            within = min(room[MOVED + 1, i], room[MOVED + 1, k]) * hill / max(1.0 - hill, 1e-150)
            apart = within + WAY * (room[MOVED, i] + room[MOVED, k])
            both = planets[STATE_ROWS + 2, i] >= 0.0 and planets[STATE_ROWS + 2, k] >= 0.0
            room[NEAREST + places - 1, i] = apart * apart if both else 0.0
    X, Y, Z = load_three(planets, 0)
    note_nearest(room, interaction(X, Y, Z, masses_of(full(0.0), room))[2])


@verb
def note_nearest(room, pairs):
    """Take note of the distances at a kick, of planets of a single register; pairs : of `interaction`."""
    if pairs.types[1].types[0] == pair:
        return lambda room, pairs: None
    return lambda room, pairs: _note(room, pairs)


@kernel(inline=True)
def _note(room, pairs):
    (one, two, three, four), inwards, _ = pairs
    near = maximum(one.squared * load(room, NEAREST), two.squared * load(room, NEAREST + 1))
    far = maximum(three.squared * load(room, NEAREST + 2), four.squared * load(room, NEAREST + 3))
    closest = maximum(maximum(near, far), inwards.squared * load(room, CENTRE))
    store(room, CLOSEST, maximum(closest, load(room, CLOSEST)))
