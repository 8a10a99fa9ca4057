"""Variational partitioned Runge–Kutta methods for bodies on which more acts than forces of position.

What acts is Newton's Lagrangian, terms of any kind and forces f without a Lagrangian. With s = dL/dv - m v, what terms
add to the momenta, G_j = h b_j (dL/dq + f) / m at the stages and W_i = V_i - v,

    Q_i = q + h c_i v + sum_j mu_ij h b_j W_j,     W_i = sum_j mu_bar_ij G_j - (s_i - s) / m
    q+ = q + h v + sum_i h b_i W_i,                v+ = v + sum_i G_i - (s+ - s) / m

This is the canonical form (`orbits.integrators.canonical`) of momenta p = m v + s, written in velocities: p is known
from (q, v) to the last bit wherever it is needed, so that the state that is marched is the one that is seen. s+ depends
on v+ and is iterated until v+ stands; the next step begins with the same bits of s. The forces are those of the
discrete Lagrange–d'Alembert principle, and what they do is accounted by the same quadrature.

The stages are iterated to the round-off floor by fixed point, as in `orbits.integrators.collocation`: a term whose part
of the momentum depends on v as strongly as m v itself is refused by that.

Source: Marsden & West (2001), sec. 2.6, 3.2; Hairer, Lubich & Wanner (2006), sec. VI.6.2, VIII.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np

from orbits.integrators.canonical import combine
from orbits.integrators.collocation import moved
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.acting import FIGURES, account, add_acting, add_terms, particle_acting, particle_terms
from orbits.kernels.binding import accelerate, dimension, field, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.iteration import (
    CONVERGED,
    LIMIT,
    LOST,
    NEAR_FLOOR,
    PATIENCE,
    begin,
    falling,
    settled,
    unsettled_body,
)
from orbits.kernels.lanes import WIDTH, any_lane, fma, full, largest, load, row_sums, store, total
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK, Particles
from orbits.kernels.summation import add_compensated, compensated_row_sums, two_sum
from orbits.tableaux import SymplecticTableau

# Rows of the table. From MU on each entry is the first of eight: row j holds column j of a matrix, a stage a lane.
HOURS, HC, HC_LO, HB, MU, MU_BAR, CONTINUATION = 0, 1, 2, 3, 4, 12, 20
ROWS = 28

VELOCITY_SWEEPS = 50
"""Evaluations of s+ after which the velocities at the end of a step are given up."""

SETTLED = 2.0**-46
"""Velocities at the end of a step that change by less than this fraction, and by no less than before, stand."""


class Stages(NamedTuple):
    """What a step goes through: what massless particles feel.

    Q, V : (rows, 8) positions and velocities of the stages; q, v, q_end, v_end : (rows,) at both ends of the step
    """

    Q: Any
    V: Any
    q: Any
    v: Any
    q_end: Any
    v_end: Any


class Work(NamedTuple):
    """The scratch of a step of d coordinates; rows are coordinates, lanes are stages.

    W, base, G : (rows, 8) see above; base is what moves the stages without W
    F, S : (rows, 8) forces and momenta that are added to Newton's
    change, history : see `orbits.kernels.iteration`
    f, s, s_end, kick, kick_lo : (rows,)
    """

    W: Any
    base: Any
    G: Any
    F: Any
    S: Any
    change: Any
    history: Any
    f: Any
    s: Any
    s_end: Any
    kick: Any
    kick_lo: Any


@kernel(inline=True)
def stages_in(room, rows):
    """Return the parts of the stages by their names."""
    at, some = 2 * rows, rows // WIDTH
    return Stages(
        room[:rows],
        room[rows:at],
        room[at : at + some].reshape(-1),
        room[at + some : at + 2 * some].reshape(-1),
        room[at + 2 * some : at + 3 * some].reshape(-1),
        room[at + 3 * some : at + 4 * some].reshape(-1),
    )


@kernel(inline=True)
def work_in(scratch, rows):
    """Return the parts of the scratch by their names."""
    at, some = 6 * rows, rows // WIDTH
    more = at + 3 * some
    return Work(
        scratch[:rows],
        scratch[rows : 2 * rows],
        scratch[2 * rows : 3 * rows],
        scratch[3 * rows : 4 * rows],
        scratch[4 * rows : 5 * rows],
        scratch[5 * rows : 6 * rows],
        scratch[at:more],
        scratch[more : more + some].reshape(-1),
        scratch[more + some : more + 2 * some].reshape(-1),
        scratch[more + 2 * some : more + 3 * some].reshape(-1),
        scratch[more + 3 * some : more + 4 * some].reshape(-1),
        scratch[more + 4 * some : more + 5 * some].reshape(-1),
    )


@kernel
def momenta(model, t, q, v, f, s):
    """Write what terms add to the momenta into s; f is free to use."""
    for k in range(dimension(model.tag, model.parameters)):
        f[k] = s[k] = 0.0
    add_terms(model.tag, model.parameters, t, q, v, f, s)


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
    """Write h b times the accelerations of the stages, and what terms add to their momenta."""
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
def prepare(method, model, t, h, state, storage):
    """Begin with the velocities of the state as those of the stages, where none are carried."""
    d = dimension(model.tag, model.parameters)
    V, cold = storage.carry, True
    for k in range(d):
        cold &= V[k, 0] == 0.0
    if cold:
        for k in range(d):
            store(V, k, full(state.p[k]))


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.carry` holds the velocities of the stages of the step before, then what forces did."""
    coefficients, strength = method.coefficients, model.parameters[0]
    q, q_lo, v, v_lo = state
    d = dimension(model.tag, model.parameters)
    n, blocks, rows = d // 3, (d + WIDTH - 1) // WIDTH, q.shape[0]
    V, work, stages = storage.carry, work_in(storage.scratch, rows), stages_in(storage.stages, rows)
    times = load(coefficients, HOURS) + t
    hc, hc_lo = load(coefficients, HC), load(coefficients, HC_LO)
    for k in range(d):
        stages.q[k], stages.v[k] = q[k], v[k]
        # Sum the increments first: q is O(30 au), what moves it is O(1e-3 au).
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
        if evaluations == 1:
            begin(work.change, work.history, blocks)
        elif not falling(work.change, work.history, blocks):
            patience -= 1
            last = patience == 0 or settled(work.history, blocks, NEAR_FLOOR)
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
    """Move positions and velocities to the time t, the end of the step. Returns a body whose velocity does not settle,
    or -1.
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
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of one particle through the stages that the massive bodies went through.

    carry : (3, 8), the velocities of the stages of the step before; `storage.share` begins with the number of the
        particle. A step that fails returns the particle as it was.
    """
    coefficients, strength = method.coefficients, model.parameters[0]
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    d = dimension(model.tag, model.parameters)
    number, stages = storage.share.start, stages_in(storage.stages, padded_length(d))
    hc, hc_lo, hb = load(coefficients, HC), load(coefficients, HC_LO), load(coefficients, HB)
    times = load(coefficients, HOURS) + t
    x_base = fma(hc, full(vx), hc_lo * vx + hc * vx_lo + x_lo)
    y_base = fma(hc, full(vy), hc_lo * vy + hc * vy_lo + y_lo)
    z_base = fma(hc, full(vz), hc_lo * vz + hc * vz_lo + z_lo)
    _, _, _, sx, sy, sz = particle_terms(
        model.tag, model.parameters, t, stages.q, stages.v, (x, y, z), (vx, vy, vz)
    )
    Wx, Wy, Wz = full(0.0), full(0.0), full(0.0)
    if largest(abs(load(carry, 0)) + abs(load(carry, 1)) + abs(load(carry, 2))) > 0.0:
        Wx = combine(coefficients, CONTINUATION, carry, 0) - vx
        Wy = combine(coefficients, CONTINUATION, carry, 1) - vy
        Wz = combine(coefficients, CONTINUATION, carry, 2) - vz
    room = storage.scratch
    Gx = Gy = Gz = full(0.0)
    least = last_change = scale = 0.0
    patience, last, evaluations = PATIENCE, False, 0
    while True:
        store(room, 0, hb * Wx)
        store(room, 1, hb * Wy)
        store(room, 2, hb * Wz)
        Vx, Vy, Vz = vx + Wx, vy + Wy, vz + Wz
        Qx = x + (x_base + combine(coefficients, MU, room, 0))
        Qy = y + (y_base + combine(coefficients, MU, room, 1))
        Qz = z + (z_base + combine(coefficients, MU, room, 2))
        ax, ay, az = field(first_term(model.tag), strength, stages.Q, Qx, Qy, Qz)
        place, velocity = (Qx, Qy, Qz), (Vx, Vy, Vz)
        bx, by, bz, Sx, Sy, Sz = particle_terms(
            model.tag, model.parameters, times, stages.Q, stages.V, place, velocity
        )
        cx, cy, cz = particle_acting(
            model.tag, model.parameters, times, number, stages.Q, stages.V, place, velocity
        )
        Gx, Gy, Gz = hb * (ax + (bx + cx)), hb * (ay + (by + cy)), hb * (az + (bz + cz))
        store(room, 0, Gx)
        store(room, 1, Gy)
        store(room, 2, Gz)
        new_x = combine(coefficients, MU_BAR, room, 0) - (Sx - sx)
        new_y = combine(coefficients, MU_BAR, room, 1) - (Sy - sy)
        new_z = combine(coefficients, MU_BAR, room, 2) - (Sz - sz)
        evaluations += 1
        now = largest(abs(new_x - Wx) + abs(new_y - Wy) + abs(new_z - Wz))
        Wx, Wy, Wz = new_x, new_y, new_z
        if evaluations == 1:
            now = scale = least = largest(abs(Wx) + abs(Wy) + abs(Wz))
        if last:
            break
        if evaluations > 1:
            if not (now < least and now * now > LOST * scale * last_change):
                patience -= 1
                last = patience == 0 or least <= NEAR_FLOOR * scale or now <= NEAR_FLOOR * scale
            least = min(least, now)
        last_change = now
        if evaluations == LIMIT:
            break
    if not least <= CONVERGED * scale:
        return particles, carry, NOT_CONVERGED, evaluations
    kicks = total(Gx), total(Gy), total(Gz)
    if (kicks[0] + kicks[1] + kicks[2] + total(Wx + Wy + Wz)) * 0.0 != 0.0:
        return particles, carry, NOT_FINITE, evaluations
    store(carry, 0, vx + Wx)
    store(carry, 1, vy + Wy)
    store(carry, 2, vz + Wz)
    x, x_lo = moved(h, x, x_lo, vx, vx_lo, total(hb * Wx))
    y, y_lo = moved(h, y, y_lo, vy, vy_lo, total(hb * Wy))
    z, z_lo = moved(h, z, z_lo, vz, vz_lo, total(hb * Wz))
    ux, uy, uz = vx + kicks[0], vy + kicks[1], vz + kicks[2]
    ux_lo = uy_lo = uz_lo = 0.0
    last_change, off = math.inf, 0.0
    for _ in range(VELOCITY_SWEEPS):
        _, _, _, ex, ey, ez = particle_terms(
            model.tag, model.parameters, t + h, stages.q_end, stages.v_end, (x, y, z), (ux, uy, uz)
        )
        before = ux, uy, uz
        ux, ux_lo = pushed(vx, vx_lo, kicks[0], sx - ex)
        uy, uy_lo = pushed(vy, vy_lo, kicks[1], sy - ey)
        uz, uz_lo = pushed(vz, vz_lo, kicks[2], sz - ez)
        off = abs(ux - before[0]) + abs(uy - before[1]) + abs(uz - before[2])
        enough = SETTLED * (abs(ux) + abs(uy) + abs(uz))
        if off == 0.0 or (off <= enough and off >= last_change):
            break
        last_change = off
    if not off <= enough:
        return particles, carry, NOT_CONVERGED, evaluations
    return Particles(x, y, z, x_lo, y_lo, z_lo, ux, uy, uz, ux_lo, uy_lo, uz_lo), carry, OK, evaluations


