"""Variational partitioned Runge–Kutta methods for bodies in transformed time, dt = g dtau.

The Lagrangian is L~(q, q') = q'.M q' / (2 g) - g (V - E0), with g the dynamical time of the bodies and E0 their energy
at the start (`orbits.lagrangians.bodies_in_transformed_time`). Its momenta are those of L, so that its canonical
equations are, in positions and velocities,

    q' = g v,     v' = g a - (H - E0) M^-1 grad g,     t' = g

and with K_i, L_i the right-hand sides at the stages, times h b_i,

    Q_i = q + sum_j mu_ij K_j,     V_i = v + sum_j mu_bar_ij L_j
    q+ = q + sum_i K_i,            v+ = v + sum_i L_i,            t+ = t + sum_i h b_i g_i

This is the canonical form of the method for L~ (`orbits.integrators.canonical.form`), written in velocities: a step of
h in tau is symplectic. The stages are iterated to the round-off floor by fixed-point iteration, as in
`orbits.integrators.collocation.form`, with the positions of the stages in doubled precision.

Source: Marsden & West (2001), sec. 2.6; Hairer, Lubich & Wanner (2006), sec. VI.6.2, VIII.2.1, VIII.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from orbits.integrators.canonical.form import combine, finite_rows
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.binding import Tag, dimension, dynamical_rate
from orbits.kernels.compile import kernel
from orbits.kernels.dense import keep_coefficients
from orbits.kernels.gravity.transformed_time import energy_of_bodies, transformed_field
from orbits.kernels.lanes import WIDTH, full, load, maximum, store
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK
from orbits.kernels.sums.iteration import CONVERGED, LIMIT, NEAR_FLOOR, settled, solve
from orbits.kernels.sums.summation import add_compensated, compensated_row_sums, two_sum
from orbits.tableaux import SymplecticTableau

# Rows of the table. From MU on, each is the first of eight: row j holds column j of a matrix, one stage in each lane.
HB, WEIGHTS, MU, MU_BAR, CONTINUATION = 0, 1, 2, 10, 18
ROWS = 26

CANCELLED = 1e-6
"""The share of the momenta of all bodies below which a kick does not count as that of a body."""

ROUND_OFF = 2.0**-54
"""The fraction of its time by which a step of a given time may miss it."""

FINEST = 2.0**-52
"""The relative distance of bounds of its length between which there is no other."""

PARTS = 100

ENERGY, ENERGY_LO, KNOWN, ELAPSED, ELAPSED_LO = 0, 1, 2, 3, 4
"""The last row of the carry: E0 in doubled precision, whether it is known (1), and the time that the last step took."""


class Work(NamedTuple):
    """The scratch of a step; rows are coordinates, lanes are stages.

    moves : (2 rows, 8), K in the first half and L in the second; change : (2 rows, 8), their changes
    Q, Q_lo, V, pull : (rows, 8) positions in doubled precision and velocities of the stages, and workspace
    hours : (8, 8), h b g in its first row; history : see `orbits.kernels.sums.iteration`
    """

    moves: Any
    change: Any
    Q: Any
    Q_lo: Any
    V: Any
    pull: Any
    hours: Any
    history: Any


@kernel(inline=True)
def work_in(scratch, rows):
    """Return the parts of the scratch by name."""
    at = 8 * rows + WIDTH
    return Work(
        scratch[: 2 * rows],
        scratch[2 * rows : 4 * rows],
        scratch[4 * rows : 5 * rows],
        scratch[5 * rows : 6 * rows],
        scratch[6 * rows : 7 * rows],
        scratch[7 * rows : 8 * rows],
        scratch[8 * rows : at],
        scratch[at : at + 6 * rows // WIDTH],
    )


@kernel
def begin_energy(method, model, t, h, state, storage):
    """Compute the energy E0 from the state, unless the carry has it."""
    carry, rows = storage.carry, state.q.shape[0]
    if carry[2 * rows, KNOWN] == 0.0:
        room = storage.scratch.reshape(-1)
        energy, low = energy_of_bodies(model.parameters, state.q, state.p, room)
        carry[2 * rows, ENERGY], carry[2 * rows, ENERGY_LO], carry[2 * rows, KNOWN] = energy, low, 1.0
        for k in range(storage.scratch.shape[0]):
            store(storage.scratch, k, full(0.0))


@kernel(inline=True)
def place(method, state, work, rows, d):
    """Write positions and velocities of the stages."""
    for k in range(d):
        position, low = two_sum(
            full(state.q[k]), state.q_lo[k] + combine(method.coefficients, MU, work.moves, k)
        )
        store(work.Q, k, position)
        store(work.Q_lo, k, low)
        store(work.V, k, state.p[k] + (state.p_lo[k] + combine(method.coefficients, MU_BAR, work.moves[rows:], k)))


@kernel
def unsettled(history, blocks, rows, strength, n):
    """Return the first body whose least change exceeds `CONVERGED` of its own largest one; -1 if none does.

    Where attractions cancel, the kick that remains is round-off: none counts as less than `CANCELLED` of that which the
    momenta of all bodies would give.
    """
    for first in range(0, 2 * rows, rows):
        momenta = 0.0
        for k in range(3 * n):
            momenta += strength[1 + k % n] * history[2 * blocks + (first + k) // WIDTH, (first + k) % WIDTH]
        for i in range(n):
            least, scale = 0.0, CANCELLED * momenta / strength[1 + i]
            for k in range(first + i, first + 3 * n, n):
                least = maximum(history[k // WIDTH, k % WIDTH], least)
                scale = maximum(history[2 * blocks + k // WIDTH, k % WIDTH], scale)
            if not least <= CONVERGED * scale:
                return i
    return -1


@kernel(inline=True)
def sweep(equations, first):
    """Compute the moves K and L of the stages from the derivatives there, and these from K and L."""
    method, model, energy, state, work, carry = equations
    d, rows = dimension(model.tag, model.parameters), state.q.shape[0]
    hb = load(method.coefficients, HB)
    place(method, state, work, rows, d)
    g = transformed_field(
        model.parameters, energy, work.Q, work.Q_lo, work.V, work.pull, carry[:rows], carry[rows : 2 * rows]
    )
    store(work.hours, 0, hb * g)
    for half in range(0, 2 * rows, rows):
        for k in range(half, half + d):
            new = hb * load(carry, k)
            store(work.change, k, abs(new) if first else abs(new - load(work.moves, k)))
            store(work.moves, k, new)
    return work.change, True


STAGES = Tag("stages in transformed time", {"sweep": sweep})


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step of h in tau; `storage.carry` holds q' and v' at the stages of the previous step, and E0."""
    d, rows, carry = dimension(model.tag, model.parameters), state.q.shape[0], storage.carry
    work, count, blocks = work_in(storage.scratch, rows), d // 3, 2 * rows // WIDTH
    hb, energy = load(method.coefficients, HB), (carry[2 * rows, ENERGY], carry[2 * rows, ENERGY_LO])
    for half in range(0, 2 * rows, rows):
        for k in range(half, half + d):
            store(work.moves, k, hb * combine(method.coefficients, CONTINUATION, carry, k))
    cold = carry[0, 0] == 0.0
    for k in range(d):
        cold &= carry[k, 0] == 0.0 and carry[rows + k, 0] == 0.0
    if cold:  # from the derivatives at the start: at a single place, forces that cancel would set no scale
        place(method, state, work, rows, d)
        transformed_field(
            model.parameters, energy, work.Q, work.Q_lo, work.V, work.pull, carry[:rows], carry[rows : 2 * rows]
        )
        for half in range(0, 2 * rows, rows):
            for k in range(half, half + d):
                store(work.moves, k, hb * load(carry, k))
    equations = method, model, energy, state, work, carry
    _, evaluations, _, _ = solve(STAGES, equations, work.history, NEAR_FLOOR, True, LIMIT)
    if not settled(work.history, CONVERGED):
        body = unsettled(work.history, blocks, rows, model.parameters, count)
        if body >= 0:
            return NOT_CONVERGED, body, evaluations
    hours, hours_lo = compensated_row_sums(work.hours, 0)
    store(work.hours, 1, hours)
    store(work.hours, 2, hours_lo)
    carry[2 * rows, ELAPSED], carry[2 * rows, ELAPSED_LO] = work.hours[1, 0], work.hours[2, 0]
    store(work.hours, 1, full(0.0))
    store(work.hours, 2, full(0.0))
    if carry[2 * rows, ELAPSED] * 0.0 != 0.0 or not (
        finite_rows(work.moves, d) and finite_rows(work.moves[rows:], d)
    ):
        return NOT_FINITE, 0, evaluations
    for k in range(0, d, WIDTH):
        moved, moved_lo = compensated_row_sums(work.moves, k)
        x, x_lo = add_compensated(load(state.q, k), load(state.q_lo, k) + moved_lo, moved)
        kick, kick_lo = compensated_row_sums(work.moves, rows + k)
        u, u_lo = add_compensated(load(state.p, k), load(state.p_lo, k) + kick_lo, kick)
        store(state.q, k, x)
        store(state.q_lo, k, x_lo)
        store(state.p, k, u)
        store(state.p_lo, k, u_lo)
    return OK, 0, evaluations


