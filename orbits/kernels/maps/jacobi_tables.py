"""Tables of what massless particles need of planets in Jacobi coordinates; see `orbits.kernels.maps.jacobi_particles`.

A table is of one time; the stages of a step have several. It has a row for each planet: u, the same for the second
evaluation of a modified or a lazy kick, and m. Then three rows for each place i = 0 ... n: C_i and B_i; the same for
the second evaluation; R_i and its velocity. The last column of the first two has m_0. The last rows of the stages are
workspace, three for each register of planets. In democratic heliocentric coordinates there is one place, and the second
of its rows has P / m_0.
"""

from __future__ import annotations

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, alike, full, get, halves, lane, load, pair, store, transposed
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
    dominant,
    registers_in,
)
from orbits.kernels.maps.programs import LAZY, MODIFIED, STANDARD
from orbits.kernels.maps.threes import (
    NOTHING,
    added,
    inside_of,
    joined_three,
    load_three,
    minus,
    outside_of,
    store_three,
    times,
    totals,
)


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
    inside, beyond = NOTHING, NOTHING
    for register in range(registers):
        own = ROWS * register
        r = load_three(planets, STATE_ROWS * register) if evaluation == STANDARD else load_three(room, own + SHIFTED)
        share = load(room, own + SHARE)
        store_three(table, work + 3 * register, plus(inside, inside_of(share, r)))
        inside = plus(inside, totals(times(share, r)))
    central = strength[1 + dominant(planets)]
    # From outside inwards, B_(i-1) = B_i + w_i r'_i''.
    for back in range(registers):
        register = registers - 1 - back
        own = ROWS * register
        shifted = load_three(room, own + SHIFTED)
        own_pair = pair_of(shifted if evaluation == LAZY else load_three(planets, STATE_ROWS * register))
        pull = times(own_pair.cubed, own_pair.apart)
        if evaluation == MODIFIED:
            pull = plus(pull, change_of_pull(own_pair, shifted))
        share, gm = load(room, own + SHARE), load(room, own + ATTRACTING)
        change = times(share, added(load_three(room, own + FORCE), -gm, pull))
        offset, rest = load_three(table, work + 3 * register), plus(beyond, plus(change, outside_of(change)))
        _write_places(room, table, places + second, register, count, offset, rest, central)
        beyond = plus(beyond, totals(change))
    _write_place(table, places + 3 * count + second, inside, NOTHING, central)
    moved = MOVED if evaluation == MODIFIED else PLACE
    for i in range(count):
        for k in range(3):
            table[first + i, 3 * second + k] = constant(room, moved + k, i)
        table[first + i, 6] = constant(room, MASS, i)


@kernel
def tabulate_centres(strength, planets, room, table, first):
    """Write R_i and its velocity into a table."""
    count, registers, places = strength.shape[0] - 2, registers_in(planets), first + strength.shape[0] - 2
    centre = planets[STATE_ROWS * registers]
    there, motion = (centre[0], centre[1], centre[2]), (centre[3], centre[4], centre[5])
    _write_place(table, places + 3 * count + 2, there, motion, 0.0)
    for back in range(registers):
        register = registers - 1 - back
        own, share = STATE_ROWS * register, load(room, ROWS * register + SHARE)
        r, v = times(share, load_three(planets, own)), times(share, load_three(planets, own + 3))
        within, slower = minus(there, plus(r, outside_of(r))), minus(motion, plus(v, outside_of(v)))
        _write_places(room, table, places + 2, register, count, within, slower, 0.0)
        there, motion = minus(there, totals(r)), minus(motion, totals(v))


@kernel(inline=True)
def _write_places(room, table, first, register, count, a, b, last):
    """Write the rows of the places that have planets of a register as their next ones, three rows apart: two times
    three numbers in lanes, and in the last column `last`. The workspace of `room` is overwritten.
    """
    rows = room.shape[0] - WIDTH
    store_three(room, rows, a)
    store_three(room, rows + 3, b)
    store(room, rows + 6, full(0.0))
    store(room, rows + 7, full(last))
    columns = transposed(room, rows)
    for k in range(WIDTH):
        i = WIDTH * register + k
        if i < count:
            store(table, first + 3 * i, columns[k])


@kernel(inline=True)
def _write_place(table, row, a, b, last):
    """Write the row of one place."""
    for k in range(3):
        table[row, k], table[row, 3 + k] = a[k], b[k]
    table[row, 6], table[row, 7] = 0.0, last


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
