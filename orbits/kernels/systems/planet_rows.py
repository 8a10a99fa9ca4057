"""The rows of the planets of eight systems, with a coordinate of each system in a lane.

The planets of each system are numbered outwards, as they are alone. Rows 0 ... 11 have the centre of mass: its position
and velocity, and their low parts; the next six the dominant body as it is seen. Then there are `PLANET` rows for each
planet, of as many planets as fill the registers of a system alone: row `PLANET * i + GM` is the GM of planet i. Those
of planets that do not exist are 0.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, load, store
from orbits.kernels.maps.interaction import (
    ATTRACTING,
    CENTRAL,
    INNER,
    MASS,
    OUTER,
    REST,
    ROWS,
    SHARE,
    STATE_ROWS,
    Masses,
)
from orbits.kernels.maps.jacobi import prepare_room

CENTRE, STAR = 0, STATE_ROWS
STATE = STAR + 6
GM = STATE + STATE_ROWS
WEIGHT, ALL_IN = GM + 1, GM + 5
FORCE = GM + 8
PLACE = FORCE + 3
CHANGE = PLACE + 3
SHIFTED = CHANGE + 3
MOVED = SHIFTED + 3
POWERS = MOVED + 3
OWN = POWERS + 4
INWARDS = OWN + 3
PULLS = INWARDS + 3
INVERSE = PULLS + 12
SEEN = INVERSE + 8
PLANET = SEEN + 6 - STATE
"""Rows of a planet: its state, r', its velocity and their low parts; eight constants, the fields of `Masses`, among
them w_i and M_i; the interaction; u; the change of velocity; r' displaced, or the displacement; the displacement of u,
both of which the changes of r' / r'^3 and u / u^3 replace; the powers -3 of u and of r', and -2; the sum of the pulls
on it, and what it passes on to those inside; the pulls of the planets 1 ... 4 places on in its register, counted round,
and the same powers of their distances; and its state as it is seen."""


def rows_of_planets(count: int) -> int:
    """Return the rows for `count` planets."""
    return STATE + PLANET * (-(-count // WIDTH) * WIDTH)


@kernel(inline=True)
def registers_of(count):
    """Return the number of registers that `count` planets fill."""
    return (count + WIDTH - 1) // WIDTH


@kernel(inline=True)
def masses_at(rows, planet):
    """Return the constants of a planet; planet : `PLANET` times its number."""
    first = planet + GM
    return Masses(
        load(rows, first),
        load(rows, first + 1),
        load(rows, first + 2),
        load(rows, first + 3),
        load(rows, first + 4),
        load(rows, first + 5),
        load(rows, first + 6),
        load(rows, first + 7),
    )


@kernel
def gather_planets(strengths, carries, room, rows):
    """Write the states and constants of eight systems into `rows`.

    strengths : (8, 1 + n), see `prepare_room`; carries : (8, rows, 8), the `planets` of each; room : workspace for one
    """
    count = strengths.shape[1] - 2
    centre = STATE_ROWS * registers_of(count)
    for k in range(rows.shape[0]):
        store(rows, k, full(0.0))
    for system in range(WIDTH):
        planets = carries[system]
        prepare_room(strengths[system], planets, room)
        for i in range(count):
            first, k = i // WIDTH, i % WIDTH
            for row in range(STATE_ROWS):
                rows[PLANET * i + STATE + row, system] = planets[STATE_ROWS * first + row, k]
            constants = PLANET * i + GM
            rows[constants, system] = room[ROWS * first + MASS, k]
            rows[constants + 1, system] = room[ROWS * first + SHARE, k]
            rows[constants + 2, system] = room[ROWS * first + OUTER, k]
            rows[constants + 3, system] = room[ROWS * first + INNER, k]
            rows[constants + 4, system] = room[ROWS * first + CENTRAL, k]
            rows[constants + 5, system] = room[ROWS * first + ATTRACTING, k]
            rows[constants + 6, system] = room[ROWS * first + REST, k]
            rows[constants + 7, system] = room[CENTRAL, 0] / room[INNER, 0]
        for row in range(6):
            rows[CENTRE + row, system] = planets[centre, row]
            rows[CENTRE + 6 + row, system] = planets[centre + 1, row]


@kernel
def scatter_planets(rows, count, carries):
    """Write the states of eight systems back."""
    centre = STATE_ROWS * registers_of(count)
    for system in range(WIDTH):
        planets = carries[system]
        for i in range(count):
            for row in range(STATE_ROWS):
                planets[STATE_ROWS * (i // WIDTH) + row, i % WIDTH] = rows[PLANET * i + STATE + row, system]
        for row in range(6):
            planets[centre, row] = rows[CENTRE + row, system]
            planets[centre + 1, row] = rows[CENTRE + 6 + row, system]


@kernel(inline=True)
def body_of(planets, count, i):
    """Return the number of the body that is planet i of a system, the dominant one for i = -1; planets : its carry."""
    centre = STATE_ROWS * registers_of(count)
    return int(planets[centre, 6]) if i < 0 else int(planets[centre + 2 + i // WIDTH, i % WIDTH])
