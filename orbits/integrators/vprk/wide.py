"""Variational partitioned Runge–Kutta methods of more stages than one register holds, in second-order form.

The equations and the iteration are those of `second_order`. The stages of a coordinate lie in R registers: an array of
stages has R blocks of rows, one for each register, each as `second_order` has it.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from orbits.integrators.base import NOT_CONVERGED, NOT_FINITE, OK, Array, padded
from orbits.integrators.vprk.second_order import moved
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
from orbits.kernels.lanes import WIDTH, any_lane, fma, full, largest, load, maximum, row_sums, store, total
from orbits.kernels.observing import call_observer
from orbits.kernels.paths import record_state
from orbits.kernels.summation import add_compensated, compensated_row_sums, two_sum
from orbits.tableaux import SymplecticTableau

# Rows of the table of one register of stages. ETA is the first of 8 R rows: row j holds column j of the matrix, this
# register's stages in the lanes; START follows, in the same form.
HC, HC_LO, HB, REST, ETA = 0, 1, 2, 3, 4


def registers(stages: int) -> int:
    """Return how many registers of eight hold so many stages."""
    return (stages + WIDTH - 1) // WIDTH


def in_registers(tableau: SymplecticTableau, h: float, ratio: float = 1.0) -> Array:
    """Return (R, 4 + 16 R, 8) for steps of h; lanes past the last stage repeat it with weight 0."""
    s, count = tableau.stages, registers(tableau.stages)
    lane = np.minimum(np.arange(WIDTH * count), s - 1)
    out = np.zeros((count, ETA + 2 * WIDTH * count, WIDTH))
    hc = h * tableau.nodes
    rounding = [float(Fraction(h) * Fraction(c) - Fraction(p)) for c, p in zip(tableau.nodes, hc, strict=True)]
    weights = np.zeros(WIDTH * count)
    weights[:s] = h * tableau.b
    ahead = ratio * tableau.b[:, None] * tableau.continued(ratio) / tableau.b[None, :]
    start = tableau.eta @ ahead
    for r in range(count):
        own = slice(WIDTH * r, WIDTH * (r + 1))
        out[r, HC], out[r, HC_LO] = hc[lane[own]], np.array(rounding)[lane[own]]
        out[r, HB], out[r, REST] = weights[own], tableau.one_minus_nodes[lane[own]]
        out[r, ETA : ETA + s] = tableau.eta[lane[own]].T
        out[r, ETA + WIDTH * count : ETA + WIDTH * count + s] = start[lane[own]].T
    return out


def work_rows(size: int, count: int) -> int:
    """Return the rows of eight that `advance` and `advance_particles` want for `size` coordinates."""
    rows = padded(size)
    return max(count * rows + 2 * rows + 3 * rows // WIDTH, 6 * count)


@kernel(inline=True)
def _combine(table, first, rows, block, k):
    """Return sum_j column_j * rows[.., j] over all registers, `block` rows of `rows` apart."""
    even, odd = full(0.0), full(0.0)
    for r in range((table.shape[0] - ETA) // (2 * WIDTH)):
        at, row = first + WIDTH * r, r * block + k
        for j in range(0, WIDTH, 2):
            even = even + load(table, at + j) * rows[row, j]
            odd = odd + load(table, at + j + 1) * rows[row, j + 1]
    return even + odd


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March by `steps` steps of h; `memory` holds L of the step before, zeros for a cold start.

    Returns (status, steps done, body or coordinate, evaluations). A step that fails changes nothing.
    """
    size = dimension(tag, parameters)
    count = bodies(tag, parameters)
    R = coefficients.shape[0]
    block = memory.shape[0] // R
    blocks = (size + WIDTH - 1) // WIDTH
    start = ETA + WIDTH * R
    base, g = work[: R * block], work[R * block : (R + 1) * block]
    change = work[(R + 1) * block : (R + 2) * block]
    history, L = work[(R + 2) * block : (R + 2) * block + 3 * blocks], memory
    evaluations = 0
    for step in range(steps):
        record_state(path, step, q, v, size)
        Q = field_record[step % field_record.shape[0]]
        for r in range(R):
            table = coefficients[r]
            hc, hc_lo = load(table, HC), load(table, HC_LO)
            for k in range(size):
                increment = fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k])
                store(base, r * block + k, increment)
                store(Q, r * block + k, q[k] + (increment + h * _combine(table, start, L, block, k)))
        iteration, patience, last = 0, PATIENCE, False
        while True:
            for r in range(R):
                accelerate(tag, parameters, Q[r * block : (r + 1) * block], g)
                hb = load(coefficients[r], HB)
                for k in range(size):
                    new = hb * load(g, k)
                    moved_by = abs(new) if iteration == 0 else abs(new - load(L, r * block + k))
                    store(change, k, moved_by if r == 0 else maximum(load(change, k), moved_by))
                    store(L, r * block + k, new)
            evaluations += 1
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
            for r in range(R):
                table = coefficients[r]
                for k in range(size):
                    store(Q, r * block + k, q[k] + (load(base, r * block + k) + h * _combine(table, ETA, L, block, k)))
        if not settled(history, blocks, CONVERGED):
            body = unsettled_body(history, blocks, count, CONVERGED)
            if count > 0 and body >= 0:
                return NOT_CONVERGED, step, body, evaluations
        if count == 0:
            where = unsettled_coordinate(history, blocks, size, TIGHT, FLOOR)
            if where >= 0:
                return NOT_CONVERGED, step, where, evaluations

        finite = True
        for b in range(blocks):
            kick, kick_lo, drift = full(0.0), full(0.0), full(0.0)
            for r in range(R):
                rest = load(coefficients[r], REST)
                for k in range(WIDTH * b, min(WIDTH * (b + 1), size)):
                    store(change, k, rest * load(L, r * block + k))
                more, more_lo = compensated_row_sums(L, r * block + WIDTH * b)
                kick, lost = two_sum(kick, more)
                kick_lo = kick_lo + (lost + more_lo)
                drift = drift + row_sums(change, WIDTH * b)
            store(g, b, kick_lo)
            store(history, b, kick)
            store(history, blocks + b, drift)
            finite &= not any_lane(1.0 - (kick * 0.0 == 0.0) * (drift * 0.0 == 0.0))
        if not finite:
            return NOT_FINITE, step, 0, evaluations
        for b in range(blocks):
            k = WIDTH * b
            v_now, v_rest = load(v, k), load(v_lo, k)
            x, x_rest = moved(h, load(q, k), load(q_lo, k), v_now, v_rest, h * load(history, blocks + b))
            store(q, k, x)
            store(q_lo, k, x_rest)
            v_now, v_rest = add_compensated(v_now, v_rest + load(g, b), load(history, b))
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

    q, q_lo, v, v_lo : (3, padded); memory : (particles, 3 R, 8), L of the step before
    Returns (status, steps done by the particle that failed, particle, evaluations).
    """
    R = coefficients.shape[0]
    block = field_record.shape[1] // R
    first = ETA + WIDTH * R
    Q = work[3 * R : 6 * R]
    evaluations = 0
    for particle in range(start, stop):
        L, slot = memory[particle], particle % WIDTH
        for step in range(steps):
            for k in range(3):
                track[6 * step + k, slot], track[6 * step + 3 + k, slot] = q[k, particle], v[k, particle]
            for r in range(R):
                table = coefficients[r]
                hc, hc_lo = load(table, HC), load(table, HC_LO)
                for k in range(3):
                    position, speed = q[k, particle], v[k, particle]
                    increment = fma(hc, full(speed), hc_lo * speed + hc * v_lo[k, particle] + q_lo[k, particle])
                    store(work, 3 * r + k, increment)
                    store(Q, 3 * r + k, position + (increment + h * _combine(table, first, L, 3, k)))
            least = last_change = scale = 0.0
            iteration, patience, last = 0, PATIENCE, False
            while True:
                now = size = 0.0
                for r in range(R):
                    sources = field_record[step, r * block : (r + 1) * block]
                    x, y, z = load(Q, 3 * r), load(Q, 3 * r + 1), load(Q, 3 * r + 2)
                    ax, ay, az = field(tag, parameters, sources, x, y, z)
                    hb = load(coefficients[r], HB)
                    lx, ly, lz = hb * ax, hb * ay, hb * az
                    off = abs(lx - load(L, 3 * r)) + abs(ly - load(L, 3 * r + 1)) + abs(lz - load(L, 3 * r + 2))
                    now = max(now, largest(off))
                    size = max(size, largest(abs(lx) + abs(ly) + abs(lz)))
                    store(L, 3 * r, lx)
                    store(L, 3 * r + 1, ly)
                    store(L, 3 * r + 2, lz)
                evaluations += 1
                if iteration == 0:
                    now = scale = least = size
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
                for r in range(R):
                    table = coefficients[r]
                    for k in range(3):
                        stage = load(work, 3 * r + k) + h * _combine(table, ETA, L, 3, k)
                        store(Q, 3 * r + k, q[k, particle] + stage)
            if not least <= CONVERGED * scale:
                return NOT_CONVERGED, step, particle, evaluations
            for k in range(3):
                kick, kick_lo, drift = 0.0, 0.0, 0.0
                for r in range(R):
                    own = load(L, 3 * r + k)
                    kick, lost = two_sum(kick, total(own))
                    kick_lo += lost
                    drift += total(load(coefficients[r], REST) * own)
                if (kick + drift) * 0.0 != 0.0:
                    return NOT_FINITE, step, particle, evaluations
                store(work, k, full(kick))
                work[k, 1], work[k, 2] = kick_lo, drift
            for k in range(3):
                speed, speed_lo = v[k, particle], v_lo[k, particle]
                q[k, particle], q_lo[k, particle] = moved(
                    h, q[k, particle], q_lo[k, particle], speed, speed_lo, h * work[k, 2]
                )
                v[k, particle], v_lo[k, particle] = add_compensated(speed, speed_lo + work[k, 1], work[k, 0])
        for k in range(3):
            track[6 * steps + k, slot], track[6 * steps + 3 + k, slot] = q[k, particle], v[k, particle]
        if slot == WIDTH - 1 or particle == stop - 1:
            call_observer(observer, context, track, h, steps, particle - slot, stop)
    return OK, steps, 0, evaluations
