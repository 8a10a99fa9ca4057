"""RATTLE's step: kick, drift and kick for a separable Lagrangian with constraints g(q) = 0.

With a(q) = M^-1 dL/dq, the gradients G of the constraints and W = G M^-1, from q and v with g(q) = 0, G(q) v = 0:

    w = v + h/2 a(q) - W(q)^T s / h,     q+ = q + h w     with s from g(q+) = 0
    v+ = w + h/2 a(q+) - W(q+)^T u                        with u from G(q+) v+ = 0

s is found by Newton's method to the round-off floor. There may be several solutions, as a line meets a circle twice.
The one that belongs to the step is that which h = 0 leads to: along it G(q+) W(q)^T, which is positive definite for
h = 0, keeps a positive determinant and diagonal. Others are not taken.

Source: Andersen (1983); Leimkuhler & Skeel (1994); Hairer, Lubich & Wanner (2006), sec. VII.1.4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from orbits.integrators.forms import Form, padded
from orbits.kernels.binding import accelerate, dimension
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.constraints import constraint_count, constraints
from orbits.kernels.state import copy, drift, kick
from orbits.kernels.steps import NO_MULTIPLIERS, OK, State
from orbits.kernels.sums.linear_equations import factorize, solve

SWEEPS = 40
"""Sweeps of Newton's method after which a step fails; four to six are taken."""

FLOOR, NEAR_FLOOR = 2.0**-52, 2.0**-36
"""Changes of positions, relative to the largest coordinate, that are lost in rounding; those that are rounding errors
once they have stopped falling."""

class Work(NamedTuple):
    """The scratch of a step: vectors of d coordinates, padded, or of m <= d numbers.

    force, trial, impulse : accelerations; positions at which constraints are tried; W^T s
    change, pivots : of Newton's method
    end : the state at the end of the step
    here, there : g, G and W at the beginning of the step and at its end, see `constraints`
    matrix : (d, padded), of which m x m
    """

    force: Any
    trial: Any
    impulse: Any
    change: Any
    pivots: Any
    end: Any
    here: Any
    there: Any
    matrix: Any


@kernel(inline=True)
def work_in(scratch, d):
    """Return the parts of the scratch by name."""
    at, rows = 9, 1 + 2 * d
    return Work(
        scratch[0],
        scratch[1],
        scratch[2],
        scratch[3],
        scratch[4],
        State(scratch[5], scratch[6], scratch[7], scratch[8]),
        scratch[at : at + rows].reshape(-1),
        scratch[at + rows : at + 2 * rows].reshape(-1),
        scratch[at + 2 * rows : at + 2 * rows + d],
    )


@kernel(inline=True)
def begin(method, model, t, h, state, storage):
    """Compute the force and the constraints at the beginning of the first step."""
    work = work_in(storage.scratch, dimension(model.tag, model.parameters))
    accelerate(model.tag, model.parameters, state.q, work.force)
    constraints(model.tag, model.parameters, state.q, work.here)


@kernel
def normal_matrix(d, m, gradients, directions, matrix):
    """Write G W^T, (m, m), of G in one vector of `constraints` and W in another."""
    G, W = m, m + m * d
    for a in range(m):
        for b in range(m):
            entry = 0.0
            for k in range(d):
                entry += gradients[G + a * d + k] * directions[W + b * d + k]
            matrix[a, b] = entry


@kernel
def keeps_its_sign(matrix, pivots, m):
    """Return whether the determinant of a factorized matrix is positive."""
    positive = True
    for k in range(m):
        if int(pivots[k]) != k:
            positive = not positive
        if matrix[k, k] < 0.0:
            positive = not positive
    return positive


@kernel
def largest(x, d):
    """Return the largest absolute value of the first d elements."""
    most = 0.0
    for k in range(d):
        most = max(most, abs(x[k]))
    return most


