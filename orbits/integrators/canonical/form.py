"""Variational partitioned Runge–Kutta methods for any regular Lagrangian, in canonical form.

With V_i the velocities of the stages, F_i = dL/dq(Q_i, V_i), K_i = h b_i V_i and L_i = h b_i F_i,

    Q_i = q + sum_j mu_ij K_j,     P_i = p + sum_j mu_bar_ij L_j,     dL/dv(Q_i, V_i) = P_i
    q+ = q + sum_i K_i,            p+ = p + sum_i L_i

The velocities are iterated to the round-off floor: by the fixed-point iteration V_i <- V_i + M^-1 (P_i - dL/dv(Q_i,
V_i)) with the mass matrix M at the start of the step, if it converges; otherwise by the simplified Newton method for
all stages together, from the same start, with a Jacobian that is recomputed when the iteration stalls above the floor.

Source: Marsden & West (2001), sec. 2.6; Hairer, Lubich & Wanner (2006), sec. VI.6.2, VIII.6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.binding import Tag, bodies, dimension, gradients, hessians
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, load, store
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, NOT_REGULAR, OK
from orbits.kernels.sums.iteration import (
    CONVERGED,
    FLOOR,
    NEAR_FLOOR,
    TIGHT,
    solve,
    unsettled_body,
    unsettled_coordinate,
)
from orbits.kernels.sums.linear_equations import factorize, solve_rows
from orbits.kernels.sums.linear_equations import solve as solve_linear
from orbits.kernels.sums.summation import add_compensated, compensated_row_sums
from orbits.tableaux import SymplecticTableau

# Rows of the table. From MU on, each is the first of eight: row j holds column j of a matrix, one stage in each lane.
HC, HB, STAGES, MU, MU_BAR, CONTINUATION = 0, 1, 2, 3, 11, 19
ROWS = 27

FIXED_POINT_SWEEPS, NEWTON_SWEEPS = 16, 40
"""Sweeps before the next attempt. A fixed-point iteration that needs more gains less than a bit in two sweeps."""

ATTEMPTS = 6
"""Number of attempts: the fixed-point iteration, then Newton's method with a new Jacobian each."""


class Work(NamedTuple):
    """The scratch of a step of d coordinates in s <= 8 stages; rows are coordinates, lanes are stages.

    start : (rows, 8) initial velocities of the iteration
    Q, F, P, K : (rows, 8) positions, h b times forces, momenta and h b times velocities of the stages
    change, delta : (rows, 8) changes of the last iteration, and residuals
    history : (3 rows / 8, 8), see `orbits.kernels.sums.iteration`
    curvature : (3 d^2, 8) Hessian blocks of the stages
    matrix : (8 d, 8 d) of Newton's method, pivots (8 d,) its row exchanges
    mass : (d, d) mass matrix of the start, mass_pivots (d,) its row exchanges
    vector : (8 rows,), the unknowns of Newton's method, ordered by stage
    sound : (1,), whether the forces at the first stages are finite
    """

    start: Any
    Q: Any
    F: Any
    P: Any
    K: Any
    change: Any
    delta: Any
    history: Any
    curvature: Any
    matrix: Any
    pivots: Any
    mass: Any
    mass_pivots: Any
    vector: Any
    sound: Any


