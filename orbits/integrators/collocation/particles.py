"""The step of `collocation` for massless particles: one particle at a time, its stages in lanes, in the field of the
massive bodies at their stages.
"""

from __future__ import annotations

from orbits.integrators.collocation.rows import (
    ETA,
    HB,
    HC,
    HC_LO,
    REST,
    columns,
    combine,
    is_close,
    layers,
    place,
    registers,
)
from orbits.kernels.binding import Tag, field
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.close_field import field_close, gross_field
from orbits.kernels.lanes import WIDTH, fma, full, largest, load, maximum, store, total
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK, Particles
from orbits.kernels.sums.iteration import CONVERGED, LIMIT, NEAR_FLOOR, TIGHT, solve
from orbits.kernels.sums.summation import add_compensated, moved, two_sum


@verb
def pull(method, model, stages, r, block, lows, Q):
    """Return the acceleration of a particle at its stages of register r; with low parts, also write their rates into
    row 6 R + r of Q.

    Q : 3 R rows of positions, and their low parts, if any
    """
    if not is_close(method):

        def plain(method, model, stages, r, block, lows, Q):
            sources = stages if registers(method) == 1 else stages[r * block : (r + 1) * block]
            return field(
                model.tag, model.parameters, sources, load(Q, 3 * r), load(Q, 3 * r + 1), load(Q, 3 * r + 2)
            )

        return plain

    def with_low_parts(method, model, stages, r, block, lows, Q):
        sources, rest = stages[r * block : (r + 1) * block], stages[lows + r * block : lows + (r + 1) * block]
        low = 3 * registers(method) + 3 * r
        x, y, z, rate = field_close(
            model.tag,
            model.parameters,
            sources,
            rest,
            (load(Q, 3 * r), load(Q, 3 * r + 1), load(Q, 3 * r + 2)),
            (load(Q, low), load(Q, low + 1), load(Q, low + 2)),
        )
        store(Q, 6 * registers(method) + r, rate)
        return x, y, z

    return with_low_parts


@verb
def is_round_off(method, model, h, stages, lows, Q, change):
    """Return whether a change of L is round-off of attractions on a particle that cancel; with low parts only, and for
    one register.
    """
    if not is_close(method):
        return lambda method, model, h, stages, lows, Q, change: False

    def with_low_parts(method, model, h, stages, lows, Q, change):
        pulls = gross_field(model.tag, model.parameters, stages[:lows], load(Q, 0), load(Q, 1), load(Q, 2))
        return change <= TIGHT * abs(h) * largest(pulls)

    return with_low_parts


@kernel(inline=True)
def sweep(equations, first):
    """Compute the kicks L from the positions Q of the stages, and these from L, in the first sweep of the step before.

    stages : those of the massive bodies; base : (3 R, 8), the increments of the stages without L
    """
    method, model, h, stages, (x, y, z), base, Q, L = equations
    R, coefficients = registers(method), method.coefficients
    block, most = stages.shape[0] // (R * layers(method)), full(0.0)
    for r in range(R):
        table = coefficients[r]
        matrix = columns(method, table, ETA + WIDTH * R if first else ETA)
        place(method, Q, 3 * r, 3 * R, x, load(base, 3 * r) + h * combine(matrix, R, table, L, 3, 0))
        place(method, Q, 3 * r + 1, 3 * R, y, load(base, 3 * r + 1) + h * combine(matrix, R, table, L, 3, 1))
        place(method, Q, 3 * r + 2, 3 * R, z, load(base, 3 * r + 2) + h * combine(matrix, R, table, L, 3, 2))
    for r in range(R):
        ax, ay, az = pull(method, model, stages, r, block, R * block, Q)
        hb = load(coefficients[r], HB)
        lx, ly, lz = hb * ax, hb * ay, hb * az
        if first:
            off = abs(lx) + abs(ly) + abs(lz)
        else:
            off = abs(lx - load(L, 3 * r)) + abs(ly - load(L, 3 * r + 1)) + abs(lz - load(L, 3 * r + 2))
        most = maximum(off, most)
        store(L, 3 * r, lx)
        store(L, 3 * r + 1, ly)
        store(L, 3 * r + 2, lz)
    return most, True


STAGES = Tag("stages of a particle in collocation", {"sweep": sweep})


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of one particle through the stages of the massive bodies.

    carry : (3 R, 8), L of the previous step. A step that fails returns the particle unchanged.
    """
    R, coefficients = registers(method), method.coefficients
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    L, scratch, stages = carry, storage.scratch, storage.stages
    block = stages.shape[0] // (R * layers(method))
    lows = R * block
    base, Q = scratch, scratch[3 * R :]
    for r in range(R):
        hc, hc_lo = load(coefficients[r], HC), load(coefficients[r], HC_LO)
        store(base, 3 * r, fma(hc, full(vx), hc_lo * vx + hc * vx_lo + x_lo))
        store(base, 3 * r + 1, fma(hc, full(vy), hc_lo * vy + hc * vy_lo + y_lo))
        store(base, 3 * r + 2, fma(hc, full(vz), hc_lo * vz + hc * vz_lo + z_lo))
    equations = method, model, h, stages, (x, y, z), base, Q, L
    (least, _, scale), evaluations, _, _ = solve(STAGES, equations, (0.0, 0.0, 0.0), NEAR_FLOOR, True, LIMIT)
    if not (least <= CONVERGED * scale or is_round_off(method, model, h, stages, lows, Q, least)):
        return particles, carry, NOT_CONVERGED, evaluations
    x_kick, x_kick_lo, x_drift = _sums(coefficients, R, L, 0)
    y_kick, y_kick_lo, y_drift = _sums(coefficients, R, L, 1)
    z_kick, z_kick_lo, z_drift = _sums(coefficients, R, L, 2)
    if (x_kick + y_kick + z_kick + x_drift + y_drift + z_drift) * 0.0 != 0.0:
        return particles, carry, NOT_FINITE, evaluations
    x, x_lo = moved(h, x, x_lo, vx, vx_lo, h * x_drift)
    y, y_lo = moved(h, y, y_lo, vy, vy_lo, h * y_drift)
    z, z_lo = moved(h, z, z_lo, vz, vz_lo, h * z_drift)
    vx, vx_lo = add_compensated(vx, vx_lo + x_kick_lo, x_kick)
    vy, vy_lo = add_compensated(vy, vy_lo + y_kick_lo, y_kick)
    vz, vz_lo = add_compensated(vz, vz_lo + z_kick_lo, z_kick)
    return Particles(x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo), carry, OK, evaluations


@kernel(inline=True)
def _sums(coefficients, R, L, k):
    """Return sum_i L_i as a pair, and sum_i (1 - c_i) L_i, of component k of a particle."""
    own = load(L, k)
    kick, kick_lo, drift = total(own), 0.0, total(load(coefficients[0], REST) * own)
    for r in range(1, R):
        own = load(L, 3 * r + k)
        kick, lost = two_sum(kick, total(own))
        kick_lo += lost
        drift += total(load(coefficients[r], REST) * own)
    return kick, kick_lo, drift
