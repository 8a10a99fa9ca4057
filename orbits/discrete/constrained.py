"""Discrete Lagrangians with constraints: L_d(q0, q1; h) on N x N, N being where g(q) = 0.

A path on N at which the action is stationary among paths on N has multipliers,

    D2 L_d(q-, q) + D1 L_d(q, q+) = G(q)^T lambda,      g(q+) = 0,      G = dg/dq.

The derivatives of L_d along N are what is left of D1 L_d and D2 L_d without their parts in the span of G^T. As momenta
they are tangent to N, G M^-1 p = 0: this represents a covector on N by the one of Q of least kinetic energy. With these
derivatives, the discrete Euler–Lagrange equations, the Legendre transforms, Noether's theorem and the two-form read as
without constraints, for tangent vectors.

Source: Marsden & West (2001), sec. 3.4, 3.5; Hairer, Lubich & Wanner (2006), sec. VII.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orbits.discrete.base import Array, DiscreteLagrangian, Jet
from orbits.discrete.newton import solve
from orbits.errors import InputError, shown
from orbits.lagrangians.base import Lagrangian
from orbits.lagrangians.constraints import constraint_hessians, constraint_values, directions

Linear = Callable[[Array], Array]


@dataclass(frozen=True, eq=False, repr=False)
class Constrained(DiscreteLagrangian):
    """L_d on the constraints of its Lagrangian. Points are expected to be on them.

    base : L_d without constraints

    D1 and D2 are tangent to the constraints; second derivatives are those along them, as quadratic forms of tangent
    vectors, 0 for others.
    """

    base: DiscreteLagrangian
    lagrangian: Lagrangian

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of the rule."""
        return f"{self.base.name} with constraints"

    def tangent(self, q: Array, p: Array) -> Array:
        """Return the part of a momentum, or of each column of a matrix, that is tangent to the constraints at q."""
        return p - constraint_values(self.lagrangian, q)[1].T @ self.multipliers(q, p)

    def multipliers(self, q: Array, p: Array) -> Array:
        """Return lambda, by which G^T lambda is the other part."""
        G, W = constraint_values(self.lagrangian, q)[1], directions(self.lagrangian, q)
        return np.asarray(np.linalg.solve(G @ W.T, W @ p), dtype=np.float64)

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        value, d1, d2 = self.base.first(q0, q1, h, t)
        return value, self.tangent(q0, d1), self.tangent(q1, d2)

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        jet = self.base.jet(q0, q1, h, t)
        d11 = jet.d11 - self._bending(q0, self.multipliers(q0, jet.d1))
        d22 = jet.d22 - self._bending(q1, self.multipliers(q1, jet.d2))
        one = np.eye(len(q0))
        P0, P1 = self.tangent(q0, one), self.tangent(q1, one)
        return P0 @ d11 @ P0.T, P0 @ jet.d12 @ P1.T, P1 @ d22 @ P1.T

    def _bending(self, q: Array, multipliers: Array) -> Array:
        """Return sum_a lambda_a d2 g_a."""
        bending: Array = np.einsum("a,aij->ij", multipliers, constraint_hessians(self.lagrangian, q))
        return bending

    def next_point(self, q: Array, p: Array, h: float, t: float, guess: Array, failure: str, index: int) -> Array:
        """Return q1 on the constraints with -D1 L_d(q, q1) = p along them, by Newton's method with multipliers."""
        G0 = constraint_values(self.lagrangian, q)[1]

        def equations(jet: Jet, x: Array, unknown: Array) -> tuple[Array, Array]:
            g, G = constraint_values(self.lagrangian, x)
            return np.append(jet.d1 + p + G0.T @ unknown, g), _bordered(jet.d12, G0.T, G)

        return self._solved(lambda x: self.base.jet(q, x, h, t), equations, guess, failure, index, t)

    def previous_point(self, q: Array, p: Array, h: float, t: float, guess: Array, failure: str) -> Array:
        """Return q0 on the constraints with D2 L_d(q0, q) = p along them."""
        G1 = constraint_values(self.lagrangian, q)[1]

        def equations(jet: Jet, x: Array, unknown: Array) -> tuple[Array, Array]:
            g, G = constraint_values(self.lagrangian, x)
            return np.append(jet.d2 - p + G1.T @ unknown, g), _bordered(jet.d12.T, G1.T, G)

        return self._solved(lambda x: self.base.jet(x, q, h, t), equations, guess, failure, -1, t)

    def _solved(
        self,
        jet_at: Callable[[Array], Jet],
        equations: Callable[[Jet, Array, Array], tuple[Array, Array]],
        guess: Array,
        failure: str,
        index: int,
        t: float,
    ) -> Array:
        d, m = len(guess), len(self.lagrangian.constraints)

        def residual(z: Array) -> tuple[Array, Linear]:
            value, matrix = equations(jet_at(z[:d]), z[:d], z[d:])
            return value, lambda right: _solve_scaled(matrix, right)

        scale = float(np.max(np.abs(guess)))
        z = solve(residual, np.append(guess, np.zeros(m)), scale=scale, failure=failure, step=index, time=t)
        return z[:d]

    def phase_derivative(self, q0: Array, q1: Array, h: float, t: float) -> Array:
        """Return the derivative of the step (q0, p0) -> (q1, p1) for vectors tangent to the constraints, (2d, 2d)."""
        jet, L, d = self.base.jet(q0, q1, h, t), self.lagrangian, len(q0)
        G0, G1, W1 = constraint_values(L, q0)[1], constraint_values(L, q1)[1], directions(L, q1)
        m = len(G0)
        # 0 = dp0 + (D11 - bending) dq0 + D12 dq1 + G0^T dmu and G1 dq1 = 0
        right = np.zeros((d + m, 2 * d))
        right[:d, :d] = -(jet.d11 - self._bending(q0, self.multipliers(q0, jet.d1)))
        right[:d, d:] = -np.eye(d)
        upper = _solve_scaled(_bordered(jet.d12, G0.T, G1), right)[:d]
        # dp1 = D12^T dq0 + (D22 - bending) dq1 - G1^T dnu, with d(G M^-1 p1) = 0
        lower = np.hstack([jet.d12.T, np.zeros((d, d))])
        lower += (jet.d22 - self._bending(q1, self.multipliers(q1, jet.d2))) @ upper
        v1 = L.velocity(q1, self.tangent(q1, jet.d2), t + h)
        turned = np.einsum("aij,j->ai", constraint_hessians(L, q1), v1) @ upper
        return np.vstack([upper, lower - G1.T @ np.linalg.solve(G1 @ W1.T, W1 @ lower + turned)])

    def pair_derivative(self, q0: Array, q1: Array, q2: Array, h: float, t: float) -> Array:
        """Return the derivative of (q0, q1) -> (q1, q2) for vectors tangent to the constraints, (2d, 2d)."""
        before, after, d = self.base.jet(q0, q1, h, t), self.base.jet(q1, q2, h, t + h), len(q0)
        G1, G2 = constraint_values(self.lagrangian, q1)[1], constraint_values(self.lagrangian, q2)[1]
        bending = self._bending(q1, self.multipliers(q1, before.d2 + after.d1))
        right = np.zeros((d + len(G1), 2 * d))
        right[:d] = -np.hstack([before.d12.T, before.d22 + after.d11 - bending])
        lower = _solve_scaled(_bordered(after.d12, G1.T, G2), right)[:d]
        return np.vstack([np.hstack([np.zeros((d, d)), np.eye(d)]), lower])

    def tangents(self, q: Array, p: Array | None = None) -> Array:
        """Return a basis of the vectors tangent to the constraints at q, the columns of (d, d - m); with a momentum p,
        of pairs (dq, dp) tangent to {g(q) = 0, G M^-1 p = 0}, (2d, 2(d - m)).
        """
        L = self.lagrangian
        G, W = constraint_values(L, q)[1], directions(L, q)
        if p is None:
            return _kernel(G)
        turned = np.einsum("aij,j->ai", constraint_hessians(L, q), L.velocity(q, p))
        return _kernel(np.vstack([np.hstack([G, np.zeros_like(G)]), np.hstack([turned, W])]))


