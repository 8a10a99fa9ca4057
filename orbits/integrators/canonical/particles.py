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
from orbits.kernels.binding import dimension, field, field_close, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.terms_and_forces import particle_acting, particle_momenta, particle_terms
from orbits.kernels.lanes import fma, full, largest, load, store, total
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK, Particles
from orbits.kernels.sums.iteration import CONVERGED, LIMIT, LOST, NEAR_FLOOR, PATIENCE
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


@verb
def keep(method, table, room, v, W, G, D, carry):
    """Write what is kept of the stages into the carry: their velocities, or with low parts the kicks by which these are
    a polynomial.
    """
    if is_close(method):

        def kicks(method, table, room, v, W, G, D, carry):
            for k in range(3):
                store(room, k, D[k])
                store(carry, k, G[k] - combine(table, INVERSE, room, k))

        return kicks

    def velocities(method, table, room, v, W, G, D, carry):
        store(carry, 0, v[0] + W[0])
        store(carry, 1, v[1] + W[1])
        store(carry, 2, v[2] + W[2])

    return velocities


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of one particle through the stages of the massive bodies.

    carry : (3, 8), the velocities of the stages of the previous step, or with low parts the kicks by which they are a
        polynomial; `storage.share` begins with the number of the particle. A step that fails returns the particle
        unchanged.
    """
    coefficients = method.coefficients[0]
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    d = dimension(model.tag, model.parameters)
    rows = padded_length(d)
    number, stages = storage.share.start, stages_in(storage.stages, rows)
    hc, hc_lo, hb = load(coefficients, HC), load(coefficients, HC_LO), load(coefficients, HB)
    times = load(coefficients, HOURS) + t
    x_base = fma(hc, full(vx), hc_lo * vx + hc * vx_lo + x_lo)
    y_base = fma(hc, full(vy), hc_lo * vy + hc * vy_lo + y_lo)
    z_base = fma(hc, full(vz), hc_lo * vz + hc * vz_lo + z_lo)
    sx, sy, sz = particle_momenta(
        model.tag, model.parameters, t, stages.q, stages.v, (x, y, z), (vx, vy, vz)
    )
    Wx, Wy, Wz = guess(method, coefficients, carry, vx, vy, vz)
    room, places = storage.scratch, storage.scratch[3:]
    Gx = Gy = Gz = Sx = Sy = Sz = full(0.0)
    least = last_change = scale = 0.0
    patience, last, evaluations = PATIENCE, False, 0
    while True:
        store(room, 0, hb * Wx)
        store(room, 1, hb * Wy)
        store(room, 2, hb * Wz)
        Vx, Vy, Vz = vx + Wx, vy + Wy, vz + Wz
        place(method, places, 0, 3, x, x_base + combine(coefficients, MU, room, 0))
        place(method, places, 1, 3, y, y_base + combine(coefficients, MU, room, 1))
        place(method, places, 2, 3, z, z_base + combine(coefficients, MU, room, 2))
        ax, ay, az = pull(method, model, stages, places)
        here, velocity = (load(places, 0), load(places, 1), load(places, 2)), (Vx, Vy, Vz)
        bx, by, bz, Sx, Sy, Sz = particle_terms(
            model.tag, model.parameters, times, stages.Q, stages.V, here, velocity
        )
        cx, cy, cz = particle_acting(
            model.tag, model.parameters, times, number, stages.Q, stages.V, here, velocity
        )
        Gx, Gy, Gz = hb * (ax + (bx + cx)), hb * (ay + (by + cy)), hb * (az + (bz + cz))
        store(room, 0, Gx)
        store(room, 1, Gy)
        store(room, 2, Gz)
        new_x = combine(coefficients, MU_BAR, room, 0) - (Sx - sx)
        new_y = combine(coefficients, MU_BAR, room, 1) - (Sy - sy)
        new_z = combine(coefficients, MU_BAR, room, 2) - (Sz - sz)
        evaluations += 1
        now = largest(abs(new_x - Wx) + abs(new_y - Wy) + abs(new_z - Wz))
        Wx, Wy, Wz = new_x, new_y, new_z
        if evaluations == 1:
            now = scale = least = largest(abs(Wx) + abs(Wy) + abs(Wz))
        if last:
            break
        if evaluations > 1:
            if not (now < least and now * now > LOST * scale * last_change):
                patience -= 1
                last = patience == 0 or least <= NEAR_FLOOR * scale or now <= NEAR_FLOOR * scale
            least = min(least, now)
        last_change = now
        if evaluations == LIMIT:
            break
    if not (least <= CONVERGED * scale or is_round_off(method, model, h, storage.stages, rows, places, least)):
        return particles, carry, NOT_CONVERGED, evaluations
    kicks = total(Gx), total(Gy), total(Gz)
    if (kicks[0] + kicks[1] + kicks[2] + total(Wx + Wy + Wz)) * 0.0 != 0.0:
        return particles, carry, NOT_FINITE, evaluations
    keep(method, coefficients, room, (vx, vy, vz), (Wx, Wy, Wz), (Gx, Gy, Gz), (Sx - sx, Sy - sy, Sz - sz), carry)
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
        ux, ux_lo = pushed(vx, vx_lo, kicks[0], sx - ex)
        uy, uy_lo = pushed(vy, vy_lo, kicks[1], sy - ey)
        uz, uz_lo = pushed(vz, vz_lo, kicks[2], sz - ez)
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
