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
body in each lane, -1 for none, for each register. `room` has for each register the rows named in
`orbits.kernels.maps.interaction`, and then eight of the unit matrix.

Source: Wisdom & Holman (1991), AJ 102, 1528; Rein & Tamayo (2015), MNRAS 452, 376.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.flow import kepler_increments
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import (
    WIDTH,
    alike,
    exact_sub,
    fma,
    full,
    lane,
    load,
    store,
    store_some,
    sums_after,
    turned,
    unit,
)
from orbits.kernels.maps.interaction import (
    ATTRACTING,
    CENTRAL,
    CHANGE,
    FORCE,
    IN_ORDER,
    INNER,
    MASS,
    MOVED,
    OUTER,
    PLACE,
    REST,
    ROWS,
    SHARE,
    SHIFTED,
    STATE_ROWS,
    change_along,
    interaction,
    kind_of,
    load_three,
    masses_of,
    of_room,
    of_state,
    store_three,
    write_room,
    write_state,
)
from orbits.kernels.maps.nearest import note_nearest
from orbits.kernels.maps.terms_of_dominant import flow_of_register, force_with_pulls
from orbits.kernels.sums.summation import accumulate, add_product, quick_two_sum, two_product, two_sum


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
def move_planets(planets, room, h, kick):
    """Advance the planets on their Kepler orbits by h, of any length, from velocities changed by `kick` times the
    interaction.

    The velocities are not changed: the rows CHANGE receive the change, that by the kick included.
    """
    _move(planets, room, h, kick, False)


@kernel
def advance_planets(planets, room, h, kick):
    """The same, to the same accuracy, fast for steps that are short beside the orbits."""
    _move(planets, room, h, kick, True)


@kernel(inline=True)
def _move(planets, room, h, kick, short):
    registers = room.shape[0] // ROWS
    for register in range(registers):
        first, other = STATE_ROWS * register, ROWS * register
        x, y, z = load_three(planets, first)
        ax, ay, az = load_three(room, other + FORCE)
        vx, vy, vz = _kicked(load_three(planets, first + 3), kick, ax, ay, az)
        attracting = load(room, other + ATTRACTING)
        if short:
            dx, dy, dz, dvx, dvy, dvz = short_increments(x, y, z, vx, vy, vz, attracting, full(h))
        else:
            dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, attracting, full(h))
        _advance(planets, first, dx)
        _advance(planets, first + 1, dy)
        _advance(planets, first + 2, dz)
        store_three(room, other + CHANGE, _kicked((dvx, dvy, dvz), kick, ax, ay, az))
    move_centre(planets, registers, h)


@kernel(inline=True)
def _kicked(v, kick, ax, ay, az):
    return fma(kick, ax, v[0]), fma(kick, ay, v[1]), fma(kick, az, v[2])


@kernel(inline=True)
def move_centre(planets, registers, h):
    """Advance the centre of mass: its position is in lanes 0 ... 2, its velocity in the next three."""
    centre = STATE_ROWS * registers
    there, rest = load(planets, centre), load(planets, centre + 1)
    h = h * (unit(0) + unit(1) + unit(2))
    there, rest = add_product(there, rest, h, turned(there, 3), turned(rest, 3))
    store(planets, centre, there)
    store(planets, centre + 1, rest)


@kernel
def step_plain(registers, planets, room, h):
    """Take a step of planets that stay in registers: half a kick, Kepler motions, half a kick.

    The same as `advance_planets`, the interaction for the kick and `finish_velocities`, to the last bit, but that
    nothing leaves registers, in two thirds of the time. The rows FORCE have the interaction of the kick before, and
    receive that of this one.

    registers : see `orbits.kernels.maps.interaction.registers_of`
    """
    _step(kind_of(registers), planets, room, h, 0.0, False, False)


@kernel
def step_modified(registers, planets, room, h, shift):
    """The same with the modified kick, changed by `shift` times its derivative along itself."""
    _step(kind_of(registers), planets, room, h, shift, True, False)


@kernel
def step_lazy(registers, planets, room, h, shift):
    """The same with the lazy kick, by the interaction at places displaced by `shift` times the interaction."""
    _step(kind_of(registers), planets, room, h, shift, False, True)


