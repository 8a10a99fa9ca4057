"""The interaction of planets in Jacobi coordinates, one in each lane.

`orbits.kernels.maps.jacobi` has its formula. The pairs within a register are formed by turning it: by 1, 2 and 3 lanes
for both planets of a pair, by 4 for one. Those of two registers are formed by broadcasting the planets of one. Up to
sixteen planets stay in registers, in one or in two at once, `joined`: one source for both. More are taken by passes
over memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    exact_mul,
    exact_sub,
    first_lane,
    fma,
    full,
    halves,
    inverse_powers,
    joined,
    lane,
    load,
    pair,
    rsqrt_cubed,
    sums_after,
    sums_before,
    total,
    turned,
    unit,
)
from orbits.kernels.maps.layout import (
    FORCE,
    MASS,
    PLACE,
    ROWS,
    SHARE,
    SHIFTED,
    STATE_ROWS,
    load_three,
    masses_of,
    of_room,
    store_three,
    write_room,
)
from orbits.kernels.maps.orbits import added, orbits_of, place_of


@kernel(inline=True, exact=True)
def difference(a, b, c, d):
    """Return a b - c d, which is exactly 0 for equal products."""
    return exact_sub(exact_mul(a, b), exact_mul(c, d))


class Pairs(NamedTuple):
    """The pairs of the planets of a register with those 1 ... 4 lanes on: the difference, its length to the power of -3
    and of -2.
    """

    x: Any
    y: Any
    z: Any
    cubed: Any
    squared: Any


@kernel
def _interact(like, planets, room, shifted):
    """`interact`, of planets that stay in registers."""
    x, y, z = of_room(like, room, SHIFTED) if shifted else place_of(orbits_of(like, planets))
    force, place, _ = interaction(x, y, z, masses_of(like, room))
    write_room(room, FORCE, force)
    write_room(room, PLACE, place)


@verb
def interact_in(registers, planets, room, count, shifted):
    """`interact` in the registers of a form; see `registers_of`."""
    if registers == pair:
        return lambda registers, planets, room, count, shifted: _interact(registers, planets, room, shifted)
    return lambda registers, planets, room, count, shifted: interact(planets, room, count, shifted)


@kernel
def interact(planets, room, count, shifted):
    """Write the interaction of `count` planets into the rows FORCE; shifted : whether at the displaced positions."""
    registers = room.shape[0] // ROWS
    if registers == 1:
        _interact(full(0.0), planets, room, shifted)
        return
    bx, by, bz = 0.0, 0.0, 0.0
    for register in range(registers):
        x, y, z = coordinates_of(planets, room, register, shifted)
        bx, by, bz = write_places(room, register, PLACE, x, y, z, bx, by, bz)
    # From outside inwards, for the sums over the planets further out.
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(registers):
        register = registers - 1 - k
        first = ROWS * register
        masses, (ux, uy, uz) = masses_of(full(0.0), room[first:]), load_three(room, first + PLACE)
        (fx, fy, fz), _ = pulls_within(ux, uy, uz, masses.mass)
        for source in range(registers):
            other = ROWS * source
            for slot in range(min(WIDTH, count - WIDTH * source) if source != register else 0):
                dx = room[other + PLACE, slot] - ux
                dy = room[other + PLACE + 1, slot] - uy
                dz = room[other + PLACE + 2, slot] - uz
                w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx))) * room[other + MASS, slot]
                fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
        near = rsqrt_cubed(fma(ux, ux, fma(uy, uy, uz * uz)))
        sx, sy, sz = pulls_on_inner(masses, (fx, fy, fz), (ux, uy, uz), near)
        beyond = sums_after(sx) + bx, sums_after(sy) + by, sums_after(sz) + bz
        bx, by, bz = bx + total(sx), by + total(sy), bz + total(sz)
        x, y, z = coordinates_of(planets, room, register, shifted)
        kepler = rsqrt_cubed(fma(x, x, fma(y, y, z * z)))
        force = whole_interaction(masses, (fx, fy, fz), beyond, (x, y, z), kepler, (ux, uy, uz), near)
        store_three(room, first + FORCE, force)


@kernel(inline=True)
def interaction(x, y, z, masses):
    """Return the interaction of planets that stay in registers at r' = (x, y, z), u, and the pairs of `change_along`:
    those of planets, that with the dominant body, and that with the centre of mass of those inside.
    """
    ux = x + sums_before(masses.share * x)
    uy = y + sums_before(masses.share * y)
    uz = z + sums_before(masses.share * z)
    own, pairs = _pulls(ux, uy, uz, masses)
    near, near2 = inverse_powers(fma(ux, ux, fma(uy, uy, uz * uz)))
    kepler, kepler2 = inverse_powers(fma(x, x, fma(y, y, z * z)))
    sx, sy, sz = pulls_on_inner(masses, own, (ux, uy, uz), near)
    beyond = sums_after(sx), sums_after(sy), sums_after(sz)
    force = whole_interaction(masses, own, beyond, (x, y, z), kepler, (ux, uy, uz), near)
    return force, (ux, uy, uz), (pairs, Pairs(ux, uy, uz, near, near2), Pairs(x, y, z, kepler, kepler2))


@kernel(inline=True)
def write_places(room, register, row, x, y, z, bx, by, bz):
    """Write (x, y, z) relative to the dominant body; return the sums (bx, by, bz) with this register."""
    first, share = ROWS * register, load(room, ROWS * register + SHARE)
    wx, wy, wz = share * x, share * y, share * z
    store_three(
        room, first + row, (x + (bx + sums_before(wx)), y + (by + sums_before(wy)), z + (bz + sums_before(wz)))
    )
    return bx + total(wx), by + total(wy), bz + total(wz)


@kernel(inline=True)
def pulls_on_inner(masses, own, place, near):
    """Return m F, which is summed over the planets further out."""
    pull = -masses.central * near
    return (
        masses.mass * fma(pull, place[0], own[0]),
        masses.mass * fma(pull, place[1], own[1]),
        masses.mass * fma(pull, place[2], own[2]),
    )


@kernel(inline=True)
def whole_interaction(masses, own, beyond, r, kepler, place, near):
    """Return the interaction from its three parts."""
    pull, rest = masses.pull * near, masses.rest * near
    return (
        _component(masses, own[0], fma(masses.inner, beyond[0], -rest * place[0]), r[0], kepler, place[0], pull),
        _component(masses, own[1], fma(masses.inner, beyond[1], -rest * place[1]), r[1], kepler, place[1], pull),
        _component(masses, own[2], fma(masses.inner, beyond[2], -rest * place[2]), r[2], kepler, place[2], pull),
    )


@kernel(inline=True)
def _component(masses, own, further, x, kepler, u, pull):
    return fma(masses.attracting, difference(x, kepler, u, pull), fma(masses.outer, own, further))


@kernel(inline=True)
def pulls_within(x, y, z, mass):
    """Return the accelerations of the planets of a register at (x, y, z) by each other, and their pairs."""
    a, b = _pairs(x, y, z, 1), _pairs(x, y, z, 2)
    c, d = _pairs(x, y, z, 3), _pairs(x, y, z, 4)
    return (
        sum_of_pairs(mass, a.cubed * a.x, b.cubed * b.x, c.cubed * c.x, d.cubed * d.x),
        sum_of_pairs(mass, a.cubed * a.y, b.cubed * b.y, c.cubed * c.y, d.cubed * d.y),
        sum_of_pairs(mass, a.cubed * a.z, b.cubed * b.z, c.cubed * c.z, d.cubed * d.z),
    ), (a, b, c, d)


@kernel(inline=True)
def in_the_second(masses):
    """Return how many planets are in the second register."""
    _, attracting = halves(masses.attracting)
    return first_lane(attracting <= 0.0)


def _pulls_of_one(x, y, z, masses):
    return pulls_within(x, y, z, masses.mass)


def _pulls_of_two(x, y, z, masses):
    """Those of the first register by turning it; then each planet of the second one with all others at once, so that
    the time grows with how many there are.
    """
    (x0, X), (y0, Y), (z0, Z), (mass, source) = halves(x), halves(y), halves(z), halves(masses.mass)
    (ax, ay, az), pairs = pulls_within(x0, y0, z0, mass)
    bx, by, bz = full(0.0), full(0.0), full(0.0)
    fx, fy, fz = joined(ax, bx), joined(ay, by), joined(az, bz)
    here = unit(0)
    for _ in range(in_the_second(masses)):
        dx, dy, dz = lane(X, 0) - x, lane(Y, 0) - y, lane(Z, 0) - z
        # A body feels nothing of itself: its distance, 0, is made 1.
        cubed = rsqrt_cubed(fma(dx, dx, fma(dy, dy, fma(dz, dz, joined(full(0.0), here)))))
        there, back = lane(source, 0) * cubed, mass * halves(cubed)[0]
        fx, fy, fz = fma(there, dx, fx), fma(there, dy, fy), fma(there, dz, fz)
        bx = fma(-total(back * halves(dx)[0]), here, bx)
        by = fma(-total(back * halves(dy)[0]), here, by)
        bz = fma(-total(back * halves(dz)[0]), here, bz)
        X, Y, Z, source, here = turned(X, 1), turned(Y, 1), turned(Z, 1), turned(source, 1), turned(here, 7)
    zero = full(0.0)
    return (fx + joined(zero, bx), fy + joined(zero, by), fz + joined(zero, bz)), pairs


@verb
def _pulls(x, y, z, masses):
    """Return the accelerations of planets by each other, and the pairs of those in the first register."""
    return _pulls_of_two if x == pair else _pulls_of_one


@kernel(inline=True)
def _pairs(x, y, z, places):
    """Return the pairs with the planets so many lanes on."""
    dx, dy, dz = turned(x, places) - x, turned(y, places) - y, turned(z, places) - z
    cubed, squared = inverse_powers(fma(dx, dx, fma(dy, dy, dz * dz)))
    return Pairs(dx, dy, dz, cubed, squared)


@kernel(inline=True)
def sum_of_pairs(mass, a, b, c, d):
    """Return a component of the sums over pairs: a ... d times the mass of the planet 1 ... 4 lanes on, and back."""
    there = fma(turned(mass, 1), a, turned(mass, 2) * b) + fma(turned(mass, 3), c, turned(mass, 4) * d)
    return there - ((turned(mass * a, 7) + turned(mass * b, 6)) + turned(mass * c, 5))


@kernel(inline=True)
def coordinates_of(planets, room, register, shifted):
    """Return r' of a register, or the displaced one."""
    if shifted:
        return load_three(room, ROWS * register + SHIFTED)
    return load_three(planets, STATE_ROWS * register)


@kernel
def displace(planets, room, shift):
    """Write r' displaced by `shift` times the interaction."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register, ROWS * register
        displaced = added(load_three(planets, first), full(shift), load_three(room, other + FORCE))
        store_three(room, other + SHIFTED, displaced)
