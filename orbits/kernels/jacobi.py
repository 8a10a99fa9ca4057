"""Planets about a dominant body in Jacobi coordinates, one in each lane: the Kepler motions, and the interaction.

The bodies are numbered outwards, 0 the dominant one, and m stands for GM. With M_i = m_0 + ... + m_i and the centre of
mass R_i of the bodies 0 ... i, the coordinates of planet i and its position relative to the dominant body are

    r'_i = r_i - R_(i-1),     R_i = R_(i-1) + w_i r'_i,  w_i = m_i / M_i,     u_i = r'_i + sum_(j<i) w_j r'_j

Each planet moves about M_i in the Kepler part. The interaction is the rest; with the accelerations f by the other
planets, and F = f - m_0 u / u^3 with the pull of the dominant body,

    r''_i = M_i/M_(i-1) f_i + sum_(k>i) m_k F_k / M_(i-1) + M_i [r'_i / r'_i^3 - (m_0 / M_(i-1)) u_i / u_i^3]

in which the bracket is exactly 0 for the first planet. The masses in front of it are rounded; what that takes from the
pull of the dominant body, 1e-16 of it, is part of the interaction too.

Arrays are (rows, 8). `planets`, the state, has for each register of eight planets 12 rows: r' and its velocity, then
their low parts; then two rows of the centre of mass, its position and velocity and their low parts, with the number of
the dominant body in lane 6, and in lane 7 whether the planets have been numbered, 1 or `IN_ORDER`; then a row of the
body in each lane, -1 for none, for each register. `room` has for each register the rows named below, and then eight of
the unit matrix.

Source: Wisdom & Holman (1991), AJ 102, 1528; Rein & Tamayo (2015), MNRAS 452, 376.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler import kepler_increments
from orbits.kernels.lanes import (
    WIDTH,
    exact_mul,
    exact_sub,
    fma,
    full,
    lane,
    load,
    rsqrt_cubed,
    store,
    store_some,
    sums_after,
    sums_before,
    total,
    unit,
)
from orbits.kernels.summation import accumulate, add_product, quick_two_sum, two_product, two_sum

STATE_ROWS, ROWS = 12, 22
"""Rows of a register in `planets` and in `room`."""

FORCE, PLACE, SHIFTED, CHANGE, MOVED = 0, 3, 6, 9, 18
"""Rows of `room`: the interaction; u; r' displaced along the interaction, or the displacement; the change of velocity
by the Kepler motion and the kick before it; the displacement of u."""

IN_ORDER = 2.0
"""The planets are numbered as the bodies, and the dominant body is the first."""

ATTRACTING, MASS, SHARE, OUTER, INNER, CENTRAL, REST = 12, 13, 14, 15, 16, 17, 21
"""Rows of `room`: M_i; m_i; w_i; M_i / M_(i-1); 1 / M_(i-1); m_0 / M_(i-1); what rounding takes from the product of the
first and the last, with which the dominant body attracts; all 0 in lanes without a planet."""


@kernel
def prepare_room(strength, planets, room):
    """Write the constants of the planets in their order; strength : (1 + n,), with GM from its second element on."""
    registers = room.shape[0] // ROWS
    numbers = STATE_ROWS * registers
    central = strength[1 + int(planets[numbers, 6])]
    inside = central
    for k in range(WIDTH):
        store(room, ROWS * registers + k, unit(k))
    for register in range(registers):
        first = ROWS * register
        for k in range(WIDTH):
            body = int(planets[numbers + 2 + register, k])
            gm = strength[1 + body] if body >= 0 else 0.0
            here = 1.0 if body >= 0 else 0.0
            all_in = inside + gm
            room[first + ATTRACTING, k] = here * all_in
            room[first + MASS, k] = gm
            room[first + SHARE, k] = gm / all_in
            room[first + OUTER, k] = here * (all_in / inside)
            room[first + INNER, k] = here / inside
            room[first + CENTRAL, k] = here * (central / inside)
            room[first + REST, k] = here * _rest(central, gm, all_in, central / inside)
            inside = all_in


@kernel(inline=True, exact=True)
def _rest(central, gm, all_in, share):
    """Return m_0 M_i / M_(i-1) = m_0 + m_i m_0 / M_(i-1), less the product of the rounded M_i and m_0 / M_(i-1).
    Without it, planets would be ahead, or behind, in proportion to time.
    """
    product, lost = two_product(all_in, share)
    return exact_sub(fma(gm, share, exact_sub(central, product)), lost)


@kernel(inline=True, exact=True)
def difference(a, b, c, d):
    """Return a b - c d, which is exactly 0 for equal products."""
    return exact_sub(exact_mul(a, b), exact_mul(c, d))


@kernel
def interact(planets, room, count, shifted):
    """Write the interaction of `count` planets into the rows FORCE; shifted : whether at the displaced positions."""
    registers = room.shape[0] // ROWS
    bx, by, bz = 0.0, 0.0, 0.0
    for register in range(registers):
        first = ROWS * register
        x, y, z = _coordinates(planets, room, register, shifted)
        share = load(room, first + SHARE)
        wx, wy, wz = share * x, share * y, share * z
        store(room, first + PLACE, x + (bx + sums_before(wx)))
        store(room, first + PLACE + 1, y + (by + sums_before(wy)))
        store(room, first + PLACE + 2, z + (bz + sums_before(wz)))
        if registers > 1:
            bx, by, bz = bx + total(wx), by + total(wy), bz + total(wz)
    # From outside inwards, for the sums over the planets further out.
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(registers):
        register = registers - 1 - k
        first = ROWS * register
        ux, uy, uz = load(room, first + PLACE), load(room, first + PLACE + 1), load(room, first + PLACE + 2)
        fx, fy, fz = full(0.0), full(0.0), full(0.0)
        for source in range(registers):
            other = ROWS * source
            # At distance 1 from itself, in the direction 0, a body feels nothing of itself.
            own = 1.0 if source == register else 0.0
            for slot in range(min(WIDTH, count - WIDTH * source)):
                dx = room[other + PLACE, slot] - ux
                dy = room[other + PLACE + 1, slot] - uy
                dz = room[other + PLACE + 2, slot] - uz
                apart = fma(full(own), load(room, ROWS * registers + slot), dx * dx)
                w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, apart))) * room[other + MASS, slot]
                fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
        x, y, z = _coordinates(planets, room, register, shifted)
        near = rsqrt_cubed(fma(ux, ux, fma(uy, uy, uz * uz)))
        pull = load(room, first + CENTRAL) * near
        kepler = rsqrt_cubed(fma(x, x, fma(y, y, z * z)))
        outer, inner, mass = load(room, first + OUTER), load(room, first + INNER), load(room, first + MASS)
        attracting, rest = load(room, first + ATTRACTING), load(room, first + REST) * near
        # m_0 = (m_0 / M_(i-1)) / (1 / M_(i-1)); lanes without a planet have mass 0.
        central = room[CENTRAL, 0] / room[INNER, 0]
        sx, sy, sz = (
            mass * fma(-central * near, ux, fx),
            mass * fma(-central * near, uy, fy),
            mass * fma(-central * near, uz, fz),
        )
        gx, gy, gz = (
            fma(inner, bx + sums_after(sx), -rest * ux),
            fma(inner, by + sums_after(sy), -rest * uy),
            fma(inner, bz + sums_after(sz), -rest * uz),
        )
        store(room, first + FORCE, _whole(outer, fx, gx, attracting, x, kepler, ux, pull))
        store(room, first + FORCE + 1, _whole(outer, fy, gy, attracting, y, kepler, uy, pull))
        store(room, first + FORCE + 2, _whole(outer, fz, gz, attracting, z, kepler, uz, pull))
        if registers > 1:
            bx, by, bz = bx + total(sx), by + total(sy), bz + total(sz)


@kernel(inline=True)
def _whole(outer, own, further, attracting, x, kepler, u, pull):
    """Return a component of the interaction from its three parts."""
    return fma(attracting, difference(x, kepler, u, pull), fma(outer, own, further))


@kernel(inline=True)
def _coordinates(planets, room, register, shifted):
    """Return r' of a register, or the displaced one."""
    first, other = STATE_ROWS * register, ROWS * register + SHIFTED
    if shifted:
        return load(room, other), load(room, other + 1), load(room, other + 2)
    return load(planets, first), load(planets, first + 1), load(planets, first + 2)


