"""Gauss: the variational partitioned Runge–Kutta method of collocation at Gauss nodes, order 2s.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, Q'_i),   extremized under   q+ = q + h sum_i b_i Q'_i

For a separable Lagrangian, q'' = g(q), with L_i = h b_i g(Q_i):

    Q_i = q + h c_i v + h sum_j eta_ij L_j,     eta_ij = (A^2)_ij / b_j
    v+  = v + sum_i L_i,     q+ = q + h v + h sum_i (1 - c_i) L_i

The stages are the lanes of one register. They are iterated, each component, until the largest change stops falling: to
the round-off floor, with no tolerance. The iteration starts from the collocation polynomial of the step before.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3, VI.6.3, VIII.6; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError
from orbits.integrators.base import (
    MOMENTUM_MAPS,
    NOT_CONVERGED,
    NOT_FINITE,
    OK,
    SYMMETRIC,
    SYMPLECTIC,
    Array,
    Integrator,
    padded,
)
from orbits.kernels.binding import accelerate, field
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
from orbits.kernels.summation import add_compensated, compensated_row_sums, two_product, two_sum
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux.gauss import gauss

# Rows of the coefficients.
_HC, _HC_LO, _HB, _REST, _ETA, _START = 0, 1, 2, 3, 4, 12


@kernel(inline=True)
def _combine(coefficients, first, rows, k):
    """Return sum_j column_j * rows[k, j] for the eight columns of coefficients from `first` on."""
    even = load(coefficients, first) * rows[k, 0]
    odd = load(coefficients, first + 1) * rows[k, 1]
    for j in range(2, WIDTH, 2):
        even = even + load(coefficients, first + j) * rows[k, j]
        odd = odd + load(coefficients, first + j + 1) * rows[k, j + 1]
    return even + odd


@kernel(inline=True)
def _moved(h, q, q_lo, v, v_lo, drift):
    """Return (q, q_lo) + h (v, v_lo) + drift, drift being of the size of h v."""
    p, e = two_product(v, h)
    s, f = two_sum(p, fma(v_lo, h, e + drift))
    return add_compensated(q, q_lo + f, s)


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, steps):
    """March the massive bodies by `steps` steps of h; `memory` holds L of the step before, zeros for a cold start.

    Returns (status, steps done, body, evaluations). A step that fails changes nothing.
    """
    bodies = parameters.shape[0] - 1
    size = 3 * bodies
    blocks = (size + WIDTH - 1) // WIDTH
    rows = WIDTH * blocks
    base, change, history, L = work[:rows], work[rows : 2 * rows], work[2 * rows : 2 * rows + 3 * blocks], memory
    hc, hc_lo = load(coefficients, _HC), load(coefficients, _HC_LO)
    hb, rest = load(coefficients, _HB), load(coefficients, _REST)
    evaluations = 0
    for step in range(steps):
        Q = field_record[step % field_record.shape[0]]
        for k in range(size):
            # Sum the increments first: q is O(30 au), what moves it is O(1e-3 au).
            increment = fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k])
            store(base, k, increment)
            store(Q, k, q[k] + (increment + h * _combine(coefficients, _START, L, k)))
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
                last = patience == 0 or settled(history, blocks, NEAR_FLOOR)
            iteration += 1
            if iteration == LIMIT:
                break
            for k in range(size):
                store(Q, k, q[k] + (load(base, k) + h * _combine(coefficients, _ETA, L, k)))
        if not settled(history, blocks, CONVERGED):
            body = unsettled_body(history, blocks, bodies, CONVERGED)
            if body >= 0:
                return NOT_CONVERGED, step, body, evaluations

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
            x, x_rest = _moved(h, load(q, k), load(q_lo, k), v_now, v_rest, h * load(history, blocks + block))
            store(q, k, x)
            store(q_lo, k, x_rest)
            v_now, v_rest = add_compensated(v_now, v_rest + load(base, block), load(history, block))
            store(v, k, v_now)
            store(v_lo, k, v_rest)
    return OK, steps, 0, evaluations


@kernel
def advance_particles(
    tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, steps, start, stop
):
    """March particles start ... stop - 1, one at a time, through the stages that the massive bodies went through.

    q, q_lo, v, v_lo : (3, padded); memory : (particles, 3, 8), L of the step before
    Returns (status, steps done by the particle that failed, particle, evaluations).
    """
    hc, hc_lo = load(coefficients, _HC), load(coefficients, _HC_LO)
    hb, rest = load(coefficients, _HB), load(coefficients, _REST)
    evaluations = 0
    for particle in range(start, stop):
        L = memory[particle]
        for step in range(steps):
            sources = field_record[step]
            for k in range(3):
                position, speed = q[k, particle], v[k, particle]
                increment = fma(hc, full(speed), hc_lo * speed + hc * v_lo[k, particle] + q_lo[k, particle])
                store(work, k, increment)
                store(work, 3 + k, position + (increment + h * _combine(coefficients, _START, L, k)))
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
                x = q[0, particle] + (load(work, 0) + h * _combine(coefficients, _ETA, L, 0))
                y = q[1, particle] + (load(work, 1) + h * _combine(coefficients, _ETA, L, 1))
                z = q[2, particle] + (load(work, 2) + h * _combine(coefficients, _ETA, L, 2))
            if not least <= CONVERGED * scale:
                return NOT_CONVERGED, step, particle, evaluations
            kicks = (total(lx), total(ly), total(lz))
            drifts = (total(rest * lx), total(rest * ly), total(rest * lz))
            if (kicks[0] + kicks[1] + kicks[2] + drifts[0] + drifts[1] + drifts[2]) * 0.0 != 0.0:
                return NOT_FINITE, step, particle, evaluations
            for k in range(3):
                speed, speed_lo = v[k, particle], v_lo[k, particle]
                q[k, particle], q_lo[k, particle] = _moved(
                    h, q[k, particle], q_lo[k, particle], speed, speed_lo, h * drifts[k]
                )
                v[k, particle], v_lo[k, particle] = add_compensated(speed, speed_lo, kicks[k])
    return OK, steps, 0, evaluations


@dataclass(frozen=True)
class Gauss(Integrator):
    """Gauss collocation with 1 ... 8 stages, order 2s: the method of choice when accuracy matters.

    stages : s; 8 stages (order 16) fill one register. Fewer save nothing: a step is evaluated for eight lanes all the
        same, and its iteration starts from a poorer guess

    Implicit, symplectic, symmetric; keeps linear and angular momentum to round-off. With 8 stages, 15 steps
    for a nearly circular orbit leave nothing but round-off; eccentric ones want more. A step whose iteration does not
    converge is an error, never a result.
    """

    stages: int = 8

    name: ClassVar[str] = "gauss"
    summary: ClassVar[str] = "Gauss collocation: variational, implicit, order 2s, to the round-off floor"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. II.1.3, VIII.6; Marsden & West (2001), sec. 2.6"
    advance: ClassVar[Any] = staticmethod(advance)
    advance_particles: ClassVar[Any] = staticmethod(advance_particles)

    def __post_init__(self) -> None:
        if not isinstance(self.stages, int) or isinstance(self.stages, bool) or not 1 <= self.stages <= WIDTH:
            raise InputError(f"Gauss needs stages between 1 and {WIDTH}, got {self.stages!r}; use e.g. Gauss(stages=8)")

    @property
    def order(self) -> int:
        """Order of convergence: twice the number of stages."""
        return 2 * self.stages

    def coefficients(self, h: float) -> Array:
        """Return the tableau for steps of h in lanes; lanes past the last stage repeat it with weight 0."""
        t = gauss(self.stages)
        s = self.stages
        lane = np.minimum(np.arange(WIDTH), s - 1)
        out = np.zeros((_START + WIDTH, WIDTH))
        hc = h * t.c
        out[_HC] = hc[lane]
        rounding = [float(Fraction(h) * Fraction(c) - Fraction(p)) for c, p in zip(t.c, hc, strict=True)]
        out[_HC_LO] = np.array(rounding)[lane]
        out[_HB, :s] = h * t.b
        out[_REST] = t.one_minus_c[lane]
        out[_ETA : _ETA + s] = t.eta[lane].T
        out[_START : _START + s] = (t.eta @ t.extrapolation)[lane].T
        return out

    def field_shape(self, bodies: int) -> tuple[int, int]:
        """One row of eight stages for each coordinate."""
        return padded(3 * bodies), WIDTH

    def memory_rows(self, bodies: int) -> int:
        """L of the step before, one row for each coordinate."""
        return padded(3 * bodies)

    @property
    def particle_memory_rows(self) -> int:
        """L of the step before, one row for each coordinate."""
        return 3

    def work_shape(self, bodies: int) -> tuple[int, int]:
        """Increments and changes of each coordinate, and three numbers of history for each."""
        return 2 * padded(3 * bodies) + 3 * padded(3 * bodies) // WIDTH, WIDTH
