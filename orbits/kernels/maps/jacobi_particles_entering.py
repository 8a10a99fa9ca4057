"""How massless particles enter and leave Wisdom–Holman maps: the corrector, momenta, and the flow of terms; see
`orbits.kernels.maps.jacobi_particles`.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    full,
    get,
    select,
    unit,
)
from orbits.kernels.maps.interaction import ATTRACTING, ROWS, SHARE, STATE_ROWS, interact
from orbits.kernels.maps.jacobi import finish_velocities, kick_planets, move_planets
from orbits.kernels.maps.jacobi_particles import (
    ATTRACTED,
    ELSEWHERE,
    NUMBER,
    PLAIN,
    Marched,
    drifted_particles,
    interaction,
    kicked_particles,
    of_places,
    store_marched,
    table_rows,
    tabulate,
    take_particles,
)
from orbits.kernels.maps.terms_of_dominant import (
    depends_on_velocities,
    flow_among,
    has_flow,
    has_terms,
    kick_more,
    particle_rates,
    strength_of,
    to_momenta,
    to_velocities,
)
from orbits.kernels.search.apsides import apsides
from orbits.kernels.search.context import flat
from orbits.kernels.sums.summation import accumulate, add_product, quick_two_sum, two_sum


@kernel
def _correct(model, coefficients, planets, room, table, particles, sign):
    """Apply the corrector, or its inverse for sign = -1, to planets and particles; the first table is overwritten.

    particles : their memory, the status of each, workspace, and the share of them
    """
    memory, retired, rows, share = particles
    strength = strength_of(model)
    stages, count, flows = coefficients.shape[0] - 1, strength.shape[0] - 2, flow_rows(strength.shape[0] - 2)
    for i in range(stages):
        row = 1 + i if sign > 0.0 else stages - i
        drift = sign * coefficients[row, 0]
        move_planets(planets, room, drift, 0.0)
        finish_velocities(planets, room, 0.0)
        # Backwards, the kick before a Kepler motion follows it.
        other = row if sign > 0.0 else row - 1
        length = sign * coefficients[other, 1] if other > 0 else 0.0
        if length != 0.0:
            if sign > 0.0:
                flow_among(model, planets, room, table, flows, length)
            interact(planets, room, count, False)
            kick_more(model, planets, room)
            tabulate(strength, planets, room, table, 0, PLAIN)
            kick_planets(planets, room, length)
            if sign < 0.0:
                flow_among(model, planets, room, table, flows, length)
        for p in range(share.start, share.stop, WIDTH):
            _correct_eight(model, memory, retired, table, rows, p, drift, length, sign)


@kernel
def _correct_eight(model, memory, retired, table, rows, p, drift, kick, sign):
    """Apply a stage of the corrector to eight particles: a Kepler motion, then a kick with the flow of terms."""
    flows = flow_rows(strength_of(model).shape[0] - 2)
    marched = take_particles(memory, p, present(memory, retired, p), rows)
    marched, ax, ay, az = drifted_particles(marched, drift, 0.0)
    g = full(0.0), full(0.0), full(0.0)
    if kick != 0.0 and has_flow(model) and sign > 0.0:
        marched = kicked_particles(marched, (ax, ay, az), 0.0, g)
        marched, ax, ay, az = flowing_particles(model, table, flows, marched, rows, kick), g[0], g[1], g[2]
    if kick != 0.0:
        g = interaction(model, table, 0, 0.0, 0.0, marched, rows)
    marched = kicked_particles(marched, (ax, ay, az), kick, g)
    if kick != 0.0 and has_flow(model) and sign < 0.0:
        marched = flowing_particles(model, table, flows, marched, rows, kick)
    store_marched(memory, p, marched, rows)


@kernel(inline=True)
def flow_rows(planets):
    """Return the first of the rows of the stages for the flow of terms of the dominant body: two tables of three rows
    for each place.
    """
    return 2 * table_rows(planets)


@verb
def flowing_particles(model, table, first, marched, rows, h):
    """Return particles after h in the flow of terms of the dominant body; see
    `orbits.kernels.maps.terms_of_dominant`.
    """
    if not depends_on_velocities(model):
        return lambda model, table, first, marched, rows, h: marched
    return lambda model, table, first, marched, rows, h: _flowing(model, table, first, marched, rows, h)


@kernel(inline=True)
def _flowing(model, table, first, marched, rows, h):
    x, y, z, vx, vy, vz = _rates(model, table, first, marched, rows, 0.5 * h, True)
    x, x_lo = accumulate(marched.x, marched.x_lo, h * x)
    y, y_lo = accumulate(marched.y, marched.y_lo, h * y)
    z, z_lo = accumulate(marched.z, marched.z_lo, h * z)
    vx, vx_lo = accumulate(marched.vx, marched.vx_lo, h * vx)
    vy, vy_lo = accumulate(marched.vy, marched.vy_lo, h * vy)
    vz, vz_lo = accumulate(marched.vz, marched.vz_lo, h * vz)
    return Marched(
        x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo,
        marched.gx, marched.gy, marched.gz, marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def _rates(model, table, first, marched, rows, half, known):
    """Return the rates of r' and of its velocity in the flow of terms; 0 in lanes without a particle."""
    line = flat(table)
    cx, cy, cz, cu, cv, cw = of_places(line, first, 0, marched, rows)
    dx, dy, dz, du, dv, dw = of_places(line, first, 1, marched, rows)
    at = WIDTH * (first + 1)
    central = (
        get(line, at), get(line, at + 1), get(line, at + 2), get(line, at + 3), get(line, at + 4), get(line, at + 5),
    )  # fmt: skip
    u, w = (marched.x + cx, marched.y + cy, marched.z + cz), (marched.vx + cu, marched.vy + cv, marched.vz + cw)
    x, y, z, vx, vy, vz = particle_rates(model, central, u, w, half, known)
    there = marched.gm > 0.0
    return (
        select(there, x - dx, 0.0), select(there, y - dy, 0.0), select(there, z - dz, 0.0),
        select(there, vx - du, 0.0), select(there, vy - dv, 0.0), select(there, vz - dw, 0.0),
    )  # fmt: skip