@kernel
def kick_planets(planets, room, h):
    """Advance the velocities by h times the interaction."""
    for register in range(room.shape[0] // ROWS):
        first, force = STATE_ROWS * register, ROWS * register + FORCE
        for k in range(3):
            hi, lo = load(planets, first + 3 + k), load(planets, first + 9 + k)
            hi, lo = accumulate(hi, lo, h * load(room, force + k))
            store(planets, first + 3 + k, hi)
            store(planets, first + 9 + k, lo)


@kernel
def displace(planets, room, shift):
    """Write r' displaced by `shift` times the interaction."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register, ROWS * register
        for k in range(3):
            store(room, other + SHIFTED + k, fma(full(shift), load(room, other + FORCE + k), load(planets, first + k)))


@kernel
def modify(planets, room, count, shift):
    """Add `shift` times the derivative of the interaction along itself to the rows FORCE.

    The sum is the acceleration by the potential V - shift/2 sum of m'_i |r''_i|^2, with the masses m'_i of Jacobi's
    coordinates. `interact` must have been called.
    """
    registers = room.shape[0] // ROWS
    bx, by, bz = 0.0, 0.0, 0.0
    for register in range(registers):
        first = ROWS * register
        x, y, z = (
            shift * load(room, first + FORCE),
            shift * load(room, first + FORCE + 1),
            shift * load(room, first + FORCE + 2),
        )
        store(room, first + SHIFTED, x)
        store(room, first + SHIFTED + 1, y)
        store(room, first + SHIFTED + 2, z)
        share = load(room, first + SHARE)
        wx, wy, wz = share * x, share * y, share * z
        store(room, first + MOVED, x + (bx + sums_before(wx)))
        store(room, first + MOVED + 1, y + (by + sums_before(wy)))
        store(room, first + MOVED + 2, z + (bz + sums_before(wz)))
        if registers > 1:
            bx, by, bz = bx + total(wx), by + total(wy), bz + total(wz)
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(registers):
        register = registers - 1 - k
        first = ROWS * register
        ux, uy, uz = load(room, first + PLACE), load(room, first + PLACE + 1), load(room, first + PLACE + 2)
        ex, ey, ez = load(room, first + MOVED), load(room, first + MOVED + 1), load(room, first + MOVED + 2)
        fx, fy, fz = full(0.0), full(0.0), full(0.0)
        for source in range(registers):
            other, own = ROWS * source, 1.0 if source == register else 0.0
            for slot in range(min(WIDTH, count - WIDTH * source)):
                dx = room[other + PLACE, slot] - ux
                dy = room[other + PLACE + 1, slot] - uy
                dz = room[other + PLACE + 2, slot] - uz
                r2 = fma(dz, dz, fma(dy, dy, fma(full(own), load(room, ROWS * registers + slot), dx * dx)))
                tx, ty, tz = tide(
                    dx, dy, dz, r2, room[other + MOVED, slot] - ex,
                    room[other + MOVED + 1, slot] - ey, room[other + MOVED + 2, slot] - ez,
                )  # fmt: skip
                mass = room[other + MASS, slot]
                fx, fy, fz = fma(mass, tx, fx), fma(mass, ty, fy), fma(mass, tz, fz)
        x, y, z = _coordinates(planets, room, register, False)
        sx, sy, sz = load(room, first + SHIFTED), load(room, first + SHIFTED + 1), load(room, first + SHIFTED + 2)
        kx, ky, kz = tide(x, y, z, fma(x, x, fma(y, y, z * z)), sx, sy, sz)
        cx, cy, cz = tide(ux, uy, uz, fma(ux, ux, fma(uy, uy, uz * uz)), ex, ey, ez)
        outer, inner, mass = load(room, first + OUTER), load(room, first + INNER), load(room, first + MASS)
        attracting, pull = load(room, first + ATTRACTING), load(room, first + CENTRAL)
        central = room[CENTRAL, 0] / room[INNER, 0]
        gx, gy, gz = (
            mass * fma(-central, cx, fx),
            mass * fma(-central, cy, fy),
            mass * fma(-central, cz, fz),
        )
        _add(room, first + FORCE, fma(attracting, kx - pull * cx, fma(outer, fx, inner * (bx + sums_after(gx)))))
        _add(room, first + FORCE + 1, fma(attracting, ky - pull * cy, fma(outer, fy, inner * (by + sums_after(gy)))))
        _add(room, first + FORCE + 2, fma(attracting, kz - pull * cz, fma(outer, fz, inner * (bz + sums_after(gz)))))
        if registers > 1:
            bx, by, bz = bx + total(gx), by + total(gy), bz + total(gz)


@kernel(inline=True)
def tide(x, y, z, r2, ex, ey, ez):
    """Return the change of (x, y, z) / r^3 with (x, y, z) along (ex, ey, ez); r2 : r^2."""
    w = rsqrt_cubed(r2)
    near = w * r2  # 1/r
    along = -3.0 * fma(x, ex, fma(y, ey, z * ez)) * near * near
    return w * fma(along, x, ex), w * fma(along, y, ey), w * fma(along, z, ez)


@kernel(inline=True)
def _add(room, row, change):
    store(room, row, load(room, row) + change)


@kernel
def move_planets(planets, room, h, kick):
    """Advance the planets on their Kepler orbits by h, from velocities changed by `kick` times the interaction.

    The velocities are not changed: the rows CHANGE receive the change, that by the kick included.
    """
    registers = room.shape[0] // ROWS
    for register in range(registers):
        first, other = STATE_ROWS * register, ROWS * register
        x, y, z = load(planets, first), load(planets, first + 1), load(planets, first + 2)
        kx, ky, kz = (
            kick * load(room, other + FORCE),
            kick * load(room, other + FORCE + 1),
            kick * load(room, other + FORCE + 2),
        )
        vx, vy, vz = load(planets, first + 3) + kx, load(planets, first + 4) + ky, load(planets, first + 5) + kz
        attracting = load(room, other + ATTRACTING)
        dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, attracting, full(h))
        _advance(planets, first, dx)
        _advance(planets, first + 1, dy)
        _advance(planets, first + 2, dz)
        store(room, other + CHANGE, dvx + kx)
        store(room, other + CHANGE + 1, dvy + ky)
        store(room, other + CHANGE + 2, dvz + kz)
    centre = STATE_ROWS * registers
    for k in range(3):
        planets[centre, k], planets[centre + 1, k] = add_product(
            planets[centre, k], planets[centre + 1, k], h, planets[centre, 3 + k], planets[centre + 1, 3 + k]
        )


@kernel(inline=True)
def _advance(planets, row, change):
    hi, lo = accumulate(load(planets, row), load(planets, row + 6), change)
    store(planets, row, hi)
    store(planets, row + 6, lo)


@kernel
def finish_velocities(planets, room, kick):
    """Add the rows CHANGE, and `kick` times the interaction, to the velocities, rounded once."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register, ROWS * register
        for k in range(3):
            change = fma(full(kick), load(room, other + FORCE + k), load(room, other + CHANGE + k))
            _advance(planets, first + 3 + k, change)


@kernel
def number_planets(strength, q, p, planets):
    """Number the planets outwards: by the energy of their orbits about the heaviest body.

    q, p : (3n,) positions and velocities, all x, then all y, then all z
    """
    n = strength.shape[0] - 1
    registers = (planets.shape[0] - 2) // (STATE_ROWS + 1)
    centre = STATE_ROWS * registers
    sun = 0
    for body in range(n):
        if strength[1 + body] > strength[1 + sun]:
            sun = body
    planets[centre, 6], planets[centre, 7] = sun, 1.0
    for register in range(registers):
        for k in range(WIDTH):
            planets[centre + 2 + register, k] = -1.0
    placed = 0
    for body in range(n):
        if body == sun:
            continue
        # Insertion into the sorted bodies, tightest orbit first; equal ones keep their order.
        place = placed
        while place > 0:
            before = int(planets[centre + 2 + (place - 1) // WIDTH, (place - 1) % WIDTH])
            if not _tightness(strength, q, p, sun, body) > _tightness(strength, q, p, sun, before):
                break
            planets[centre + 2 + place // WIDTH, place % WIDTH] = before
            place -= 1
        planets[centre + 2 + place // WIDTH, place % WIDTH] = body
        placed += 1
    in_order = sun == 0
    for i in range(n - 1):
        in_order = in_order and planets[centre + 2 + i // WIDTH, i % WIDTH] == i + 1
    if in_order:
        planets[centre, 7] = IN_ORDER


@kernel
def _tightness(strength, q, p, sun, body):
    """Return 1/a of a body's orbit about the dominant one."""
    n = strength.shape[0] - 1
    r2, v2 = 0.0, 0.0
    for k in range(3):
        r2 += (q[k * n + body] - q[k * n + sun]) ** 2
        v2 += (p[k * n + body] - p[k * n + sun]) ** 2
    return 2.0 / r2**0.5 - v2 / (strength[1 + sun] + strength[1 + body])


@kernel
def enter_planets(strength, q, q_lo, p, p_lo, planets, room):
    """Write the planets of a state (q, q_lo), (p, p_lo) of bodies, and the constants into `room`; numbers the planets
    unless they are numbered already.
    """
    n = strength.shape[0] - 1
    registers = room.shape[0] // ROWS
    centre = STATE_ROWS * registers
    if planets[centre, 7] == 0.0:
        number_planets(strength, q, p, planets)
    prepare_room(strength, planets, room)
    sun = int(planets[centre, 6])
    furthest = 0.0
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        hi, lo = x[axis + sun], x_lo[axis + sun]
        for i in range(n - 1):
            register, k = i // WIDTH, i % WIDTH
            body = int(planets[centre + 2 + register, k])
            d, e = two_sum(x[axis + body], -hi)
            d, e = quick_two_sum(d, e + (x_lo[axis + body] - lo))
            planets[STATE_ROWS * register + component, k] = d
            planets[STATE_ROWS * register + 6 + component, k] = e
            if component < 3:
                furthest = max(furthest, abs(d))
            hi, lo = add_product(hi, lo, room[ROWS * register + SHARE, k], d, e)
        planets[centre, component], planets[centre + 1, component] = hi, lo
    # Lanes without a planet rest at different places.
    for i in range(n - 1, WIDTH * registers):
        register, k = i // WIDTH, i % WIDTH
        for row in range(STATE_ROWS):
            planets[STATE_ROWS * register + row, k] = 0.0
        planets[STATE_ROWS * register, k] = (2.0 + i) * (furthest + 1.0)


@kernel
def leave_planets(strength, planets, room, q, q_lo, p, p_lo):
    """Write the state of the bodies, in doubled precision."""
    n = strength.shape[0] - 1
    centre = STATE_ROWS * (room.shape[0] // ROWS)
    sun = int(planets[centre, 6])
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        hi, lo = planets[centre, component], planets[centre + 1, component]
        for j in range(n - 1):
            i = n - 2 - j
            register, k = i // WIDTH, i % WIDTH
            body = int(planets[centre + 2 + register, k])
            d, e = planets[STATE_ROWS * register + component, k], planets[STATE_ROWS * register + 6 + component, k]
            hi, lo = add_product(hi, lo, -room[ROWS * register + SHARE, k], d, e)
            s, f = two_sum(hi, d)
            x[axis + body], x_lo[axis + body] = quick_two_sum(s, f + (lo + e))
        x[axis + sun], x_lo[axis + sun] = hi, lo


@kernel
def show_planets(strength, planets, room, q, p):
    """Write the state of the bodies, rounded: for observers, at every step."""
    n = strength.shape[0] - 1
    registers = room.shape[0] // ROWS
    centre = STATE_ROWS * registers
    sun = int(planets[centre, 6])
    for component in range(6):
        x = q if component < 3 else p
        axis = component % 3 * n
        inside = planets[centre, component]
        for j in range(registers):
            register = registers - 1 - j
            own = load(planets, STATE_ROWS * register + component)
            weighted = load(room, ROWS * register + SHARE) * own
            place = own + (inside - (weighted + sums_after(weighted)))
            inside = inside - total(weighted)
            count = n - 1 - WIDTH * register
            if planets[centre, 7] == IN_ORDER:
                store_some(x, axis + 1 + WIDTH * register, place, count)
            else:
                for k in range(min(WIDTH, count)):
                    x[axis + int(planets[centre + 2 + register, k])] = lane(place, k)
        x[axis + sun] = inside
