"""The discrete Noether theorem along a trajectory: a drift split into broken symmetry, solver error and round-off.

Let a one-parameter group have the generator xi(q, t) and the gauge term K(q, t), which is 0 where L is invariant. If
L_d changes by s [K(q1, t1) - K(q0, t0)], to first order in s, when both points are moved, then

    D1 L_d . xi(q0, t0) + D2 L_d . xi(q1, t1) = K(q1, t1) - K(q0, t0),

and J_k = p_k . xi(q_k, t_k) - K(q_k, t_k) is conserved along discrete trajectories. In general, for *any* points q_k
and momenta p_k, with xi_k and K_k at (q_k, t_k),

    J_{k+1} - J_k =   D1 L_d(q_k, q_{k+1}) . xi_k + D2 L_d(q_k, q_{k+1}) . xi_{k+1} - (K_{k+1} - K_k)   broken symmetry
                    + [p_{k+1} - D2 L_d(q_k, q_{k+1})] . xi_{k+1} - [p_k + D1 L_d(q_k, q_{k+1})] . xi_k       residual

Which K a discrete Lagrangian inherits from L depends on its rule. For an affine xi = A q + u + w t, and with Q_i, V_i
at the times t + c_i h of a symplectic pair of tableaux a, a_bar with weights b, c_i = sum_j a_ij, the change is
h sum_i b_i dK/dt(Q_i, V_i), which equals K(q1, t1) - K(q0, t0)

    for K linear in q and t                              by every method of the family
    for K with t^2                                       where sum_i b_i c_i = 1/2: order 2
    for K with products of coordinates                   where b_i a_ij + b_j a_ji = b_i b_j: Gauss, but not Lobatto
    for all K                                            by the exact discrete Lagrangian, for every xi

The momenta are the step's own. Momenta recomputed from stored positions lose digits: a stored position is rounded by
eps |q|, and L_d depends on the differences of neighbours.

Source: Marsden & West (2001), sec. 1.3.3, for K = 0.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number, real_numbers
from orbits.discrete.base import Array, DiscreteLagrangian
from orbits.discrete.path import points_of, spacing
from orbits.errors import InputError, shown
from orbits.lagrangians.symmetry import Symmetry

EPS = 2.0**-53


@dataclass(frozen=True, eq=False)
class Drift:
    """The drift of a momentum map along a trajectory of N points, split by cause; all arrays (N,).

    momentum : J_k = p_k . xi(q_k, t_k) - K(q_k, t_k)
    total : J_k - J_0
    broken : the sum over the steps of D1 L_d . xi_k + D2 L_d . xi_{k+1} - (K_{k+1} - K_k): L_d lacks the symmetry
    solver : the sum of the residuals above the noise floor of their step: the equations were not solved
    round_off : total - broken - solver: residuals that cannot be distinguished from rounding of the stored values
    floor : the sum of the noise floors, the most that round-off can account for

    The noise floor of a step bounds what the rounding of the stored q and p, and of the sums themselves, adds to its
    residual: four times 2^-53 (|D1D2 L_d| |q| + |p|), contracted with |xi|, summed over both ends. `broken` needs no
    such floor for positions, as its identity holds at any points; its own rounding is 2^-53 |p| |xi| a step.
    """

    symmetry: str
    momentum: Array
    total: Array
    broken: Array
    solver: Array
    round_off: Array
    floor: Array

    def __str__(self) -> str:
        parts = (
            f"{name} {np.max(np.abs(x)):.2e}" for name, x in vars(self).items() if name not in ("symmetry", "momentum")
        )
        return f"{self.symmetry}: J = {self.momentum[0]:.6g}; largest " + ", ".join(parts)


def invariance(
    discrete: DiscreteLagrangian,
    symmetry: Symmetry,
    q0: ArrayLike,
    q1: ArrayLike,
    h: float,
    s: float,
    t: float = 0.0,
) -> float:
    """Return L_d(g q0, g q1) - L_d(q0, q1), an action, g being the group at s; 0 if L_d is invariant.

    A gauge term's own contribution is subtracted, K_s(q1, t + h) - K_s(q0, t), K_s being K integrated along the flow up
    to s; the result is 0 if L_d is invariant up to a total difference.
    """
    require_symmetry(symmetry)
    s = finite_number(s, "s")
    x0, x1 = discrete.vector(q0, "q0"), discrete.vector(q1, "q1")
    change = discrete.value(symmetry.moved(s, x0, t), symmetry.moved(s, x1, t + h), h, t) - discrete.value(x0, x1, h, t)
    return change - (symmetry.gained(s, x1, t + h) - symmetry.gained(s, x0, t))


def momentum_map(symmetry: Symmetry, q: ArrayLike, p: ArrayLike, t: ArrayLike | None = None) -> float | Array:
    """Return J = p . xi(q, t) - K(q, t): a float for one point (d,), (N,) for N points (N, d) or (N, n, 3).

    t : time of the point, or (N,) of the points; needed where the symmetry depends on time
    """
    require_symmetry(symmetry)
    x, y = real_numbers(q, "q"), real_numbers(p, "p")
    if x.shape != y.shape or x.ndim not in (1, 2, 3):
        raise InputError(f"q and p must have one shape, (d,), (N, d) or (N, n, 3); got {x.shape} and {y.shape}")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        raise InputError("q and p must be finite")
    if t is None and symmetry.timed:
        raise InputError(
            f"'{symmetry.name}' depends on time, but no time was given. Pass t=, the time of the point or the times of "
            "the points."
        )
    times = np.zeros(()) if t is None else real_numbers(t, "t")
    count = x.shape[:1] if x.ndim > 1 else ()
    if times.shape not in ((), count) or not np.all(np.isfinite(times)):
        raise InputError(f"t must be a finite number, or one for each point; got {shown(t)}")
    if x.ndim == 1:
        return symmetry.charge(x, y, float(times))
    times = np.broadcast_to(times, count)
    points = [(a.ravel(), b.ravel(), float(c)) for a, b, c in zip(x, y, times, strict=True)]
    return np.array([symmetry.charge(*point) for point in points])


def require_symmetry(symmetry: Symmetry) -> None:
    """Raise InputError unless it is a symmetry, such as one of those of a Lagrangian."""
    if not isinstance(symmetry, Symmetry):
        raise InputError(
            f"expected an orbits.Symmetry, such as one of orbits.lagrangians.kepler.symmetries; got {shown(symmetry)}"
        )


def drift(
    discrete: DiscreteLagrangian,
    symmetry: Symmetry,
    q_path: ArrayLike,
    p_path: ArrayLike | None,
    h: float | ArrayLike,
    t0: float = 0.0,
) -> Drift:
    """Return how a momentum map changes along a trajectory, and why.

    q_path, p_path : (N, d) or (N, n, 3), N >= 2, from any source
    h : the uniform spacing of the path, or its N times
    Without p_path, p_k = D2 L_d(q_{k-1}, q_k) is computed from the positions. The residual is then the residual of the
    discrete Euler–Lagrange equations along xi, with a rounding error of |q|/|dq| ulps.
    Raises InputError for paths or times that do not fit.
    """
    require_symmetry(symmetry)
    q, _ = points_of(discrete, q_path, least=2)
    step, start = spacing(h, len(q), t0)
    t = start + step * np.arange(len(q))
    jets = [discrete.jet(a, b, step, float(t[k])) for k, (a, b) in enumerate(itertools.pairwise(q))]
    d1, d2 = np.array([jet.d1 for jet in jets]), np.array([jet.d2 for jet in jets])
    if p_path is None:
        p = np.vstack([-d1[:1], d2])
    else:
        p, _ = points_of(discrete, p_path, least=2)
        if p.shape != q.shape:
            raise InputError(f"q_path and p_path must have one shape; got {q.shape} and {p.shape}")
    xi = np.array([symmetry.xi(x, float(at)) for x, at in zip(q, t, strict=True)])
    before, after = xi[:-1], xi[1:]
    K = np.array([symmetry.K(x, float(at)) for x, at in zip(q, t, strict=True)])
    broken = np.einsum("ki,ki->k", d1, before) + np.einsum("ki,ki->k", d2, after) - np.diff(K)
    residual = np.einsum("ki,ki->k", p[1:] - d2, after) - np.einsum("ki,ki->k", p[:-1] + d1, before)
    size = np.array([np.abs(jet.d12) for jet in jets])
    # The rounding of q0 and q1 enters D1 and D2 through the second derivatives, whose scale is |D1D2|.
    felt = np.einsum("kij,ki->kj", size, np.abs(q[:-1])) + np.einsum("kij,kj->ki", size, np.abs(q[1:]))
    floor = np.einsum("ki,ki->k", felt + np.abs(p[:-1]), np.abs(before))
    floor += np.einsum("ki,ki->k", felt + np.abs(p[1:]), np.abs(after))
    floor *= 4.0 * EPS
    momentum = np.asarray(momentum_map(symmetry, q, p, t))
    total = momentum - momentum[0]
    parts = [
        np.concatenate([[0.0], np.cumsum(x)])
        for x in (broken, np.where(np.abs(residual) > floor, residual, 0.0), floor)
    ]
    return Drift(symmetry.name, momentum, total, parts[0], parts[1], total - parts[0] - parts[1], parts[2])
