"""Massless particles among planets in democratic heliocentric coordinates, eight in lanes.

Their coordinates are those of planets (`orbits.kernels.maps.heliocentric`): the position relative to the dominant body,
and the velocity relative to the centre of mass of all. They are kept as in `orbits.kernels.maps.jacobi_particles`.

A table is what particles need of the planets in a step: a row with P / m_0, one with the position of the dominant body
and the velocity of the centre of mass at the end of the step, and a row for each planet: its position relative to the
dominant body at the kick, and m in column 6.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, get, select
from orbits.kernels.maps.heliocentric import MASS, jumped_and_drifted, origin_of
from orbits.kernels.maps.jacobi_particles import attraction, on_orbits, seen_particles
from orbits.kernels.maps.layout import constant, coordinate
from orbits.kernels.maps.orbits import place_of, times
from orbits.kernels.search.context import flat

CENTRE, PLANETS = 1, 2
"""Rows of a table: the position of the dominant body and the velocity of the centre of mass; the first planet."""


@kernel
def tabulate_planets(planets, room, table, count):
    """Write the rows of the planets."""
    for i in range(count):
        for component in range(3):
            table[PLANETS + i, component] = coordinate(planets, component, i)
        table[PLANETS + i, 6] = constant(room, MASS, i)


@kernel
def tabulate_the_rest(strength, planets, room, table, jump):
    """Write the rows of the jump, P / m_0, and of the centre; planets : at the end of the step."""
    for component in range(6):
        table[CENTRE, component] = origin_of(strength, planets, room, component)[0]
        if component < 3:
            table[0, component] = jump[component]


@kernel(inline=True)
def stepped_particles(marched, table, count, h):
    """Return eight particles after a step."""
    line, zero = flat(table), full(0.0)
    force = attraction(line, PLANETS, count, 0, place_of(marched.orbits), (zero, zero, zero))
    there = select(marched.gm > 0.0, full(h), 0.0)
    jump = there * get(line, 0), there * get(line, 1), there * get(line, 2)
    return on_orbits(marched, jumped_and_drifted(marched.orbits, marched.gm, h, jump, times(h, force)))


@kernel(inline=True)
def seen_among_heliocentric(table, marched):
    """Return particles at the end of a step as observers see them."""
    line, at = flat(table), WIDTH * CENTRE
    x, y, z = get(line, at), get(line, at + 1), get(line, at + 2)
    return seen_particles((x, y, z, get(line, at + 3), get(line, at + 4), get(line, at + 5)), marched)
