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
`ELSEWHERE` for one that other steps march) and M_i; then the low parts of the first six numbers. What particles need of
the planets stands in tables, see `orbits.kernels.maps.jacobi_tables`. In democratic heliocentric coordinates all
particles have the place 0.

Source: Wisdom & Holman (1991), AJ 102, 1528; Rein & Tamayo (2015), MNRAS 452, 376.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import (
    WIDTH,
    fma,
    full,
    get,
    halves,
    joined,
    lane,
    load,
    rsqrt_cubed,
    select,
    store,
    transposed,
    unit,
)
from orbits.kernels.maps.interaction import difference
from orbits.kernels.maps.interaction_along_itself import tide
from orbits.kernels.maps.jacobi_tables import of_places
from orbits.kernels.maps.orbits import Orbits, added, drifted, kicked, place_of, times, velocity_of
from orbits.kernels.maps.terms_by_kind import strength_of
from orbits.kernels.maps.terms_of_dominant import pull_more
from orbits.kernels.search.context import flat
from orbits.kernels.steps import NOWHERE, Particles

MEMORY_ROWS = 2
"""Rows of a particle in `memory`."""

NUMBER, ATTRACTED = 6, 7
"""Columns of the first row of a particle: i + 1, and M_i."""

ELSEWHERE = -1.0
"""In the place of i + 1: the particle is not marched by the map, and its state is what is seen of it."""


class Marched(NamedTuple):
    """Eight particles as they are marched, or two times eight.

    orbits : r' and its velocity; g : (gx, gy, gz); gm : M_i, 0 in lanes without a particle
    number : i; common : i as an integer if it is that of all lanes, else -1
    """

    orbits: Any
    g: Any
    gm: Any
    number: Any
    common: Any


@kernel(inline=True)
def on_orbits(marched, orbits):
    """Return particles on other orbits."""
    return Marched(orbits, marched.g, marched.gm, marched.number, marched.common)


@kernel(inline=True)
def with_force(marched, g):
    """Return particles with another g."""
    return Marched(marched.orbits, g, marched.gm, marched.number, marched.common)


@kernel(inline=True)
def attraction(line, planets, count, second, u, g):
    """Return g with the attraction by the planets at u.

    planets : the first of their rows in the table; second : whether of those at displaced positions
    """
    (ux, uy, uz), (fx, fy, fz) = u, g
    for j in range(count):
        row = WIDTH * (planets + j)
        at = row + 3 * second
        dx, dy, dz = get(line, at) - ux, get(line, at + 1) - uy, get(line, at + 2) - uz
        w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx))) * get(line, row + 6)
        fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
    return fx, fy, fz


@kernel(inline=True)
def _plain(line, first, count, second, place, moved, marched):
    """Return (g, u) at a place relative to R_i.

    line : the table, row after row; second : whether of the planets at displaced positions
    place : (x, y, z); moved : C_i and B_i
    """
    (x, y, z), (cx, cy, cz, bx, by, bz) = place, moved
    ux, uy, uz = x + cx, y + cy, z + cz
    fx, fy, fz = attraction(line, first + 3 * (count + 1), count, second, (ux, uy, uz), (bx, by, bz))
    if marched.common == 0:  # inside all planets the pull of the dominant body is that of the Kepler part, exactly
        return (fx, fy, fz), (ux, uy, uz)
    kepler = marched.gm * rsqrt_cubed(fma(x, x, fma(y, y, z * z)))
    # In lanes without a particle nothing attracts.
    central = select(marched.gm > 0.0, get(line, WIDTH * first + 7), 0.0)
    pull = central * rsqrt_cubed(fma(ux, ux, fma(uy, uy, uz * uz)))
    return (
        fx + difference(kepler, x, pull, ux),
        fy + difference(kepler, y, pull, uy),
        fz + difference(kepler, z, pull, uz),
    ), (ux, uy, uz)


@kernel(inline=True)
def _modified(line, first, count, shift, marched, plain, second):
    """Return g of the modified kick, from that of the plain one, with the change of g along itself.

    plain : (g, u), from `_plain`; second : the displacement of R_i - R_0, and B_i of the modified kick
    """
    (gx, gy, gz), (ux, uy, uz) = plain
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
    (x, y, z), gm = place_of(marched.orbits), marched.gm
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
    """Return g for the kick of a step: plain, modified, or at displaced positions.

    shift : h^2/12, or 0 for the plain kick; lazy : whether it is the lazy one; rows : (8, 8), workspace
    """
    count = strength_of(model).shape[0] - 2
    line, number, common = flat(table), marched.number, marched.common
    moved = of_places(line, first, 0, number, common, rows)
    g, u = _plain(line, first, count, 0, place_of(marched.orbits), moved, marched)
    if lazy:
        there = added(place_of(marched.orbits), shift, pull_more(model, u, g))
        moved = of_places(line, first, 1, number, common, rows)
        g, u = _plain(line, first, count, 1, there, moved, marched)
    elif shift != 0.0:
        ex, ey, ez, bx, by, bz = of_places(line, first, 1, number, common, rows)
        # The plain B_i is in g already.
        second = ex, ey, ez, bx - moved[3], by - moved[4], bz - moved[5]
        g = _modified(line, first, count, shift, marched, (g, u), second)
    return pull_more(model, u, g)


@kernel
def with_interaction(model, table, first, shift, lazy, marched, rows):
    """Return particles with their g, that for the kick of a step, to the bits that `interaction` gives elsewhere: there
    is no product in it whose sum could be rounded in two ways.
    """
    return with_force(marched, interaction(model, table, first, shift, lazy, marched, rows))


