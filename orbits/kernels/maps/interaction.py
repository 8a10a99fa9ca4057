"""The interaction of planets in Jacobi coordinates, one in each lane, and its change along itself.

`orbits.kernels.maps.jacobi` has its formula, and what the arrays `planets` and `room` hold. The pairs within a register
are formed by turning it: by 1, 2 and 3 lanes for both planets of a pair, by 4 for one. Those of two registers are
formed by broadcasting the planets of one. Up to sixteen planets stay in registers, in one or in two at once, `joined`:
one source for both. More are taken by passes over memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import kernel_of
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
    load_like,
    pair,
    rsqrt_cubed,
    store,
    store_like,
    sums_after,
    sums_before,
    total,
    turned,
    unit,
)

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


@kernel(inline=True, exact=True)
def difference(a, b, c, d):
    """Return a b - c d, which is exactly 0 for equal products."""
    return exact_sub(exact_mul(a, b), exact_mul(c, d))


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


class Pairs(NamedTuple):
    """The pairs of the planets of a register with those 1 ... 4 lanes on: the difference, its length to the power of -3
    and of -2.
    """

    x: Any
    y: Any
    z: Any
    cubed: Any
    squared: Any


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


@kernel(inline=True)
def of_state(like, planets, row):
    """Return three rows of `planets`."""
    return (
        load_like(like, planets, row, STATE_ROWS),
        load_like(like, planets, row + 1, STATE_ROWS),
        load_like(like, planets, row + 2, STATE_ROWS),
    )


@kernel(inline=True)
def write_state(planets, row, values):
    """Write three rows of `planets`."""
    store_like(planets, row, STATE_ROWS, values[0])
    store_like(planets, row + 1, STATE_ROWS, values[1])
    store_like(planets, row + 2, STATE_ROWS, values[2])


@kernel(inline=True)
def of_room(like, room, row):
    """Return three rows of `room`."""
    return load_like(like, room, row, ROWS), load_like(like, room, row + 1, ROWS), load_like(like, room, row + 2, ROWS)


@kernel(inline=True)
def write_room(room, row, values):
    """Write three rows of `room`."""
    store_like(room, row, ROWS, values[0])
    store_like(room, row + 1, ROWS, values[1])
    store_like(room, row + 2, ROWS, values[2])


@kernel
def _interact(like, planets, room, shifted):
    """`interact`, of planets that stay in registers."""
    x, y, z = of_room(like, room, SHIFTED) if shifted else of_state(like, planets, 0)
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
        x, y, z = _coordinates(planets, room, register, shifted)
        bx, by, bz = _place(room, register, PLACE, x, y, z, bx, by, bz)
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
        x, y, z = _coordinates(planets, room, register, shifted)
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
def _place(room, register, row, x, y, z, bx, by, bz):
    """Write (x, y, z) relative to the dominant body; return the sums (bx, by, bz) with this register."""
    first, share = ROWS * register, load(room, ROWS * register + SHARE)
    wx, wy, wz = share * x, share * y, share * z
    store(room, first + row, x + (bx + sums_before(wx)))
    store(room, first + row + 1, y + (by + sums_before(wy)))
    store(room, first + row + 2, z + (bz + sums_before(wz)))
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
        _sum_of_pairs(mass, a.cubed * a.x, b.cubed * b.x, c.cubed * c.x, d.cubed * d.x),
        _sum_of_pairs(mass, a.cubed * a.y, b.cubed * b.y, c.cubed * c.y, d.cubed * d.y),
        _sum_of_pairs(mass, a.cubed * a.z, b.cubed * b.z, c.cubed * c.z, d.cubed * d.z),
    ), (a, b, c, d)


@kernel(inline=True)
def _in_the_second(masses):
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
    for _ in range(_in_the_second(masses)):
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
def _sum_of_pairs(mass, a, b, c, d):
    """Return a component of the sums over pairs: a ... d times the mass of the planet 1 ... 4 lanes on, and back."""
    there = fma(turned(mass, 1), a, turned(mass, 2) * b) + fma(turned(mass, 3), c, turned(mass, 4) * d)
    return there - ((turned(mass * a, 7) + turned(mass * b, 6)) + turned(mass * c, 5))


@kernel(inline=True)
def _coordinates(planets, room, register, shifted):
    """Return r' of a register, or the displaced one."""
    first, other = STATE_ROWS * register, ROWS * register + SHIFTED
    if shifted:
        return load(room, other), load(room, other + 1), load(room, other + 2)
    return load(planets, first), load(planets, first + 1), load(planets, first + 2)


@kernel
def displace(planets, room, shift):
    """Write r' displaced by `shift` times the interaction."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register, ROWS * register
        for k in range(3):
            store(room, other + SHIFTED + k, fma(full(shift), load(room, other + FORCE + k), load(planets, first + k)))


@kernel
def _modify(like, planets, room, shift):
    """`modify`, of planets that stay in registers."""
    (x, y, z), force, masses = of_state(like, planets, 0), of_room(like, room, FORCE), masses_of(like, room)
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
        bx, by, bz = _place(room, register, MOVED, x, y, z, bx, by, bz)
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
        (x, y, z), (sx, sy, sz) = _coordinates(planets, room, register, False), load_three(room, first + SHIFTED)
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
    return _sum_of_pairs(mass, ax, bx, cx, dx), _sum_of_pairs(mass, ay, by, cy, dy), _sum_of_pairs(mass, az, bz, cz, dz)


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
    for _ in range(_in_the_second(masses)):
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


@kernel(inline=True)
def load_three(rows, first):
    """Return three rows."""
    return load(rows, first), load(rows, first + 1), load(rows, first + 2)


@kernel(inline=True)
def store_three(rows, first, values):
    """Write three rows."""
    store(rows, first, values[0])
    store(rows, first + 1, values[1])
    store(rows, first + 2, values[2])
