"""The discrete Noether theorem along a trajectory: which part of a drift is round-off, which the solver's, which true.

If L_d(g q0, g q1) = L_d(q0, q1) for all g of a one-parameter group with generator xi, then
D1 L_d . xi(q0) + D2 L_d . xi(q1) = 0, and J_k = p_k . xi(q_k) is conserved along discrete trajectories. In general, for
*any* points q_k and momenta p_k,

    J_{k+1} - J_k =   D1 L_d(q_k, q_{k+1}) . xi(q_k) + D2 L_d(q_k, q_{k+1}) . xi(q_{k+1})               broken symmetry
                    + [p_{k+1} - D2 L_d(q_k, q_{k+1})] . xi(q_{k+1}) - [p_k + D1 L_d(q_k, q_{k+1})] . xi(q_k)   residual

The momenta are the step's own: recomputed from stored positions they lose digits, for a position has lost eps |q| and
L_d sees the difference of neighbours.

Source: Marsden & West (2001), sec. 1.3.3.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.discrete.base import Array, DiscreteLagrangian
from orbits.discrete.path import points_of, spacing
from orbits.errors import InputError
from orbits.lagrangians.symmetry import Symmetry

EPS = 2.0**-53


@dataclass(frozen=True, eq=False)
class Drift:
    """The drift of a momentum map along a trajectory of N points, split; all arrays (N,), since the first point.

    momentum : J_k = p_k . xi(q_k)
    total : J_k - J_0
    broken : the sum over the steps of D1 L_d . xi(q_k) + D2 L_d . xi(q_{k+1}): L_d is not invariant
    solver : the sum of the residuals above the noise floor of their step: the equations were not solved
    round_off : total - broken - solver: residuals that cannot be told from the rounding of what is stored
    floor : the sum of the noise floors, the most that round-off can have done

    The noise floor of a step is what the rounding of the stored q and p, and of the sums themselves, does to its
    residual: 2^-53 times |D1D2 L_d| |q| + |p|, from both ends, contracted with |xi|, four times over. `broken` needs no
    such floor for positions, the identity behind it holds at any points; its own rounding is 2^-53 |p| |xi| a step.
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
    """Return L_d(g q0, g q1) - L_d(q0, q1), an action, g = the group at s; 0 if L_d is invariant."""
    moved0, moved1 = symmetry.flow(s, discrete.vector(q0, "q0")), symmetry.flow(s, discrete.vector(q1, "q1"))
    return discrete.value(moved0, moved1, h, t) - discrete.value(q0, q1, h, t)


def momentum_map(symmetry: Symmetry, q: ArrayLike, p: ArrayLike) -> float | Array:
    """Return J = p . xi(q): a float for one point (d,), (N,) for N points (N, d) or (N, n, 3)."""
    x, y = np.asarray(q, dtype=np.float64), np.asarray(p, dtype=np.float64)
    if x.shape != y.shape or x.ndim not in (1, 2, 3):
        raise InputError(f"q and p must have one shape, (d,), (N, d) or (N, n, 3); got {x.shape} and {y.shape}")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        raise InputError("q and p must be finite")
    if x.ndim == 1:
        return float(y @ symmetry.generator(x))
    return np.array([b.ravel() @ symmetry.generator(a.ravel()) for a, b in zip(x, y, strict=True)])


def drift(
    discrete: DiscreteLagrangian,
    symmetry: Symmetry,
    q_path: ArrayLike,
    p_path: ArrayLike | None,
    h: float | ArrayLike,
    t0: float = 0.0,
) -> Drift:
    """Return how a momentum map changes along a trajectory, and by what.

    q_path, p_path : (N, d) or (N, n, 3), N >= 2, from anywhere, with uniform spacing h (or the N times)
    p_path = None: p_k = D2 L_d(q_{k-1}, q_k) is computed from the positions; the residual is then that of the discrete
    Euler–Lagrange equations along xi, and rounding of |q|/|dq| ulps comes with it.
    """
    q, _ = points_of(discrete, q_path, least=2)
    step, start = spacing(h, len(q), t0)
    jets = [discrete.jet(a, b, step, start + k * step) for k, (a, b) in enumerate(itertools.pairwise(q))]
    d1, d2 = np.array([jet.d1 for jet in jets]), np.array([jet.d2 for jet in jets])
    if p_path is None:
        p = np.vstack([-d1[:1], d2])
    else:
        p, _ = points_of(discrete, p_path, least=2)
        if p.shape != q.shape:
            raise InputError(f"q_path and p_path must have one shape; got {q.shape} and {p.shape}")
    xi = np.array([symmetry.generator(x) for x in q])
    if xi.shape != q.shape:
        raise InputError(f"{symmetry.name}: the generator gives {xi.shape[1:]} for a point of shape {q.shape[1:]}")
    before, after = xi[:-1], xi[1:]
    broken = np.einsum("ki,ki->k", d1, before) + np.einsum("ki,ki->k", d2, after)
    residual = np.einsum("ki,ki->k", p[1:] - d2, after) - np.einsum("ki,ki->k", p[:-1] + d1, before)
    size = np.array([np.abs(jet.d12) for jet in jets])
    # D1 and D2 feel the rounding of q0 and q1 through the second derivatives, of which |D1D2| is the scale.
    felt = np.einsum("kij,ki->kj", size, np.abs(q[:-1])) + np.einsum("kij,kj->ki", size, np.abs(q[1:]))
    floor = np.einsum("ki,ki->k", felt + np.abs(p[:-1]), np.abs(before))
    floor += np.einsum("ki,ki->k", felt + np.abs(p[1:]), np.abs(after))
    floor *= 4.0 * EPS
    momentum = np.asarray(momentum_map(symmetry, q, p))
    total = momentum - momentum[0]
    parts = [
        np.concatenate([[0.0], np.cumsum(x)])
        for x in (broken, np.where(np.abs(residual) > floor, residual, 0.0), floor)
    ]
    return Drift(symmetry.name, momentum, total, parts[0], parts[1], total - parts[0] - parts[1], parts[2])