@kernel(inline=True)
def prepare(method, h, before, storage):
    """Write the weights of a step of h. The stages are predicted as for steps of one length."""
    store(method.coefficients, HB, h * load(method.coefficients, WEIGHTS))


@kernel(inline=True)
def elapsed(method, state, storage):
    """Return the time that the last step took, in doubled precision."""
    row = 2 * state.q.shape[0]
    return storage.carry[row, ELAPSED], storage.carry[row, ELAPSED_LO]


@kernel
def part(method, model, t, h, state, storage):
    """Take a step of tau that takes the time h: its length is found by Newton's method, with dt / dtau = g."""
    rows, carry = state.q.shape[0], storage.carry
    kept = storage.scratch[8 * rows + WIDTH + 6 * rows // WIDTH :].reshape(-1)
    _copy(state, kept, True)
    rate, _ = dynamical_rate(model.tag, model.parameters, state.q, state.p)
    length, low, high = abs(h) * math.sqrt(rate), 0.0, math.inf
    status, where, evaluations = NOT_CONVERGED, 0, 0
    for _ in range(PARTS):
        for k in range(2 * rows):
            store(carry, k, full(0.0))
        own = math.copysign(length, h)
        prepare(method, own, own, storage)
        status, where, count = step(method, model, t, own, state, storage)
        evaluations += count
        after = 0.0
        if status == OK:
            dt, dt_lo = elapsed(method, state, storage)
            beyond = math.copysign(1.0, h) * ((dt - h) + dt_lo)
            low, high = (low, length) if beyond > 0.0 else (length, high)
            rate, _ = dynamical_rate(model.tag, model.parameters, state.q, state.p)
            after = length - beyond * math.sqrt(rate)
            if abs(beyond) <= ROUND_OFF * abs(h) or after == length or high <= low * (1.0 + FINEST):
                break
        else:
            high = length
        if not low < after < high:
            after = 0.5 * (low + high) if high < math.inf else 2.0 * length
        _copy(state, kept, False)
        length = after
    return status, where, evaluations


@kernel(inline=True)
def _copy(state, room, away):
    """Copy the state into `room`, or back."""
    at = 0
    for x in (state.q, state.q_lo, state.p, state.p_lo):
        for k in range(0, x.shape[0], WIDTH):
            if away:
                store(room, at + k, load(x, k))
            else:
                store(x, k, load(room, at + k))
        at += x.shape[0]


@dataclass(frozen=True)
class TransformedBodies(Form):
    """The form of a variational partitioned Runge–Kutta method of up to eight stages for bodies in transformed time."""

    tableau: SymplecticTableau

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin_energy,
        "step": step,
        "prepare": prepare,
        "elapsed": elapsed,
        "part": part,
        "stretch": keep_coefficients,  # `part` makes those of each step that it tries
    }

    def coefficients(self, h: float, before: float) -> Array:
        """Return (ROWS, 8) for steps of h in tau; lanes past the last stage repeat it with weight 0."""
        tableau, s = self.tableau, self.tableau.stages
        lane = np.minimum(np.arange(WIDTH), s - 1)
        out = np.zeros((ROWS, WIDTH))
        out[WEIGHTS, :s] = tableau.b
        out[HB] = h * out[WEIGHTS]
        for first, matrix in ((MU, tableau.mu), (MU_BAR, tableau.mu_bar), (CONTINUATION, tableau.continued(1.0))):
            out[first : first + s] = matrix[lane].T
        return out

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Empty: no massless particles are stepped in this form."""
        return 1, 1

    def carry_rows(self, size: int) -> int:
        """The derivatives q' and v' at the stages of the previous step; E0 and the time that it took."""
        return 2 * padded(size) + 1

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The size of `Work`, and of a state that `part` keeps."""
        rows = padded(size)
        return 8 * rows + WIDTH + 10 * rows // WIDTH, WIDTH

    def forget(self, carry: Array) -> None:
        """Delete the stages; E0 remains."""
        carry[:-1] = 0.0
