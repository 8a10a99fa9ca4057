"""Variational partitioned Runge–Kutta methods for separable Lagrangians, q'' = g(q), in their second-order form.

With L_i = h b_i g(Q_i), and the velocities of the stages eliminated:

    Q_i = q + h c_i v + h sum_j eta_ij L_j,     eta_ij = (A A_bar)_ij / b_j
    v+  = v + sum_i L_i,     q+ = q + h v + h sum_i (1 - c_i) L_i

The stages of a coordinate are in the lanes of R registers: an array of stages has R blocks of rows, one for each
register. Each component is iterated until its largest change stops falling: to the round-off floor, without a
tolerance. The iteration starts from the polynomial through the stages of the previous step.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3, VI.6.3, VIII.6; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numba.extending import overload

from orbits.integrators.collocation_end import finish
from orbits.integrators.collocation_rows import (
    BARYCENTRIC,
    ETA,
    HB,
    HC,
    HC_LO,
    LAST,
    NODES,
    REST,
    WEIGHTS,
    columns,
    combine,
    is_close,
    layers,
    registers,
)
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.binding import (
    OPTIONS,
    accelerate,
    accelerate_close,
    bodies,
    dimension,
    field,
    field_close,
    gross_attraction,
    gross_field,
    kernel_of,
)
from orbits.kernels.compile import kernel
from orbits.kernels.dense import weights as dense_weights
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
    unsettled_coordinate,
    unsettled_part,
)
from orbits.kernels.lanes import (
    WIDTH,
    fma,
    full,
    largest,
    load,
    maximum,
    row_maxima,
    row_sums,
    select,
    store,
    total,
    unit,
)
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK, Particles
from orbits.kernels.summation import add_compensated, two_product, two_sum
from orbits.tableaux import SymplecticTableau
from orbits.tableaux.symplectic import FAR

RESOLVED = 3e-10
"""The last Legendre coefficient of the forces, times h, as a fraction of the position of a body, up to which their
polynomial serves for dense output; it leaves errors of 2e-14 of the position."""

ROUNDED = 1e-12
"""The rounding errors of integrals of up to 32 Lagrange polynomials, which are below 1."""

CANCELLED = 1e-6
"""The share of the attractions on a body below which their sum does not count as its force."""


TINY = 1e-300
"""Divides where there is no force, without dividing by zero."""


def place(method, Q, at, lows, x, increment):
    """Write the position x + increment of eight stages into row `at`, and its low part, if any, `lows` rows later."""
    raise NotImplementedError("place() is for compiled code only")


@overload(place, jit_options=OPTIONS)
def _place(method, Q, at, lows, x, increment):
    if not is_close(method):
        return lambda method, Q, at, lows, x, increment: store(Q, at, x + increment)

    def with_low_part(method, Q, at, lows, x, increment):
        position, low = two_sum(full(x), increment)
        store(Q, at, position)
        store(Q, at + lows, low)

    return with_low_part


def attract(method, model, Q, r, block, lows, out):
    """Write the accelerations at the stages of register r."""
    raise NotImplementedError("attract() is for compiled code only")


@overload(attract, jit_options=OPTIONS)
def _attract(method, model, Q, r, block, lows, out):
    if is_close(method):
        return lambda method, model, Q, r, block, lows, out: accelerate_close(
            model.tag,
            model.parameters,
            Q[r * block : (r + 1) * block],
            Q[lows + r * block : lows + (r + 1) * block],
            out,
        )
    if kernel_of(method.types[0], "registers") == 1:
        return lambda method, model, Q, r, block, lows, out: accelerate(model.tag, model.parameters, Q, out)
    return lambda method, model, Q, r, block, lows, out: accelerate(
        model.tag, model.parameters, Q[r * block : (r + 1) * block], out
    )


def pull(method, model, stages, r, block, lows, Q):
    """Return the acceleration of a particle at its stages of register r; with low parts, also write their rates into
    row 6 R + r of Q.

    Q : 3 R rows of positions, and their low parts, if any
    """
    raise NotImplementedError("pull() is for compiled code only")


@overload(pull, jit_options=OPTIONS)
def _pull(method, model, stages, r, block, lows, Q):
    if not is_close(method):

        def plain(method, model, stages, r, block, lows, Q):
            sources = stages if registers(method) == 1 else stages[r * block : (r + 1) * block]
            return field(
                model.tag, model.parameters, sources, load(Q, 3 * r), load(Q, 3 * r + 1), load(Q, 3 * r + 2)
            )

        return plain

    def with_low_parts(method, model, stages, r, block, lows, Q):
        sources, rest = stages[r * block : (r + 1) * block], stages[lows + r * block : lows + (r + 1) * block]
        low = 3 * registers(method) + 3 * r
        x, y, z, rate = field_close(
            model.tag,
            model.parameters,
            sources,
            rest,
            (load(Q, 3 * r), load(Q, 3 * r + 1), load(Q, 3 * r + 2)),
            (load(Q, low), load(Q, low + 1), load(Q, low + 2)),
        )
        store(Q, 6 * registers(method) + r, rate)
        return x, y, z

    return with_low_parts


def is_round_off(method, model, h, stages, lows, Q, change):
    """Return whether a change of L is round-off of attractions on a particle that cancel; with low parts only, and for
    one register.
    """
    raise NotImplementedError("is_round_off() is for compiled code only")


@overload(is_round_off, jit_options=OPTIONS)
def _is_round_off(method, model, h, stages, lows, Q, change):
    if not is_close(method):
        return lambda method, model, h, stages, lows, Q, change: False

    def with_low_parts(method, model, h, stages, lows, Q, change):
        pulls = gross_field(model.tag, model.parameters, stages[:lows], load(Q, 0), load(Q, 1), load(Q, 2))
        return change <= TIGHT * abs(h) * largest(pulls)

    return with_low_parts


@kernel(inline=True)
def moved(h, q, q_lo, v, v_lo, drift):
    """Return (q, q_lo) + h (v, v_lo) + drift, where drift has the size of h v."""
    p, e = two_product(v, h)
    s, f = two_sum(p, fma(v_lo, h, e + drift))
    return add_compensated(q, q_lo + f, s)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.carry` holds L of the previous step, or zeros for a cold start."""
    R, coefficients = registers(method), method.coefficients
    q, q_lo, v, v_lo = state
    size, count = dimension(model.tag, model.parameters), bodies(model.tag, model.parameters)
    parts = count if count > 0 else size  # what is to converge: each body, or each coordinate
    blocks, rows = (parts + WIDTH - 1) // WIDTH, WIDTH * ((size + WIDTH - 1) // WIDTH)
    L, Q, scratch = storage.carry, storage.stages, storage.scratch
    block = Q.shape[0] // (R * layers(method))
    lows, start = R * block, ETA + WIDTH * R
    g, change, history = scratch[:rows], scratch[rows : 2 * rows], scratch[2 * rows : 2 * rows + 3 * blocks]
    base = scratch[2 * rows + 3 * blocks :]
    for i in range(parts, WIDTH * blocks):
        store(change, i, full(0.0))
    evaluations = 0
    for r in range(R):
        table = coefficients[r]
        hc, hc_lo, continued = load(table, HC), load(table, HC_LO), columns(method, table, start)
        for k in range(size):
            # Sum the increments first: q is O(30 au), dq is O(1e-3 au).
            increment = fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k])
            store(base, r * block + k, increment)
            place(method, Q, r * block + k, lows, q[k], increment + h * combine(continued, R, table, L, block, k))
    iteration, patience, last = 0, PATIENCE, False
    while True:
        for r in range(R):
            attract(method, model, Q, r, block, lows, g)
            hb = load(coefficients[r], HB)
            for i in range(parts):
                most = full(0.0) if r == 0 else load(change, i)
                for k in range(i, size, parts):
                    new = hb * load(g, k)
                    most = maximum(most, abs(new) if iteration == 0 else abs(new - load(L, r * block + k)))
                    store(L, r * block + k, new)
                store(change, i, most)
        evaluations += 1
        if iteration == 0:
            begin(change, history, blocks)
        elif not falling(change, history, blocks):
            patience -= 1
            last = patience == 0 or settled(history, blocks, NEAR_FLOOR if count > 0 else FLOOR)
        iteration += 1
        if last or iteration == LIMIT:
            break
        for r in range(R):
            table = coefficients[r]
            eta = columns(method, table, ETA)
            for k in range(size):
                moved_by = load(base, r * block + k) + h * combine(eta, R, table, L, block, k)
                place(method, Q, r * block + k, lows, q[k], moved_by)
    if count > 0 and not settled(history, blocks, CONVERGED):
        return NOT_CONVERGED, unsettled_part(history, blocks, count, CONVERGED), evaluations
    if count == 0:
        where = unsettled_coordinate(history, blocks, size, TIGHT, FLOOR)
        if where >= 0:
            return NOT_CONVERGED, where, evaluations
    return finish(method, model, h, state, storage), 0, evaluations + 1


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of one particle through the stages of the massive bodies.

    carry : (3 R, 8), L of the previous step. A step that fails returns the particle unchanged.
    """
    R, coefficients = registers(method), method.coefficients
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    L, scratch, stages = carry, storage.scratch, storage.stages
    block = stages.shape[0] // (R * layers(method))
    lows, start = R * block, ETA + WIDTH * R
    base, Q = scratch, scratch[3 * R :]
    for r in range(R):
        table = coefficients[r]
        hc, hc_lo = load(table, HC), load(table, HC_LO)
        continued = columns(method, table, start)
        x_base = fma(hc, full(vx), hc_lo * vx + hc * vx_lo + x_lo)
        y_base = fma(hc, full(vy), hc_lo * vy + hc * vy_lo + y_lo)
        z_base = fma(hc, full(vz), hc_lo * vz + hc * vz_lo + z_lo)
        store(base, 3 * r, x_base)
        store(base, 3 * r + 1, y_base)
        store(base, 3 * r + 2, z_base)
        place(method, Q, 3 * r, 3 * R, x, x_base + h * combine(continued, R, table, L, 3, 0))
        place(method, Q, 3 * r + 1, 3 * R, y, y_base + h * combine(continued, R, table, L, 3, 1))
        place(method, Q, 3 * r + 2, 3 * R, z, z_base + h * combine(continued, R, table, L, 3, 2))
    least = last_change = scale = 0.0
    iteration, patience, last, evaluations = 0, PATIENCE, False, 0
    while True:
        now = size = 0.0
        for r in range(R):
            ax, ay, az = pull(method, model, stages, r, block, lows, Q)
            hb = load(coefficients[r], HB)
            lx, ly, lz = hb * ax, hb * ay, hb * az
            off = abs(lx - load(L, 3 * r)) + abs(ly - load(L, 3 * r + 1)) + abs(lz - load(L, 3 * r + 2))
            now = max(now, largest(off))
            if iteration == 0:
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
            eta = columns(method, table, ETA)
            moved_by = load(base, 3 * r) + h * combine(eta, R, table, L, 3, 0)
            place(method, Q, 3 * r, 3 * R, x, moved_by)
            moved_by = load(base, 3 * r + 1) + h * combine(eta, R, table, L, 3, 1)
            place(method, Q, 3 * r + 1, 3 * R, y, moved_by)
            moved_by = load(base, 3 * r + 2) + h * combine(eta, R, table, L, 3, 2)
            place(method, Q, 3 * r + 2, 3 * R, z, moved_by)
    if not (least <= CONVERGED * scale or is_round_off(method, model, h, stages, lows, Q, least)):
        return particles, carry, NOT_CONVERGED, evaluations
    x_kick, x_kick_lo, x_drift = _sums(coefficients, R, L, 0)
    y_kick, y_kick_lo, y_drift = _sums(coefficients, R, L, 1)
    z_kick, z_kick_lo, z_drift = _sums(coefficients, R, L, 2)
    if (x_kick + y_kick + z_kick + x_drift + y_drift + z_drift) * 0.0 != 0.0:
        return particles, carry, NOT_FINITE, evaluations
    x, x_lo = moved(h, x, x_lo, vx, vx_lo, h * x_drift)
    y, y_lo = moved(h, y, y_lo, vy, vy_lo, h * y_drift)
    z, z_lo = moved(h, z, z_lo, vz, vz_lo, h * z_drift)
    vx, vx_lo = add_compensated(vx, vx_lo + x_kick_lo, x_kick)
    vy, vy_lo = add_compensated(vy, vy_lo + y_kick_lo, y_kick)
    vz, vz_lo = add_compensated(vz, vz_lo + z_kick_lo, z_kick)
    return Particles(x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo), carry, OK, evaluations


@kernel(inline=True)
def _sums(coefficients, R, L, k):
    """Return sum_i L_i as a pair, and sum_i (1 - c_i) L_i, of component k of a particle."""
    own = load(L, k)
    kick, kick_lo, drift = total(own), 0.0, total(load(coefficients[0], REST) * own)
    for r in range(1, R):
        own = load(L, 3 * r + k)
        kick, lost = two_sum(kick, total(own))
        kick_lo += lost
        drift += total(load(coefficients[r], REST) * own)
    return kick, kick_lo, drift


@kernel
def prepare(method, h, before, storage):
    """Write `Collocation.coefficients` for a step of h that follows one of `before`; for one register."""
    table = method.coefficients[0]
    ells = storage.scratch[storage.scratch.shape[0] - WIDTH :]  # after the increments of the last coordinate
    nodes, weights = load(table, NODES), load(table, WEIGHTS)
    ratio = h / before
    hc = h * nodes
    store(table, HC, hc)
    store(table, HC_LO, fma(nodes, full(h), -hc))
    store(table, HB, h * weights)
    scaled = ratio * weights
    if abs(ratio) > FAR:  # a polynomial is useless far from its nodes
        for j in range(WIDTH):
            store(ells, j, ratio * unit(j))
    else:
        # The Lagrange polynomials of the nodes of the step before: products of all factors but one.
        ahead = 1.0 + ratio * nodes
        f0, f1, f2 = _factor(table, ahead, 0), _factor(table, ahead, 1), _factor(table, ahead, 2)
        f3, f4, f5 = _factor(table, ahead, 3), _factor(table, ahead, 4), _factor(table, ahead, 5)
        f6, f7 = _factor(table, ahead, 6), _factor(table, ahead, 7)
        first, second = (f0 * f1) * (f2 * f3), (f4 * f5) * (f6 * f7)
        rest0, rest1, rest2, rest3 = (f2 * f3) * second, (f0 * f1) * second, (f6 * f7) * first, (f4 * f5) * first
        store(ells, 0, (table[BARYCENTRIC, 0] * scaled) * (f1 * rest0))
        store(ells, 1, (table[BARYCENTRIC, 1] * scaled) * (f0 * rest0))
        store(ells, 2, (table[BARYCENTRIC, 2] * scaled) * (f3 * rest1))
        store(ells, 3, (table[BARYCENTRIC, 3] * scaled) * (f2 * rest1))
        store(ells, 4, (table[BARYCENTRIC, 4] * scaled) * (f5 * rest2))
        store(ells, 5, (table[BARYCENTRIC, 5] * scaled) * (f4 * rest2))
        store(ells, 6, (table[BARYCENTRIC, 6] * scaled) * (f7 * rest3))
        store(ells, 7, (table[BARYCENTRIC, 7] * scaled) * (f6 * rest3))
    eta = columns(method, table, ETA)
    for j in range(WIDTH):
        store(table, ETA + WIDTH + j, combine(eta, 1, table, ells, 0, j))


@kernel(inline=True)
def _factor(table, x, j):
    """Return x - c_j, or 1 past the last stage."""
    return x - table[NODES, j] if table[WEIGHTS, j] != 0.0 else full(1.0)


@kernel
def signal(method, model, h, state, storage):
    """Return the last Legendre coefficient of the forces on a body in the step of h just taken, as a fraction of the
    largest force on it; the maximum over all bodies. For one register.

    Where attractions cancel, the force that remains is round-off: no force counts as less than `CANCELLED` of the sum
    of their magnitudes.
    """
    table, L, scratch = method.coefficients[0], storage.carry, storage.scratch
    size, count = dimension(model.tag, model.parameters), bodies(model.tag, model.parameters)
    blocks = (size + WIDTH - 1) // WIDTH
    rows = WIDTH * blocks
    last, weights = load(table, LAST), load(table, WEIGHTS)
    inverse = select(weights > 0.0, 1.0 / weights, full(0.0))
    sums, sizes = scratch[rows : rows + blocks], scratch[rows + blocks : rows + 2 * blocks]
    products, room = scratch[:rows], scratch[rows + 2 * blocks :]
    for k in range(size):
        store(products, k, last * load(L, k))
    for i in range(count):
        most = abs(inverse * load(L, i))
        store(room, i, maximum(most, maximum(abs(inverse * load(L, count + i)), abs(inverse * load(L, 2 * count + i)))))
    for b in range(blocks):
        store(sums, b, abs(row_sums(products, WIDTH * b)))
    for b in range((count + WIDTH - 1) // WIDTH):
        store(sizes, b, row_maxima(room, WIDTH * b))
    worst, judge = 0.0, -1
    for i in range(count):
        ratio = _last_of(sums, count, i) / max(sizes[i >> 3, i & 7], TINY)
        if ratio > worst:
            worst, judge = ratio, i
    if judge < 0 or sizes[judge >> 3, judge & 7] >= _floor(model, h, state, judge):
        return worst
    worst = 0.0
    for i in range(count):
        worst = max(worst, _last_of(sums, count, i) / max(sizes[i >> 3, i & 7], _floor(model, h, state, i)))
    return worst


@kernel(inline=True)
def _last_of(sums, count, i):
    """Return the last Legendre coefficient of body i, the largest of three components in consecutive elements."""
    y, z = count + i, 2 * count + i
    return max(sums[i >> 3, i & 7], max(sums[y >> 3, y & 7], sums[z >> 3, z & 7]))


@kernel(inline=True)
def _floor(model, h, state, i):
    """Return the least kick that counts as the force on body i."""
    return max(CANCELLED * abs(h) * gross_attraction(model.tag, model.parameters, state.q, i), TINY)


@kernel(inline=True)
def dense(method, h, q, v, kicks, theta, out_q, out_v):
    """Write q and v at a fraction of a step, from the polynomial through the forces at its stages.

    q, v : at the beginning of the step; kicks : its L. See `orbits.kernels.dense`.
    """
    R, coefficients, size = registers(method), method.coefficients, out_q.shape[0]
    block, first, part = kicks.shape[0] // R, ETA + 2 * WIDTH * R, theta * h
    for r in range(R):
        once, twice = dense_weights(coefficients[r], first, WIDTH * R, theta)
        for k in range(size):
            L = load(kicks, r * block + k)
            if r == 0:
                out_v[k], out_q[k] = 0.0, 0.0
            out_v[k] += total(once * L)
            out_q[k] += total(twice * L)
    for k in range(size):
        out_q[k] = q[k] + fma(part, v[k], h * out_q[k])
        out_v[k] += v[k]


@kernel(inline=True)
def resolves(method, h, q, kicks, bodies):
    """Return whether the polynomial through the forces leaves hardly more than round-off in the position of each body:
    about 1e-4 of h times their last Legendre coefficient.
    """
    R, coefficients = registers(method), method.coefficients
    block = kicks.shape[0] // R
    for i in range(bodies):
        off = size = 0.0
        for k in range(i, 3 * bodies, bodies):
            last = 0.0
            for r in range(R):
                last += total(load(coefficients[r], LAST) * load(kicks, r * block + k))
            off, size = max(off, abs(last)), max(size, abs(q[k]))
        if not abs(h) * off <= RESOLVED * size:
            return False
    return True


@kernel(inline=True)
def stretch(method, unit, factor):
    """Write the coefficients of steps `factor` times as long, for a cold start."""
    for r in range(registers(method)):
        table, base = method.coefficients[r], unit.coefficients[r]
        c, hc = load(base, HC), factor * load(base, HC)
        store(table, HC, hc)
        store(table, HC_LO, fma(c, full(factor), -hc) + factor * load(base, HC_LO))
        store(table, HB, factor * load(base, HB))


@dataclass(frozen=True)
class Collocation(Form):
    """The second-order form of a variational partitioned Runge–Kutta method, for separable Lagrangians.

    close : whether the positions of the stages have low parts, so that the distances of close bodies keep their digits
    """

    tableau: SymplecticTableau
    close: bool = False

    kernels: ClassVar[Mapping[str, Any]] = {
        "step": step,
        "step_particles": step_particles,
        "prepare": prepare,
        "signal": signal,
        "dense": dense,
        "resolves": resolves,
        "stretch": stretch,
        "width": 1,
    }

    @property
    def registers(self) -> int:
        """The number of registers of eight for the stages of a coordinate."""
        return (self.tableau.stages + WIDTH - 1) // WIDTH

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels for this number of registers."""
        return {**self.kernels, "registers": self.registers, "close": int(self.close)}

    def coefficients(self, h: float, before: float) -> Array:
        """Return (R, 8 + 24 R, 8) for steps of h; lanes past the last stage repeat it with weight 0.

        h c is a pair in doubled precision; eta is not scaled, because h eta would be rounded once more.
        """
        out = _table(self.tableau, self.registers, h / before).copy()
        out[:, HC], out[:, HC_LO] = _product(h, out[:, NODES])
        out[:, HB] = h * out[:, WEIGHTS]
        return out

    @property
    def is_dense(self) -> bool:
        """Whether the stages are those of collocation, as for Gauss: where the polynomial through their forces resolves
        the motion, they lie on it.
        """
        return _collocates(self.tableau)

    def stages_shape(self, size: int) -> tuple[int, int]:
        """One row of eight stages for each coordinate and register, and for its low part."""
        return (1 + self.close) * self.registers * padded(size), WIDTH

    def carry_rows(self, size: int) -> int:
        """The kicks of the stages of the previous step, one row for each coordinate and register."""
        return self.registers * padded(size)

    @property
    def particle_carry_rows(self) -> int:
        """The same for each particle."""
        return 3 * self.registers

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """Increments and changes of each coordinate, its history of three numbers, and low parts for the last sweep."""
        rows = padded(size)
        own = (10 if self.close else 6) * self.registers  # of a particle: increments, stages, low parts and rates
        return max((self.registers + 6) * rows + 3 * rows // WIDTH, own), WIDTH


SPLITTER = 2.0**27 + 1.0
"""Splits a float into two of 26 bits."""


def _product(h: float, c: Array) -> tuple[Array, Array]:
    """Return h c and its rounding error, of numbers c in [0, 1]. Source: Dekker (1971)."""
    part, exponent = math.frexp(h)  # so that nothing overflows
    product = part * c
    c_high, part_high = SPLITTER * c - (SPLITTER * c - c), SPLITTER * part - (SPLITTER * part - part)
    c_low, part_low = c - c_high, part - part_high
    error = part_low * c_low - (((product - part_high * c_high) - part_low * c_high) - part_high * c_low)
    return np.ldexp(product, exponent), np.ldexp(error, exponent) + 0.0


@lru_cache(maxsize=64)
def _table(tableau: SymplecticTableau, count: int, ratio: float) -> Array:
    """Return the coefficients of steps `ratio` times as long as the one before, in `count` registers, without those
    that depend on the length itself.
    """
    s = tableau.stages
    lane = np.minimum(np.arange(WIDTH * count), s - 1)
    out = np.zeros((count, ETA + 3 * WIDTH * count, WIDTH))
    weights = np.zeros(WIDTH * count)
    weights[:s] = tableau.b
    ahead = ratio * tableau.b[:, None] * tableau.continued(ratio) / tableau.b[None, :]
    start = tableau.eta @ ahead
    apart = tableau.nodes[:, None] - tableau.nodes[None, :] + np.eye(s)
    with np.errstate(divide="ignore"):  # coinciding nodes, through which there is no polynomial
        barycentric = 1.0 / apart.prod(axis=1)
    legendre = np.zeros((s, s))
    if np.isfinite(barycentric).all():
        values = np.polynomial.legendre.legvander(2.0 * tableau.nodes - 1.0, s - 1)
        legendre = np.linalg.inv(values) / tableau.b
    last = (2 * s - 1) * np.polynomial.legendre.legval(2.0 * tableau.nodes - 1.0, np.eye(s)[-1])
    for r in range(count):
        own = slice(WIDTH * r, WIDTH * (r + 1))
        out[r, REST] = tableau.one_minus_nodes[lane[own]]
        out[r, NODES], out[r, WEIGHTS] = tableau.nodes[lane[own]], weights[own]
        out[r, BARYCENTRIC, : len(barycentric[own])] = barycentric[own] / tableau.b[own]
        out[r, LAST, : len(last[own])] = last[own]
        out[r, ETA : ETA + s] = tableau.eta[lane[own]].T
        out[r, ETA + WIDTH * count : ETA + WIDTH * count + s] = start[lane[own]].T
        out[r, ETA + 2 * WIDTH * count : ETA + 2 * WIDTH * count + s, : len(last[own])] = legendre[:, own]
    return out


@lru_cache(maxsize=256)
def _collocates(tableau: SymplecticTableau) -> bool:
    """Return whether eta b = a a, where a_ij is the integral up to c_i of the Lagrange polynomial of c_j."""
    s, x = tableau.stages, 2.0 * tableau.nodes - 1.0
    if len(set(x.tolist())) < s:
        return False
    integrals = np.stack([np.polynomial.legendre.legint(one, lbnd=-1, scl=0.5) for one in np.eye(s)], axis=1)
    values = np.polynomial.legendre.legvander(x, s - 1)
    a = np.polynomial.legendre.legval(x, integrals).T @ np.linalg.inv(values)
    return bool(np.abs(tableau.eta * tableau.b - a @ a).max() < ROUNDED)