@verb
def change_momenta(model, table, particles, sign):
    """Change the velocities of particles to momenta for sign = -1, or back for sign = 1, with the table for it."""
    if not depends_on_velocities(model):
        return lambda model, table, particles, sign: None
    return lambda model, table, particles, sign: _change_all(model, table, particles, sign)


@kernel
def _change_all(model, table, particles, sign):
    memory, retired, rows, share = particles
    first = flow_rows(strength_of(model).shape[0] - 2)
    for p in range(share.start, share.stop, WIDTH):
        marched = take_particles(memory, p, present(memory, retired, p), rows)
        x, y, z, _, _, _ = _rates(model, table, first, marched, rows, 0.0, sign > 0.0)
        store_marched(memory, p, kicked_particles(marched, (sign * x, sign * y, sign * z), 0.0, (x, y, z)), rows)


@kernel(inline=True)
def present(memory, retired, p):
    """Return 1 in the lanes of particles that are neither retired nor marched elsewhere."""
    there = full(1.0)
    for k in range(WIDTH):
        if retired[p + k, 0] != 0 or (p + k < memory.shape[0] and memory[p + k, 0, NUMBER] == ELSEWHERE):
            there = there - unit(k)
    return there


@kernel(inline=True)
def _is_displaced(model, coefficients):
    """Return whether what is marched is elsewhere than what is seen. About a body that is alone a corrector leads back
    to where it began, but not a single motion, without a kick.
    """
    stages, alone = coefficients.shape[0] - 1, strength_of(model).shape[0] == 2 and not has_terms(model)
    return stages > 0 and (stages == 1 or not alone)


