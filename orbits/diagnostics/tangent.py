"""The exact derivative of a step: a partitioned Runge–Kutta step and the same step of its variational equations.

For these methods, stepping commutes with differentiation by the starting point. The derivative therefore follows by
linear algebra from the Hessian blocks of the Lagrangian at the stages, without differences. The stages are solved for
independently here, by Newton's method in NumPy, which also gives an independent value of the step.

Source: Hairer, Lubich & Wanner (2006), sec. VI.4.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import ConvergenceError
from orbits.lagrangians.base import Lagrangian, show
from orbits.tableaux import PartitionedTableau

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlainStep:
    """One step of a tableau, solved by Newton's method in NumPy.

    q, p : (d,) after the step
    Q, V : (s, d) positions and velocities of the stages
    derivative : (2d, 2d), of (q, p) after the step with respect to (q, p) before it
    """

    q: Array
    p: Array
    Q: Array
    V: Array
    derivative: Array


def plain_step(
    lagrangian: Lagrangian, tableau: PartitionedTableau, q: ArrayLike, p: ArrayLike, h: float, t: float = 0.0
) -> PlainStep:
    """Return one step from (q, p), each (d,), with its derivative. Raises ConvergenceError if Newton's method fails."""
    x, y = lagrangian.vector(q, "q"), lagrangian.vector(p, "p")
    a, a_bar, b, c = tableau.a, tableau.a_bar, tableau.b, tableau.c
    s, d = len(b), len(x)
    V = np.tile(lagrangian.velocity(x, y, t), (s, 1))
    F, qq, qv, vv = np.empty((s, d)), np.empty((s, d, d)), np.empty((s, d, d)), np.empty((s, d, d))
    previous, floor = np.inf, False
    failure = ConvergenceError(
        f"'{lagrangian.name}': Newton's method fails for one step of {h:.6g} from q = {show(x)}, p = {show(y)}; use a "
        "smaller dt.",
        time=t,
    )
    for _ in range(60):
        Q = x + h * a @ V
        P = np.empty((s, d))
        for i in range(s):
            F[i], P[i] = lagrangian.gradients(Q[i], V[i], t + c[i] * h)
            qq[i], qv[i], vv[i] = lagrangian.hessians(Q[i], V[i], t + c[i] * h)
        matrix = _matrix(a, a_bar, h, qq, qv, vv)
        if floor:
            break
        residual = y + h * a_bar @ F - P
        try:
            change = np.linalg.solve(matrix, residual.ravel()).reshape(s, d)
        except np.linalg.LinAlgError:  # far from any solution
            raise failure from None
        V = V + change
        size = float(np.max(np.abs(change)))
        floor = size == 0.0 or (size >= 0.5 * previous and size <= 1e-8 * float(np.max(np.abs(V))))
        previous = size
    else:
        raise failure
    moved = h * np.einsum("ij,jb->ib", a, V) + x
    # dP_i = L_vq dQ_i + L_vv dV_i,   dQ_i = dq + h sum a_ij dV_j,   dP_i = dp + h sum a_bar_ij dF_j
    right = np.zeros((s, d, 2 * d))
    right[:, :, :d] = -qv.transpose(0, 2, 1) + h * np.einsum("ij,jab->iab", a_bar, qq)
    right[:, :, d:] = np.eye(d)
    dV = np.linalg.solve(matrix, right.reshape(s * d, 2 * d)).reshape(s, d, 2 * d)
    unit = np.hstack([np.eye(d), np.zeros((d, d))])
    dQ = unit + h * np.einsum("ij,jab->iab", a, dV)
    dF = np.einsum("iab,ibc->iac", qq, dQ) + np.einsum("iab,ibc->iac", qv, dV)
    derivative = np.vstack([unit, np.hstack([np.zeros((d, d)), np.eye(d)])])
    derivative[:d] += h * np.einsum("i,iab->ab", b, dV)
    derivative[d:] += h * np.einsum("i,iab->ab", b, dF)
    return PlainStep(x + h * b @ V, y + h * b @ F, moved, V, derivative)


def symplecticity_defect(derivative: Array, weights: Array) -> float:
    """Return the largest |M^T J M - J| in coordinates (w q, p / w), divided by |M|^2 where that exceeds 1.

    derivative : (2d, 2d)
    weights : (d,), such as the square roots of the masses, which bring all coordinates to one size
    """
    scale = np.concatenate([weights, 1.0 / weights])
    M = scale[:, None] * derivative / scale[None, :]
    d = len(weights)
    J = np.block([[np.zeros((d, d)), np.eye(d)], [-np.eye(d), np.zeros((d, d))]])
    return float(np.max(np.abs(M.T @ J @ M - J)) / max(1.0, float(np.max(np.abs(M)))) ** 2)


def _matrix(a: Array, a_bar: Array, h: float, qq: Array, qv: Array, vv: Array) -> Array:
    """Derivative of P_i - p - h sum a_bar_ij F_j, P_i the momenta of the stages, by their velocities: (s d, s d)."""
    s, d = qq.shape[:2]
    matrix = h * np.einsum("ij,iba->iajb", a, qv)
    matrix -= h * np.einsum("ij,jab->iajb", a_bar, qv)
    matrix -= h * h * np.einsum("ik,kj,kab->iajb", a_bar, a, qq)
    for i in range(s):
        matrix[i, :, i, :] += vv[i]
    stacked: Array = matrix.reshape(s * d, s * d)
    return stacked
