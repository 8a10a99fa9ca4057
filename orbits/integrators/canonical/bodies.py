"""Variational partitioned Runge–Kutta methods for bodies with terms that depend on velocities, and with forces.

The model is Newton's Lagrangian, terms of any kind and forces f without a Lagrangian. With s = dL/dv - m v, the
contribution of terms to the momenta, G_j = h b_j (dL/dq + f) / m at the stages and W_i = V_i - v,

    Q_i = q + h c_i v + sum_j mu_ij h b_j W_j,     W_i = sum_j mu_bar_ij G_j - (s_i - s) / m
    q+ = q + h v + sum_i h b_i W_i,                v+ = v + sum_i G_i - (s+ - s) / m

This is the canonical form (`orbits.integrators.canonical.form`) with momenta p = m v + s, written in velocities: p is
computed from (q, v) to the last bit where it is needed, so that observers see the marched variables. s+ depends on v+
and is iterated until v+ has converged; the next step begins with the same bits of s. Forces enter by the discrete
Lagrange–d'Alembert principle, and their work, torque and impulse are summed with the same quadrature. Their internal
variables, if any, are stepped like momenta: Y_i = y + sum_j mu_bar_ij h b_j Y'_j, y+ = y + sum_i h b_i Y'_i.

The stages are iterated to the round-off floor by fixed-point iteration, as in `orbits.integrators.collocation.form`. It
does not converge for a term whose contribution to the momentum depends on v as strongly as m v itself.

Source: Marsden & West (2001), sec. 2.6, 3.2; Hairer, Lubich & Wanner (2006), sec. VI.6.2, VIII.6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.canonical.end import finish, finish_finely, momenta
from orbits.integrators.canonical.form import combine, finite_rows
from orbits.integrators.canonical.lengths import end_late, prepare, stretch
from orbits.integrators.canonical.particles import step_particles
from orbits.integrators.canonical.room import (
    CONTINUATION,
    HOURS,
    INVERSE,
    LATE,
    MU,
    MU_BAR,
    ROWS,
    SETTLED,
    inner_rows,
    stages_in,
    work_in,
)
from orbits.integrators.collocation.dense_output import dense, resolves
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.collocation.lengths import signal
from orbits.integrators.collocation.rows import HB, HC, HC_LO, is_close
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.binding import Tag, accelerate, accelerate_close, dimension, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.terms_and_forces import FIGURES, Moment, account, add_acting, add_terms, inner_variables
from orbits.kernels.lanes import WIDTH, fma, full, largest, load, maximum, store
from orbits.kernels.steps import INNER_NOT_CONVERGED, NOT_CONVERGED, NOT_FINITE, OK
from orbits.kernels.sums.iteration import CONVERGED, LIMIT, NEAR_FLOOR, settled, solve, unsettled_body
from orbits.kernels.sums.summation import two_sum
from orbits.tableaux import SymplecticTableau


@verb
def guess(method, table, carry, k, v):
    """Return the velocities of the stages of coordinate k, relative to v, as the step before lets expect them."""
    if is_close(method):
        return lambda method, table, carry, k, v: combine(table, CONTINUATION, carry, k)
    return lambda method, table, carry, k, v: combine(table, CONTINUATION, carry, k) - v


@verb
def put(method, stages, k, x, increment):
    """Write the positions x + increment of the stages of coordinate k, with low parts if the form has them."""
    if not is_close(method):
        return lambda method, stages, k, x, increment: store(stages.Q, k, x + increment)

    def with_low_part(method, stages, k, x, increment):
        position, low = two_sum(full(x), increment)
        store(stages.Q, k, position)
        store(stages.Q_lo, k, low)

    return with_low_part


@verb
def attract(method, model, stages, out):
    """Write the accelerations of the stages by Newton's attractions."""
    if is_close(method):
        return lambda method, model, stages, out: accelerate_close(
            first_term(model.tag), model.parameters[0], stages.Q, stages.Q_lo, out
        )
    return lambda method, model, stages, out: accelerate(first_term(model.tag), model.parameters[0], stages.Q, out)


