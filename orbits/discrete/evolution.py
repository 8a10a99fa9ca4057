"""The evolution maps of a discrete Lagrangian: F on Q x Q, and F~ in positions and momenta.

    F: (q_{k-1}, q_k) -> (q_k, q_{k+1})    with    D2 L_d(q_{k-1}, q_k) + D1 L_d(q_k, q_{k+1}) = 0
    F~: (q_k, p_k) -> (q_{k+1}, p_{k+1})   with    p_k = -D1 L_d(q_k, q_{k+1}),   p_{k+1} = D2 L_d(q_k, q_{k+1})

The next point is found by Newton's method with D1D2 L_d, to the round-off floor. This works for any L_d, and checks the
integrators, which are fast implementations of the same maps.

Source: Marsden & West (2001), sec. 1.3, 1.5.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number, whole_number
from orbits.discrete.base import Array, DiscreteLagrangian, time_step
from orbits.discrete.constrained import Constrained, require_constraints_kept
from orbits.discrete.newton import solve
from orbits.errors import InputError
from orbits.lagrangians.base import show

SINGULAR = 1e-13


def advance(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0
) -> tuple[Array, Array]:
    """Return (q1, q2) with D1 L_d(q1, q2) = -D2 L_d(q0, q1), each (d,); t : time at q0.

    Raises ConvergenceError if Newton's method fails, InputError if L_d is not regular.
    """
    x1 = discrete.vector(q1, "q1")
    p = discrete.d2(q0, q1, h, t)
    x2 = _next(discrete, x1, p, h, t + h, 2.0 * x1 - discrete.vector(q0, "q0"), -1)
    return x1, x2


def march_pairs(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, steps: int, t: float = 0.0
) -> Array:
    """Return the discrete trajectory that starts with q0, q1: F applied `steps` times, (steps + 2, ...).

    q0, q1 : (d,) or (n, 3), like the points of the result; t : time at q0
    Raises InputError and ConvergenceError as `advance` does.
    """
    steps = whole_number(steps, "steps", least=0)
    shape = np.shape(q1)
    path = [discrete.vector(q0, "q0"), discrete.vector(q1, "q1")]
    h, t = time_step(h), finite_number(t, "t")
    p = discrete.d2(path[0], path[1], h, t)
    for k in range(1, steps + 1):
        path.append(_next(discrete, path[-1], p, h, t + k * h, 2.0 * path[-1] - path[-2], k))
        p = discrete.d2(path[-2], path[-1], h, t + k * h)
    return np.array(path).reshape(steps + 2, *shape)


def step(
    discrete: DiscreteLagrangian,
    q: ArrayLike,
    p: ArrayLike,
    h: float,
    t: float = 0.0,
    *,
    guess: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Return (q1, p1) with p = -D1 L_d(q, q1) and p1 = D2 L_d(q, q1), each (d,).

    guess : where Newton's method for q1 starts; by default the point that the momentum leads to on a straight line
    Raises ConvergenceError if Newton's method fails, InputError if L_d is not regular.
    """
    x, y = discrete.vector(q, "q"), discrete.vector(p, "p")
    first = None if guess is None else discrete.vector(guess, "guess")
    x1 = _next(discrete, x, y, h, t, first, -1)
    return x1, discrete.d2(x, x1, h, t)


def start(discrete: DiscreteLagrangian, q: ArrayLike, v: ArrayLike, h: float, t: float = 0.0) -> tuple[Array, Array]:
    """Return the pair (q0, q1) of a position and velocity: p = dL/dv(q, v, t), then p = -D1 L_d(q0, q1)."""
    if discrete.lagrangian is None:
        raise InputError(
            f"{discrete.name} was made from numbers alone, so it cannot turn velocities into momenta. Make it with "
            "lagrangian=, or pass the momentum to `step`."
        )
    x = discrete.vector(q, "q")
    return x, step(discrete, x, discrete.lagrangian.momentum(x, v, t), h, t)[0]


def _next(
    discrete: DiscreteLagrangian, q: Array, p: Array, h: float, t: float, guess: Array | None, index: int
) -> Array:
    """Return q1 with -D1 L_d(q, q1) = p."""
    h, t = time_step(h), finite_number(t, "t")
    require_constraints_kept(discrete)
    if guess is None:
        guess = discrete.guess(q, p, h, t)

    of = f" {index}" if index >= 0 else ""
    failure = f"{discrete.name}: step{of} from q = {show(q)} with p = {show(p)}, h = {h:.6g}"
    if isinstance(discrete, Constrained):
        return discrete.next_point(q, p, h, t, guess, failure, index)

    def equations(x: Array) -> tuple[Array, Callable[[Array], Array]]:
        jet = discrete.jet(q, x, h, t)
        return jet.d1 + p, lambda right: invert(discrete, jet.d12, right, q, x)

    scale = max(float(np.max(np.abs(q))), float(np.max(np.abs(guess))))
    return solve(equations, guess, scale=scale, failure=failure, step=index, time=t)


def invert(discrete: DiscreteLagrangian, matrix: Array, right: Array, q0: Array, q1: Array) -> Array:
    """Return matrix^-1 right, the matrix being D1D2 L_d or its transpose. Raises InputError if it is singular."""
    # Rows and columns are scaled to one size: bodies may have masses of 1 and 1e-16.
    rows = np.max(np.abs(matrix), axis=1)
    columns = np.max(np.abs(matrix / np.where(rows > 0.0, rows, 1.0)[:, None]), axis=0)
    even = matrix / np.where(rows > 0.0, rows, 1.0)[:, None] / np.where(columns > 0.0, columns, 1.0)
    if not np.linalg.svd(even, compute_uv=False)[-1] > SINGULAR:
        raise InputError(
            f"{discrete.name} L_d is degenerate between q0 = {show(q0)} and q1 = {show(q1)}: D1D2 L_d = {show(matrix)} "
            "has no inverse, so that momenta do not determine the next point. Expected a regular Lagrangian, whose "
            "kinetic energy depends on every velocity, and an h away from conjugate points."
        )
    by_row = right / rows if right.ndim == 1 else right / rows[:, None]
    solved = np.linalg.solve(even, by_row)
    return np.asarray(solved / columns if right.ndim == 1 else solved / columns[:, None])
