"""Discrete Lagrangians by a quadrature of the action along the straight line from q0 to q1.

    L_d(q0, q1; h) = h sum_k w_k L((1 - theta_k) q0 + theta_k q1, (q1 - q0)/h, t + theta_k h)

    symplectic Euler A   w = 1          theta = 1        q1 with the new force; order 1
    symplectic Euler B   w = 1          theta = 0        the adjoint of A; order 1
    trapezoidal          w = 1/2, 1/2   theta = 0, 1     Störmer–Verlet, if L is separable; order 2, symmetric
    midpoint             w = 1          theta = 1/2      the implicit midpoint rule, Gauss with one stage; order 2

Source: Marsden & West (2001), sec. 2.1, 2.6; Hairer, Lubich & Wanner (2006), sec. VI.6.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbits.discrete.base import Array, DiscreteLagrangian, Mechanics, require_mechanics


@dataclass(frozen=True, eq=False, repr=False)
class Quadrature(DiscreteLagrangian):
    """The quadrature of the action with weights w_k at the fractions theta_k of the straight line."""

    name: str
    lagrangian: Mechanics
    weights: tuple[float, ...]
    nodes: tuple[float, ...]

    def __post_init__(self) -> None:
        """Raise InputError for what is no Lagrangian."""
        require_mechanics(self.lagrangian)

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        # Differences first: q is O(30 au), dq is O(1e-3 au).
        dq = q1 - q0
        value, d1, d2 = 0.0, np.zeros(q0.size), np.zeros(q0.size)
        for w, theta in zip(self.weights, self.nodes, strict=True):
            q, v, at = q0 + theta * dq if theta < 1.0 else q1, dq / h, t + theta * h
            f, p = self.lagrangian.gradients(q, v, at)
            value += h * w * self.lagrangian.value(q, v, at)
            d1 += w * ((1.0 - theta) * h * f - p)
            d2 += w * (theta * h * f + p)
        return value, d1, d2

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        dq, d = q1 - q0, q0.size
        d11, d12, d22 = np.zeros((d, d)), np.zeros((d, d)), np.zeros((d, d))
        for w, theta in zip(self.weights, self.nodes, strict=True):
            q, rest = q0 + theta * dq if theta < 1.0 else q1, 1.0 - theta
            qq, qv, vv = self.lagrangian.hessians(q, dq / h, t + theta * h)
            d11 += w * (rest * rest * h * qq - rest * (qv + qv.T) + vv / h)
            d12 += w * (rest * theta * h * qq + rest * qv - theta * qv.T - vv / h)
            d22 += w * (theta * theta * h * qq + theta * (qv + qv.T) + vv / h)
        return d11, d12, d22


def symplectic_euler_a(lagrangian: Mechanics) -> Quadrature:
    """Return h L(q1, (q1 - q0)/h): order 1, the adjoint of `symplectic_euler_b`."""
    return Quadrature("symplectic-euler-a", lagrangian, (1.0,), (1.0,))


def symplectic_euler_b(lagrangian: Mechanics) -> Quadrature:
    """Return h L(q0, (q1 - q0)/h): order 1, the adjoint of `symplectic_euler_a`."""
    return Quadrature("symplectic-euler-b", lagrangian, (1.0,), (0.0,))


def trapezoidal(lagrangian: Mechanics) -> Quadrature:
    """Return h/2 [L(q0, (q1 - q0)/h) + L(q1, (q1 - q0)/h)]: order 2, symmetric; Störmer–Verlet if L is separable."""
    return Quadrature("trapezoidal", lagrangian, (0.5, 0.5), (0.0, 1.0))


def midpoint(lagrangian: Mechanics) -> Quadrature:
    """Return h L((q0 + q1)/2, (q1 - q0)/h): order 2, symmetric; Gauss with one stage."""
    return Quadrature("midpoint", lagrangian, (1.0,), (0.5,))
