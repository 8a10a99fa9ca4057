"""Variational partitioned Runge–Kutta methods for any regular Lagrangian, in canonical form.

With V_i the velocities of the stages, F_i = dL/dq(Q_i, V_i), K_i = h b_i V_i and L_i = h b_i F_i,

    Q_i = q + sum_j mu_ij K_j,     P_i = p + sum_j mu_bar_ij L_j,     dL/dv(Q_i, V_i) = P_i
    q+ = q + sum_i K_i,            p+ = p + sum_i L_i

The velocities are iterated to the round-off floor: V_i <- V_i + M^-1 (P_i - dL/dv(Q_i, V_i)) with the mass matrix M of
the start of the step, a fixed point where it converges; otherwise simplified Newton on all stages at once, from the
same start, with a Jacobian that is renewed when the iteration stalls above the floor.

Source: Marsden & West (2001), sec. 2.6; Hairer, Lubich & Wanner (2006), sec. VI.6.2, VIII.6.
"""

from __future__ import annotations

from orbits.integrators.base import NOT_CONVERGED, NOT_FINITE, NOT_REGULAR, OK
from orbits.integrators.vprk.coefficients import CONTINUATION, HB, HC, MU, MU_BAR, STAGES
from orbits.integrators.vprk.second_order import combine
from orbits.kernels.binding import bodies, dimension, gradients, hessians
from orbits.kernels.compile import kernel
from orbits.kernels.iteration import (
    CONVERGED,
    FLOOR,
    NEAR_FLOOR,
    PATIENCE,
    TIGHT,
    begin,
    falling,
    settled,
    unsettled_body,
    unsettled_coordinate,
)
from orbits.kernels.lanes import WIDTH, any_lane, full, load, store
from orbits.kernels.linear import factorize, solve, solve_rows
from orbits.kernels.summation import add_compensated, compensated_row_sums

FIXED_POINT_SWEEPS, NEWTON_SWEEPS = 16, 40
"""Sweeps after which the next attempt begins. A fixed point that needs more gains less than a bit in two sweeps."""

ATTEMPTS = 6
"""The fixed point, then Newton with so many Jacobians less one."""


def work_rows(size: int, padded: int) -> int:
    """Return the rows of eight that `advance` wants for `size` coordinates, `padded` being their padded number."""
    return 7 * padded + 3 * padded // WIDTH + 11 * size * size + size * size // WIDTH + 1 + padded + 2 * size


@kernel
def _newton_matrix(curvature, coefficients, d, stages, matrix):
    """Write the derivative of dL/dv(Q, V) - P by the velocities of all stages; unknowns are stage after stage.

    curvature : (3 d^2, 8), the Hessian blocks of the stages
    """
    for i in range(stages):
        for j in range(stages):
            hb = coefficients[HB, j]
            a = coefficients[MU + j, i] * hb
            a_bar = coefficients[MU_BAR + j, i] * hb
            for m in range(d):
                for n in range(d):
                    mixed = curvature[d * d + n * d + m, i]
                    entry = a * mixed - a_bar * curvature[d * d + m * d + n, j]
                    for k in range(stages):
                        through = coefficients[MU_BAR + k, i] * coefficients[HB, k] * coefficients[MU + j, k] * hb
                        entry -= through * curvature[m * d + n, k]
                    if i == j:
                        entry += curvature[2 * d * d + m * d + n, i]
                    matrix[i * d + m, j * d + n] = entry


