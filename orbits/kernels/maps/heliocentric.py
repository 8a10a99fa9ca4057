"""Planets about a dominant body in democratic heliocentric coordinates, one in each lane.

With m for GM, m_0 that of the dominant body, the coordinates of planet i are its position relative to the dominant body
and its velocity relative to the centre of mass of all,

    Q_i = r_i - r_0,     V_i = v_i - v_c,     m_0 (v_0 - v_c) = -P,   P = sum_i m_i V_i

in which the Hamiltonian falls into three parts: Kepler motions of all planets about m_0, whatever their order; the
planets' attraction of each other, which changes V; and P^2 / (2 m_0), which moves all Q alike, by P / m_0 times the
time. The last two commute, and are applied together, between the halves of the Kepler motions: so the error is half of
what it is with the Kepler motions between halves of the others. What is marched stands in the middle of the Kepler
motions, which are thereby joined to those of the step before.

Arrays are (rows, 8). `planets` is as in `orbits.kernels.maps.jacobi`, with Q and V for r' and its velocity. `room` has
for each register the rows named below.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067; Rein & Tamayo (2019), RNAAS 3, 16.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import WIDTH, fma, full, lane, load, rsqrt_cubed, store, total
from orbits.kernels.maps.interaction import STATE_ROWS, load_three, pulls_within, store_three
from orbits.kernels.maps.jacobi import move_centre, number_planets
from orbits.kernels.sums.summation import accumulate, add_product, quick_two_sum, two_sum

FORCE, MASS, SHARE, PART, ATTRACTING, ROWS = 0, 3, 4, 5, 6, 16
"""Rows of `room`: the attraction by the planets; m_i; m_i / m_0; m_i over the mass of all; m_0, 0 in lanes without a
planet; and their number, with what eight particles need as workspace."""


@kernel
def prepare_heliocentric(strength, planets, room):
    """Write the constants of the planets in their order; strength : (1 + n,), with GM from its second element on."""
    registers = room.shape[0] // ROWS
    numbers = STATE_ROWS * registers
    central, all_of_them = strength[1 + int(planets[numbers, 6])], 0.0
    for k in range(strength.shape[0] - 1):
        all_of_them += strength[1 + k]
    for register in range(registers):
        first = ROWS * register
        for k in range(WIDTH):
            body = int(planets[numbers + 2 + register, k])
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
    x, y, z = _jump(planets, room)
    _move(planets, room, h, h, (x, y, z))
    return x, y, z


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
        first, force = STATE_ROWS * register, load_three(room, ROWS * register + FORCE)
        _advance(planets, first, full(h * x))
        _advance(planets, first + 1, full(h * y))
        _advance(planets, first + 2, full(h * z))
        for k in range(3):
            _advance(planets, first + 3 + k, h * force[k])


@kernel
def drift_heliocentric(planets, room, h):
    """Advance the planets on their Kepler orbits by h; the rows FORCE are lost."""
    for register in range(room.shape[0] // ROWS):
        store_three(room, ROWS * register + FORCE, (full(0.0), full(0.0), full(0.0)))
    _move(planets, room, h, 0.0, (0.0, 0.0, 0.0))


@kernel(inline=True)
def _move(planets, room, h, kick, jump):
    """Advance the planets by `kick` times the attraction and times `jump`, and then on their Kepler orbits by h."""
    jx, jy, jz = full(kick * jump[0]), full(kick * jump[1]), full(kick * jump[2])
    for register in range(room.shape[0] // ROWS):
        first, own = STATE_ROWS * register, ROWS * register
        (x, y, z), (vx, vy, vz) = load_three(planets, first), load_three(planets, first + 3)
        fx, fy, fz = load_three(room, own + FORCE)
        kx, ky, kz = kick * fx, kick * fy, kick * fz
        dx, dy, dz, dvx, dvy, dvz = short_increments(
            x + jx, y + jy, z + jz, vx + kx, vy + ky, vz + kz, load(room, own + ATTRACTING), full(h)
        )
        _advance(planets, first, dx + jx)
        _advance(planets, first + 1, dy + jy)
        _advance(planets, first + 2, dz + jz)
        _advance(planets, first + 3, dvx + kx)
        _advance(planets, first + 4, dvy + ky)
        _advance(planets, first + 5, dvz + kz)
    move_centre(planets, room.shape[0] // ROWS, h)


@kernel(inline=True)
def _advance(planets, row, change):
    hi, lo = accumulate(load(planets, row), load(planets, row + 6), change)
    store(planets, row, hi)
    store(planets, row + 6, lo)


@kernel
def enter_heliocentric(strength, q, q_lo, p, p_lo, planets, room):
    """Write the planets of a state (q, q_lo), (p, p_lo) of bodies, and the constants into `room`; numbers the planets
    unless they are numbered already.
    """
    n, registers = strength.shape[0] - 1, room.shape[0] // ROWS
    centre = STATE_ROWS * registers
    if planets[centre, 7] == 0.0:
        number_planets(strength, q, p, planets)
    prepare_heliocentric(strength, planets, room)
    sun = int(planets[centre, 6])
    furthest = 0.0
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        sun_hi, sun_lo = x[axis + sun], x_lo[axis + sun]
        hi, lo = sun_hi, sun_lo
        for i in range(n - 1):
            register, k = i // WIDTH, i % WIDTH
            body = int(planets[centre + 2 + register, k])
            d, e = _less(x[axis + body], x_lo[axis + body], sun_hi, sun_lo)
            hi, lo = add_product(hi, lo, room[ROWS * register + PART, k], d, e)
            planets[STATE_ROWS * register + component, k] = d
            planets[STATE_ROWS * register + 6 + component, k] = e
            if component < 3:
                furthest = max(furthest, abs(d))
        planets[centre, component], planets[centre + 1, component] = hi, lo
        for i in range(n - 1 if component >= 3 else 0):
            register, k = i // WIDTH, i % WIDTH
            body = int(planets[centre + 2 + register, k])
            d, e = _less(x[axis + body], x_lo[axis + body], hi, lo)
            planets[STATE_ROWS * register + component, k] = d
            planets[STATE_ROWS * register + 6 + component, k] = e
    # Lanes without a planet rest at different places.
    for i in range(n - 1, WIDTH * registers):
        register, k = i // WIDTH, i % WIDTH
        for row in range(STATE_ROWS):
            planets[STATE_ROWS * register + row, k] = 0.0
        planets[STATE_ROWS * register, k] = (2.0 + i) * (furthest + 1.0)


@kernel(inline=True)
def _less(x, x_lo, hi, lo):
    """Return (x, x_lo) - (hi, lo)."""
    d, e = two_sum(x, -hi)
    return quick_two_sum(d, e + (x_lo - lo))


@kernel
def leave_heliocentric(strength, planets, room, q, q_lo, p, p_lo):
    """Write the state of the bodies, in doubled precision."""
    n, centre = strength.shape[0] - 1, STATE_ROWS * (room.shape[0] // ROWS)
    sun = int(planets[centre, 6])
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        sun_hi, sun_lo = place_of_the_dominant(planets, room, n - 1, component)
        # Positions are relative to the dominant body, velocities to the centre of mass.
        hi, lo = (sun_hi, sun_lo) if component < 3 else (planets[centre, component], planets[centre + 1, component])
        for i in range(n - 1):
            register, k = i // WIDTH, i % WIDTH
            body = int(planets[centre + 2 + register, k])
            s, f = two_sum(hi, planets[STATE_ROWS * register + component, k])
            x[axis + body], x_lo[axis + body] = quick_two_sum(
                s, f + (lo + planets[STATE_ROWS * register + 6 + component, k])
            )
        x[axis + sun], x_lo[axis + sun] = sun_hi, sun_lo


@kernel
def place_of_the_dominant(planets, room, count, component):
    """Return a component of the position (0 ... 2) or velocity (3 ... 5) of the dominant body as a pair (hi, lo)."""
    centre, row = STATE_ROWS * (room.shape[0] // ROWS), PART if component < 3 else SHARE
    hi, lo = planets[centre, component], planets[centre + 1, component]
    for i in range(count):
        register, k = i // WIDTH, i % WIDTH
        own = STATE_ROWS * register + component
        hi, lo = add_product(hi, lo, -room[ROWS * register + row, k], planets[own, k], planets[own + 6, k])
    return hi, lo


@kernel
def show_heliocentric(strength, planets, room, q, p):
    """Write the state of the bodies, rounded: for observers, at every step.

    planets : at the end of the step
    """
    n, registers = strength.shape[0] - 1, room.shape[0] // ROWS
    centre = STATE_ROWS * registers
    sun = int(planets[centre, 6])
    for component in range(6):
        x = q if component < 3 else p
        axis = component % 3 * n
        middle = planets[centre, component]
        outwards = 0.0
        for register in range(registers):
            share = load(room, ROWS * register + (PART if component < 3 else SHARE))
            outwards += total(share * load(planets, STATE_ROWS * register + component))
        own = middle - outwards
        origin = own if component < 3 else middle
        for register in range(registers):
            place = origin + load(planets, STATE_ROWS * register + component)
            for k in range(min(WIDTH, n - 1 - WIDTH * register)):
                x[axis + int(planets[centre + 2 + register, k])] = lane(place, k)
        x[axis + sun] = own