@kernel(inline=True)
def drifted_particles(marched, h, kick):
    """Return particles moved on their Kepler orbits by h, from velocities changed by `kick` times g, and the change of
    their velocities, which they do not have yet, that by the kick included.
    """
    (vx, vy, vz), (kx, ky, kz) = velocity_of(marched.orbits), times(kick, marched.g)
    orbits, (ax, ay, az) = drifted(marched.orbits, marched.gm, h, (vx + kx, vy + ky, vz + kz))
    return on_orbits(marched, orbits), (ax + kx, ay + ky, az + kz)


@kernel(inline=True)
def kicked_particles(marched, change, kick, g):
    """Return particles with velocities changed by `change` and by `kick` times g, rounded once, and this g."""
    return with_force(on_orbits(marched, kicked(marched.orbits, added(change, kick, g))), g)


@kernel(inline=True)
def moved_particles(marched, h):
    """Return particles after Kepler motions of h."""
    orbits, change = drifted(marched.orbits, marched.gm, h, velocity_of(marched.orbits))
    return on_orbits(marched, kicked(orbits, change))


@kernel(inline=True)
def seen_particles(origin, marched):
    """Return particles as observers see them, uncorrected, and in lanes without one at rest far away.

    origin : position and velocity relative to which they are marched, six numbers
    """
    (x, y, z), (vx, vy, vz) = place_of(marched.orbits), velocity_of(marched.orbits)
    there, zero = marched.gm > 0.0, 0.0 * marched.gm
    return Particles(
        select(there, origin[0] + x, NOWHERE),
        select(there, origin[1] + y, NOWHERE),
        select(there, origin[2] + z, NOWHERE),
        zero, zero, zero,
        select(there, origin[3] + vx, 0.0),
        select(there, origin[4] + vy, 0.0),
        select(there, origin[5] + vz, 0.0),
        zero, zero, zero,
    )  # fmt: skip


@kernel(inline=True)
def seen_at(table, first, marched, rows):
    """Return the same by R_i and its velocity in a table."""
    return seen_particles(of_places(flat(table), first, 2, marched.number, marched.common, rows), marched)


@kernel(inline=True)
def present(memory, retired, p):
    """Return 1 in the lanes of particles that are neither retired nor marched elsewhere."""
    there = full(1.0)
    for k in range(WIDTH):
        if retired[p + k, 0] != 0 or (p + k < memory.shape[0] and memory[p + k, 0, NUMBER] == ELSEWHERE):
            there = there - unit(k)
    return there


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
    orbits = Orbits(x, y, z, vx, vy, vz, x_lo, y_lo, z_lo, vx_lo, vy_lo, vz_lo)
    return Marched(orbits, (full(0.0), full(0.0), full(0.0)), gm, number, 0 if common == -2 else common)


@kernel(inline=True)
def joined_marched(one, two):
    """Return two times eight particles at once."""
    a, b = one.orbits, two.orbits
    return Marched(
        Orbits(
            joined(a.x, b.x), joined(a.y, b.y), joined(a.z, b.z),
            joined(a.vx, b.vx), joined(a.vy, b.vy), joined(a.vz, b.vz),
            joined(a.x_lo, b.x_lo), joined(a.y_lo, b.y_lo), joined(a.z_lo, b.z_lo),
            joined(a.vx_lo, b.vx_lo), joined(a.vy_lo, b.vy_lo), joined(a.vz_lo, b.vz_lo),
        ),
        (joined(one.g[0], two.g[0]), joined(one.g[1], two.g[1]), joined(one.g[2], two.g[2])),
        joined(one.gm, two.gm), joined(one.number, two.number),
        one.common if one.common == two.common else -1,
    )  # fmt: skip


@kernel(inline=True)
def half_of_marched(both, which):
    """Return eight of `joined_marched`; which : 0 or 1, a literal."""
    a, g = both.orbits, both.g
    return Marched(
        Orbits(
            halves(a.x)[which], halves(a.y)[which], halves(a.z)[which],
            halves(a.vx)[which], halves(a.vy)[which], halves(a.vz)[which],
            halves(a.x_lo)[which], halves(a.y_lo)[which], halves(a.z_lo)[which],
            halves(a.vx_lo)[which], halves(a.vy_lo)[which], halves(a.vz_lo)[which],
        ),
        (halves(g[0])[which], halves(g[1])[which], halves(g[2])[which]),
        halves(both.gm)[which], halves(both.number)[which], both.common,
    )  # fmt: skip


@kernel(inline=True)
def store_marched(memory, p, marched, rows):
    """Write eight particles to where `take_particles` reads them, but for lanes without one."""
    orbits, gm = marched.orbits, marched.gm
    store(rows, 0, orbits.x)
    store(rows, 1, orbits.y)
    store(rows, 2, orbits.z)
    store(rows, 3, orbits.vx)
    store(rows, 4, orbits.vy)
    store(rows, 5, orbits.vz)
    store(rows, 6, marched.number + 1.0)
    store(rows, 7, gm)
    store(rows, 8, orbits.x_lo)
    store(rows, 9, orbits.y_lo)
    store(rows, 10, orbits.z_lo)
    store(rows, 11, orbits.vx_lo)
    store(rows, 12, orbits.vy_lo)
    store(rows, 13, orbits.vz_lo)
    store(rows, 14, full(0.0))
    store(rows, 15, full(0.0))
    a, b = transposed(rows, 0), transposed(rows, WIDTH)
    for k in range(WIDTH):
        if p + k < memory.shape[0] and lane(gm, k) != 0.0:
            store(memory[p + k], 0, a[k])
            store(memory[p + k], 1, b[k])