@kernel
def advance(tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps):
    """March by `steps` steps of h from step `first`, counted from time t; `memory` holds the velocities of the stages
    of the step before, zeros for a cold start.

    Returns (status, steps done, body or coordinate, evaluations). A step that fails leaves the state as it was.
    """
    d = dimension(tag, parameters)
    blocks = (d + WIDTH - 1) // WIDTH
    rows = memory.shape[0]
    stages = int(coefficients[STAGES, 0])
    V = memory
    start, Q, F, P, K = (
        work[:rows],
        work[rows : 2 * rows],
        work[2 * rows : 3 * rows],
        work[3 * rows : 4 * rows],
        work[4 * rows : 5 * rows],
    )
    change, delta = work[5 * rows : 6 * rows], work[6 * rows : 7 * rows]
    at = 7 * rows
    history = work[at : at + 3 * rows // WIDTH]
    at += 3 * rows // WIDTH
    curvature = work[at : at + 3 * d * d]
    at += 3 * d * d
    matrix = work[at : at + 8 * d * d].reshape(8 * d, 8 * d)
    at += 8 * d * d
    mass = work[at : at + d * d // WIDTH + 1].reshape(-1)[: d * d].reshape(d, d)
    at += d * d // WIDTH + 1
    velocity = work[at : at + rows].reshape(-1)
    at += rows
    pivots = work[at : at + 2 * d].reshape(-1)
    vector_curvature = curvature.reshape(-1)
    hb, hc = load(coefficients, HB), load(coefficients, HC)
    evaluations = 0
    for step in range(steps):
        now = t + (first + step) * h
        times = hc + now
        for k in range(d):
            guess = combine(coefficients, CONTINUATION, V, k)
            store(start, k, guess)
            store(V, k, guess)
            velocity[k] = V[k, 0]
        hessians(tag, parameters, now, q, velocity, vector_curvature)
        for m in range(d):
            for n in range(d):
                mass[m, n] = vector_curvature[2 * d * d + m * d + n]
        mass_pivots = pivots[:d]
        regular = factorize(mass, d, mass_pivots)
        if not regular:
            return NOT_REGULAR, step, 0, evaluations
        converged, sound, where = False, True, 0
        for attempt in range(ATTEMPTS):
            if attempt > 0:
                for k in range(d):
                    if attempt == 1:
                        store(V, k, load(start, k))
                    store(K, k, hb * load(V, k))
                    store(Q, k, q[k] + (q_lo[k] + combine(coefficients, MU, K, k)))
                hessians(tag, parameters, times, Q, V, curvature)
                evaluations += 1
                _newton_matrix(curvature, coefficients, d, stages, matrix)
                if not factorize(matrix, stages * d, pivots[d:]):
                    break
            iteration, patience, last, finished = 0, PATIENCE, False, False
            while iteration < (FIXED_POINT_SWEEPS if attempt == 0 else NEWTON_SWEEPS):
                for k in range(d):
                    store(K, k, hb * load(V, k))
                    store(Q, k, q[k] + (q_lo[k] + combine(coefficients, MU, K, k)))
                gradients(tag, parameters, times, Q, V, F, P)
                evaluations += 1
                for k in range(d):
                    store(F, k, hb * load(F, k))
                    if attempt == 0 and iteration == 0:
                        sound &= not any_lane(1.0 - (load(F, k) * 0.0 == full(0.0)))
                for k in range(d):
                    store(delta, k, (p[k] - load(P, k)) + (p_lo[k] + combine(coefficients, MU_BAR, F, k)))
                if attempt == 0:
                    solve_rows(mass, d, mass_pivots, delta)
                else:
                    for i in range(stages):
                        for m in range(d):
                            velocity[i * d + m] = delta[m, i]
                    solve(matrix, stages * d, pivots[d:], velocity)
                    for m in range(d):
                        for i in range(WIDTH):
                            delta[m, i] = velocity[min(i, stages - 1) * d + m]
                for k in range(d):
                    new = load(V, k) + load(delta, k)
                    store(V, k, new)
                    store(change, k, abs(hb * new) if iteration == 0 else abs(hb * load(delta, k)))
                iteration += 1
                if last:
                    finished = True
                    break
                if iteration == 1:
                    begin(change, history, blocks)
                elif not falling(change, history, blocks):
                    patience -= 1
                    last = patience == 0 or settled(history, blocks, FLOOR)
            if finished:
                finite = True
                for k in range(d):
                    finite &= not any_lane(1.0 - (load(V, k) * 0.0 == full(0.0)) * (load(F, k) * 0.0 == full(0.0)))
                count = bodies(tag, parameters)
                # What has stalled gets a new Jacobian; when even the last one stalls, it is the rounding of the forces.
                where = unsettled_coordinate(history, blocks, d, TIGHT, FLOOR)
                if where >= 0 and attempt == ATTEMPTS - 1:
                    if count > 0:
                        where = unsettled_body(history, blocks, count, CONVERGED)
                    else:
                        where = unsettled_coordinate(history, blocks, d, NEAR_FLOOR, NEAR_FLOOR)
                if finite and where < 0:
                    converged = True
                    break
        for k in range(d):
            store(K, k, hb * load(V, k))
            if not converged:
                store(V, k, full(0.0))
        if not converged:
            return (NOT_CONVERGED if sound else NOT_FINITE), step, max(where, 0), evaluations
        for block in range(blocks):
            k = WIDTH * block
            moved, moved_lo = compensated_row_sums(K, k)
            x, x_lo = add_compensated(load(q, k), load(q_lo, k) + moved_lo, moved)
            kick, kick_lo = compensated_row_sums(F, k)
            y, y_lo = add_compensated(load(p, k), load(p_lo, k) + kick_lo, kick)
            store(q, k, x)
            store(q_lo, k, x_lo)
            store(p, k, y)
            store(p_lo, k, y_lo)
    return OK, steps, 0, evaluations
