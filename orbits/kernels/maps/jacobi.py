"""Planets about a dominant body in Jacobi coordinates, one in each lane: how they enter and leave.

The bodies are numbered outwards, 0 the dominant one, and m stands for GM. With M_i = m_0 + ... + m_i and the centre of
mass R_i of the bodies 0 ... i, the coordinates of planet i and its position relative to the dominant body are

    r'_i = r_i - R_(i-1),     R_i = R_(i-1) + w_i r'_i,  w_i = m_i / M_i,     u_i = r'_i + sum_(j<i) w_j r'_j

Each planet moves about M_i in the Kepler part. The interaction is the rest; with the accelerations f by the other
planets, and F = f - m_0 u / u^3 with the pull of the dominant body,

    r''_i = M_i/M_(i-1) f_i + sum_(k>i) m_k F_k / M_(i-1) + M_i [r'_i / r'_i^3 - (m_0 / M_(i-1)) u_i / u_i^3]

in which the bracket is exactly 0 for the first planet. The masses in front of it are rounded; what that takes from the
pull of the dominant body, 1e-16 of it, is part of the interaction too.

The arrays `planets` and `room` are those of `orbits.kernels.maps.layout`.

Source: Wisdom & Holman (1991), AJ 102, 1528; Rein & Tamayo (2015), MNRAS 452, 376.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, exact_sub, fma, lane, load, store, store_some, sums_after
from orbits.kernels.maps.layout import (
    ATTRACTING,
    CENTRAL,
    IN_ORDER,
    INNER,
    MASS,
    OUTER,
    REST,
    ROWS,
    SHARE,
    STATE_ROWS,
    body_of,
    constant,
    coordinate,
    dominant,
    registers_in,
)
from orbits.kernels.sums.summation import add_product, quick_two_sum, two_product, two_sum


@kernel
def prepare_room(strength, planets, room):
    """Write the constants of the planets in their order; strength : (1 + n,), with GM from its second element on."""
    registers = room.shape[0] // ROWS
    numbers = STATE_ROWS * registers
    central = strength[1 + int(planets[numbers, 6])]
    inside = central
    for register in range(registers):
        first = ROWS * register
        for k in range(WIDTH):
            body = int(planets[numbers + 2 + register, k])
            gm = strength[1 + body] if body >= 0 else 0.0
            here = 1.0 if body >= 0 else 0.0
            counted = 1.0 if register + k == 0 else here  # m_0 is read off the first lane, with a planet or without
            all_in = inside + gm
            room[first + ATTRACTING, k] = here * all_in
            room[first + MASS, k] = gm
            room[first + SHARE, k] = gm / all_in
            room[first + OUTER, k] = here * (all_in / inside)
            room[first + INNER, k] = counted / inside
            room[first + CENTRAL, k] = counted * (central / inside)
            room[first + REST, k] = here * _rest(central, gm, all_in, central / inside)
            inside = all_in


@kernel(inline=True, exact=True)
def _rest(central, gm, all_in, share):
    """Return m_0 M_i / M_(i-1) = m_0 + m_i m_0 / M_(i-1), less the product of the rounded M_i and m_0 / M_(i-1).
    Without it, planets would be ahead, or behind, in proportion to time.
    """
    product, lost = two_product(all_in, share)
    return exact_sub(fma(gm, share, exact_sub(central, product)), lost)


@kernel
def number_planets(strength, q, p, planets):
    """Number the planets outwards: by the energy of their orbits about the heaviest body.

    q, p : (3n,) positions and velocities, all x, then all y, then all z
    """
    n, registers = strength.shape[0] - 1, registers_in(planets)
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
            before = body_of(planets, place - 1)
            if not _tightness(strength, q, p, sun, body) > _tightness(strength, q, p, sun, before):
                break
            planets[centre + 2 + place // WIDTH, place % WIDTH] = before
            place -= 1
        planets[centre + 2 + place // WIDTH, place % WIDTH] = body
        placed += 1
    in_order = sun == 0
    for i in range(n - 1):
        in_order = in_order and body_of(planets, i) == i + 1
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
def enter_planets(planets, room, component, n, x, x_lo):
    """Write a component of the planets and of the centre of mass from that of n bodies, (x, x_lo)."""
    centre, sun = STATE_ROWS * registers_in(planets), dominant(planets)
    hi, lo = x[sun], x_lo[sun]
    for i in range(n - 1):
        body = body_of(planets, i)
        d, e = write_difference(planets, component, i, x[body], x_lo[body], hi, lo)
        hi, lo = add_product(hi, lo, constant(room, SHARE, i), d, e)
    planets[centre, component], planets[centre + 1, component] = hi, lo


@kernel(inline=True)
def write_difference(planets, component, i, x, x_lo, hi, lo):
    """Write (x, x_lo) - (hi, lo) as a component of planet i; returns it."""
    row, slot = STATE_ROWS * (i // WIDTH) + component, i % WIDTH
    d, e = difference_of_pairs(x, x_lo, hi, lo)
    planets[row, slot], planets[row + 6, slot] = d, e
    return d, e


@kernel(inline=True)
def difference_of_pairs(x, x_lo, hi, lo):
    """Return (x, x_lo) - (hi, lo)."""
    d, e = two_sum(x, -hi)
    return quick_two_sum(d, e + (x_lo - lo))


@kernel(inline=True)
def sum_of_pairs(hi, lo, d, e):
    """Return (hi, lo) + (d, e)."""
    s, f = two_sum(hi, d)
    return quick_two_sum(s, f + (lo + e))


@kernel
def leave_planets(planets, room, component, n, x, x_lo):
    """Write a component of n bodies, in doubled precision."""
    centre, sun = STATE_ROWS * registers_in(planets), dominant(planets)
    hi, lo = planets[centre, component], planets[centre + 1, component]
    for back in range(n - 1):
        i = n - 2 - back
        body = body_of(planets, i)
        d, e = coordinate(planets, component, i), coordinate(planets, 6 + component, i)
        hi, lo = add_product(hi, lo, -constant(room, SHARE, i), d, e)
        x[body], x_lo[body] = sum_of_pairs(hi, lo, d, e)
    x[sun], x_lo[sun] = hi, lo


@kernel
def centre_of(strength, planets, room, i, component):
    """Return a component of R_i, the centre of mass of the bodies 0 ... i, or of its velocity as a pair (hi, lo)."""
    count, centre = strength.shape[0] - 2, STATE_ROWS * registers_in(planets)
    hi, lo = planets[centre, component], planets[centre + 1, component]
    for k in range(count - i):
        j = count - 1 - k
        d, e = coordinate(planets, component, j), coordinate(planets, 6 + component, j)
        hi, lo = add_product(hi, lo, -constant(room, SHARE, j), d, e)
    return hi, lo


@kernel
def show_planets(strength, planets, room, q, p):
    """Write the state of the bodies, rounded: for observers, at every step."""
    n = strength.shape[0] - 1
    registers = room.shape[0] // ROWS
    centre = STATE_ROWS * registers
    in_order = planets[centre, 7] == IN_ORDER
    for k in range(3):
        _show_component(planets, room, registers, n, in_order, k, q, k * n)
        _show_component(planets, room, registers, n, in_order, 3 + k, p, k * n)


@kernel(inline=True)
def place_planets(own, share, outside):
    """Return a component of the places of the planets of a register, and of the centre of mass of those inside; own :
    r'; outside : the component of the centre of mass of all but those further out
    """
    weighted = share * own
    outwards = weighted + sums_after(weighted)
    return own + (outside - outwards), outside - lane(outwards, 0)


@kernel(inline=True)
def _show_component(planets, room, registers, n, in_order, component, x, axis):
    """Write a component of positions or velocities, n elements of x from `axis` on."""
    centre = STATE_ROWS * registers
    inside = planets[centre, component]
    for j in range(registers):
        register = registers - 1 - j
        own, share = load(planets, STATE_ROWS * register + component), load(room, ROWS * register + SHARE)
        place, inside = place_planets(own, share, inside)
        count = n - 1 - WIDTH * register
        if not in_order:
            for k in range(min(WIDTH, count)):
                x[axis + int(planets[centre + 2 + register, k])] = lane(place, k)
        elif count >= WIDTH:
            store(x, axis + 1 + WIDTH * register, place)
        else:
            store_some(x, axis + 1 + WIDTH * register, place, count)
    x[axis + int(planets[centre, 6])] = inside
