"""The discrete action of a path, and the residual of its discrete Euler–Lagrange equations.

    S(q_0, ..., q_N) = sum_k L_d(q_k, q_{k+1}; h),      dS/dq_k = D2 L_d(q_{k-1}, q_k; h) + D1 L_d(q_k, q_{k+1}; h)

Positions alone do not identify L_d: L_d + f(q1) - f(q0) has the same equations, for any f, and the momenta
p + grad f(q). To show that a method is the map of L_d, its momenta are needed as well:

    p_k = -D1 L_d(q_k, q_{k+1}; h),      p_{k+1} = D2 L_d(q_k, q_{k+1}; h).

Source: Marsden & West (2001), sec. 1.3, 1.5.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number, nonzero_number, real_numbers
from orbits.discrete.base import Array, DiscreteLagrangian
from orbits.discrete.constrained import require_constraints_kept
from orbits.errors import InputError

UNIFORM = 8.0 * 2.0**-52
"""Times are uniform if they differ from k h by at most a few roundings of the largest one, more for long paths."""


def action(discrete: DiscreteLagrangian, path: ArrayLike, h: float | ArrayLike, t0: float = 0.0) -> float:
    """Return the discrete action of a path.

    path : (N, d) or (N, n, 3), N >= 2; h : its spacing, or the N times themselves, which must be uniform
    Raises InputError for other shapes or times.
    """
    points, _ = points_of(discrete, path, least=2)
    step, start = spacing(h, len(points), t0)
    pairs = itertools.pairwise(points)
    return float(sum(discrete.value(a, b, step, start + k * step) for k, (a, b) in enumerate(pairs)))


def euler_lagrange_residual(
    discrete: DiscreteLagrangian, path: ArrayLike, h: float | ArrayLike, t0: float = 0.0, *, in_ulps: bool = False
) -> Array:
    """Return D2 L_d(q_{k-1}, q_k) + D1 L_d(q_k, q_{k+1}) at the inner points, the gradient of the action.

    path : (N, d) or (N, n, 3), N >= 3, from any source; the result has N - 2 points of the same shape
    h : its spacing, or the N times themselves, which must be uniform
    in_ulps : divide by the unit in the last place of the largest component of D2 L_d at that point

    A path that solves the equations leaves only round-off. Stored positions are rounded by eps |q|, which their
    differences amplify: expect about |q|/|dq| ulps, not one. Raises InputError for other shapes or times.
    """
    require_constraints_kept(discrete)
    points, shape = points_of(discrete, path, least=3)
    step, start = spacing(h, len(points), t0)
    pairs = itertools.pairwise(points)
    first = [discrete.first(a, b, step, start + k * step) for k, (a, b) in enumerate(pairs)]
    arriving = np.array([d2 for _, _, d2 in first[:-1]])
    residual: Array = arriving + np.array([d1 for _, d1, _ in first[1:]])
    if in_ulps:
        residual = (
            residual / np.spacing(np.maximum(np.max(np.abs(arriving), axis=1), np.finfo(np.float64).tiny))[:, None]
        )
    return residual.reshape(len(residual), *shape)


def momentum_residual(
    discrete: DiscreteLagrangian, path: ArrayLike, momenta: ArrayLike, h: float | ArrayLike, t0: float = 0.0
) -> Array:
    """Return p_k + D1 L_d(q_k, q_{k+1}) and p_{k+1} - D2 L_d(q_k, q_{k+1}) of each step: 0 along the map of L_d.

    path, momenta : (N, d) or (N, n, 3), N >= 2; the result has shape (N - 1, 2, ...): both ends of each step
    h : their spacing, or the N times themselves, which must be uniform

    Stronger than `euler_lagrange_residual`, which is the difference of two of these and cannot see what an equivalent
    L_d adds to all momenta. Raises InputError for other shapes or times.
    """
    require_constraints_kept(discrete)
    points, shape = points_of(discrete, path, least=2)
    p, _ = points_of(discrete, momenta, least=2)
    if p.shape != points.shape:
        raise InputError(f"path and momenta must have one shape; got {points.shape} and {p.shape}")
    step, start = spacing(h, len(points), t0)
    residual = np.empty((len(points) - 1, 2, points.shape[1]))
    for k, (a, b) in enumerate(itertools.pairwise(points)):
        _, d1, d2 = discrete.first(a, b, step, start + k * step)
        residual[k] = p[k] + d1, p[k + 1] - d2
    return residual.reshape(len(residual), 2, *shape)


def points_of(discrete: DiscreteLagrangian, path: ArrayLike, *, least: int) -> tuple[Array, tuple[int, ...]]:
    """Return a path as (N, d), and the shape of one of its points. Raises InputError for anything else."""
    points = real_numbers(path, "the path")
    if points.ndim not in (2, 3) or (points.ndim == 3 and points.shape[2] != 3) or len(points) < least:
        raise InputError(
            f"a path has shape (N, d), or (N, bodies, 3), with N >= {least} points; got shape {points.shape}"
        )
    shape = points.shape[1:]
    return np.array([discrete.vector(q, f"point {k} of the path") for k, q in enumerate(points)]), shape


def spacing(h: float | ArrayLike, count: int, t0: float) -> tuple[float, float]:
    """Return (h, first time) from a spacing or from the times themselves, which must be uniform to rounding."""
    times = real_numbers(h, "h")
    if times.ndim == 0:
        return nonzero_number(h, "h"), finite_number(t0, "t0")
    if times.shape != (count,):
        raise InputError(f"h is the spacing of the path, or its {count} times; got an array of shape {times.shape}")
    if t0 != 0.0:
        raise InputError(f"the times already say when the path starts: leave out t0 = {t0!r}")
    if not np.all(np.isfinite(times)):
        raise InputError(f"the times of a path must be finite; got {times[~np.isfinite(times)][0]} among them")
    step = nonzero_number((times[-1] - times[0]) / (count - 1), "h")
    miss = np.abs(times - (times[0] + step * np.arange(count)))
    # Times made by adding dt repeatedly are off by up to half a rounding for each step.
    if np.max(miss) > UNIFORM * max(1.0, count / 16) * np.max(np.abs(times)):
        gaps = np.diff(times)
        usual = float(np.median(gaps))
        k = int(np.argmax(np.abs(gaps - usual)))
        raise InputError(
            f"the discrete Euler–Lagrange equations need one step h for a whole path; the usual spacing is {usual!r}, "
            f"but between the times {float(times[k])!r} and {float(times[k + 1])!r} (points {k} and {k + 1}) it is "
            f"{float(gaps[k])!r}. Sample the path uniformly, or use a uniform part of it."
        )
    return step, float(times[0])
