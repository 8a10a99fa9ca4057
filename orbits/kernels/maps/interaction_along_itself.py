"""The change of the interaction of planets along itself, of which the modified kick is made.

The layouts are those of `orbits.kernels.maps.interaction`.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    fma,
    full,
    halves,
    inverse_powers,
    joined,
    lane,
    pair,
    sums_after,
    sums_before,
    total,
    turned,
    unit,
)
from orbits.kernels.maps.interaction import (
    Pairs,
    coordinates_of,
    in_the_second,
    interaction,
    pulls_within,
    sum_of_pairs,
    write_places,
)
from orbits.kernels.maps.layout import (
    FORCE,
    MASS,
    MOVED,
    PLACE,
    ROWS,
    SHIFTED,
    load_three,
    masses_of,
    of_room,
    store_three,
    write_room,
)
from orbits.kernels.maps.orbits import orbits_of, place_of


@kernel
def _modify(like, planets, room, shift):
    """`modify`, of planets that stay in registers."""
    (x, y, z), force, masses = place_of(orbits_of(like, planets)), of_room(like, room, FORCE), masses_of(like, room)
    _, _, pairs = interaction(x, y, z, masses)
    change, shifted, moved = change_along(force, pairs, shift, masses)
    write_room(room, SHIFTED, shifted)
    write_room(room, MOVED, moved)
    write_room(room, FORCE, change)


@verb
def modify_in(registers, planets, room, count, shift):
    """`modify` in the registers of a form; see `registers_of`."""
    if registers == pair:
        return lambda registers, planets, room, count, shift: _modify(registers, planets, room, shift)
    return lambda registers, planets, room, count, shift: modify(planets, room, count, shift)


@kernel
def modify(planets, room, count, shift):
    """Add `shift` times the derivative of the interaction along itself to the rows FORCE.

    The sum is the acceleration by the potential V - shift/2 sum of m'_i |r''_i|^2, with the masses m'_i of Jacobi's
    coordinates. `interact` must have been called.
    """
    registers = room.shape[0] // ROWS
    if registers == 1:
        _modify(full(0.0), planets, room, shift)
        return
    bx, by, bz = 0.0, 0.0, 0.0
    for register in range(registers):
        first = ROWS * register
        fx, fy, fz = load_three(room, first + FORCE)
        x, y, z = shift * fx, shift * fy, shift * fz
        store_three(room, first + SHIFTED, (x, y, z))
        bx, by, bz = write_places(room, register, MOVED, x, y, z, bx, by, bz)
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(registers):
        register = registers - 1 - k
        first = ROWS * register
        masses, (ux, uy, uz) = masses_of(full(0.0), room[first:]), load_three(room, first + PLACE)
        ex, ey, ez = load_three(room, first + MOVED)
        _, pairs = pulls_within(ux, uy, uz, masses.mass)
        fx, fy, fz = _tides_within(pairs, (ex, ey, ez), masses.mass)
        for source in range(registers):
            other = ROWS * source
            for slot in range(min(WIDTH, count - WIDTH * source) if source != register else 0):
                dx = room[other + PLACE, slot] - ux
                dy = room[other + PLACE + 1, slot] - uy
                dz = room[other + PLACE + 2, slot] - uz
                tx, ty, tz = tide(
                    dx, dy, dz, fma(dz, dz, fma(dy, dy, dx * dx)), room[other + MOVED, slot] - ex,
                    room[other + MOVED + 1, slot] - ey, room[other + MOVED + 2, slot] - ez,
                )  # fmt: skip
                mass = room[other + MASS, slot]
                fx, fy, fz = fma(mass, tx, fx), fma(mass, ty, fy), fma(mass, tz, fz)
        (x, y, z), (sx, sy, sz) = coordinates_of(planets, room, register, False), load_three(room, first + SHIFTED)
        kepler = tide(x, y, z, fma(x, x, fma(y, y, z * z)), sx, sy, sz)
        centre = tide(ux, uy, uz, fma(ux, ux, fma(uy, uy, uz * uz)), ex, ey, ez)
        hx, hy, hz = tides_on_inner(masses, (fx, fy, fz), centre)
        beyond = sums_after(hx) + bx, sums_after(hy) + by, sums_after(hz) + bz
        bx, by, bz = bx + total(hx), by + total(hy), bz + total(hz)
        force = load_three(room, first + FORCE)
        store_three(room, first + FORCE, with_change(masses, force, (fx, fy, fz), beyond, kepler, centre))


@kernel(inline=True)
def change_along(force, pairs, shift, masses):
    """Return the interaction of planets that stay in registers with `shift` times its derivative along itself, r' and u
    moved by `shift` times the interaction; pairs : of `interaction`.
    """
    among, inwards, own = pairs
    x, y, z = shift * force[0], shift * force[1], shift * force[2]
    ex = x + sums_before(masses.share * x)
    ey = y + sums_before(masses.share * y)
    ez = z + sums_before(masses.share * z)
    within = _tides(among, inwards, (ex, ey, ez), masses)
    kepler, centre = tide_of_pair(own, x, y, z), tide_of_pair(inwards, ex, ey, ez)
    hx, hy, hz = tides_on_inner(masses, within, centre)
    beyond = sums_after(hx), sums_after(hy), sums_after(hz)
    return with_change(masses, force, within, beyond, kepler, centre), (x, y, z), (ex, ey, ez)


@kernel(inline=True)
def tides_on_inner(masses, own, centre):
    """Return the change of m F, which is summed over the planets further out."""
    return (
        masses.mass * fma(-masses.central, centre[0], own[0]),
        masses.mass * fma(-masses.central, centre[1], own[1]),
        masses.mass * fma(-masses.central, centre[2], own[2]),
    )


@kernel(inline=True)
def with_change(masses, force, own, beyond, kepler, centre):
    """Return the interaction with its change, from the three parts of it."""
    return (
        _changed(masses, force[0], own[0], beyond[0], kepler[0], centre[0]),
        _changed(masses, force[1], own[1], beyond[1], kepler[1], centre[1]),
        _changed(masses, force[2], own[2], beyond[2], kepler[2], centre[2]),
    )


@kernel(inline=True)
def _changed(masses, force, own, beyond, kepler, centre):
    apart = fma(-masses.pull, centre, kepler)
    return force + fma(masses.attracting, apart, fma(masses.outer, own, masses.inner * beyond))


@kernel(inline=True)
def _tides_within(pairs, moved, mass):
    """Return the changes of the accelerations of `pulls_within` with the places moved."""
    ex, ey, ez = moved
    ax, ay, az = tide_of_pair(pairs[0], turned(ex, 1) - ex, turned(ey, 1) - ey, turned(ez, 1) - ez)
    bx, by, bz = tide_of_pair(pairs[1], turned(ex, 2) - ex, turned(ey, 2) - ey, turned(ez, 2) - ez)
    cx, cy, cz = tide_of_pair(pairs[2], turned(ex, 3) - ex, turned(ey, 3) - ey, turned(ez, 3) - ez)
    dx, dy, dz = tide_of_pair(pairs[3], turned(ex, 4) - ex, turned(ey, 4) - ey, turned(ez, 4) - ez)
    return sum_of_pairs(mass, ax, bx, cx, dx), sum_of_pairs(mass, ay, by, cy, dy), sum_of_pairs(mass, az, bz, cz, dz)


def _tides_of_one(among, inwards, moved, masses):
    return _tides_within(among, moved, masses.mass)


def _tides_of_two(among, inwards, moved, masses):
    (x, y, z), (mass, source) = (inwards.x, inwards.y, inwards.z), halves(masses.mass)
    (_, X), (_, Y), (_, Z) = halves(x), halves(y), halves(z)
    ex, ey, ez = moved
    (ex0, EX), (ey0, EY), (ez0, EZ) = halves(ex), halves(ey), halves(ez)
    ax, ay, az = _tides_within(among, (ex0, ey0, ez0), mass)
    bx, by, bz = full(0.0), full(0.0), full(0.0)
    fx, fy, fz = joined(ax, bx), joined(ay, by), joined(az, bz)
    here = unit(0)
    for _ in range(in_the_second(masses)):
        dx, dy, dz = lane(X, 0) - x, lane(Y, 0) - y, lane(Z, 0) - z
        r2 = fma(dx, dx, fma(dy, dy, fma(dz, dz, joined(full(0.0), here))))
        tx, ty, tz = tide(dx, dy, dz, r2, lane(EX, 0) - ex, lane(EY, 0) - ey, lane(EZ, 0) - ez)
        there = lane(source, 0)
        fx, fy, fz = fma(there, tx, fx), fma(there, ty, fy), fma(there, tz, fz)
        bx = fma(-total(mass * halves(tx)[0]), here, bx)
        by = fma(-total(mass * halves(ty)[0]), here, by)
        bz = fma(-total(mass * halves(tz)[0]), here, bz)
        X, Y, Z, source, here = turned(X, 1), turned(Y, 1), turned(Z, 1), turned(source, 1), turned(here, 7)
        EX, EY, EZ = turned(EX, 1), turned(EY, 1), turned(EZ, 1)
    zero = full(0.0)
    return fx + joined(zero, bx), fy + joined(zero, by), fz + joined(zero, bz)


@verb
def _tides(among, inwards, moved, masses):
    """Return the changes of the accelerations of `_pulls` with the places moved."""
    return _tides_of_two if inwards.types[0] == pair else _tides_of_one


@kernel(inline=True)
def tide(x, y, z, r2, ex, ey, ez):
    """Return the change of (x, y, z) / r^3 with (x, y, z) along (ex, ey, ez); r2 : r^2."""
    cubed, squared = inverse_powers(r2)
    return tide_of_pair(Pairs(x, y, z, cubed, squared), ex, ey, ez)


@kernel(inline=True)
def tide_of_pair(pair, ex, ey, ez):
    along = -3.0 * fma(pair.x, ex, fma(pair.y, ey, pair.z * ez)) * pair.squared
    return pair.cubed * fma(along, pair.x, ex), pair.cubed * fma(along, pair.y, ey), pair.cubed * fma(along, pair.z, ez)
