"""Massless particles in the form of `orbits.integrators.canonical.bodies`: the same equations for a mass of 1, in the
field of the bodies at their stages.
"""

from __future__ import annotations

import math

from orbits.integrators.canonical.form import combine
from orbits.integrators.canonical.room import (
    CONTINUATION,
    HOURS,
    INVERSE,
    LATE,
    MU,
    MU_BAR,
    SETTLED,
    VELOCITY_SWEEPS,
    padded_length,
    stages_in,
)
from orbits.integrators.collocation.particles import is_round_off
from orbits.integrators.collocation.rows import HB, HC, HC_LO, is_close, place
from orbits.kernels.binding import Tag, dimension, field, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.close_field import field_close
from orbits.kernels.gravity.terms_and_forces import particle_acting, particle_momenta, particle_terms
from orbits.kernels.lanes import fma, full, largest, load, store, total
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK, Particles
from orbits.kernels.sums.iteration import CONVERGED, LIMIT, NEAR_FLOOR, solve
from orbits.kernels.sums.summation import add_compensated, moved, two_sum


@verb
def guess(method, table, carry, vx, vy, vz):
    """Return the velocities of the stages relative to that of the particle, as the step before lets expect them."""
    if is_close(method):
        return lambda method, table, carry, vx, vy, vz: (
            combine(table, CONTINUATION, carry, 0),
            combine(table, CONTINUATION, carry, 1),
            combine(table, CONTINUATION, carry, 2),
        )

    def of_velocities(method, table, carry, vx, vy, vz):
        Wx, Wy, Wz = full(0.0), full(0.0), full(0.0)
        if largest(abs(load(carry, 0)) + abs(load(carry, 1)) + abs(load(carry, 2))) > 0.0:
            Wx = combine(table, CONTINUATION, carry, 0) - vx
            Wy = combine(table, CONTINUATION, carry, 1) - vy
            Wz = combine(table, CONTINUATION, carry, 2) - vz
        return Wx, Wy, Wz

    return of_velocities


@verb
def pull(method, model, stages, places):
    """Return the acceleration by Newton's attractions of a particle at its stages; with low parts, also write their
    rates into the last row.

    places : 7 rows, the positions of the stages, their low parts, if any, and the rates
    """
    if not is_close(method):
        return lambda method, model, stages, places: field(
            first_term(model.tag), model.parameters[0], stages.Q, load(places, 0), load(places, 1), load(places, 2)
        )

    def with_low_parts(method, model, stages, places):
        x, y, z, rate = field_close(
            first_term(model.tag),
            model.parameters[0],
            stages.Q,
            stages.Q_lo,
            (load(places, 0), load(places, 1), load(places, 2)),
            (load(places, 3), load(places, 4), load(places, 5)),
        )
        store(places, 6, rate)
        return x, y, z

    return with_low_parts


# Rows of the scratch of a particle's step: of three numbers each but the places, see `pull`.
PRODUCTS, PLACES, W, G, D = 0, 3, 10, 13, 16


@verb
def keep(method, table, room, v, carry):
    """Write what is kept of the stages into the carry: their velocities, or with low parts the kicks by which these are
    a polynomial.
    """
    if is_close(method):

        def kicks(method, table, room, v, carry):
            for k in range(3):
                store(carry, k, load(room, G + k) - combine(table, INVERSE, room, D + k))

        return kicks

    def velocities(method, table, room, v, carry):
        for k in range(3):
            store(carry, k, v[k] + load(room, W + k))

    return velocities


@kernel(inline=True)
def sweep(equations, first):
    """Compute the velocities W of the stages, relative to that of the particle, from the kicks G and the momenta there,
    and these from W. D are the momenta of terms, less s, that at the start.
    """
    method, model, times, number, stages, base, (x, y, z), (vx, vy, vz), (sx, sy, sz), room = equations
    table = method.coefficients[0]
    hb, places = load(table, HB), room[PLACES:]
    Wx, Wy, Wz = load(room, W), load(room, W + 1), load(room, W + 2)
    store(room, PRODUCTS, hb * Wx)
    store(room, PRODUCTS + 1, hb * Wy)
    store(room, PRODUCTS + 2, hb * Wz)
    place(method, places, 0, 3, x, base[0] + combine(table, MU, room, 0))
    place(method, places, 1, 3, y, base[1] + combine(table, MU, room, 1))
    place(method, places, 2, 3, z, base[2] + combine(table, MU, room, 2))
    ax, ay, az = pull(method, model, stages, places)
    here, velocity = (load(places, 0), load(places, 1), load(places, 2)), (vx + Wx, vy + Wy, vz + Wz)
    bx, by, bz, Sx, Sy, Sz = particle_terms(model.tag, model.parameters, times, stages.Q, stages.V, here, velocity)
    cx, cy, cz = particle_acting(model.tag, model.parameters, times, number, stages.Q, stages.V, here, velocity)
    store(room, G, hb * (ax + (bx + cx)))
    store(room, G + 1, hb * (ay + (by + cy)))
    store(room, G + 2, hb * (az + (bz + cz)))
    store(room, D, Sx - sx)
    store(room, D + 1, Sy - sy)
    store(room, D + 2, Sz - sz)
    new_x = combine(table, MU_BAR, room, G) - load(room, D)
    new_y = combine(table, MU_BAR, room, G + 1) - load(room, D + 1)
    new_z = combine(table, MU_BAR, room, G + 2) - load(room, D + 2)
    store(room, W, new_x)
    store(room, W + 1, new_y)
    store(room, W + 2, new_z)
    if first:
        return abs(new_x) + abs(new_y) + abs(new_z), True
    return abs(new_x - Wx) + abs(new_y - Wy) + abs(new_z - Wz), True


