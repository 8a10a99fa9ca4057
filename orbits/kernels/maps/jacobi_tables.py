"""Tables of what massless particles need of planets in Jacobi coordinates; see `orbits.kernels.maps.jacobi_particles`.

A table is of one time; the stages of a step have several. It has a row for each planet: u, the same for the second
evaluation of a modified or a lazy kick, and m. Then three rows for each place i = 0 ... n: C_i and B_i; the same for
the second evaluation; R_i and its velocity. The last rows of the stages are workspace, three for each register of
planets. In democratic heliocentric coordinates there is one place, and the second of its rows has P / m_0.
"""

from __future__ import annotations

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, alike, get, halves, lane, load, pair, store, transposed
from orbits.kernels.maps.interaction import change_of_pull, pair_of
from orbits.kernels.maps.layout import (
    ATTRACTING,
    FORCE,
    MASS,
    MOVED,
    PLACE,
    ROWS,
    SHARE,
    SHIFTED,
    STATE_ROWS,
    constant,
    coordinate,
    dominant,
    registers_in,
)
from orbits.kernels.maps.programs import LAZY, MODIFIED, STANDARD
from orbits.kernels.maps.threes import added, joined_three, load_three, store_three, times


@kernel(inline=True)
def table_rows(planets):
    """Return the number of rows of a table for so many planets."""
    return planets + 3 * (planets + 1)


@kernel(inline=True)
def flow_rows(planets):
    """Return the first of the rows of the stages for the flow of terms of the dominant body: two tables of three rows
    for each place.
    """
    return 2 * table_rows(planets)


@kernel
def tabulate(strength, planets, room, table, first, evaluation):
    """Write C_i, B_i and the places of the planets after an evaluation of the interaction into a table.

    planets, room : see `orbits.kernels.maps.layout`, with the interaction in the rows FORCE
    table, first : the stages of a step, and the first row of the table in them
    evaluation : the first, STANDARD; that at displaced places, LAZY; and its change along itself, MODIFIED
    """
    count, registers = strength.shape[0] - 2, room.shape[0] // ROWS
    work, second, places = table.shape[0] - 3 * registers, 0 if evaluation == STANDARD else 1, first + count
    for register in range(registers):
        own = ROWS * register
        shifted = load_three(room, own + SHIFTED)
        own_pair = pair_of(shifted if evaluation == LAZY else load_three(planets, STATE_ROWS * register))
        pull = times(own_pair.cubed, own_pair.apart)
        if evaluation == MODIFIED:
            pull = plus(pull, change_of_pull(own_pair, shifted))
        share, gm = load(room, own + SHARE), load(room, own + ATTRACTING)
        store_three(table, work + 3 * register, times(share, added(load_three(room, own + FORCE), -gm, pull)))
    central = strength[1 + dominant(planets)]
    # From outside inwards, B_(i-1) = B_i + w_i r'_i''.
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(count + 1):
        i = count - k
        row = places + 3 * i + second
        table[row, 3], table[row, 4], table[row, 5] = bx, by, bz
        table[row, 6], table[row, 7] = central, central
        if i > 0:
            at, slot = work + 3 * ((i - 1) // WIDTH), (i - 1) % WIDTH
            table[row, 6] = constant(room, ATTRACTING, i - 1)
            bx, by, bz = bx + table[at, slot], by + table[at + 1, slot], bz + table[at + 2, slot]
    moved = MOVED if evaluation == MODIFIED else PLACE
    for k in range(3):
        offset = 0.0
        table[places + second, k] = offset
        for i in range(count):
            if evaluation == STANDARD:
                place = coordinate(planets, k, i)
            else:
                place = constant(room, SHIFTED + k, i)
            offset += constant(room, SHARE, i) * place
            table[places + 3 * (i + 1) + second, k] = offset
            row = first + i
            table[row, 3 * second + k], table[row, 6] = constant(room, moved + k, i), constant(room, MASS, i)


@kernel
def tabulate_centres(strength, planets, room, table, first):
    """Write R_i and its velocity into a table."""
    count = strength.shape[0] - 2
    places = first + count
    for component in range(6):
        centre = planets[STATE_ROWS * registers_in(planets), component]
        table[places + 3 * count + 2, component] = centre
        for back in range(count):
            i = count - 1 - back
            centre -= constant(room, SHARE, i) * coordinate(planets, component, i)
            table[places + 3 * i + 2, component] = centre


@kernel(inline=True)
def of_places(line, first, kind, number, common, rows):
    """Return the numbers of a row of the table, two times three, each for the places of eight particles.

    line : the table, row after row; first : of the rows of places; rows : (8, 8), workspace
    number, common : the places, see `orbits.kernels.maps.jacobi_particles.Marched`
    """
    if common >= 0:
        at = WIDTH * (first + 3 * common + kind)
        a, b, c = alike(get(line, at), number), alike(get(line, at + 1), number), alike(get(line, at + 2), number)
        d, e, f = alike(get(line, at + 3), number), alike(get(line, at + 4), number), alike(get(line, at + 5), number)
        return (a, b, c), (d, e, f)
    return _gathered(line, first + kind, number, rows)


@verb
def _gathered(line, first, number, rows):
    """Return the first six numbers of every third row from `first` on: of row i of these where `number` is i."""
    gathered = _gathered_pair if number == pair else _gathered_lanes
    return lambda line, first, number, rows: gathered(line, first, number, rows)


@kernel(inline=True)
def _gathered_lanes(line, first, number, rows):
    for k in range(WIDTH):
        store(rows, k, load(line, WIDTH * (first + 3 * int(lane(number, k)))))
    a, b, c, d, e, f, _, _ = transposed(rows, 0)
    return (a, b, c), (d, e, f)


@kernel(inline=True)
def _gathered_pair(line, first, number, rows):
    one, two = halves(number)
    (a, b), (c, d) = _gathered_lanes(line, first, one, rows), _gathered_lanes(line, first, two, rows)
    return joined_three(a, c), joined_three(b, d)
