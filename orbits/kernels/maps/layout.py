"""Where planets and their constants stand: the rows of the arrays `planets` and `room`, and access to them.

Arrays are (rows, 8). `planets`, the state, has for each register of eight planets 12 rows: places and velocities, then
their low parts, see `orbits.kernels.maps.orbits`; then two rows of the centre of mass, its position and velocity and
their low parts, with the number of the dominant body in lane 6, and in lane 7 whether the planets have been numbered, 1
or `IN_ORDER`; then a row of the body in each lane, -1 for none, for each register. `room` has for each register the
`ROWS` that are named below for Jacobi coordinates, and in `orbits.kernels.maps.heliocentric` for the others, and then
eight of workspace.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full, joined, load, load_like, pair, store

STATE_ROWS, ROWS = 12, 41
"""Rows of a register in `planets` and in `room`."""

FORCE, PLACE, SHIFTED, CHANGE, MOVED = 0, 3, 6, 9, 18
"""Rows of `room`: the interaction; u; r' displaced along the interaction, or the displacement; the change of velocity
by the Kepler motion and the kick before it; the displacement of u."""

IN_ORDER = 2.0
"""The planets are numbered as the bodies, and the dominant body is the first."""

ATTRACTING, MASS, SHARE, OUTER, INNER, CENTRAL, REST = 12, 13, 14, 15, 16, 17, 21
"""Rows of `room`: M_i; m_i; w_i; M_i / M_(i-1); 1 / M_(i-1); m_0 / M_(i-1); what rounding takes from the product of the
first and the last, with which the dominant body attracts; all 0 in lanes without a planet."""

RATE, OWN = 22, 28
"""Rows of `room` for terms of the dominant body: the rates of r' and of its velocity; workspace."""

NEAREST = 34
"""The first of seven rows of `room` for what `orbits.kernels.maps.nearest` notes."""


class Masses(NamedTuple):
    """The constants of the planets of one or two registers; see the rows of `room`. central : m_0"""

    mass: Any
    share: Any
    outer: Any
    inner: Any
    pull: Any
    attracting: Any
    rest: Any
    central: Any


@kernel(inline=True)
def registers_in(planets):
    """Return the number of registers of the planets."""
    return (planets.shape[0] - 2) // (STATE_ROWS + 1)


@kernel(inline=True)
def rooms(planets, scratch):
    """Return the parts of the scratch: the room of the planets, and that for a copy of them, if there is one."""
    rows = ROWS * registers_in(planets) + WIDTH
    return scratch[:rows], scratch[rows:]


@kernel(inline=True)
def dominant(planets):
    """Return the number of the dominant body."""
    return int(planets[STATE_ROWS * registers_in(planets), 6])


@kernel(inline=True)
def body_of(planets, i):
    """Return the number of the body that is planet i."""
    return int(planets[STATE_ROWS * registers_in(planets) + 2 + i // WIDTH, i % WIDTH])


@kernel(inline=True)
def constant(room, row, i):
    """Return a constant of planet i."""
    return room[ROWS * (i // WIDTH) + row, i % WIDTH]


@kernel(inline=True)
def coordinate(planets, row, i):
    """Return a row of the state of planet i."""
    return planets[STATE_ROWS * (i // WIDTH) + row, i % WIDTH]


@kernel(inline=True)
def copy_rows(rows, copy):
    """Write a copy of as many rows as there is place for."""
    for row in range(copy.shape[0]):
        store(copy, row, load(rows, row))


@kernel(inline=True)
def rest_elsewhere(planets, count, furthest):
    """Put the lanes without a planet to different places, all outside of `furthest`, where they rest."""
    for i in range(count, WIDTH * registers_in(planets)):
        register, k = i // WIDTH, i % WIDTH
        for row in range(STATE_ROWS):
            planets[STATE_ROWS * register + row, k] = 0.0
        planets[STATE_ROWS * register, k] = (2.0 + i) * (furthest + 1.0)


@verb
def registers_of(method):
    """Return a value of the kind in which a form computes its planets: two registers at once for nine to sixteen. None
    for any other number: planets of a single register stay in it, those of more are taken by passes over memory.
    """
    if kernel_of(method.types[0], "registers") == 2:
        return lambda method: joined(full(0.0), full(0.0))
    return lambda method: None


@verb
def kind_of(registers):
    """Return a value of the kind in which planets stay in registers: one of them for None."""
    return (lambda registers: registers) if registers == pair else (lambda registers: full(0.0))


@verb
def stay_in_registers(registers, room):
    """Return whether planets stay in registers."""
    return (lambda registers, room: True) if registers == pair else (lambda registers, room: room.shape[0] < 2 * ROWS)


@kernel(inline=True)
def masses_of(like, room):
    """Return the constants of as many registers as `like` has."""
    # m_0 = (m_0 / M_(i-1)) / (1 / M_(i-1)); lanes without a planet have mass 0.
    return Masses(
        load_like(like, room, MASS, ROWS),
        load_like(like, room, SHARE, ROWS),
        load_like(like, room, OUTER, ROWS),
        load_like(like, room, INNER, ROWS),
        load_like(like, room, CENTRAL, ROWS),
        load_like(like, room, ATTRACTING, ROWS),
        load_like(like, room, REST, ROWS),
        room[CENTRAL, 0] / room[INNER, 0],
    )