STAGES = Tag("stages of a particle in canonical form", {"sweep": sweep})


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of one particle through the stages of the massive bodies.

    carry : (3, 8), the velocities of the stages of the previous step, or with low parts the kicks by which they are a
        polynomial; `storage.share` begins with the number of the particle. A step that fails returns the particle
        unchanged.
    """
    coefficients, room = method.coefficients[0], storage.scratch
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    rows = padded_length(dimension(model.tag, model.parameters))
    number, stages = storage.share.start, stages_in(storage.stages, rows)
    hc, hc_lo, hb = load(coefficients, HC), load(coefficients, HC_LO), load(coefficients, HB)
    times = load(coefficients, HOURS) + t
    base = (
        fma(hc, full(vx), hc_lo * vx + hc * vx_lo + x_lo),
        fma(hc, full(vy), hc_lo * vy + hc * vy_lo + y_lo),
        fma(hc, full(vz), hc_lo * vz + hc * vz_lo + z_lo),
    )
    s = particle_momenta(model.tag, model.parameters, t, stages.q, stages.v, (x, y, z), (vx, vy, vz))
    Wx, Wy, Wz = guess(method, coefficients, carry, vx, vy, vz)
    store(room, W, Wx)
    store(room, W + 1, Wy)
    store(room, W + 2, Wz)
    equations = method, model, times, number, stages, base, (x, y, z), (vx, vy, vz), s, room
    (least, _, scale), evaluations, _, _ = solve(STAGES, equations, (0.0, 0.0, 0.0), NEAR_FLOOR, True, LIMIT)
    places = room[PLACES:]
    if not (least <= CONVERGED * scale or is_round_off(method, model, h, storage.stages, rows, places, least)):
        return particles, carry, NOT_CONVERGED, evaluations
    Wx, Wy, Wz = load(room, W), load(room, W + 1), load(room, W + 2)
    kicks = total(load(room, G)), total(load(room, G + 1)), total(load(room, G + 2))
    if (kicks[0] + kicks[1] + kicks[2] + total(Wx + Wy + Wz)) * 0.0 != 0.0:
        return particles, carry, NOT_FINITE, evaluations
    keep(method, coefficients, room, (vx, vy, vz), carry)
    x, x_lo = moved(h, x, x_lo, vx, vx_lo, total(hb * Wx))
    y, y_lo = moved(h, y, y_lo, vy, vy_lo, total(hb * Wy))
    z, z_lo = moved(h, z, z_lo, vz, vz_lo, total(hb * Wz))
    ux, uy, uz = vx + kicks[0], vy + kicks[1], vz + kicks[2]
    ux_lo = uy_lo = uz_lo = 0.0
    last_change, off, end = math.inf, 0.0, (t + h) + coefficients[LATE, 0]
    for _ in range(VELOCITY_SWEEPS):
        ex, ey, ez = particle_momenta(
            model.tag, model.parameters, end, stages.q_end, stages.v_end, (x, y, z), (ux, uy, uz)
        )
        before = ux, uy, uz
        ux, ux_lo = pushed(vx, vx_lo, kicks[0], s[0] - ex)
        uy, uy_lo = pushed(vy, vy_lo, kicks[1], s[1] - ey)
        uz, uz_lo = pushed(vz, vz_lo, kicks[2], s[2] - ez)
        off = abs(ux - before[0]) + abs(uy - before[1]) + abs(uz - before[2])
        enough = SETTLED * (abs(ux) + abs(uy) + abs(uz))
        if off == 0.0 or (off <= enough and off >= last_change):
            break
        last_change = off
    if not off <= enough:
        return particles, carry, NOT_CONVERGED, evaluations
    return Particles(x, y, z, x_lo, y_lo, z_lo, ux, uy, uz, ux_lo, uy_lo, uz_lo), carry, OK, evaluations


@kernel(inline=True)
def pushed(v, v_lo, kick, more):
    """Return the pair (v, v_lo) + kick + more."""
    kick, lost = two_sum(kick, more)
    return add_compensated(v, v_lo + lost, kick)
