"""The discrete boundary-value problem: given both ends, the path that makes the discrete action stationary.

Its equations are the discrete Euler–Lagrange equations at the inner points; Newton's matrix is the second derivative of
the action, block-tridiagonal: D2D2 L_d(q_{k-1}, q_k) + D1D1 L_d(q_k, q_{k+1}) on the diagonal, D1D2 L_d beside it.

Source: Marsden & West (2001), sec. 1.3, 2.4.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number, whole_number
from orbits.discrete.base import Array, DiscreteLagrangian, Jet, time_step
from orbits.discrete.constrained import Constrained, require_constraints_kept
from orbits.discrete.newton import solve
from orbits.discrete.path import points_of
from orbits.errors import InputError
from orbits.lagrangians.base import show

DENSE_UP_TO = 400
"""Largest number of unknowns solved as one dense matrix, with pivoting, which an action without a minimum may need."""


def boundary_value(
    discrete: DiscreteLagrangian,
    q_start: ArrayLike,
    q_end: ArrayLike,
    h: float,
    steps: int,
    guess: ArrayLike | None = None,
    t0: float = 0.0,
) -> Array:
    """Return the path from q_start to q_end in `steps` steps of h that makes the discrete action stationary.

    q_start, q_end : (d,) or (n, 3); the result is (steps + 1, d) or (steps + 1, n, 3), both ends included
    guess : a path of that shape, of which the inner points are used; the straight line by default
    Solved to the round-off floor. There may be several such paths or none; the guess decides which one is found. Raises
    InputError for arguments that do not fit, ConvergenceError if Newton's method fails.
    """
    step, start = time_step(h), finite_number(t0, "t0")
    require_constraints_kept(discrete)
    if isinstance(discrete, Constrained):
        raise InputError(
            f"{discrete.name}: boundary values with constraints are not solved. Expected a Lagrangian without any, "
            "such as one in angles."
        )
    steps = whole_number(steps, "steps")
    shape = np.shape(q_start)
    first, last = discrete.vector(q_start, "q_start"), discrete.vector(q_end, "q_end")
    if first.shape != last.shape:
        raise InputError(
            f"q_start and q_end must be points of the same space; got {first.size} and {last.size} coordinates"
        )
    if guess is None:
        points = first + np.linspace(0.0, 1.0, steps + 1)[:, None] * (last - first)
    else:
        points, _ = points_of(discrete, guess, least=2)
        if points.shape != (steps + 1, first.size):
            raise InputError(
                f"guess must hold {steps + 1} points with {first.size} coordinates; got {len(points)} with "
                f"{points.shape[1]}"
            )
    points[0], points[-1] = first, last
    return stationary(discrete, points, step, start).reshape(steps + 1, *shape)


def stationary(discrete: DiscreteLagrangian, points: Array, h: float, t0: float) -> Array:
    """Return the path (N + 1, d) near `points`, with the same ends, that makes the action stationary."""
    count, d = len(points) - 1, points.shape[1]
    if count == 1:
        return points

    def with_inner(x: Array) -> Array:
        return np.vstack([points[:1], x.reshape(count - 1, d), points[-1:]])

    def equations(x: Array) -> tuple[Array, Callable[[Array], Array]]:
        jets = jets_of(discrete, with_inner(x), h, t0)
        residual = np.concatenate([a.d2 + b.d1 for a, b in itertools.pairwise(jets)])
        return residual, lambda right: block_solve(jets, right[:, None])[:, 0]

    failure = (
        f"{discrete.name}: no path with stationary action from {show(points[0])} to {show(points[-1])} in {count} "
        f"steps of h = {h:.6g}"
    )
    scale = float(np.max(np.abs(points)))
    return with_inner(solve(equations, points[1:-1].ravel(), scale=scale, failure=failure, time=t0))


def jets_of(discrete: DiscreteLagrangian, points: Array, h: float, t0: float) -> list[Jet]:
    """Return L_d with its derivatives for every step of a path."""
    return [discrete.jet(a, b, h, t0 + k * h) for k, (a, b) in enumerate(itertools.pairwise(points))]


def block_solve(jets: list[Jet], right: Array) -> Array:
    """Return H^-1 right, H being the Hessian of the action in the inner points; right : ((N - 1) d, columns)."""
    d, inner = jets[0].d1.size, len(jets) - 1
    diagonal = [a.d22 + b.d11 for a, b in itertools.pairwise(jets)]
    upper = [jet.d12 for jet in jets[1:-1]]
    if inner * d <= DENSE_UP_TO:
        matrix = np.zeros((inner, d, inner, d))
        for k in range(inner):
            matrix[k, :, k, :] = diagonal[k]
            if k + 1 < inner:
                matrix[k, :, k + 1, :], matrix[k + 1, :, k, :] = upper[k], upper[k].T
        return np.asarray(np.linalg.solve(matrix.reshape(inner * d, inner * d), right))
    # Thomas: eliminate downwards, substitute upwards, block by block.
    parts = right.reshape(inner, d, -1).copy()
    pivots = [diagonal[0]]
    for k in range(1, inner):
        factor = np.linalg.solve(pivots[-1].T, upper[k - 1]).T  # upper^T pivot^-1
        pivots.append(diagonal[k] - factor @ upper[k - 1])
        parts[k] -= factor @ parts[k - 1]
    parts[-1] = np.linalg.solve(pivots[-1], parts[-1])
    for k in range(inner - 2, -1, -1):
        parts[k] = np.linalg.solve(pivots[k], parts[k] - upper[k] @ parts[k + 1])
    solved: Array = parts.reshape(right.shape)
    return solved


def joined(jets: list[Jet]) -> Jet:
    """Return the sum of the steps of a path with stationary action as a function of its ends alone.

    The inner points depend on the ends: they are eliminated (Schur complement).
    """
    first, last = jets[0], jets[-1]
    if len(jets) == 1:
        return first
    d = first.d1.size
    by_ends = np.zeros(((len(jets) - 1) * d, 2 * d))
    by_ends[:d, :d] = first.d12.T
    by_ends[-d:, d:] = last.d12
    moved = block_solve(jets, by_ends)
    d11 = first.d11 - first.d12 @ moved[:d, :d]
    d12 = -first.d12 @ moved[:d, d:]
    d22 = last.d22 - last.d12.T @ moved[-d:, d:]
    return Jet(float(sum(jet.value for jet in jets)), first.d1, last.d2, d11, d12, d22)


class OfSteps(DiscreteLagrangian):
    """The action of several steps whose sum is stationary in the points between them, `_jets`."""

    def _jets(self, q0: Array, q1: Array, h: float, t: float) -> list[Jet]:
        raise NotImplementedError

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        jets = self._jets(q0, q1, h, t)
        return float(sum(jet.value for jet in jets)), jets[0].d1, jets[-1].d2

    def _jet(self, q0: Array, q1: Array, h: float, t: float) -> Jet:
        return joined(self._jets(q0, q1, h, t))