@kernel(inline=True)
def pushed(v, v_lo, kick, more):
    """Return the pair (v, v_lo) + kick + more."""
    kick, lost = two_sum(kick, more)
    return add_compensated(v, v_lo + lost, kick)


@kernel(inline=True)
def padded_length(count):
    """Return `padded`, in compiled code."""
    return (count + WIDTH - 1) // WIDTH * WIDTH + WIDTH


@dataclass(frozen=True)
class CanonicalBodies(Form):
    """The form of a variational partitioned Runge–Kutta method of up to eight stages for bodies on which terms of any
    kind act, and forces.

    forces : how many forces without a Lagrangian there are
    """

    tableau: SymplecticTableau
    forces: int = 0

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": prepare,
        "step": step,
        "step_particles": step_particles,
        "width": 1,
    }

    def coefficients(self, h: float, before: float) -> Array:
        """Return (ROWS, 8) for steps of h; lanes past the last stage repeat it with weight 0.

        h c is a pair of doubled precision: what the weights h b and mu_bar, which are rounded, make of it.
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
        """What `Stages` holds."""
        rows = padded(size)
        return 2 * rows + 4 * rows // WIDTH, WIDTH

    def carry_rows(self, size: int) -> int:
        """The velocities of the stages of the step before; two rows for what each force did."""
        return padded(size) + 2 * self.forces

    @property
    def particle_carry_rows(self) -> int:
        """The velocities of the stages of the step before, of each particle."""
        return 3

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """What `Work` holds."""
        rows = padded(size)
        return 6 * rows + 8 * rows // WIDTH, WIDTH

    def forget(self, carry: Array) -> None:
        """Take away the velocities of the stages; what forces did stays."""
        carry[: len(carry) - 2 * self.forces] = 0.0

    def accounts(self, carry: Array) -> Array:
        """Return what each force did up to here, (forces, 7): work, torque and impulse, times G."""
        books = carry[len(carry) - 2 * self.forces :].reshape(self.forces, 2, WIDTH)
        return np.asarray(books.sum(axis=1)[:, :FIGURES])


def _weights(tableau: SymplecticTableau, h: float) -> Array:
    """Return h b, (s,), so rounded that they sum to h where this is possible: a body that nothing pulls then keeps
    its velocity to the last bit, in the positions too.
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
