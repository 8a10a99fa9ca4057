"""Variational partitioned Runge–Kutta methods for separable Lagrangians, q'' = g(q), in their second-order form.

With L_i = h b_i g(Q_i), and the velocities of the stages eliminated:

    Q_i = q + h c_i v + h sum_j eta_ij L_j,     eta_ij = (A A_bar)_ij / b_j
    v+  = v + sum_i L_i,     q+ = q + h v + h sum_i (1 - c_i) L_i

The stages of a coordinate are in the lanes of R registers: an array of stages has R blocks of rows, one for each
register. The stages of each body, or of each coordinate of other systems, are iterated until their largest change stops
falling: to the round-off floor, without a tolerance. The iteration starts from the polynomial through the stages of the
previous step.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3, VI.6.3, VIII.6; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.collocation.dense_output import dense, resolves, stretch
from orbits.integrators.collocation.end import finish
from orbits.integrators.collocation.lengths import prepare, signal
from orbits.integrators.collocation.particles import step_particles
from orbits.integrators.collocation.rows import (
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
    place,
    registers,
)
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.binding import (
    Tag,
    accelerate,
    accelerate_close,
    bodies,
    dimension,
    kernel_of,
)
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    fma,
    full,
    load,
    maximum,
    store,
)
from orbits.kernels.steps import NOT_CONVERGED
from orbits.kernels.sums.iteration import (
    CONVERGED,
    FLOOR,
    LIMIT,
    NEAR_FLOOR,
    TIGHT,
    solve,
    unsettled_body,
    unsettled_coordinate,
)
from orbits.tableaux import SymplecticTableau

ROUNDED = 1e-12
"""The rounding errors of integrals of up to 32 Lagrange polynomials, which are below 1."""

@verb
def attract(method, model, Q, r, block, lows, out):
    """Write the accelerations at the stages of register r."""
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


@kernel(inline=True)
def sweep(equations, first):
    """Compute the kicks L from the positions Q of the stages, and these from L, in the first sweep of the step before.

    base : R blocks of rows, the increments of the stages without L
    g, change : (rows, 8), the accelerations at the stages of a register, and the changes of L
    """
    method, model, h, q, base, Q, L, g, change = equations
    R, coefficients = registers(method), method.coefficients
    size, count = dimension(model.tag, model.parameters), bodies(model.tag, model.parameters)
    parts = count if count > 0 else size
    block = Q.shape[0] // (R * layers(method))
    lows = R * block
    for r in range(R):
        table = coefficients[r]
        matrix = columns(method, table, ETA + WIDTH * R if first else ETA)
        for k in range(size):
            moved_by = load(base, r * block + k) + h * combine(matrix, R, table, L, block, k)
            place(method, Q, r * block + k, lows, q[k], moved_by)
    for r in range(R):
        attract(method, model, Q, r, block, lows, g)
        hb = load(coefficients[r], HB)
        for i in range(parts):
            most = full(0.0) if r == 0 else load(change, i)
            for k in range(i, size, parts):
                new = hb * load(g, k)
                most = maximum(most, abs(new) if first else abs(new - load(L, r * block + k)))
                store(L, r * block + k, new)
            store(change, i, most)
    return change, True


STAGES = Tag("stages of collocation", {"sweep": sweep})


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
    g, change, history = scratch[:rows], scratch[rows : 2 * rows], scratch[2 * rows : 2 * rows + 3 * blocks]
    base = scratch[2 * rows + 3 * blocks :]
    for i in range(parts, WIDTH * blocks):
        store(change, i, full(0.0))
    for r in range(R):
        hc, hc_lo = load(coefficients[r], HC), load(coefficients[r], HC_LO)
        for k in range(size):
            # Sum the increments first: q is O(30 au), dq is O(1e-3 au).
            store(base, r * block + k, fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k]))
    equations = method, model, h, q, base, Q, L, g, change
    # The last sweep is that of `finish`, in doubled precision.
    _, evaluations, _, _ = solve(STAGES, equations, history, NEAR_FLOOR if count > 0 else FLOOR, False, LIMIT)
    if count > 0:
        where = unsettled_body(history, count, 1, CONVERGED)
    else:
        where = unsettled_coordinate(history, size, TIGHT, FLOOR)
    if where >= 0:
        return NOT_CONVERGED, where, evaluations
    return finish(method, model, h, state, storage), 0, evaluations + 1


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

    @cached_property
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