@verb
def parts(method, d):
    """Return what is to converge: each coordinate, or with low parts each body."""
    return (lambda method, d: d // 3) if is_close(method) else (lambda method, d: d)


@verb
def end(method, model, t, h, state, stages, work, carry):
    """Take the step from its stages, and write what is kept of them into the carry. Returns (status, body)."""
    if is_close(method):

        def of_kicks(method, model, t, h, state, stages, work, carry):
            times = load(method.coefficients[0], HOURS) + t, (t + h) + method.coefficients[0, LATE, 0]
            return finish_finely(method, model, times, h, state, stages, work, carry)

        return of_kicks

    def of_velocities(method, model, t, h, state, stages, work, carry):
        d = dimension(model.tag, model.parameters)
        status, body = finish(method, model, t + h, h, state, stages, work, d)
        if status == OK:
            for k in range(d):
                store(carry, k, load(stages.V, k))
        return status, body

    return of_velocities


@kernel(inline=True)
def place(method, q, v, stages, work, d):
    """Write positions and velocities of the stages."""
    table = method.coefficients[0]
    hb = load(table, HB)
    for k in range(d):
        W = load(work.W, k)
        store(work.change, k, hb * W)
        store(stages.V, k, v[k] + W)
    for k in range(d):
        put(method, stages, k, q[k], load(work.base, k) + combine(table, MU, work.change, k))


@kernel(inline=True)
def evaluate(method, model, times, stages, work, d):
    """Write h b times the accelerations of the stages, and the contributions of terms to their momenta."""
    strength, n = model.parameters[0], d // 3
    attract(method, model, stages, work.G)
    for k in range(d):
        store(work.F, k, full(0.0))
        store(work.S, k, full(0.0))
    clear(work.D)
    add_terms(model.tag, model.parameters, times, stages.Q, stages.V, work.F, work.S)
    add_acting(model.tag, model.parameters, times, stages.Q, stages.V, work.Y, work.F, work.D)
    hb = load(method.coefficients[0], HB)
    for k in range(inner_variables(model.tag)):
        store(work.D, k, hb * load(work.D, k))
    for k in range(d):
        store(work.G, k, hb * (load(work.G, k) + load(work.F, k) / strength[1 + k % n]))


@kernel(inline=True)
def clear(rows):
    """Write zeros into rows."""
    for k in range(rows.shape[0]):
        store(rows, k, full(0.0))


@kernel(inline=True)
def place_inner(method, count, inner, work):
    """Write the internal variables of forces at the stages, from their rates. Returns whether they have converged.

    inner : rows of their values at the start of the step, eight in each, then of their low parts
    """
    half, converged = inner.shape[0] // 2, True
    for k in range(count):
        y, y_lo = inner[k // WIDTH, k % WIDTH], inner[half + k // WIDTH, k % WIDTH]
        Y = y + (y_lo + combine(method.coefficients[0], MU_BAR, work.D, k))
        change, scale = largest(abs(Y - load(work.Y, k))), largest(abs(load(work.D, k)))
        converged &= change <= max(NEAR_FLOOR * scale, SETTLED * abs(y))
        store(work.Y, k, Y)
    return converged


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
def sweep(equations, first):
    """Compute the velocities W of the stages, relative to v, from the forces and momenta there, and these from W."""
    method, model, times, q, v, stages, work, inner = equations
    table, strength, d = method.coefficients[0], model.parameters[0], dimension(model.tag, model.parameters)
    n, each = d // 3, parts(method, d)
    place(method, q, v, stages, work, d)
    inner_converged = place_inner(method, inner_variables(model.tag), inner, work)
    evaluate(method, model, times, stages, work, d)
    for i in range(each):
        most = full(0.0)
        for k in range(i, d, each):
            W = combine(table, MU_BAR, work.G, k) - (load(work.S, k) - work.s[k]) / strength[1 + k % n]
            most = maximum(most, abs(W) if first else abs(W - load(work.W, k)))
            store(work.W, k, W)
        store(work.change, i, most)
    for i in range(each, (each + WIDTH - 1) // WIDTH * WIDTH):
        store(work.change, i, full(0.0))
    return work.change, inner_converged


STAGES = Tag("stages of bodies in canonical form", {"sweep": sweep})


@kernel(inline=True)
def iterate(rule, equations, history, n, each):
    """Iterate the velocities of the stages of n bodies by the sweeps of a rule; `each` coordinates or bodies are to
    converge. Returns (status, body, evaluations).
    """
    history = history[: 3 * ((each + WIDTH - 1) // WIDTH)]
    _, evaluations, inner_converged, _ = solve(rule, equations, history, NEAR_FLOOR, True, LIMIT)
    if not inner_converged:
        return INNER_NOT_CONVERGED, 0, evaluations
    if not settled(history, CONVERGED):
        body = unsettled_body(history, n, each // n, CONVERGED)
        if body >= 0:
            return NOT_CONVERGED, body, evaluations
    return OK, 0, evaluations


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.carry` holds the velocities of the stages of the previous step, or with low parts the
    kicks by which they are a polynomial, then the accounts of forces.
    """
    table = method.coefficients[0]
    q, q_lo, v, v_lo = state
    d = dimension(model.tag, model.parameters)
    rows, count = q.shape[0], inner_variables(model.tag)
    work, stages = work_in(storage.scratch, rows, inner_rows(count)), stages_in(storage.stages, rows)
    times = load(table, HOURS) + t
    hc, hc_lo = load(table, HC), load(table, HC_LO)
    for k in range(d):
        stages.q[k], stages.v[k] = q[k], v[k]
        # Sum the increments first: q is O(30 au), dq is O(1e-3 au).
        store(work.base, k, fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k]))
        store(work.W, k, guess(method, table, storage.carry, k, v[k]))
    momenta(model, t, stages.q, stages.v, work.f, work.s)
    books = storage.carry[rows:]
    inner = books[books.shape[0] - inner_rows(count) // WIDTH * 2 :]
    clear(work.D)
    equations = method, model, times, q, v, stages, work, inner
    status, body, evaluations = iterate(STAGES, equations, work.history, d // 3, parts(method, d))
    if status != OK:
        return status, body, evaluations
    if not (finite_rows(work.G, d) and finite_rows(work.W, d)):
        return NOT_FINITE, 0, evaluations
    status, body = end(method, model, t, h, state, stages, work, storage.carry)
    if status == OK:
        at = Moment(times, stages.Q, stages.V, work.Y)
        account(model.tag, model.parameters, load(table, HB), at, work.F, work.D, books)
    return status, body, evaluations


@dataclass(frozen=True)
class CanonicalBodies(Form):
    """The form of a variational partitioned Runge–Kutta method of up to eight stages for bodies with terms of any kind
    and forces.

    forces : the number of forces without a Lagrangian; inner : that of their internal variables
    close : whether the positions of the stages have low parts and the last sweep is in doubled precision; only then
        can the length of steps change
    """

    tableau: SymplecticTableau
    forces: int = 0
    inner: int = 0
    close: bool = False

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin_stages,
        "step": step,
        "step_particles": step_particles,
        "width": 1,
        "stretch": stretch,
    }

    more_kernels: ClassVar[Mapping[str, Any]] = {
        "prepare": prepare,
        "end_late": end_late,
        "signal": signal,
        "dense": dense,
        "resolves": resolves,
        "speeds": 1,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        own = {**self.kernels, "registers": 1, "close": int(self.close)}
        if self.close:
            del own["begin"]
            own |= self.more_kernels
        return own

    @property
    def is_dense(self) -> bool:
        """Whether the carry holds kicks by which the velocities of the stages are a polynomial."""
        return self.close and Collocation(self.tableau).is_dense

    def coefficients(self, h: float, before: float) -> Array:
        """Return (1, ROWS, 8) for steps of h; lanes past the last stage repeat it with weight 0.

        h c is a pair in doubled precision, computed from the rounded weights h b and mu_bar.
        """
        tableau, s = self.tableau, self.tableau.stages
        lane = np.minimum(np.arange(WIDTH), s - 1)
        out = np.zeros((1, ROWS, WIDTH))
        out[:, : MU] = Collocation(tableau).coefficients(h, before)
        table = out[0]
        for first, matrix in ((MU, tableau.mu), (MU_BAR, tableau.mu_bar)):
            table[first : first + s] = matrix[lane].T
        table[HOURS] = (h * tableau.nodes)[lane]
        if self.close:
            ratio = h / before
            ahead = ratio * tableau.b[:, None] * tableau.continued(ratio) / tableau.b[None, :]
            table[CONTINUATION : CONTINUATION + s] = (tableau.mu_bar @ ahead)[lane].T
            table[INVERSE : INVERSE + s, :s] = np.linalg.inv(tableau.mu_bar).T
            return out
        hb = _weights(tableau, h)
        hc = [
            Fraction(h) - sum(Fraction(hb[j]) * Fraction(tableau.mu_bar[j, i]) for j in range(s)) for i in range(s)
        ]
        high = np.array([float(x) for x in hc])
        low = np.array([float(x - Fraction(y)) for x, y in zip(hc, high, strict=True)])
        table[HC], table[HC_LO] = high[lane], low[lane]
        table[HB, :s] = hb
        table[CONTINUATION : CONTINUATION + s] = tableau.continued(h / before)[lane].T
        return out

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The size of `Stages`."""
        rows = padded(size)
        return (3 if self.close else 2) * rows + 4 * rows // WIDTH, WIDTH

    def carry_rows(self, size: int) -> int:
        """The velocities or kicks of the stages of the previous step; two rows for the accounts of each force; the
        internal variables of forces, eight in a row, and their low parts.
        """
        return padded(size) + 2 * (self.forces + self._inner_rows)

    @property
    def particle_carry_rows(self) -> int:
        """The same of the stages for each particle."""
        return 3

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The size of `Work`."""
        rows = padded(size)
        return (11 if self.close else 6) * rows + 8 * rows // WIDTH + 2 * WIDTH * self._inner_rows, WIDTH

    @property
    def _inner_rows(self) -> int:
        return -(-self.inner // WIDTH)

    def forget(self, carry: Array) -> None:
        """Delete the velocities of the stages; the accounts of forces and their internal variables remain."""
        carry[: len(carry) - 2 * (self.forces + self._inner_rows)] = 0.0

    def accounts(self, carry: Array) -> Array:
        """Return the accounts of each force so far, (forces, 7): work, torque and impulse, times G."""
        end = len(carry) - 2 * self._inner_rows
        books = carry[end - 2 * self.forces : end].reshape(self.forces, 2, WIDTH)
        return np.asarray(books.sum(axis=1)[:, :FIGURES])

    def inner_of(self, carry: Array) -> Array:
        """Return a view of the internal variables of forces, (inner,)."""
        end = len(carry) - self._inner_rows
        return carry[end - self._inner_rows : end].reshape(-1)[: self.inner]


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