@kernel(inline=True)
def work_in(scratch, rows, d):
    """Return the parts of the scratch by name."""
    at = 7 * rows
    curvature = scratch[at + 3 * rows // WIDTH :][: 3 * d * d]
    history = scratch[at : at + 3 * rows // WIDTH]
    at += 3 * rows // WIDTH + 3 * d * d
    matrix = scratch[at : at + 8 * d * d].reshape(8 * d, 8 * d)
    at += 8 * d * d
    mass = scratch[at : at + d * d // WIDTH + 1].reshape(-1)[: d * d].reshape(d, d)
    at += d * d // WIDTH + 1
    vector = scratch[at : at + rows].reshape(-1)
    at += rows
    pivots = scratch[at : at + 2 * d].reshape(-1)
    return Work(
        scratch[:rows],
        scratch[rows : 2 * rows],
        scratch[2 * rows : 3 * rows],
        scratch[3 * rows : 4 * rows],
        scratch[4 * rows : 5 * rows],
        scratch[5 * rows : 6 * rows],
        scratch[6 * rows : 7 * rows],
        history,
        curvature,
        matrix,
        pivots[2 * d :],
        mass,
        pivots[1 : d + 1],
        vector,
        pivots[:1],
    )


@kernel(inline=True)
def combine(table, first, rows, k):
    """Return sum_j column_j * rows[k, j] for the eight columns of the table from `first` on."""
    even = load(table, first) * rows[k, 0]
    odd = load(table, first + 1) * rows[k, 1]
    for j in range(2, WIDTH, 2):
        even = even + load(table, first + j) * rows[k, j]
        odd = odd + load(table, first + j + 1) * rows[k, j + 1]
    return even + odd


@kernel(inline=True)
def predict(method, model, t, state, V, work):
    """Predict the velocities of the stages from those of the previous step, and factorize the mass matrix at the start.

    Returns whether it is regular.
    """
    d = dimension(model.tag, model.parameters)
    for k in range(d):
        guess = combine(method.coefficients, CONTINUATION, V, k)
        store(work.start, k, guess)
        store(V, k, guess)
        work.vector[k] = V[k, 0]
    curvature = work.curvature.reshape(-1)
    hessians(model.tag, model.parameters, t, state.q, work.vector, curvature)
    for m in range(d):
        for n in range(d):
            work.mass[m, n] = curvature[2 * d * d + m * d + n]
    return factorize(work.mass, d, work.mass_pivots)


@kernel(inline=True)
def place(method, state, V, work, d):
    """Write the positions of the stages, and their increments."""
    hb = load(method.coefficients, HB)
    for k in range(d):
        store(work.K, k, hb * load(V, k))
        store(work.Q, k, state.q[k] + (state.q_lo[k] + combine(method.coefficients, MU, work.K, k)))


@kernel
def linearize(method, model, times, state, V, work):
    """Factorize the derivative of dL/dv(Q, V) - P by the velocities of all stages. Returns whether it is regular.

    The unknowns are ordered by stage.
    """
    d, stages = dimension(model.tag, model.parameters), int(method.coefficients[STAGES, 0])
    place(method, state, V, work, d)
    hessians(model.tag, model.parameters, times, work.Q, V, work.curvature)
    _newton_matrix(work.curvature, method.coefficients, d, stages, work.matrix)
    return factorize(work.matrix, stages * d, work.pivots)


@kernel
def _newton_matrix(curvature, coefficients, d, stages, matrix):
    """Write the matrix; curvature : (3 d^2, 8), the Hessian blocks of the stages."""
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


@kernel(inline=True)
def evaluate(method, model, times, state, V, work, d):
    """Write the forces and momenta of the stages, and the residuals of the momenta."""
    place(method, state, V, work, d)
    gradients(model.tag, model.parameters, times, work.Q, V, work.F, work.P)
    hb = load(method.coefficients, HB)
    for k in range(d):
        store(work.F, k, hb * load(work.F, k))
    for k in range(d):
        missing = state.p_lo[k] + combine(method.coefficients, MU_BAR, work.F, k)
        store(work.delta, k, (state.p[k] - load(work.P, k)) + missing)


@kernel
def solve_stages(work, d, stages):
    """Compute the changes of the velocities from the residuals of the momenta, by Newton's matrix."""
    for i in range(stages):
        for m in range(d):
            work.vector[i * d + m] = work.delta[m, i]
    solve_linear(work.matrix, stages * d, work.pivots, work.vector)
    for m in range(d):
        for i in range(WIDTH):
            work.delta[m, i] = work.vector[min(i, stages - 1) * d + m]


@kernel(inline=True)
def finite_rows(rows, d):
    """Return whether d rows of eight numbers are finite."""
    finite = True
    for k in range(d):
        finite &= not any_lane(1.0 - (load(rows, k) * 0.0 == full(0.0)))
    return finite


@kernel(inline=True)
def sweep(equations, first):
    """Compute the velocities V of the stages from the residuals of their momenta: by Newton's matrix, or by the mass
    matrix of the start.
    """
    method, model, times, state, V, work, newton = equations
    d, stages = dimension(model.tag, model.parameters), int(method.coefficients[STAGES, 0])
    hb = load(method.coefficients, HB)
    evaluate(method, model, times, state, V, work, d)
    if newton:
        solve_stages(work, d, stages)
    else:
        if first:
            work.sound[0] = finite_rows(work.F, d)
        solve_rows(work.mass, d, work.mass_pivots, work.delta)
    for k in range(d):
        new = load(V, k) + load(work.delta, k)
        store(V, k, new)
        store(work.change, k, abs(hb * new) if first else abs(hb * load(work.delta, k)))
    return work.change, True


VELOCITIES = Tag("stages in canonical form", {"sweep": sweep})


@kernel(inline=True)
def iterate(method, model, times, state, V, work):
    """Iterate the velocities of the stages: by fixed-point iteration, then by Newton's method. Returns (status, where,
    evaluations).
    """
    d, where, evaluations = dimension(model.tag, model.parameters), 0, 0
    history = work.history[: 3 * ((d + WIDTH - 1) // WIDTH)]
    for attempt in range(ATTEMPTS):
        if attempt > 0:
            if attempt == 1:
                for k in range(d):
                    store(V, k, load(work.start, k))
            evaluations += 1
            if not linearize(method, model, times, state, V, work):
                break
        equations = method, model, times, state, V, work, attempt > 0
        limit = FIXED_POINT_SWEEPS if attempt == 0 else NEWTON_SWEEPS
        _, sweeps, _, done = solve(VELOCITIES, equations, history, FLOOR, True, limit)
        evaluations += sweeps
        if done:
            finite = finite_rows(V, d) and finite_rows(work.F, d)
            # A stalled iteration gets a new Jacobian; if even the last one stalls, rounding of the forces is the limit.
            where = unsettled_coordinate(history, d, TIGHT, FLOOR)
            if where >= 0 and attempt == ATTEMPTS - 1:
                count = bodies(model.tag, model.parameters)
                if count > 0:
                    where = unsettled_body(history, count, 3, CONVERGED)
                else:
                    where = unsettled_coordinate(history, d, NEAR_FLOOR, NEAR_FLOOR)
            if finite and where < 0:
                return OK, 0, evaluations
    return (NOT_CONVERGED if work.sound[0] != 0.0 else NOT_FINITE), max(where, 0), evaluations


@kernel(inline=True)
def update(state, K, L, d):
    """Advance positions and momenta by the sums over the stages."""
    for k in range(0, d, WIDTH):
        moved, moved_lo = compensated_row_sums(K, k)
        x, x_lo = add_compensated(load(state.q, k), load(state.q_lo, k) + moved_lo, moved)
        kick, kick_lo = compensated_row_sums(L, k)
        y, y_lo = add_compensated(load(state.p, k), load(state.p_lo, k) + kick_lo, kick)
        store(state.q, k, x)
        store(state.q_lo, k, x_lo)
        store(state.p, k, y)
        store(state.p_lo, k, y_lo)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.carry` holds the velocities of the stages of the previous step, and initially those of
    the start.
    """
    d, V = dimension(model.tag, model.parameters), storage.carry
    work = work_in(storage.scratch, V.shape[0], d)
    if not predict(method, model, t, state, V, work):
        return NOT_REGULAR, 0, 0
    times = load(method.coefficients, HC) + t
    status, where, evaluations = iterate(method, model, times, state, V, work)
    if status == OK:
        hb = load(method.coefficients, HB)
        for k in range(d):
            store(work.K, k, hb * load(V, k))
        update(state, work.K, work.F, d)
    else:
        for k in range(d):
            store(V, k, full(0.0))
    return status, where, evaluations


@dataclass(frozen=True)
class Canonical(Form):
    """The canonical form of a variational partitioned Runge–Kutta method of up to eight stages."""

    tableau: SymplecticTableau

    kernels: ClassVar[Mapping[str, Any]] = {"step": step}

    def coefficients(self, h: float, before: float) -> Array:
        """Return (ROWS, 8) for steps of h; lanes past the last stage repeat it with weight 0."""
        tableau, s = self.tableau, self.tableau.stages
        lane = np.minimum(np.arange(WIDTH), s - 1)
        out = np.zeros((ROWS, WIDTH))
        out[HC] = (h * tableau.nodes)[lane]
        out[HB, :s] = h * tableau.b
        out[STAGES] = s
        continuation = tableau.continued(h / before)
        for first, matrix in ((MU, tableau.mu), (MU_BAR, tableau.mu_bar), (CONTINUATION, continuation)):
            out[first : first + s] = matrix[lane].T
        return out

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Empty: no massless particles are stepped in this form."""
        return 1, 1

    def carry_rows(self, size: int) -> int:
        """The velocities of the stages of the previous step."""
        return padded(size)

    def guess(self, carry: Array, v: Array) -> None:
        """The velocities of all stages."""
        carry[: len(v)] = v[:, None]

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The size of `Work`."""
        rows, d = padded(size), size
        return 7 * rows + 3 * rows // WIDTH + 11 * d * d + d * d // WIDTH + 1 + rows + 2 * d, WIDTH
