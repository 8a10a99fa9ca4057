"""Massless particles among planets in Jacobi coordinates: eight in lanes, each with a place in the planets' order.

A massless particle changes no coordinates but its own. One that has i planets inside it moves relative to their centre
of mass R_i, about M_i, as a planet of no mass in their order would (see `orbits.kernels.maps.jacobi`):

    r' = r - R_i,   r'' = -M_i r'/r'^3 + g,   g = f + B_i + M_i r'/r'^3 - m_0 u/u^3,   u = r' + C_i

with f the attraction by the planets, C_i = R_i - R_0 and B_i = -R_i''. Whatever its place, this is its motion to the
last bit; the place decides how small g is. About the dominant body alone, i = 0, the acceleration of that body is a
part of g, which far outside a planet is (r/a)^2 times as large as the attraction by the planet. About the centre of
mass of all, g has the displacement of the dominant body from it, which far inside is (a/r)^4 times as large. So a
particle has those planets inside it whose semi-major axes are below its pericentre distance at the start: where it is
fastest, and the steps are longest for it, g is small.

`memory` is (particles, 2, 8), what is marched: r' and its velocity, i + 1 (0 for a particle that has no place yet,
`ELSEWHERE` for one that other steps march) and M_i; then the low parts of the first six numbers.

A table is what particles need of the planets at one time; the stages of a step have two, before and after it. It has
three rows for each place i = 0 ... n - 1: C_i and B_i; the same for the second evaluation of a modified or a lazy kick;
R_i and its velocity. Then a row for each planet: u, the same for the second evaluation, and m. The last rows of the
stages are workspace, three for each register of planets.

Source: Wisdom & Holman (1991), AJ 102, 1528; Rein & Tamayo (2015), MNRAS 452, 376.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import (
    WIDTH,
    alike,
    fma,
    full,
    get,
    halves,
    joined,
    lane,
    load,
    pair,
    rsqrt_cubed,
    select,
    store,
    transposed,
    unit,
)
from orbits.kernels.maps.interaction import (
    ATTRACTING,
    FORCE,
    MASS,
    MOVED,
    PLACE,
    ROWS,
    SHARE,
    SHIFTED,
    STATE_ROWS,
    difference,
    tide,
)
from orbits.kernels.maps.terms_of_dominant import pull_more, strength_of
from orbits.kernels.search.context import flat
from orbits.kernels.steps import NOWHERE
from orbits.kernels.sums.summation import accumulate

MEMORY_ROWS = 2
"""Rows of a particle in `memory`."""

NUMBER, ATTRACTED = 6, 7
"""Columns of the first row of a particle: i + 1, and M_i."""

ELSEWHERE = -1.0
"""In the place of i + 1: the particle is not marched by the map, and its state is what is seen of it."""

PLAIN, DISPLACED, MODIFIED = 0, 1, 2
"""The evaluations of the interaction: the first; that at displaced positions; and its change along itself."""


class Marched(NamedTuple):
    """Eight particles as they are marched, or two times eight.

    x ... vz_lo : r' and its velocity with their low parts; gx, gy, gz : g; gm : M_i, 0 in lanes without a particle
    number : i; common : i as an integer if it is that of all lanes, else -1
    """

    x: Any
    y: Any
    z: Any
    x_lo: Any
    y_lo: Any
    z_lo: Any
    vx: Any
    vy: Any
    vz: Any
    vx_lo: Any
    vy_lo: Any
    vz_lo: Any
    gx: Any
    gy: Any
    gz: Any
    gm: Any
    number: Any
    common: Any


@kernel(inline=True)
def table_rows(planets):
    """Return the number of rows of a table for so many planets."""
    return 3 * (planets + 1) + planets


@kernel
def tabulate(strength, planets, room, table, first, evaluation):
    """Write C_i, B_i and the places of the planets after an evaluation of the interaction into a table.

    planets, room : see `orbits.kernels.maps.jacobi`, with the interaction in the rows FORCE
    table, first : the stages of a step, and the first row of the table in them
    """
    count, registers = strength.shape[0] - 2, room.shape[0] // ROWS
    work, second = table.shape[0] - 3 * registers, 0 if evaluation == PLAIN else 1
    for register in range(registers):
        state, own = STATE_ROWS * register, ROWS * register
        x, y, z = load(planets, state), load(planets, state + 1), load(planets, state + 2)
        sx, sy, sz = load(room, own + SHIFTED), load(room, own + SHIFTED + 1), load(room, own + SHIFTED + 2)
        if evaluation == DISPLACED:
            x, y, z = sx, sy, sz
        r2 = fma(x, x, fma(y, y, z * z))
        kepler = rsqrt_cubed(r2)
        ax, ay, az = kepler * x, kepler * y, kepler * z
        if evaluation == MODIFIED:
            tx, ty, tz = tide(x, y, z, r2, sx, sy, sz)
            ax, ay, az = ax + tx, ay + ty, az + tz
        share, gm, force = load(room, own + SHARE), load(room, own + ATTRACTING), own + FORCE
        store(table, work + 3 * register, share * fma(-gm, ax, load(room, force)))
        store(table, work + 3 * register + 1, share * fma(-gm, ay, load(room, force + 1)))
        store(table, work + 3 * register + 2, share * fma(-gm, az, load(room, force + 2)))
    central = strength[1 + int(planets[STATE_ROWS * registers, 6])]
    # From outside inwards, B_(i-1) = B_i + w_i r'_i''.
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(count + 1):
        i = count - k
        row = first + 3 * i + second
        table[row, 3], table[row, 4], table[row, 5] = bx, by, bz
        table[row, 6], table[row, 7] = central, central
        if i > 0:
            at, slot = work + 3 * ((i - 1) // WIDTH), (i - 1) % WIDTH
            table[row, 6] = room[ROWS * ((i - 1) // WIDTH) + ATTRACTING, slot]
            bx, by, bz = bx + table[at, slot], by + table[at + 1, slot], bz + table[at + 2, slot]
    cx, cy, cz = 0.0, 0.0, 0.0
    for i in range(count + 1):
        if i > 0:
            register, slot = (i - 1) // WIDTH, (i - 1) % WIDTH
            own, at = ROWS * register, STATE_ROWS * register
            share = room[own + SHARE, slot]
            if evaluation == PLAIN:
                dx, dy, dz = planets[at, slot], planets[at + 1, slot], planets[at + 2, slot]
            else:
                dx, dy, dz = room[own + SHIFTED, slot], room[own + SHIFTED + 1, slot], room[own + SHIFTED + 2, slot]
            cx, cy, cz = cx + share * dx, cy + share * dy, cz + share * dz
            row, place = first + 3 * (count + 1) + i - 1, own + (MOVED if evaluation == MODIFIED else PLACE)
            for k in range(3):
                table[row, 3 * second + k] = room[place + k, slot]
            table[row, 6] = room[own + MASS, slot]
        row = first + 3 * i + second
        table[row, 0], table[row, 1], table[row, 2] = cx, cy, cz


@kernel
def tabulate_centres(strength, planets, room, table, first):
    """Write R_i and its velocity into a table."""
    count, registers = strength.shape[0] - 2, room.shape[0] // ROWS
    for component in range(6):
        centre = planets[STATE_ROWS * registers, component]
        for k in range(count + 1):
            i = count - k
            table[first + 3 * i + 2, component] = centre
            if i > 0:
                register, slot = (i - 1) // WIDTH, (i - 1) % WIDTH
                centre -= room[ROWS * register + SHARE, slot] * planets[STATE_ROWS * register + component, slot]


@kernel(inline=True)
def of_places(line, first, kind, marched, rows):
    """Return the numbers of a row of the table, each for the places of eight particles; rows : (8, 8), workspace."""
    number, common = marched.number, marched.common
    if common >= 0:
        at = WIDTH * (first + 3 * common + kind)
        a, b, c = alike(get(line, at), number), alike(get(line, at + 1), number), alike(get(line, at + 2), number)
        d, e, f = alike(get(line, at + 3), number), alike(get(line, at + 4), number), alike(get(line, at + 5), number)
        return a, b, c, d, e, f
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
    return a, b, c, d, e, f


@kernel(inline=True)
def _gathered_pair(line, first, number, rows):
    one, two = halves(number)
    a, b, c, d, e, f = _gathered_lanes(line, first, one, rows)
    u, v, w, x, y, z = _gathered_lanes(line, first, two, rows)
    return joined(a, u), joined(b, v), joined(c, w), joined(d, x), joined(e, y), joined(f, z)


@kernel(inline=True)
def _plain(line, first, count, second, place, moved, marched):
    """Return (g, u) at a place relative to R_i.

    line : the table, row after row; second : whether of the planets at displaced positions
    place : (x, y, z); moved : C_i and B_i
    """
    (x, y, z), (cx, cy, cz, bx, by, bz) = place, moved
    ux, uy, uz = x + cx, y + cy, z + cz
    fx, fy, fz = bx, by, bz
    planets = WIDTH * (first + 3 * (count + 1))
    for j in range(count):
        row = planets + WIDTH * j
        at = row + 3 * second
        dx, dy, dz = get(line, at) - ux, get(line, at + 1) - uy, get(line, at + 2) - uz
        w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx))) * get(line, row + 6)
        fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
    if marched.common == 0:  # inside all planets the pull of the dominant body is that of the Kepler part, exactly
        return fx, fy, fz, ux, uy, uz
    kepler = marched.gm * rsqrt_cubed(fma(x, x, fma(y, y, z * z)))
    # In lanes without a particle nothing attracts.
    central = select(marched.gm > 0.0, get(line, WIDTH * first + 7), 0.0)
    pull = central * rsqrt_cubed(fma(ux, ux, fma(uy, uy, uz * uz)))
    return (
        fx + difference(kepler, x, pull, ux),
        fy + difference(kepler, y, pull, uy),
        fz + difference(kepler, z, pull, uz),
        ux,
        uy,
        uz,
    )


@kernel(inline=True)
def _modified(line, first, count, shift, marched, plain, second):
    """Return g of the modified kick, from that of the plain one, with the change of g along itself.

    plain : (gx ... uz), from `_plain`; second : the displacement of R_i - R_0, and B_i of the modified kick
    """
    gx, gy, gz, ux, uy, uz = plain
    ex, ey, ez, bx, by, bz = second
    sx, sy, sz = shift * gx, shift * gy, shift * gz
    ex, ey, ez = fma(shift, gx, ex), fma(shift, gy, ey), fma(shift, gz, ez)
    planets = WIDTH * (first + 3 * (count + 1))
    for j in range(count):
        row = planets + WIDTH * j
        dx, dy, dz = get(line, row) - ux, get(line, row + 1) - uy, get(line, row + 2) - uz
        tx, ty, tz = tide(
            dx, dy, dz, fma(dz, dz, fma(dy, dy, dx * dx)),
            get(line, row + 3) - ex, get(line, row + 4) - ey, get(line, row + 5) - ez,
        )  # fmt: skip
        mass = get(line, row + 6)
        bx, by, bz = fma(mass, tx, bx), fma(mass, ty, by), fma(mass, tz, bz)
    if marched.common == 0:
        return gx + bx, gy + by, gz + bz
    x, y, z, gm = marched.x, marched.y, marched.z, marched.gm
    kx, ky, kz = tide(x, y, z, fma(x, x, fma(y, y, z * z)), sx, sy, sz)
    cx, cy, cz = tide(ux, uy, uz, fma(ux, ux, fma(uy, uy, uz * uz)), ex, ey, ez)
    central = select(gm > 0.0, get(line, WIDTH * first + 7), 0.0)
    return (
        gx + (bx + difference(gm, kx, central, cx)),
        gy + (by + difference(gm, ky, central, cy)),
        gz + (bz + difference(gm, kz, central, cz)),
    )


@kernel(inline=True)
def interaction(model, table, first, shift, lazy, marched, rows):
    """Return g for the kick of a step: plain, modified, or at displaced positions."""
    count = strength_of(model).shape[0] - 2
    line = flat(table)
    moved = of_places(line, first, 0, marched, rows)
    plain = _plain(line, first, count, 0, (marched.x, marched.y, marched.z), moved, marched)
    gx, gy, gz = plain[0], plain[1], plain[2]
    if lazy != 0.0:
        gx, gy, gz = pull_more(model, (plain[3], plain[4], plain[5]), (gx, gy, gz))
        place = fma(shift, gx, marched.x), fma(shift, gy, marched.y), fma(shift, gz, marched.z)
        moved = of_places(line, first, 1, marched, rows)
        plain = _plain(line, first, count, 1, place, moved, marched)
        gx, gy, gz = plain[0], plain[1], plain[2]
    elif shift != 0.0:
        ex, ey, ez, bx, by, bz = of_places(line, first, 1, marched, rows)
        # The plain B_i is in g already.
        second = ex, ey, ez, bx - moved[3], by - moved[4], bz - moved[5]
        gx, gy, gz = _modified(line, first, count, shift, marched, plain, second)
    return pull_more(model, (plain[3], plain[4], plain[5]), (gx, gy, gz))


@kernel
def with_interaction(model, table, first, shift, lazy, marched, rows):
    """Return particles with their g, that for the kick of a step, to the bits that `interaction` gives elsewhere: there
    is no product in it whose sum could be rounded in two ways.
    """
    gx, gy, gz = interaction(model, table, first, shift, lazy, marched, rows)
    return Marched(
        marched.x, marched.y, marched.z, marched.x_lo, marched.y_lo, marched.z_lo,
        marched.vx, marched.vy, marched.vz, marched.vx_lo, marched.vy_lo, marched.vz_lo,
        gx, gy, gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def drifted_particles(marched, h, kick):
    """Return particles moved on their Kepler orbits by h, from velocities changed by `kick` times g, and the change of
    their velocities, which they do not have yet, that by the kick included.
    """
    kx, ky, kz = kick * marched.gx, kick * marched.gy, kick * marched.gz
    vx, vy, vz = marched.vx + kx, marched.vy + ky, marched.vz + kz
    dx, dy, dz, dvx, dvy, dvz = short_increments(marched.x, marched.y, marched.z, vx, vy, vz, marched.gm, alike(h, vx))
    x, x_lo = accumulate(marched.x, marched.x_lo, dx)
    y, y_lo = accumulate(marched.y, marched.y_lo, dy)
    z, z_lo = accumulate(marched.z, marched.z_lo, dz)
    moved = Marched(
        x, y, z, x_lo, y_lo, z_lo,
        marched.vx, marched.vy, marched.vz, marched.vx_lo, marched.vy_lo, marched.vz_lo,
        marched.gx, marched.gy, marched.gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip
    return moved, dvx + kx, dvy + ky, dvz + kz


@kernel(inline=True)
def kicked_particles(marched, change, kick, g):
    """Return particles with velocities changed by `change` and by `kick` times g, rounded once, and this g."""
    (ax, ay, az), (gx, gy, gz) = change, g
    vx, vx_lo = accumulate(marched.vx, marched.vx_lo, fma(kick, gx, ax))
    vy, vy_lo = accumulate(marched.vy, marched.vy_lo, fma(kick, gy, ay))
    vz, vz_lo = accumulate(marched.vz, marched.vz_lo, fma(kick, gz, az))
    return Marched(
        marched.x, marched.y, marched.z, marched.x_lo, marched.y_lo, marched.z_lo,
        vx, vy, vz, vx_lo, vy_lo, vz_lo, gx, gy, gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def seen_particles(table, first, marched, rows):
    """Return position and velocity, (x, y, z, vx, vy, vz), of particles as observers see them: uncorrected; lanes
    without one stay where they are.
    """
    x, y, z, vx, vy, vz = of_places(flat(table), first, 2, marched, rows)
    there = marched.gm > 0.0
    return (
        select(there, x + marched.x, NOWHERE),
        select(there, y + marched.y, NOWHERE),
        select(there, z + marched.z, NOWHERE),
        select(there, vx + marched.vx, 0.0),
        select(there, vy + marched.vy, 0.0),
        select(there, vz + marched.vz, 0.0),
    )


@kernel(inline=True)
def take_particles(memory, p, there, rows):
    """Return particles p ... p + 7, with g = 0; lanes in which `there` is 0 rest far away. rows : (16, 8), workspace"""
    common, held = -2, full(0.0)
    for k in range(WIDTH):
        store(rows, k, full(0.0))
        store(rows, WIDTH + k, full(0.0))
        if p + k < memory.shape[0] and lane(there, k) != 0.0:
            store(rows, k, load(memory[p + k], 0))
            store(rows, WIDTH + k, load(memory[p + k], 1))
            i = int(memory[p + k, 0, NUMBER]) - 1
            common = i if common == -2 or common == i else -1
            held = held + unit(k)
    x, y, z, vx, vy, vz, number, gm = transposed(rows, 0)
    x_lo, y_lo, z_lo, vx_lo, vy_lo, vz_lo, _, _ = transposed(rows, WIDTH)
    # All lanes without a particle are at one place, and take any number.
    number = select(held > 0.0, number - 1.0, full(max(common, 0) * 1.0))
    x = select(held > 0.0, x, NOWHERE)
    zero = full(0.0)
    return Marched(
        x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo, zero, zero, zero, gm, number,
        0 if common == -2 else common,
    )  # fmt: skip


@kernel(inline=True)
def joined_marched(one, two):
    """Return two times eight particles at once."""
    return Marched(
        joined(one.x, two.x), joined(one.y, two.y), joined(one.z, two.z),
        joined(one.x_lo, two.x_lo), joined(one.y_lo, two.y_lo), joined(one.z_lo, two.z_lo),
        joined(one.vx, two.vx), joined(one.vy, two.vy), joined(one.vz, two.vz),
        joined(one.vx_lo, two.vx_lo), joined(one.vy_lo, two.vy_lo), joined(one.vz_lo, two.vz_lo),
        joined(one.gx, two.gx), joined(one.gy, two.gy), joined(one.gz, two.gz),
        joined(one.gm, two.gm), joined(one.number, two.number),
        one.common if one.common == two.common else -1,
    )  # fmt: skip


@kernel(inline=True)
def half_of_marched(both, which):
    """Return eight of `joined_marched`; which : 0 or 1, a literal."""
    (x, y, z), (x_lo, y_lo, z_lo) = (both.x, both.y, both.z), (both.x_lo, both.y_lo, both.z_lo)
    (u, v, w), (u_lo, v_lo, w_lo) = (both.vx, both.vy, both.vz), (both.vx_lo, both.vy_lo, both.vz_lo)
    return Marched(
        halves(x)[which], halves(y)[which], halves(z)[which],
        halves(x_lo)[which], halves(y_lo)[which], halves(z_lo)[which],
        halves(u)[which], halves(v)[which], halves(w)[which],
        halves(u_lo)[which], halves(v_lo)[which], halves(w_lo)[which],
        halves(both.gx)[which], halves(both.gy)[which], halves(both.gz)[which],
        halves(both.gm)[which], halves(both.number)[which], both.common,
    )  # fmt: skip


@kernel(inline=True)
def store_marched(memory, p, marched, rows):
    """Write eight particles to where `take_particles` reads them, but for lanes without one."""
    gm = marched.gm
    store(rows, 0, marched.x)
    store(rows, 1, marched.y)
    store(rows, 2, marched.z)
    store(rows, 3, marched.vx)
    store(rows, 4, marched.vy)
    store(rows, 5, marched.vz)
    store(rows, 6, marched.number + 1.0)
    store(rows, 7, gm)
    store(rows, 8, marched.x_lo)
    store(rows, 9, marched.y_lo)
    store(rows, 10, marched.z_lo)
    store(rows, 11, marched.vx_lo)
    store(rows, 12, marched.vy_lo)
    store(rows, 13, marched.vz_lo)
    store(rows, 14, full(0.0))
    store(rows, 15, full(0.0))
    a0, a1, a2, a3, a4, a5, a6, a7 = transposed(rows, 0)
    b0, b1, b2, b3, b4, b5, b6, b7 = transposed(rows, WIDTH)
    _keep(memory, p, gm, 0, a0, b0)
    _keep(memory, p + 1, gm, 1, a1, b1)
    _keep(memory, p + 2, gm, 2, a2, b2)
    _keep(memory, p + 3, gm, 3, a3, b3)
    _keep(memory, p + 4, gm, 4, a4, b4)
    _keep(memory, p + 5, gm, 5, a5, b5)
    _keep(memory, p + 6, gm, 6, a6, b6)
    _keep(memory, p + 7, gm, 7, a7, b7)


@kernel(inline=True)
def _keep(memory, p, gm, slot, first, second):
    if p < memory.shape[0] and lane(gm, slot) != 0.0:
        store(memory[p], 0, first)
        store(memory[p], 1, second)
