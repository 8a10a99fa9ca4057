"""Variational partitioned Runge–Kutta methods for separable Lagrangians, q'' = g(q), in their second-order form.

With L_i = h b_i g(Q_i), the velocities of the stages eliminated:

    Q_i = q + h c_i v + h sum_j eta_ij L_j,     eta_ij = (A A_bar)_ij / b_j
    v+  = v + sum_i L_i,     q+ = q + h v + h sum_i (1 - c_i) L_i

The stages are the lanes of one register. They are iterated, each component, until the largest change stops falling: to
the round-off floor, with no tolerance. The iteration starts from the polynomial through the stages of the step before.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3, VI.6.3, VIII.6; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from orbits.integrators.base import NOT_CONVERGED, NOT_FINITE, OK
from orbits.integrators.vprk.coefficients import ETA, HB, HC, HC_LO, REST, START
from orbits.kernels.binding import accelerate, bodies, dimension, field
from orbits.kernels.compile import kernel
from orbits.kernels.iteration import (
    CONVERGED,
    FLOOR,
    LIMIT,
    LOST,
    NEAR_FLOOR,
    PATIENCE,
    TIGHT,
    begin,
    falling,
    settled,
    unsettled_body,
    unsettled_coordinate,
)
from orbits.kernels.lanes import (
    WIDTH,
    any_lane,
    fma,
    full,
    largest,
    load,
    row_sums,
    store,
    total,
)
from orbits.kernels.observing import call_observer
from orbits.kernels.paths import record_state
from orbits.kernels.summation import add_compensated, compensated_row_sums, two_product, two_sum


@kernel(inline=True)
def combine(coefficients, first, rows, k):
    """Return sum_j column_j * rows[k, j] for the eight columns of coefficients from `first` on."""
    even = load(coefficients, first) * rows[k, 0]
    odd = load(coefficients, first + 1) * rows[k, 1]
    for j in range(2, WIDTH, 2):
        even = even + load(coefficients, first + j) * rows[k, j]
        odd = odd + load(coefficients, first + j + 1) * rows[k, j + 1]
    return even + odd


@kernel(inline=True)
def moved(h, q, q_lo, v, v_lo, drift):
    """Return (q, q_lo) + h (v, v_lo) + drift, drift being of the size of h v."""
    p, e = two_product(v, h)
    s, f = two_sum(p, fma(v_lo, h, e + drift))
    return add_compensated(q, q_lo + f, s)


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March by `steps` steps of h; `memory` holds L of the step before, zeros for a cold start.

    Returns (status, steps done, body or coordinate, evaluations). A step that fails changes nothing.
    """
    size = dimension(tag, parameters)
    count = bodies(tag, parameters)
    blocks = (size + WIDTH - 1) // WIDTH
    rows = WIDTH * blocks
    base, change, history, L = work[:rows], work[rows : 2 * rows], work[2 * rows : 2 * rows + 3 * blocks], memory
    hc, hc_lo = load(coefficients, HC), load(coefficients, HC_LO)
    hb, rest = load(coefficients, HB), load(coefficients, REST)
    evaluations = 0
    for step in range(steps):
        record_state(path, step, q, v, size)
        Q = field_record[step % field_record.shape[0]]
        for k in range(size):
            # Sum the increments first: q is O(30 au), what moves it is O(1e-3 au).
            increment = fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k])
            store(base, k, increment)
            store(Q, k, q[k] + (increment + h * combine(coefficients, START, L, k)))
        iteration, patience, last = 0, PATIENCE, False
        while True:
            accelerate(tag, parameters, Q, change)
            evaluations += 1
            for k in range(size):
                new = hb * load(change, k)
                store(change, k, abs(new) if iteration == 0 else abs(new - load(L, k)))
                store(L, k, new)
            if last:
                break
            if iteration == 0:
                begin(change, history, blocks)
            elif not falling(change, history, blocks):
                patience -= 1
                last = patience == 0 or settled(history, blocks, NEAR_FLOOR if count > 0 else FLOOR)
            iteration += 1
            if iteration == LIMIT:
                break
            for k in range(size):
                store(Q, k, q[k] + (load(base, k) + h * combine(coefficients, ETA, L, k)))
        if not settled(history, blocks, CONVERGED):
            body = unsettled_body(history, blocks, count, CONVERGED)
            if count > 0 and body >= 0:
                return NOT_CONVERGED, step, body, evaluations
        if count == 0:
            where = unsettled_coordinate(history, blocks, size, TIGHT, FLOOR)
            if where >= 0:
                return NOT_CONVERGED, step, where, evaluations

        for k in range(size):
            store(change, k, rest * load(L, k))
        finite = True
        for block in range(blocks):
            kick, kick_lo = compensated_row_sums(L, WIDTH * block)
            drift = row_sums(change, WIDTH * block)
            store(base, block, kick_lo)
            store(history, block, kick)
            store(history, blocks + block, drift)
            finite &= not any_lane(1.0 - (kick * 0.0 == 0.0) * (drift * 0.0 == 0.0))
        if not finite:
            return NOT_FINITE, step, 0, evaluations
        for block in range(blocks):
            k = WIDTH * block
            v_now, v_rest = load(v, k), load(v_lo, k)
            x, x_rest = moved(h, load(q, k), load(q_lo, k), v_now, v_rest, h * load(history, blocks + block))
            store(q, k, x)
            store(q_lo, k, x_rest)
            v_now, v_rest = add_compensated(v_now, v_rest + load(base, block), load(history, block))
            store(v, k, v_now)
            store(v_lo, k, v_rest)
    return OK, steps, 0, evaluations


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
    """March particles start ... stop - 1, one at a time, through the stages that the massive bodies went through.

    q, q_lo, v, v_lo : (3, padded); memory : (particles, 3, 8), L of the step before
    Returns (status, steps done by the particle that failed, particle, evaluations).
    """
    hc, hc_lo = load(coefficients, HC), load(coefficients, HC_LO)
    hb, rest = load(coefficients, HB), load(coefficients, REST)
    evaluations = 0
    for particle in range(start, stop):
        L, slot = memory[particle], particle % WIDTH
        for step in range(steps):
            for k in range(3):
                track[6 * step + k, slot], track[6 * step + 3 + k, slot] = q[k, particle], v[k, particle]
            sources = field_record[step]
            for k in range(3):
                position, speed = q[k, particle], v[k, particle]
                increment = fma(hc, full(speed), hc_lo * speed + hc * v_lo[k, particle] + q_lo[k, particle])
                store(work, k, increment)
                store(work, 3 + k, position + (increment + h * combine(coefficients, START, L, k)))
            x, y, z = load(work, 3), load(work, 4), load(work, 5)
            least = last_change = scale = 0.0
            iteration, patience, last = 0, PATIENCE, False
            while True:
                ax, ay, az = field(tag, parameters, sources, x, y, z)
                evaluations += 1
                lx, ly, lz = hb * ax, hb * ay, hb * az
                now = largest(abs(lx - load(L, 0)) + abs(ly - load(L, 1)) + abs(lz - load(L, 2)))
                if iteration == 0:
                    now = scale = least = largest(abs(lx) + abs(ly) + abs(lz))
                store(L, 0, lx)
                store(L, 1, ly)
                store(L, 2, lz)
                if last:
                    break
                if iteration > 0:
                    if not (now < least and now * now > LOST * scale * last_change):
                        patience -= 1
                        last = patience == 0 or least <= NEAR_FLOOR * scale or now <= NEAR_FLOOR * scale
                    least = min(least, now)
                last_change = now
                iteration += 1
                if iteration == LIMIT:
                    break
                x = q[0, particle] + (load(work, 0) + h * combine(coefficients, ETA, L, 0))
                y = q[1, particle] + (load(work, 1) + h * combine(coefficients, ETA, L, 1))
                z = q[2, particle] + (load(work, 2) + h * combine(coefficients, ETA, L, 2))
            if not least <= CONVERGED * scale:
                return NOT_CONVERGED, step, particle, evaluations
            kicks = (total(lx), total(ly), total(lz))
            drifts = (total(rest * lx), total(rest * ly), total(rest * lz))
            if (kicks[0] + kicks[1] + kicks[2] + drifts[0] + drifts[1] + drifts[2]) * 0.0 != 0.0:
                return NOT_FINITE, step, particle, evaluations
            for k in range(3):
                speed, speed_lo = v[k, particle], v_lo[k, particle]
                q[k, particle], q_lo[k, particle] = moved(
                    h, q[k, particle], q_lo[k, particle], speed, speed_lo, h * drifts[k]
                )
                v[k, particle], v_lo[k, particle] = add_compensated(speed, speed_lo, kicks[k])
        for k in range(3):
            track[6 * steps + k, slot], track[6 * steps + 3 + k, slot] = q[k, particle], v[k, particle]
        if slot == WIDTH - 1 or particle == stop - 1:
            call_observer(observer, context, track, h, steps, particle - slot, stop)
    return OK, steps, 0, evaluations