def constrained(discrete: DiscreteLagrangian) -> Constrained:
    """Return a discrete Lagrangian on the constraints of its Lagrangian: for the trapezoidal rule, that of RATTLE.

    discrete : of a Lagrangian with constraints, such as `trapezoidal(L)`; points are expected to satisfy them
    Raises InputError for a Lagrangian without constraints.

        L_d = discrete.constrained(discrete.trapezoidal(orbits.lagrangians.dumbbell))
    """
    lagrangian = getattr(discrete, "lagrangian", None)
    if isinstance(discrete, Constrained) or not isinstance(discrete, DiscreteLagrangian):
        raise InputError(
            f"expected a discrete Lagrangian without constraints, such as trapezoidal(L); got {shown(discrete)}"
        )
    if not isinstance(lagrangian, Lagrangian) or not lagrangian.constraints:
        name = getattr(lagrangian, "name", discrete.name)
        raise InputError(
            f"'{name}' has no constraints. Expected a discrete Lagrangian of one that has, such as "
            "discrete.trapezoidal(orbits.lagrangians.dumbbell)."
        )
    return Constrained(discrete, lagrangian)


def require_constraints_kept(discrete: DiscreteLagrangian) -> None:
    """Raise InputError for an L_d without multipliers of a Lagrangian with constraints."""
    names = getattr(discrete.lagrangian, "constraints", ())
    if names and not isinstance(discrete, Constrained):
        raise InputError(
            f"the {discrete.name} L_d does not know the constraints of its Lagrangian, "
            f"{', '.join(f'{g} = 0' for g in names)}: its equations are those of free motion. Use "
            "discrete.constrained(L_d)."
        )


def _bordered(matrix: Array, right: Array, lower: Array) -> Array:
    return np.block([[matrix, right], [lower, np.zeros((len(lower), len(lower)))]])


def _solve_scaled(matrix: Array, right: Array) -> Array:
    """Return matrix^-1 right, with rows and columns of one size: masses and 1/h differ widely."""
    rows = np.max(np.abs(matrix), axis=1)
    columns = np.max(np.abs(matrix / rows[:, None]), axis=0)
    by_row = right / rows if right.ndim == 1 else right / rows[:, None]
    solved = np.linalg.solve(matrix / rows[:, None] / columns, by_row)
    return np.asarray(solved / columns if right.ndim == 1 else solved / columns[:, None])


def _kernel(matrix: Array) -> Array:
    """Return an orthonormal basis of the vectors that a matrix of full rank maps to 0, as columns."""
    return np.asarray(np.linalg.svd(matrix)[2][len(matrix) :].T)