@kernel(inline=True)
def _step(like, planets, room, h, shift, modified, lazy):
    x, y, z = of_state(like, planets, 0)
    u, v, w = of_state(like, planets, 3)
    masses, force, kick = masses_of(like, room), of_room(like, room, FORCE), 0.5 * h
    vx, vy, vz = _kicked((u, v, w), kick, force[0], force[1], force[2])
    dx, dy, dz, dvx, dvy, dvz = short_increments(x, y, z, vx, vy, vz, masses.attracting, alike(h, like))
    change = _kicked((dvx, dvy, dvz), kick, force[0], force[1], force[2])
    x_lo, y_lo, z_lo = of_state(like, planets, 6)
    x, x_lo = accumulate(x, x_lo, dx)
    y, y_lo = accumulate(y, y_lo, dy)
    z, z_lo = accumulate(z, z_lo, dz)
    force, place, pairs = interaction(x, y, z, masses)
    note_nearest(room, pairs)
    if lazy:
        there = _kicked((x, y, z), shift, force[0], force[1], force[2])
        write_room(room, SHIFTED, there)
        force, place, _ = interaction(there[0], there[1], there[2], masses)
    if modified:
        force, shifted, moved = change_along(force, pairs, shift, masses)
        write_room(room, SHIFTED, shifted)
        write_room(room, MOVED, moved)
    change = _kicked(change, kick, force[0], force[1], force[2])
    u_lo, v_lo, w_lo = of_state(like, planets, 9)
    u, u_lo = accumulate(u, u_lo, change[0])
    v, v_lo = accumulate(v, v_lo, change[1])
    w, w_lo = accumulate(w, w_lo, change[2])
    write_state(planets, 0, (x, y, z))
    write_state(planets, 3, (u, v, w))
    write_state(planets, 6, (x_lo, y_lo, z_lo))
    write_state(planets, 9, (u_lo, v_lo, w_lo))
    write_room(room, PLACE, place)
    write_room(room, FORCE, force)
    move_centre(planets, room.shape[0] // ROWS, h)


@kernel
def step_with_terms_in_a_register(model, planets, room, h, shift, lazy):
    """Take a step of planets that fit into one register, with terms: half a kick, half the flow of those that depend on
    velocities, Kepler motions, and the same back.

    shift, lazy : 0, or h^2/12 for the modified kick and, if `lazy`, for the lazy one. The same as the parts of it, to
    the last bit, without leaving registers; the rows FORCE have the interaction of the kick before, and receive that of
    this one.
    """
    masses, force, kick = masses_of(full(0.0), room), load_three(room, FORCE), 0.5 * h
    state = load_three(planets, 0) + load_three(planets, 3), load_three(planets, 6) + load_three(planets, 9)
    state = _kicked_state(state, (kick * force[0], kick * force[1], kick * force[2]))
    state = flow_of_register(model, masses, state, kick)
    (x, y, z, u, v, w), (x_lo, y_lo, z_lo, u_lo, v_lo, w_lo) = state
    dx, dy, dz, du, dv, dw = short_increments(x, y, z, u, v, w, masses.attracting, full(h))
    x, x_lo = accumulate(x, x_lo, dx)
    y, y_lo = accumulate(y, y_lo, dy)
    z, z_lo = accumulate(z, z_lo, dz)
    state = _kicked_state(((x, y, z, u, v, w), (x_lo, y_lo, z_lo, u_lo, v_lo, w_lo)), (du, dv, dw))
    state = flow_of_register(model, masses, state, kick)
    x, y, z = state[0][0], state[0][1], state[0][2]
    force, place, pairs = interaction(x, y, z, masses)
    note_nearest(room, pairs)
    if lazy:
        force = force_with_pulls(model, masses, place, force)
        there = _kicked((x, y, z), shift, force[0], force[1], force[2])
        force, place, _ = interaction(there[0], there[1], there[2], masses)
    elif shift != 0.0:
        force, _, _ = change_along(force, pairs, shift, masses)
    force = force_with_pulls(model, masses, place, force)
    state = _kicked_state(state, (kick * force[0], kick * force[1], kick * force[2]))
    for part in range(2):
        store_three(planets, 6 * part, (state[part][0], state[part][1], state[part][2]))
        store_three(planets, 6 * part + 3, (state[part][3], state[part][4], state[part][5]))
    store_three(room, FORCE, force)
    move_centre(planets, 1, h)


@kernel(inline=True)
def _kicked_state(state, change):
    """Return the state of a register, (r' and its velocity, six, and their low parts), with the velocity changed."""
    (x, y, z, u, v, w), (x_lo, y_lo, z_lo, u_lo, v_lo, w_lo) = state
    u, u_lo = accumulate(u, u_lo, change[0])
    v, v_lo = accumulate(v, v_lo, change[1])
    w, w_lo = accumulate(w, w_lo, change[2])
    return (x, y, z, u, v, w), (x_lo, y_lo, z_lo, u_lo, v_lo, w_lo)


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
