"""Massless particles among planets in democratic heliocentric coordinates, eight in lanes.

Their coordinates are those of planets (`orbits.kernels.heliocentric`): the position relative to the dominant body, and
the velocity relative to the centre of mass of all. They are kept as in `orbits.kernels.jacobi_particles`, all with the
place 0: about the dominant body alone.

A table is what particles need of the planets at one time; the stages of a step have two, before and after it. It has a
row with P / m_0 before and after the Kepler motions of the step, one with the position of the dominant body and the
velocity of the centre of mass, and a row for each planet: its position relative to the dominant body, and m in column 6.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.heliocentric import MASS, ROWS, place_of_the_dominant
from orbits.kernels.interaction import STATE_ROWS
from orbits.kernels.jacobi_particles import ATTRACTED, AWAY, NUMBER, Marched
from orbits.kernels.lanes import WIDTH, fma, full, get, rsqrt_cubed, select
from orbits.kernels.short_kepler import short_increments
from orbits.kernels.summation import accumulate, quick_two_sum, two_sum
from orbits.kernels.watch import flat

CENTRE, PLANETS = 1, 2
"""Rows of a table: the position of the dominant body and the velocity of the centre of mass; the first planet."""


@kernel
def tabulate_heliocentric(strength, planets, room, table, first, jumps):
    """Write a table from row `first` on; jumps : P / m_0 before and after the Kepler motions."""
    count, centre = strength.shape[0] - 2, STATE_ROWS * (room.shape[0] // ROWS)
    for component in range(3):
        table[first, component], table[first, 3 + component] = jumps[component], jumps[3 + component]
        table[first + CENTRE, component] = place_of_the_dominant(planets, room, count, component)[0]
        table[first + CENTRE, 3 + component] = planets[centre, 3 + component]
    for i in range(count):
        register, k = i // WIDTH, i % WIDTH
        for component in range(3):
            table[first + PLANETS + i, component] = planets[STATE_ROWS * register + component, k]
        table[first + PLANETS + i, 6] = room[ROWS * register + MASS, k]


@kernel(inline=True)
def _attraction(line, first, count, x, y, z):
    """Return the acceleration by the planets of a table at a position relative to the dominant body."""
    fx, fy, fz = full(0.0), full(0.0), full(0.0)
    for j in range(count):
        at = WIDTH * (first + PLANETS + j)
        dx, dy, dz = get(line, at) - x, get(line, at + 1) - y, get(line, at + 2) - z
        w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx))) * get(line, at + 6)
        fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
    return fx, fy, fz


@kernel
def attracted_particles(table, first, count, marched):
    """Return particles with g, the acceleration by the planets of a table."""
    gx, gy, gz = _attraction(flat(table), first, count, marched.x, marched.y, marched.z)
    return Marched(
        marched.x, marched.y, marched.z, marched.x_lo, marched.y_lo, marched.z_lo,
        marched.vx, marched.vy, marched.vz, marched.vx_lo, marched.vy_lo, marched.vz_lo,
        gx, gy, gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def stepped_particles(marched, table, first, count, h):
    """Return eight particles after a step; first : the row of the table after it."""
    line, at, half = flat(table), WIDTH * first, 0.5 * h
    there = select(marched.gm > 0.0, full(half), 0.0)
    kx, ky, kz = half * marched.gx, half * marched.gy, half * marched.gz
    jx, jy, jz = there * get(line, at), there * get(line, at + 1), there * get(line, at + 2)
    dx, dy, dz, dvx, dvy, dvz = short_increments(
        marched.x + jx, marched.y + jy, marched.z + jz, marched.vx + kx, marched.vy + ky, marched.vz + kz,
        marched.gm, full(h),
    )  # fmt: skip
    x, x_lo = accumulate(marched.x, marched.x_lo, dx + (jx + there * get(line, at + 3)))
    y, y_lo = accumulate(marched.y, marched.y_lo, dy + (jy + there * get(line, at + 4)))
    z, z_lo = accumulate(marched.z, marched.z_lo, dz + (jz + there * get(line, at + 5)))
    gx, gy, gz = _attraction(line, first, count, x, y, z)
    vx, vx_lo = accumulate(marched.vx, marched.vx_lo, fma(full(half), gx, dvx + kx))
    vy, vy_lo = accumulate(marched.vy, marched.vy_lo, fma(full(half), gy, dvy + ky))
    vz, vz_lo = accumulate(marched.vz, marched.vz_lo, fma(full(half), gz, dvz + kz))
    return Marched(
        x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo,
        gx, gy, gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def seen_among_heliocentric(table, first, marched):
    """Return position and velocity, (x, y, z, vx, vy, vz), of particles as observers see them; lanes without one stay
    where they are.
    """
    line, at, there = flat(table), WIDTH * (first + CENTRE), marched.gm > 0.0
    return (
        select(there, get(line, at) + marched.x, AWAY),
        select(there, get(line, at + 1) + marched.y, AWAY),
        select(there, get(line, at + 2) + marched.z, AWAY),
        select(there, get(line, at + 3) + marched.vx, 0.0),
        select(there, get(line, at + 4) + marched.vy, 0.0),
        select(there, get(line, at + 5) + marched.vz, 0.0),
    )


@kernel
def enter_among_heliocentric(strength, planets, room, particles, share):
    """Write what is marched of particles share.start ... share.stop - 1 from the states that are seen.

    planets : in their coordinates
    particles : their `Columns`, their memory, and their rows of a status, (padded, 2) int64: those with another one
        than 0 are left alone
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    sun = int(planets[STATE_ROWS * (room.shape[0] // ROWS), 6])
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0:
            continue
        own = memory[p]
        own[0, NUMBER], own[0, ATTRACTED] = 1.0, strength[1 + sun]
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = _origin(strength, planets, room, component)
            d, e = two_sum(x[component % 3, p], -hi)
            own[0, component], own[1, component] = quick_two_sum(d, e + (x_lo[component % 3, p] - lo))


@kernel
def leave_among_heliocentric(strength, planets, room, particles, share):
    """Write the states that are seen of particles share.start ... share.stop - 1, in doubled precision."""
    (q, q_lo, v, v_lo), memory, retired = particles
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0:
            continue
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = _origin(strength, planets, room, component)
            s, e = two_sum(hi, memory[p, 0, component])
            x[component % 3, p], x_lo[component % 3, p] = quick_two_sum(s, e + (memory[p, 1, component] + lo))


@kernel
def _origin(strength, planets, room, component):
    """Return a component of the position of the dominant body, or of the velocity of the centre of mass, (hi, lo)."""
    centre = STATE_ROWS * (room.shape[0] // ROWS)
    if component < 3:
        return place_of_the_dominant(planets, room, strength.shape[0] - 2, component)
    return planets[centre, component], planets[centre + 1, component]
