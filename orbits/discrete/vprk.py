"""The discrete Lagrangian of a variational partitioned Runge–Kutta method.

    L_d(q0, q1; h) = h sum_i b_i L(Q_i, V_i, t + c_i h),      Q_i = q0 + h sum_j a_ij V_j,

made stationary over V_1, ..., V_s under the constraint q1 = q0 + h sum_j b_j V_j. With P_i = dL/dv and F_i = dL/dq at
(Q_i, V_i), and p the multiplier of the constraint at q0, stationarity means

    P_i = p + h sum_j abar_ij F_j,      b_i abar_ij + b_j a_ji = b_i b_j,

which are the equations of the method, and D1 L_d = -p, D2 L_d = p + h sum_j b_j F_j. They are solved for (V, p) by
Newton's method; the second derivatives follow from the implicit function theorem.

Source: Marsden & West (2001), sec. 2.6.5 and theorem 2.6.1; Hairer, Lubich & Wanner (2006), theorem VI.6.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from orbits.discrete.base import Array, DiscreteLagrangian, Jet, Mechanics, require_mechanics
from orbits.discrete.newton import solve
from orbits.errors import InputError, shown
from orbits.lagrangians.base import show


class Coefficients(Protocol):
    """The arrays of a partitioned tableau that are used here: a, a_bar of shape (s, s) and b, c of shape (s,)."""

    @property
    def a(self) -> Array:
        """Coefficients of the positions."""
        ...

    @property
    def a_bar(self) -> Array:
        """Coefficients of the momenta."""
        ...

    @property
    def b(self) -> Array:
        """Weights of positions and momenta."""
        ...

    @property
    def c(self) -> Array:
        """Nodes."""
        ...


class _Stages(NamedTuple):
    """The equations at one (V, p): forces F and momenta P (s, d), values L (s,), the residual and its matrix."""

    F: Array
    L: Array
    residual: Array
    qq: Array
    qv: Array
    matrix: Array


@dataclass(frozen=True, eq=False, repr=False)
class Vprk(DiscreteLagrangian):
    """The discrete Lagrangian of a partitioned Runge–Kutta method with coefficients a, a_bar, b, c."""

    name: str
    lagrangian: Mechanics
    a: Array
    a_bar: Array
    b: Array
    c: Array

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        V, p = self._solved(q0, q1, h, t)
        stages = self._stages(q0, (q1 - q0) / h, h, t, V, p, second=False)
        return h * float(self.b @ stages.L), -p, p + h * (self.b @ stages.F)

    def _jet(self, q0: Array, q1: Array, h: float, t: float) -> Jet:
        V, p = self._solved(q0, q1, h, t)
        s, d = V.shape
        at = self._stages(q0, (q1 - q0) / h, h, t, V, p, second=True)
        # How the residual depends on q0 through the Q_i, and on q0 and q1 through the constraint.
        by_q0, by_q1 = np.zeros((s * d + d, d)), np.zeros((s * d + d, d))
        by_q0[: s * d] = (at.qv.transpose(0, 2, 1) - h * np.einsum("ij,jab->iab", self.a_bar, at.qq)).reshape(s * d, d)
        by_q0[s * d :], by_q1[s * d :] = np.eye(d) / h, -np.eye(d) / h
        moved = -np.linalg.solve(at.matrix, np.hstack([by_q0, by_q1]))
        dV, dp = moved[: s * d].reshape(s, d, 2 * d), moved[s * d :]
        # p1 = p + h sum b_j F_j(Q_j, V_j)
        dQ = h * np.einsum("ij,jab->iab", self.a, dV)
        dF = np.einsum("jab,jbc->jac", at.qq, dQ) + np.einsum("jab,jbc->jac", at.qv, dV)
        d22 = (dp + h * np.einsum("j,jab->ab", self.b, dF))[:, d:]
        d1, d2 = -p, p + h * (self.b @ at.F)
        return Jet(h * float(self.b @ at.L), d1, d2, -dp[:, :d], -dp[:, d:], d22)

    def _solved(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array]:
        s, d = len(self.b), q0.size
        mean = (q1 - q0) / h
        f, p = self.lagrangian.gradients(0.5 * (q0 + q1), mean, t + 0.5 * h)

        # Momenta of light bodies are far smaller than their velocities, so momenta are scaled: p = mass * u.
        mass = np.max(np.abs(self.lagrangian.hessians(0.5 * (q0 + q1), mean, t + 0.5 * h)[2]), axis=1)
        mass = np.where(mass > 0.0, mass, 1.0)
        unit = np.concatenate([np.tile(mass, s), np.ones(d)])
        column = np.concatenate([np.ones(s * d), mass])

        def equations(x: Array) -> tuple[Array, Callable[[Array], Array]]:
            at = self._stages(q0, mean, h, t, x[: s * d].reshape(s, d), mass * x[s * d :], second=True)
            matrix = at.matrix / unit[:, None] * column[None, :]
            return at.residual / unit, lambda right: np.linalg.solve(matrix, right)

        start = np.concatenate([np.tile(mean, s), (p - 0.5 * h * f) / mass])
        failure = f"{self.name}: no stationary velocities between q0 = {show(q0)} and q1 = {show(q1)}, h = {h:.6g}"
        x = solve(equations, start, scale=float(np.max(np.abs(start))), failure=failure, time=t)
        return x[: s * d].reshape(s, d), mass * x[s * d :]

    def _stages(self, q0: Array, mean: Array, h: float, t: float, V: Array, p: Array, *, second: bool) -> _Stages:
        s, d = V.shape
        Q = q0 + h * (self.a @ V)
        F, P, L = np.empty((s, d)), np.empty((s, d)), np.empty(s)
        qq, qv, vv = np.empty((s, d, d)), np.empty((s, d, d)), np.empty((s, d, d))
        for i in range(s):
            at = t + self.c[i] * h
            F[i], P[i] = self.lagrangian.gradients(Q[i], V[i], at)
            if second:
                qq[i], qv[i], vv[i] = self.lagrangian.hessians(Q[i], V[i], at)
            L[i] = self.lagrangian.value(Q[i], V[i], at)
        residual = np.concatenate([(P - p - h * (self.a_bar @ F)).ravel(), self.b @ V - mean])
        matrix = np.empty((0, 0))
        if second:
            matrix = np.zeros((s * d + d, s * d + d))
            stages = matrix[: s * d, : s * d].reshape(s, d, s, d)
            # P_i depends on V_j through Q_i, F_k through Q_k and V_k.
            stages += h * np.einsum("ij,iba->iajb", self.a, qv)
            stages -= h * h * np.einsum("ik,kj,kab->iajb", self.a_bar, self.a, qq)
            stages -= h * np.einsum("ij,jab->iajb", self.a_bar, qv)
            for i in range(s):
                stages[i, :, i, :] += vv[i]
                matrix[i * d : (i + 1) * d, s * d :] = -np.eye(d)
                matrix[s * d :, i * d : (i + 1) * d] = self.b[i] * np.eye(d)
        return _Stages(F, L, residual, qq, qv, matrix)


def vprk(lagrangian: Mechanics, tableau: Coefficients, *, name: str | None = None) -> Vprk:
    """Return the discrete Lagrangian of a variational partitioned Runge–Kutta method.

    tableau : a, a_bar of shape (s, s) and b, c of shape (s,), with b_i abar_ij + b_j a_ji = b_i b_j
    Raises InputError for other shapes, and for coefficients without that property, which have no discrete Lagrangian.
    """
    require_mechanics(lagrangian)
    if not all(hasattr(tableau, x) for x in ("a", "a_bar", "b", "c")):
        raise InputError(f"expected a tableau, such as orbits.Gauss(stages=2).tableau; got {shown(tableau)}")
    a, a_bar, b, c = (np.asarray(x, dtype=np.float64) for x in (tableau.a, tableau.a_bar, tableau.b, tableau.c))
    s = b.size
    if a.shape != (s, s) or a_bar.shape != (s, s) or c.shape != (s,) or b.shape != (s,) or s == 0:
        raise InputError(
            "a tableau needs a, a_bar of shape (s, s) and b, c of shape (s,); got "
            f"{a.shape}, {a_bar.shape}, {b.shape}, {c.shape}"
        )
    defect = b[:, None] * a_bar + (b[:, None] * a).T - np.outer(b, b)
    if not float(np.max(np.abs(defect))) <= 1e-14:
        raise InputError(
            f"the pair is not symplectic: b_i abar_ij + b_j a_ji - b_i b_j reaches {np.max(np.abs(defect)):.3g}, so it "
            "has no discrete Lagrangian. Expected coefficients for which it is 0, such as Gauss's or Lobatto's."
        )
    if not np.all(b != 0.0):
        raise InputError(f"the weights b_i must not be 0, which would leave stages undetermined; got {show(b)}")
    label = name or getattr(tableau, "name", "") or f"vprk {s}"
    return Vprk(str(label), lagrangian, a, a_bar, b, c)