@kernel(inline=True)
def multipliers(model, work, d, m):
    """Find W^T s, by which the positions at the end of the step are on the constraints; return whether it was found."""
    q, q_lo = work.end.q, work.end.q_lo
    for k in range(d):
        work.impulse[k] = 0.0
    scale, last = largest(q, d), 1e300
    for _ in range(SWEEPS):
        for k in range(d):
            work.trial[k] = q[k] + (q_lo[k] - work.impulse[k])
        constraints(model.tag, model.parameters, work.trial, work.there)
        normal_matrix(d, m, work.there, work.here, work.matrix)
        positive = True
        for a in range(m):
            positive = positive and work.matrix[a, a] > 0.0
            work.change[a] = work.there[a]
        if not factorize(work.matrix, m, work.pivots):
            return False
        solve(work.matrix, m, work.pivots, work.change)
        size = 0.0
        for k in range(d):
            more = 0.0
            for a in range(m):
                more += work.change[a] * work.here[m + m * d + a * d + k]
            work.impulse[k] += more
            size = max(size, abs(more))
            if more * 0.0 != 0.0:
                return False
        if size <= FLOOR * scale or (size <= NEAR_FLOOR * scale and size >= 0.5 * last):
            return positive and keeps_its_sign(work.matrix, work.pivots, m)
        last = size
    return False


@kernel(inline=True)
def onto_tangents(work, d, m):
    """Remove from the velocities what leads off the constraints at the end; return whether these are independent."""
    v, v_lo = work.end.p, work.end.p_lo
    for a in range(m):
        off = 0.0
        for k in range(d):
            off += work.there[m + a * d + k] * (v[k] + v_lo[k])
        work.change[a] = off
    normal_matrix(d, m, work.there, work.there, work.matrix)
    if not factorize(work.matrix, m, work.pivots):
        return False
    solve(work.matrix, m, work.pivots, work.change)
    for k in range(d):
        more = 0.0
        for a in range(m):
            more += work.change[a] * work.there[m + m * d + a * d + k]
        work.impulse[k] = more
    kick(v, v_lo, -1.0, work.impulse, 0, d)
    return True


@kernel(inline=True)
def copy_state(source, d, out):
    """Copy a state."""
    copy(source.q, 0, d, out.q)
    copy(source.q_lo, 0, d, out.q_lo)
    copy(source.p, 0, d, out.p)
    copy(source.p_lo, 0, d, out.p_lo)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; without a solution the state stays as it is."""
    d, m = dimension(model.tag, model.parameters), constraint_count(model.tag)
    work = work_in(storage.scratch, d)
    end = work.end
    copy_state(state, d, end)
    kick(end.p, end.p_lo, 0.5 * h, work.force, 0, d)
    drift(end.q, end.q_lo, h, end.p, end.p_lo, 0, d)
    if not multipliers(model, work, d, m):
        return NO_MULTIPLIERS, 0, 1
    kick(end.q, end.q_lo, -1.0, work.impulse, 0, d)
    kick(end.p, end.p_lo, -1.0 / h, work.impulse, 0, d)
    accelerate(model.tag, model.parameters, end.q, work.force)
    kick(end.p, end.p_lo, 0.5 * h, work.force, 0, d)
    constraints(model.tag, model.parameters, end.q, work.there)
    if not onto_tangents(work, d, m):
        return NO_MULTIPLIERS, 0, 1
    copy_state(end, d, state)
    for k in range(m + 2 * m * d):
        work.here[k] = work.there[k]
    return OK, 0, 1


@dataclass(frozen=True)
class ConstrainedSplitting(Form):
    """Kick, drift, kick with constraints, in positions and velocities."""

    kernels: ClassVar[Mapping[str, Any]] = {"begin": begin, "step": step}

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Empty: there are no massless particles."""
        return 1, 1

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The size of `Work`."""
        return 9 + 2 * (1 + 2 * size) + size, padded(size)
