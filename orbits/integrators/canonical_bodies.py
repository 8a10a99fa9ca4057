"""Variational partitioned Runge–Kutta methods for bodies with terms that depend on velocities, and with forces.

The model is Newton's Lagrangian, terms of any kind and forces f without a Lagrangian. With s = dL/dv - m v, the
contribution of terms to the momenta, G_j = h b_j (dL/dq + f) / m at the stages and W_i = V_i - v,

    Q_i = q + h c_i v + sum_j mu_ij h b_j W_j,     W_i = sum_j mu_bar_ij G_j - (s_i - s) / m
    q+ = q + h v + sum_i h b_i W_i,                v+ = v + sum_i G_i - (s+ - s) / m

This is the canonical form (`orbits.integrators.canonical`) with momenta p = m v + s, written in velocities: p is
computed from (q, v) to the last bit where it is needed, so that observers see the marched variables. s+ depends on v+
and is iterated until v+ has converged; the next step begins with the same bits of s. Forces enter by the discrete
Lagrange–d'Alembert principle, and their work, torque and impulse are summed with the same quadrature.

The stages are iterated to the round-off floor by fixed-point iteration, as in `orbits.integrators.collocation`. It does
not converge for a term whose contribution to the momentum depends on v as strongly as m v itself.

Source: Marsden & West (2001), sec. 2.6, 3.2; Hairer, Lubich & Wanner (2006), sec. VI.6.2, VIII.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.canonical import combine
from orbits.integrators.canonical_particles import step_particles
from orbits.integrators.canonical_room import (
    CONTINUATION,
    HB,
    HC,
    HC_LO,
    HOURS,
    MU,
    MU_BAR,
    ROWS,
    SETTLED,
    VELOCITY_SWEEPS,
    stages_in,
    work_in,
)
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.acting import FIGURES, account, add_acting, add_momenta, add_terms
from orbits.kernels.binding import accelerate, dimension, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.iteration import (
    CONVERGED,
    LIMIT,
    NEAR_FLOOR,
    PATIENCE,
    judged,
    settled,
    unsettled_body,
)
from orbits.kernels.lanes import WIDTH, any_lane, fma, full, load, row_sums, store
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK
from orbits.kernels.summation import add_compensated, compensated_row_sums, moved, two_sum
from orbits.tableaux import SymplecticTableau


@kernel
def momenta(model, t, q, v, f, s):
    """Write the contribution of terms to the momenta into s; f is workspace."""
    for k in range(dimension(model.tag, model.parameters)):
        f[k] = s[k] = 0.0
    add_momenta(model.tag, model.parameters, t, q, v, f, s)


@kernel(inline=True)
def place(method, q, V, work, stages, v, d):
    """Write positions and velocities of the stages."""
    hb = load(method.coefficients, HB)
    for k in range(d):
        W = load(work.W, k)
        store(work.change, k, hb * W)
        store(V, k, v[k] + W)
    for k in range(d):
        store(stages.Q, k, q[k] + (load(work.base, k) + combine(method.coefficients, MU, work.change, k)))


@kernel(inline=True)
def evaluate(method, model, times, stages, work, d):
    """Write h b times the accelerations of the stages, and the contributions of terms to their momenta."""
    strength, n = model.parameters[0], d // 3
    accelerate(first_term(model.tag), strength, stages.Q, work.G)
    for k in range(d):
        store(work.F, k, full(0.0))
        store(work.S, k, full(0.0))
    add_terms(model.tag, model.parameters, times, stages.Q, stages.V, work.F, work.S)
    add_acting(model.tag, model.parameters, times, stages.Q, stages.V, work.F)
    hb = load(method.coefficients, HB)
    for k in range(d):
        store(work.G, k, hb * (load(work.G, k) + load(work.F, k) / strength[1 + k % n]))


@kernel(inline=True)
def begin_stages(method, model, t, h, state, storage):
    """Use the velocities of the state for the stages, if the carry has none."""
    d = dimension(model.tag, model.parameters)
    V, cold = storage.carry, True
    for k in range(d):
        cold &= V[k, 0] == 0.0
    if cold:
        for k in range(d):
            store(V, k, full(state.p[k]))


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.carry` holds the velocities of the stages of the previous step, then the accounts of
    forces.
    """
    coefficients, strength = method.coefficients, model.parameters[0]
    q, q_lo, v, v_lo = state
    d = dimension(model.tag, model.parameters)
    n, blocks, rows = d // 3, (d + WIDTH - 1) // WIDTH, q.shape[0]
    V, work, stages = storage.carry, work_in(storage.scratch, rows), stages_in(storage.stages, rows)
    times = load(coefficients, HOURS) + t
    hc, hc_lo = load(coefficients, HC), load(coefficients, HC_LO)
    for k in range(d):
        stages.q[k], stages.v[k] = q[k], v[k]
        # Sum the increments first: q is O(30 au), dq is O(1e-3 au).
        store(work.base, k, fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k]))
        store(work.W, k, combine(coefficients, CONTINUATION, V, k) - v[k])
    momenta(model, t, stages.q, stages.v, work.f, work.s)
    evaluations, patience, last = 0, PATIENCE, False
    while True:
        place(method, q, stages.V, work, stages, v, d)
        evaluate(method, model, times, stages, work, d)
        for k in range(d):
            W = combine(coefficients, MU_BAR, work.G, k) - (load(work.S, k) - work.s[k]) / strength[1 + k % n]
            store(work.change, k, abs(W) if evaluations == 0 else abs(W - load(work.W, k)))
            store(work.W, k, W)
        evaluations += 1
        if last:
            break
        patience, last = judged(work.change, work.history, blocks, evaluations, patience, NEAR_FLOOR)
        if evaluations == LIMIT:
            break
    if not settled(work.history, blocks, CONVERGED):
        body = unsettled_body(work.history, blocks, n, CONVERGED)
        if body >= 0:
            return NOT_CONVERGED, body, evaluations
    if not finite(work.G, work.W, d):
        return NOT_FINITE, 0, evaluations
    body = finish(method, model, t + h, h, state, stages, work, d)
    if body >= 0:
        return NOT_CONVERGED, body, evaluations
    for k in range(d):
        store(V, k, load(stages.V, k))
    hb = load(coefficients, HB)
    account(model.tag, model.parameters, times, hb, stages.Q, stages.V, work.F, storage.carry[rows:])
    return OK, 0, evaluations


