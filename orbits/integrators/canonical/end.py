"""The end of a step of `bodies`: the sums over its stages, and the velocity that belongs to its momentum.

For steps whose length is chosen, these sums begin with a last sweep in doubled precision, as those of
`orbits.integrators.collocation.end` do: of the positions of the stages, of Newton's forces there, and of the sums. What
terms and forces add to these is rounded once. With D_i = (s_i - s) / m,

    v+ = v + sum_i G_i - (s+ - s) / m,     q+ = q + h v + h sum_i [(1 - c_i) G_i - b_i D_i]

Such a step leaves, as one of `collocation` does, the kicks L by which the velocities of the stages are a polynomial,
V_i = v + sum_j mu_bar_ij L_j: L = G - mu_bar^-1 D. From them the next step continues, its error signal is computed, and
dense output.
"""

from __future__ import annotations

import math

from orbits.integrators.canonical.form import combine
from orbits.integrators.canonical.room import INVERSE, MU, SETTLED, VELOCITY_SWEEPS
from orbits.integrators.collocation.end import COARSE, Sums, add_kick, add_up, moved_by
from orbits.integrators.collocation.rows import HB, HC, HC_LO, REST, WEIGHTS
from orbits.kernels.binding import accelerate_finely, dimension, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.terms_and_forces import add_acting, add_momenta, add_terms
from orbits.kernels.lanes import WIDTH, fma, full, largest, load, maximum, row_sums, store
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK
from orbits.kernels.sums.summation import add_compensated, compensated_row_sums, moved, two_product, two_sum


@kernel
def momenta(model, t, q, v, f, s):
    """Write the contribution of terms to the momenta into s; f is workspace."""
    for k in range(dimension(model.tag, model.parameters)):
        f[k] = s[k] = 0.0
    add_momenta(model.tag, model.parameters, t, q, v, f, s)


@kernel(inline=True)
def settle(model, t, state, stages, work, held, d):
    """Write the velocities of bodies `held` ... n - 1 at the time t, the end of a step, from the kicks. Returns a body
    whose velocity does not converge, or -1.
    """
    v, v_lo = state.p, state.p_lo
    strength, n = model.parameters[0], d // 3
    body, last = 0, math.inf
    for _ in range(VELOCITY_SWEEPS):
        momenta(model, t, stages.q_end, stages.v_end, work.f, work.s_end)
        body, now = 0, 0.0
        for i in range(held, n):
            off = size = 0.0
            for k in range(i, d, n):
                kick, lost = two_sum(work.kick[k], -(work.s_end[k] - work.s[k]) / strength[1 + i])
                new, new_lo = add_compensated(v[k], v_lo[k] + (work.kick_lo[k] + lost), kick)
                off, size = off + abs(new - stages.v_end[k]), size + abs(new)
                stages.v_end[k], work.f[k] = new, new_lo
            if not off <= now * size:
                body, now = i, off / size
        if now == 0.0 or (now <= SETTLED and now >= last):
            break
        last = now
    for i in range(held, n):
        for k in range(i, d, n):
            v[k], v_lo[k] = stages.v_end[k], work.f[k]
    return -1 if now <= SETTLED else body


@kernel(inline=True)
def _leave(state, stages, work, k, place, kick):
    """Write the places of eight coordinates at the end of a step, and their kicks, pairs both."""
    store(state.q, k, place[0])
    store(state.q_lo, k, place[1])
    store(stages.q_end, k, place[0])
    store(stages.v_end, k, load(state.p, k) + kick[0])
    store(work.kick, k, kick[0])
    store(work.kick_lo, k, kick[1])


