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

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, lane, load, total
from orbits.kernels.maps.interaction import pulls_within, with_pull
from orbits.kernels.maps.jacobi import sum_of_pairs, write_difference
from orbits.kernels.maps.jacobi_stages import move_centre
from orbits.kernels.maps.layout import (
    ROWS,
    STATE_ROWS,
    body_of,
    constant,
    coordinate,
    dominant,
    registers_in,
)
from orbits.kernels.maps.orbits import displaced, kicked, moved, orbits_of, pushed_and_drifted, write_orbits
from orbits.kernels.maps.threes import load_three, minus, store_three, times, totals
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
        u = load_three(planets, STATE_ROWS * register)
        f = pulls_within(u, load(room, ROWS * register + MASS))
        for source in range(registers):
            other = STATE_ROWS * source
            for slot in range(min(WIDTH, count - WIDTH * source) if source != register else 0):
                d = minus((planets[other, slot], planets[other + 1, slot], planets[other + 2, slot]), u)
                f = with_pull(f, room[ROWS * source + MASS, slot], d, d, False)
        store_three(room, ROWS * register + FORCE, f)


@kernel
def kick_and_drift_heliocentric(planets, room, count, kick, drift):
    """Take a kick with the motion by that of the dominant body, then Kepler motions. Returns P / m_0."""
    attract(planets, room, count)
    jump = _jump(planets, room)
    way = full(kick * jump[0]), full(kick * jump[1]), full(kick * jump[2])
    for register in range(room.shape[0] // ROWS):
        own, force = planets[STATE_ROWS * register :], load_three(room, ROWS * register + FORCE)
        attracting = load(room, ROWS * register + ATTRACTING)
        orbits, change = pushed_and_drifted(orbits_of(full(0.0), own), attracting, drift, way, times(kick, force))
        write_orbits(own, kicked(orbits, change))
    move_centre(planets, drift)
    return jump


@kernel(inline=True)
def _jump(planets, room):
    """Return P / m_0."""
    jump = 0.0, 0.0, 0.0
    for register in range(room.shape[0] // ROWS):
        share, velocity = load(room, ROWS * register + SHARE), load_three(planets, STATE_ROWS * register + 3)
        jump = plus(jump, totals(times(share, velocity)))
    return jump


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
        write_orbits(own, moved(orbits_of(full(0.0), own), attracting, h))
    move_centre(planets, h)


@kernel
def enter_heliocentric(planets, room, component, n, x, x_lo):
    """Write a component of the planets and of the centre of mass from that of n bodies, (x, x_lo)."""
    centre, sun = STATE_ROWS * registers_in(planets), dominant(planets)
    hi, lo = x[sun], x_lo[sun]
    for i in range(n - 1):
        body = body_of(planets, i)
        d, e = write_difference(planets, component, i, x[body], x_lo[body], x[sun], x_lo[sun])
        hi, lo = add_product(hi, lo, constant(room, PART, i), d, e)
    planets[centre, component], planets[centre + 1, component] = hi, lo
    for i in range(n - 1 if component >= 3 else 0):
        body = body_of(planets, i)
        write_difference(planets, component, i, x[body], x_lo[body], hi, lo)


@kernel
def leave_heliocentric(planets, room, component, n, x, x_lo):
    """Write a component of n bodies, in doubled precision."""
    hi, lo = origin_of(planets, room, n - 1, component)
    for i in range(n - 1):
        body = body_of(planets, i)
        d, e = coordinate(planets, component, i), coordinate(planets, 6 + component, i)
        x[body], x_lo[body] = sum_of_pairs(hi, lo, d, e)
    sun = dominant(planets)
    x[sun], x_lo[sun] = dominant_at(planets, room, n - 1, component)


@kernel
def origin_of(planets, room, count, component):
    """Return a component of that to which bodies are relative, as a pair (hi, lo): the position of the dominant body,
    or the velocity of the centre of mass.
    """
    centre = STATE_ROWS * registers_in(planets)
    if component < 3:
        return dominant_at(planets, room, count, component)
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


@kernel
def tabulate_heliocentric(planets, room, table, first, count):
    """Write the places of the planets before a kick into a table; see `orbits.kernels.maps.jacobi_tables`."""
    for i in range(count):
        for component in range(3):
            table[first + i, component] = coordinate(planets, component, i)
        table[first + i, 6] = constant(room, MASS, i)
    for k in range(6):
        table[first + count, k] = 0.0


@kernel
def tabulate_origin(planets, room, table, first, count):
    """Write the position of the dominant body and the velocity of the centre of mass into a table; planets : at the end
    of a step.
    """
    for component in range(6):
        table[first + count + 2, component] = origin_of(planets, room, count, component)[0]