@kernel(inline=True)
def finite(G, W, d):
    """Return whether d rows of two arrays are finite."""
    sound = True
    for k in range(d):
        sound &= not any_lane(1.0 - (load(G, k) * 0.0 == 0.0) * (load(W, k) * 0.0 == 0.0))
    return sound


@kernel(inline=True)
def finish(method, model, t, h, state, stages, work, d):
    """Advance positions and velocities to the time t, the end of the step. Returns a body whose velocity does not
    converge, or -1.
    """
    q, q_lo, v, v_lo = state
    strength, n, hb = model.parameters[0], d // 3, load(method.coefficients, HB)
    for k in range(d):
        store(work.change, k, hb * load(work.W, k))
    for k in range(0, d, WIDTH):
        x, x_lo = moved(h, load(q, k), load(q_lo, k), load(v, k), load(v_lo, k), row_sums(work.change, k))
        kick, kick_lo = compensated_row_sums(work.G, k)
        store(q, k, x)
        store(q_lo, k, x_lo)
        store(stages.q_end, k, x)
        store(stages.v_end, k, load(v, k) + kick)
        store(work.kick, k, kick)
        store(work.kick_lo, k, kick_lo)
    body, last = 0, math.inf
    for _ in range(VELOCITY_SWEEPS):
        momenta(model, t, stages.q_end, stages.v_end, work.f, work.s_end)
        body, now = 0, 0.0
        for i in range(n):
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
    for k in range(d):
        v[k], v_lo[k] = stages.v_end[k], work.f[k]
    return -1 if now <= SETTLED else body


