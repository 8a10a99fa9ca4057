"""Chains of kicks and drifts: Störmer–Verlet composed, the half kicks of neighbours merged, and splittings.

    v <- v + k_0 g(q);   for i = 1 ... s:   q <- q + d_i v,   v <- v + k_i g(q)

The lengths k and d of one step are data, (2, s + 1): k_0 ... k_s, and d_1 ... d_s. A kick of length 0 costs nothing.

Source: Hairer, Lubich & Wanner (2006), sec. II.4, II.5; Blanes & Moan (2002).
"""

from __future__ import annotations

from orbits.integrators.base import NOT_FINITE, OK
from orbits.kernels.binding import accelerate, dimension, field
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.observing import call_observer
from orbits.kernels.paths import record_particles, record_state
from orbits.kernels.state import all_finite, copy, drift, first_not_finite, kick, load_particles, store_particles
from orbits.kernels.summation import accumulate, add_product


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March the massive bodies by `steps` chains.

    `field_record` (slots, s + 1, padded) receives the positions before the chain and after each drift.
    """
    size = dimension(tag, parameters)
    substeps = coefficients.shape[1] - 1
    g = work[0]
    if coefficients[0, 0] != 0.0:
        accelerate(tag, parameters, q, g)
    evaluations = 0
    for step in range(steps):
        record_state(path, step, q, v, size)
        record = field_record[step % field_record.shape[0]]
        copy(q, 0, size, record[0])
        if coefficients[0, 0] != 0.0:
            kick(v, v_lo, coefficients[0, 0], g, size)
        for i in range(substeps):
            drift(q, q_lo, coefficients[1, i], v, v_lo, size)
            copy(q, 0, size, record[i + 1])
            length = coefficients[0, i + 1]
            if length != 0.0:
                accelerate(tag, parameters, q, g)
                kick(v, v_lo, length, g, size)
                evaluations += 1
    return (OK if all_finite(q, v, size) else NOT_FINITE), steps, 0, evaluations


@kernel
def advance_particles(
    tag,
    parameters,
    coefficients,
    h,
    q,
    q_lo,
    v,
    v_lo,
    memory,
    work,
    field_record,
    steps,
    start,
    stop,
    observer,
    context,
    track,
):
    """March particles start ... stop - 1 in the recorded field, eight in lanes; `start` is a multiple of eight."""
    substeps = coefficients.shape[1] - 1
    evaluations = 0
    for p in range(start, stop, WIDTH):
        x, y, z, x_lo, y_lo, z_lo = load_particles(q, q_lo, p)
        vx, vy, vz, vx_lo, vy_lo, vz_lo = load_particles(v, v_lo, p)
        ax, ay, az = field(tag, parameters, field_record[0, 0], x, y, z)
        for step in range(steps):
            record_particles(track, step, x, y, z, vx, vy, vz)
            length = coefficients[0, 0]
            if length != 0.0:
                vx, vx_lo = accumulate(vx, vx_lo, length * ax)
                vy, vy_lo = accumulate(vy, vy_lo, length * ay)
                vz, vz_lo = accumulate(vz, vz_lo, length * az)
            for i in range(substeps):
                way = coefficients[1, i]
                x, x_lo = add_product(x, x_lo, way, vx, vx_lo)
                y, y_lo = add_product(y, y_lo, way, vy, vy_lo)
                z, z_lo = add_product(z, z_lo, way, vz, vz_lo)
                length = coefficients[0, i + 1]
                if length != 0.0:
                    ax, ay, az = field(tag, parameters, field_record[step, i + 1], x, y, z)
                    vx, vx_lo = accumulate(vx, vx_lo, length * ax)
                    vy, vy_lo = accumulate(vy, vy_lo, length * ay)
                    vz, vz_lo = accumulate(vz, vz_lo, length * az)
                    evaluations += min(WIDTH, stop - p)
        store_particles(q, q_lo, p, x, y, z, x_lo, y_lo, z_lo)
        store_particles(v, v_lo, p, vx, vy, vz, vx_lo, vy_lo, vz_lo)
        record_particles(track, steps, x, y, z, vx, vy, vz)
        call_observer(observer, context, track, h, steps, p, stop)
    lost = first_not_finite(q, v, start, stop)
    return (OK if lost < 0 else NOT_FINITE), steps, max(lost, 0), evaluations
