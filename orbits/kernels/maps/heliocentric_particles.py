"""Massless particles among planets in democratic heliocentric coordinates, eight in lanes.

Their coordinates are those of planets (`orbits.kernels.maps.heliocentric`): the position relative to the dominant body,
and the velocity relative to the centre of mass of all. They are kept as in `orbits.kernels.maps.jacobi_particles`, all
with the place 0: about the dominant body alone.

A table is what particles need of the planets in a step: a row with P / m_0, one with the position of the dominant body
and the velocity of the centre of mass at the end of the step, and a row for each planet: its position relative to the
dominant body at the kick, and m in column 6.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import WIDTH, fma, full, get, rsqrt_cubed, select
from orbits.kernels.maps.heliocentric import MASS, ROWS, place_of_the_dominant
from orbits.kernels.maps.interaction import STATE_ROWS
from orbits.kernels.maps.jacobi_particles import ATTRACTED, ELSEWHERE, NUMBER, Marched, store_marched, take_particles
from orbits.kernels.maps.jacobi_particles_entering import present
from orbits.kernels.maps.jacobi_stages import particles_at_the_end
from orbits.kernels.search.context import flat
from orbits.kernels.steps import NOWHERE
from orbits.kernels.sums.summation import accumulate, quick_two_sum, two_sum

CENTRE, PLANETS = 1, 2
"""Rows of a table: the position of the dominant body and the velocity of the centre of mass; the first planet."""


@kernel
def tabulate_planets(planets, room, table, count):
    """Write the rows of the planets."""
    for i in range(count):
        register, k = i // WIDTH, i % WIDTH
        for component in range(3):
            table[PLANETS + i, component] = planets[STATE_ROWS * register + component, k]
        table[PLANETS + i, 6] = room[ROWS * register + MASS, k]


@kernel
def tabulate_the_rest(planets, room, table, count, jump):
    """Write the rows of the jump, P / m_0, and of the centre; planets : at the end of the step."""
    centre = STATE_ROWS * (room.shape[0] // ROWS)
    for component in range(3):
        table[0, component] = jump[component]
        table[CENTRE, component] = place_of_the_dominant(planets, room, count, component)[0]
        table[CENTRE, 3 + component] = planets[centre, 3 + component]


@kernel(inline=True)
def stepped_particles(marched, table, count, h):
    """Return eight particles after a step."""
    line = flat(table)
    fx, fy, fz = full(0.0), full(0.0), full(0.0)
    for j in range(count):
        at = WIDTH * (PLANETS + j)
        dx, dy, dz = get(line, at) - marched.x, get(line, at + 1) - marched.y, get(line, at + 2) - marched.z
        w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx))) * get(line, at + 6)
        fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
    kx, ky, kz = h * fx, h * fy, h * fz
    there = select(marched.gm > 0.0, full(h), 0.0)
    jx, jy, jz = there * get(line, 0), there * get(line, 1), there * get(line, 2)
    dx, dy, dz, dvx, dvy, dvz = short_increments(
        marched.x + jx, marched.y + jy, marched.z + jz, marched.vx + kx, marched.vy + ky, marched.vz + kz,
        marched.gm, full(h),
    )  # fmt: skip
    x, x_lo = accumulate(marched.x, marched.x_lo, dx + jx)
    y, y_lo = accumulate(marched.y, marched.y_lo, dy + jy)
    z, z_lo = accumulate(marched.z, marched.z_lo, dz + jz)
    vx, vx_lo = accumulate(marched.vx, marched.vx_lo, dvx + kx)
    vy, vy_lo = accumulate(marched.vy, marched.vy_lo, dvy + ky)
    vz, vz_lo = accumulate(marched.vz, marched.vz_lo, dvz + kz)
    return Marched(
        x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo,
        marched.gx, marched.gy, marched.gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def seen_among_heliocentric(table, marched):
    """Return position and velocity, (x, y, z, vx, vy, vz), of particles at the end of a step; lanes without one stay
    where they are.
    """
    line, at, there = flat(table), WIDTH * CENTRE, marched.gm > 0.0
    return (
        select(there, get(line, at) + marched.x, NOWHERE),
        select(there, get(line, at + 1) + marched.y, NOWHERE),
        select(there, get(line, at + 2) + marched.z, NOWHERE),
        select(there, get(line, at + 3) + marched.vx, 0.0),
        select(there, get(line, at + 4) + marched.vy, 0.0),
        select(there, get(line, at + 5) + marched.vz, 0.0),
    )


@kernel
def enter_among_heliocentric(strength, planets, room, particles, rows, share, drift):
    """Write what is marched of particles share.start ... share.stop - 1 from the states that are seen.

    planets : of the same state, in their coordinates
    particles : their `Columns`, their memory, and their rows of a status, (padded, 2) int64: those with another one
        than 0 are left alone; rows : workspace
    drift : the Kepler motion from what is seen to what is marched
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    sun = int(planets[STATE_ROWS * (room.shape[0] // ROWS), 6])
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        own = memory[p]
        own[0, NUMBER], own[0, ATTRACTED] = 1.0, strength[1 + sun]
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = _origin(strength, planets, room, component)
            d, e = two_sum(x[component % 3, p], -hi)
            own[0, component], own[1, component] = quick_two_sum(d, e + (x_lo[component % 3, p] - lo))
    _drift(memory, retired, rows, share, drift)


@kernel
def leave_among_heliocentric(strength, planets, room, particles, rows, share, drift):
    """Write the states that are seen of particles share.start ... share.stop - 1, in doubled precision; their memory is
    lost. The arguments are those of `enter_among_heliocentric`.
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    _drift(memory, retired, rows, share, -drift)
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = _origin(strength, planets, room, component)
            s, e = two_sum(hi, memory[p, 0, component])
            x[component % 3, p], x_lo[component % 3, p] = quick_two_sum(s, e + (memory[p, 1, component] + lo))


@kernel
def _drift(memory, retired, rows, share, drift):
    """Advance particles on their Kepler orbits."""
    for p in range(share.start, share.stop, WIDTH):
        marched = take_particles(memory, p, present(memory, retired, p), rows)
        store_marched(memory, p, particles_at_the_end(marched, drift), rows)


@kernel
def _origin(strength, planets, room, component):
    """Return a component of the position of the dominant body, or of the velocity of the centre of mass, (hi, lo)."""
    centre = STATE_ROWS * (room.shape[0] // ROWS)
    if component < 3:
        return place_of_the_dominant(planets, room, strength.shape[0] - 2, component)
    return planets[centre, component], planets[centre + 1, component]