@kernel(inline=True)
def stretch(method, unit, factor):
    """Write the coefficients of steps `factor` times as long, for a cold start."""
    table, base = method.coefficients, unit.coefficients
    c, hc = load(base, HC), factor * load(base, HC)
    store(table, HC, hc)
    store(table, HC_LO, fma(c, full(factor), -hc) + factor * load(base, HC_LO))
    store(table, HB, factor * load(base, HB))
    store(table, HOURS, factor * load(base, HOURS))


@dataclass(frozen=True)
class CanonicalBodies(Form):
    """The form of a variational partitioned Runge–Kutta method of up to eight stages for bodies with terms of any kind
    and forces.

    forces : the number of forces without a Lagrangian
    """

    tableau: SymplecticTableau
    forces: int = 0

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin_stages,
        "step": step,
        "step_particles": step_particles,
        "width": 1,
        "stretch": stretch,
    }

    def coefficients(self, h: float, before: float) -> Array:
        """Return (ROWS, 8) for steps of h; lanes past the last stage repeat it with weight 0.

        h c is a pair in doubled precision, computed from the rounded weights h b and mu_bar.
        """
        tableau, s = self.tableau, self.tableau.stages
        lane = np.minimum(np.arange(WIDTH), s - 1)
        out = np.zeros((ROWS, WIDTH))
        hb = _weights(tableau, h)
        hc = [
            Fraction(h) - sum(Fraction(hb[j]) * Fraction(tableau.mu_bar[j, i]) for j in range(s)) for i in range(s)
        ]
        high = np.array([float(x) for x in hc])
        low = np.array([float(x - Fraction(y)) for x, y in zip(hc, high, strict=True)])
        out[HOURS], out[HC], out[HC_LO] = (h * tableau.nodes)[lane], high[lane], low[lane]
        out[HB, :s] = hb
        continuation = tableau.continued(h / before)
        for first, matrix in ((MU, tableau.mu), (MU_BAR, tableau.mu_bar), (CONTINUATION, continuation)):
            out[first : first + s] = matrix[lane].T
        return out

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The size of `Stages`."""
        rows = padded(size)
        return 2 * rows + 4 * rows // WIDTH, WIDTH

    def carry_rows(self, size: int) -> int:
        """The velocities of the stages of the previous step; two rows for the accounts of each force."""
        return padded(size) + 2 * self.forces

    @property
    def particle_carry_rows(self) -> int:
        """The velocities of the stages of the previous step, for each particle."""
        return 3

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The size of `Work`."""
        rows = padded(size)
        return 6 * rows + 8 * rows // WIDTH, WIDTH

    def forget(self, carry: Array) -> None:
        """Delete the velocities of the stages; the accounts of forces remain."""
        carry[: len(carry) - 2 * self.forces] = 0.0

    def accounts(self, carry: Array) -> Array:
        """Return the accounts of each force so far, (forces, 7): work, torque and impulse, times G."""
        books = carry[len(carry) - 2 * self.forces :].reshape(self.forces, 2, WIDTH)
        return np.asarray(books.sum(axis=1)[:, :FIGURES])


def _weights(tableau: SymplecticTableau, h: float) -> Array:
    """Return h b, (s,), rounded so that they sum to h if possible: the positions of a free body then advance with its
    velocity to the last bit.
    """
    weights = np.asarray(h * tableau.b)
    missing, s = Fraction(h) - sum(map(Fraction, weights.tolist())), tableau.stages
    alike = [{i, s - 1 - i} for i in range((s + 1) // 2)] if tableau.symmetric else [{i} for i in range(s)]
    for ones in sorted(alike, key=lambda ones: abs(weights[min(ones)])):
        new = {i: Fraction(weights[i]) + missing / len(ones) for i in ones}
        if all(Fraction(float(x)) == x for x in new.values()):
            for i, x in new.items():
                weights[i] = float(x)
            break
    return weights