@kernel(inline=True)
def finish(method, model, t, h, state, stages, work, d):
    """Advance positions and velocities to the time t, the end of the step. Returns (status, body)."""
    q, q_lo, v, v_lo = state
    hb = load(method.coefficients[0], HB)
    for k in range(d):
        store(work.change, k, hb * load(work.W, k))
    for k in range(0, d, WIDTH):
        x, x_lo = moved(h, load(q, k), load(q_lo, k), load(v, k), load(v_lo, k), row_sums(work.change, k))
        kick, kick_lo = compensated_row_sums(work.G, k)
        _leave(state, stages, work, k, (x, x_lo), (kick, kick_lo))
    body = settle(model, t, state, stages, work, 0, d)
    return (OK, 0) if body < 0 else (NOT_CONVERGED, body)


@kernel
def finish_finely(method, model, times, h, state, stages, work, L):
    """Take the last sweep from the velocities W, and the step; write its kicks L. Returns (status, body).

    times : of the stages, and of the end of the step
    """
    table, strength, d = method.coefficients[0], model.parameters[0], dimension(model.tag, model.parameters)
    q, q_lo, v, v_lo = state
    n, rows = d // 3, q.shape[0]
    at, end = times
    hb, hc, hc_lo, remaining = load(table, HB), load(table, HC), load(table, HC_LO), load(table, REST)
    g_lo, fine = work.fine[:rows], work.fine[rows:]
    sums = Sums(fine[:rows], fine[rows : 2 * rows], fine[2 * rows : 3 * rows], fine[3 * rows : 4 * rows])
    for k in range(d):
        store(work.change, k, hb * load(work.W, k))
        store(stages.V, k, v[k] + load(work.W, k))
    for k in range(d):
        along, lost = two_product(hc, full(v[k]))
        lost = fma(hc_lo, full(v[k]), lost) + fma(hc, full(v_lo[k]), full(q_lo[k]))
        increment, rest = two_sum(along, combine(table, MU, work.change, k))
        position, low = two_sum(full(q[k]), increment)
        store(stages.Q, k, position)
        store(stages.Q_lo, k, low + (rest + lost))
    accelerate_finely(first_term(model.tag), strength, stages.Q, stages.Q_lo, True, work.G, g_lo)
    for k in range(d):
        store(work.F, k, full(0.0))
        store(work.S, k, full(0.0))
    add_terms(model.tag, model.parameters, at, stages.Q, stages.V, work.F, work.S)
    add_acting(model.tag, model.parameters, at, stages.Q, stages.V, work.Y, work.F, work.D)
    weights = load(table, WEIGHTS)
    for i in range(n):
        mass, most = strength[1 + i], full(0.0)
        for k in range(i, d, n):
            pull, lost = two_sum(load(work.G, k), load(work.F, k) / mass)
            store(work.G, k, pull)
            store(g_lo, k, load(g_lo, k) + lost)
            most = maximum(most, abs(hb * pull))
        splitter = full(COARSE * largest(most))
        for k in range(i, d, n):
            D = (load(work.S, k) - work.s[k]) / mass
            store(L, k, add_kick(0, (hb, remaining), work.G, g_lo, splitter, sums, k))
            store(work.S, k, D)
            store(work.change, k, weights * D)
    for k in range(d):
        store(L, k, load(L, k) - combine(table, INVERSE, work.S, k))
    if not add_up(d, sums, work.G):
        return NOT_FINITE, 0
    blocks = (d + WIDTH - 1) // WIDTH
    for b in range(blocks):
        k = WIDTH * b
        kick, kick_lo = load(work.G, b), load(work.G, blocks + b)
        drift, lost = two_sum(load(work.G, 2 * blocks + b), -row_sums(work.change, k))
        drift_lo = load(work.G, 3 * blocks + b) + lost
        x, x_lo = moved_by(h, load(q, k), load(q_lo, k), load(v, k), load(v_lo, k), drift, drift_lo)
        _leave(state, stages, work, k, (x, x_lo), (kick, kick_lo))
    body = settle(model, end, state, stages, work, 0, d)
    return (OK, 0) if body < 0 else (NOT_CONVERGED, body)
