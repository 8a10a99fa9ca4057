"""Planets about a dominant body in democratic heliocentric coordinates, one in each lane.

With m for GM, m_0 that of the dominant body, the coordinates of planet i are its position relative to the dominant body
and its velocity relative to the centre of mass of all,

    Q_i = r_i - r_0,     V_i = v_i - v_c,     m_0 (v_0 - v_c) = -P,   P = sum_i m_i V_i

in which the Hamiltonian falls into three parts: Kepler motions of all planets about m_0, whatever their order; the
planets' attraction of each other, which changes V; and P^2 / (2 m_0), which moves all Q alike, by P / m_0 times the
time. The last two commute, and are applied together, between the halves of the Kepler motions: so the error is half of
what it is with the Kepler motions between halves of the others. What is marched stands in the middle of the Kepler
motions, which are thereby joined to those of the step before.

The arrays are those of `orbits.kernels.maps.layout`, `planets` with Q and V for r' and its velocity, `room` with the
rows named below.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067; Rein & Tamayo (2019), RNAAS 3, 16.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import WIDTH, fma, full, lane, load, rsqrt_cubed, total
from orbits.kernels.maps.interaction import pulls_within
from orbits.kernels.maps.jacobi import number_planets, sum_of_pairs, write_difference
from orbits.kernels.maps.jacobi_stages import move_centre
from orbits.kernels.maps.layout import (
    ROWS,
    STATE_ROWS,
    body_of,
    constant,
    coordinate,
    dominant,
    load_three,
    registers_in,
    rest_elsewhere,
    store_three,
)
from orbits.kernels.maps.orbits import (
    displaced,
    drifted,
    kicked,
    orbits_of,
    place_of,
    times,
    velocity_of,
    write_orbits,
)
from orbits.kernels.sums.summation import add_product

FORCE, MASS, SHARE, PART, ATTRACTING = 0, 3, 4, 5, 6
"""Rows of `room`: the attraction by the planets; m_i; m_i / m_0; m_i over the mass of all; m_0, 0 in lanes without a
planet."""


@kernel
def prepare_heliocentric(strength, planets, room):
    """Write the constants of the planets in their order; strength : (1 + n,), with GM from its second element on."""
    central, all_of_them = strength[1 + dominant(planets)], 0.0
    for k in range(strength.shape[0] - 1):
        all_of_them += strength[1 + k]
    for register in range(registers_in(planets)):
        first = ROWS * register
        for k in range(WIDTH):
            body = body_of(planets, WIDTH * register + k)
            gm = strength[1 + body] if body >= 0 else 0.0
            room[first + MASS, k] = gm
            room[first + SHARE, k] = gm / central
            room[first + PART, k] = gm / all_of_them
            room[first + ATTRACTING, k] = central if body >= 0 else 0.0


@kernel
def attract(planets, room, count):
    """Write the attraction of `count` planets by each other into the rows FORCE."""
    registers = room.shape[0] // ROWS
    for register in range(registers):
        x, y, z = load_three(planets, STATE_ROWS * register)
        (fx, fy, fz), _ = pulls_within(x, y, z, load(room, ROWS * register + MASS))
        for source in range(registers):
            other = STATE_ROWS * source
            for slot in range(min(WIDTH, count - WIDTH * source) if source != register else 0):
                dx, dy, dz = planets[other, slot] - x, planets[other + 1, slot] - y, planets[other + 2, slot] - z
                w = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx))) * room[ROWS * source + MASS, slot]
                fx, fy, fz = fma(w, dx, fx), fma(w, dy, fy), fma(w, dz, fz)
        store_three(room, ROWS * register + FORCE, (fx, fy, fz))


@kernel
def step_heliocentric(planets, room, count, h):
    """Take a step: a kick with the motion by that of the dominant body, then Kepler motions. Returns P / m_0."""
    attract(planets, room, count)
    jump = _jump(planets, room)
    way = full(h * jump[0]), full(h * jump[1]), full(h * jump[2])
    for register in range(room.shape[0] // ROWS):
        own, force = planets[STATE_ROWS * register :], load_three(room, ROWS * register + FORCE)
        attracting = load(room, ROWS * register + ATTRACTING)
        write_orbits(own, jumped_and_drifted(orbits_of(full(0.0), own), attracting, h, way, times(h, force)))
    move_centre(planets, h)
    return jump


@kernel(inline=True)
def jumped_and_drifted(orbits, gm, h, jump, kick):
    """Return orbits after a kick with a jump of the places, three numbers each, and Kepler motions of h."""
    (x, y, z), (jx, jy, jz), (kx, ky, kz) = place_of(orbits), jump, kick
    dx, dy, dz, dvx, dvy, dvz = short_increments(
        x + jx, y + jy, z + jz, orbits.vx + kx, orbits.vy + ky, orbits.vz + kz, gm, full(h)
    )
    return kicked(displaced(orbits, (dx + jx, dy + jy, dz + jz)), (dvx + kx, dvy + ky, dvz + kz))


@kernel(inline=True)
def _jump(planets, room):
    """Return P / m_0."""
    x, y, z = 0.0, 0.0, 0.0
    for register in range(room.shape[0] // ROWS):
        share, (vx, vy, vz) = load(room, ROWS * register + SHARE), load_three(planets, STATE_ROWS * register + 3)
        x, y, z = x + total(share * vx), y + total(share * vy), z + total(share * vz)
    return x, y, z


@kernel
def kick_heliocentric(planets, room, count, h):
    """Take the first part of a step alone: a kick with the motion by that of the dominant body."""
    attract(planets, room, count)
    x, y, z = _jump(planets, room)
    for register in range(room.shape[0] // ROWS):
        own, force = planets[STATE_ROWS * register :], load_three(room, ROWS * register + FORCE)
        there = displaced(orbits_of(full(0.0), own), (full(h * x), full(h * y), full(h * z)))
        write_orbits(own, kicked(there, times(h, force)))


@kernel
def drift_heliocentric(planets, room, h):
    """Advance the planets on their Kepler orbits by h."""
    for register in range(room.shape[0] // ROWS):
        own, attracting = planets[STATE_ROWS * register :], load(room, ROWS * register + ATTRACTING)
        orbits = orbits_of(full(0.0), own)
        moved, change = drifted(orbits, attracting, h, velocity_of(orbits))
        write_orbits(own, kicked(moved, change))
    move_centre(planets, h)


@kernel
def enter_heliocentric(strength, q, q_lo, p, p_lo, planets, room):
    """Write the planets of a state (q, q_lo), (p, p_lo) of bodies, and the constants into `room`; numbers the planets
    unless they are numbered already.
    """
    n, centre = strength.shape[0] - 1, STATE_ROWS * registers_in(planets)
    if planets[centre, 7] == 0.0:
        number_planets(strength, q, p, planets)
    prepare_heliocentric(strength, planets, room)
    sun, furthest = dominant(planets), 0.0
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        sun_hi, sun_lo = x[axis + sun], x_lo[axis + sun]
        hi, lo = sun_hi, sun_lo
        for i in range(n - 1):
            body = axis + body_of(planets, i)
            d, e = write_difference(planets, component, i, x[body], x_lo[body], sun_hi, sun_lo)
            hi, lo = add_product(hi, lo, constant(room, PART, i), d, e)
            if component < 3:
                furthest = max(furthest, abs(d))
        planets[centre, component], planets[centre + 1, component] = hi, lo
        for i in range(n - 1 if component >= 3 else 0):
            body = axis + body_of(planets, i)
            write_difference(planets, component, i, x[body], x_lo[body], hi, lo)
    rest_elsewhere(planets, n - 1, furthest)


@kernel
def leave_heliocentric(strength, planets, room, q, q_lo, p, p_lo):
    """Write the state of the bodies, in doubled precision."""
    n, sun = strength.shape[0] - 1, dominant(planets)
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        hi, lo = origin_of(strength, planets, room, component)
        for i in range(n - 1):
            body = axis + body_of(planets, i)
            d, e = coordinate(planets, component, i), coordinate(planets, 6 + component, i)
            x[body], x_lo[body] = sum_of_pairs(hi, lo, d, e)
        x[axis + sun], x_lo[axis + sun] = dominant_at(planets, room, n - 1, component)


@kernel
def origin_of(strength, planets, room, component):
    """Return a component of that to which bodies are relative, as a pair (hi, lo): the position of the dominant body,
    or the velocity of the centre of mass.
    """
    centre = STATE_ROWS * registers_in(planets)
    if component < 3:
        return dominant_at(planets, room, strength.shape[0] - 2, component)
    return planets[centre, component], planets[centre + 1, component]


@kernel
def dominant_at(planets, room, count, component):
    """Return a component of the position (0 ... 2) or velocity (3 ... 5) of the dominant body as a pair (hi, lo)."""
    centre, row = STATE_ROWS * registers_in(planets), PART if component < 3 else SHARE
    hi, lo = planets[centre, component], planets[centre + 1, component]
    for i in range(count):
        d, e = coordinate(planets, component, i), coordinate(planets, 6 + component, i)
        hi, lo = add_product(hi, lo, -constant(room, row, i), d, e)
    return hi, lo


@kernel
def show_heliocentric(strength, planets, room, q, p):
    """Write the state of the bodies, rounded: for observers, at every step.

    planets : at the end of the step
    """
    n, registers = strength.shape[0] - 1, registers_in(planets)
    for component in range(6):
        x = q if component < 3 else p
        axis = component % 3 * n
        middle, outwards = planets[STATE_ROWS * registers, component], 0.0
        for register in range(registers):
            share = load(room, ROWS * register + (PART if component < 3 else SHARE))
            outwards += total(share * load(planets, STATE_ROWS * register + component))
        own = middle - outwards
        origin = own if component < 3 else middle
        for register in range(registers):
            place = origin + load(planets, STATE_ROWS * register + component)
            for k in range(min(WIDTH, n - 1 - WIDTH * register)):
                x[axis + body_of(planets, WIDTH * register + k)] = lane(place, k)
        x[axis + dominant(planets)] = own