@kernel
def enter_among(model, coefficients, planets, room, table, particles, rows, share):
    """Write what is marched of particles share.start ... share.stop - 1 from the states that are seen.

    planets : the planets of the state that is seen, uncorrected; they become what is marched
    particles : their `Columns`, their memory, and their rows of a status, (padded, 2) int64: those with another one
        than 0 are left alone
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    strength = strength_of(model)
    count = strength.shape[0] - 2
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        own = memory[p]
        if own[0, NUMBER] == 0.0:
            own[0, NUMBER] = 1.0 + _planets_inside(strength, planets, room, q, v, p)
        i = int(own[0, NUMBER]) - 1
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = _centre(strength, planets, room, i, component)
            d, e = two_sum(x[component % 3, p], -hi)
            own[0, component], own[1, component] = quick_two_sum(d, e + (x_lo[component % 3, p] - lo))
        sun = int(planets[STATE_ROWS * (room.shape[0] // ROWS), 6])
        gm = strength[1 + sun]
        if i > 0:
            gm = room[ROWS * ((i - 1) // WIDTH) + ATTRACTING, (i - 1) % WIDTH]
        own[0, ATTRACTED] = gm
    to_momenta(model, planets, room, table, flow_rows(count))
    change_momenta(model, table, (memory, retired, rows, share), -1.0)
    if _is_displaced(model, coefficients):
        _correct(model, coefficients, planets, room, table, (memory, retired, rows, share), 1.0)


@kernel
def leave_among(model, coefficients, planets, room, table, particles, rows, share):
    """Write the states that are seen of particles share.start ... share.stop - 1, in doubled precision.

    planets : as they are marched; they and the memory are lost. The rest is as for `enter_among`
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    strength = strength_of(model)
    count = strength.shape[0] - 2
    if _is_displaced(model, coefficients):
        _correct(model, coefficients, planets, room, table, (memory, retired, rows, share), -1.0)
    to_velocities(model, planets, room, table, flow_rows(count))
    change_momenta(model, table, (memory, retired, rows, share), 1.0)
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        i = int(memory[p, 0, NUMBER]) - 1
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = _centre(strength, planets, room, i, component)
            s, e = two_sum(hi, memory[p, 0, component])
            hi, lo = quick_two_sum(s, e + (memory[p, 1, component] + lo))
            x[component % 3, p], x_lo[component % 3, p] = hi, lo


@kernel
def _centre(strength, planets, room, i, component):
    """Return a component of R_i or of its velocity as a pair (hi, lo)."""
    count, centre = strength.shape[0] - 2, STATE_ROWS * (room.shape[0] // ROWS)
    hi, lo = planets[centre, component], planets[centre + 1, component]
    for k in range(count - i):
        register, slot = (count - 1 - k) // WIDTH, (count - 1 - k) % WIDTH
        row = STATE_ROWS * register + component
        hi, lo = add_product(hi, lo, -room[ROWS * register + SHARE, slot], planets[row, slot], planets[row + 6, slot])
    return hi, lo


@kernel
def _planets_inside(strength, planets, room, q, v, p):
    """Return the number of planets, from the innermost outwards, whose semi-major axes are below the pericentre
    distance of a particle about the dominant body.
    """
    count, centre = strength.shape[0] - 2, STATE_ROWS * (room.shape[0] // ROWS)
    gm = strength[1 + int(planets[centre, 6])]
    hi = _centre(strength, planets, room, 0, 0)[0]
    x, y, z = (
        q[0, p] - hi,
        q[1, p] - _centre(strength, planets, room, 0, 1)[0],
        q[2, p] - _centre(strength, planets, room, 0, 2)[0],
    )
    vx, vy, vz = (
        v[0, p] - _centre(strength, planets, room, 0, 3)[0],
        v[1, p] - _centre(strength, planets, room, 0, 4)[0],
        v[2, p] - _centre(strength, planets, room, 0, 5)[0],
    )
    pericentre = apsides(gm, x, y, z, vx, vy, vz).least
    for i in range(count):
        register, slot = i // WIDTH, i % WIDTH
        row = STATE_ROWS * register
        r2, v2 = 0.0, 0.0
        for k in range(3):
            r2 += planets[row + k, slot] ** 2
            v2 += planets[row + 3 + k, slot] ** 2
        # 1/a of a planet
        if not (2.0 / r2**0.5 - v2 / room[ROWS * register + ATTRACTING, slot]) * pericentre > 1.0:
            return i
    return count
