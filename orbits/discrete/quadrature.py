"""Discrete Lagrangians of the Newtonian N-body problem by a quadrature of the action over one step.

    trapezoidal   L_d(q0, q1; h) = h/2 [L(q0, (q1 - q0)/h) + L(q1, (q1 - q0)/h)]
    midpoint      L_d(q0, q1; h) = h L((q0 + q1)/2, (q1 - q0)/h)

The discrete Euler–Lagrange equations are D2 L_d(q_{k-1}, q_k; h) + D1 L_d(q_k, q_{k+1}; h) = 0, and the discrete
momenta are p_k = -D1 L_d(q_k, q_{k+1}; h) = D2 L_d(q_{k-1}, q_k; h). Masses are GM throughout, so momenta are GM times
velocity.

Source: Marsden & West (2001), sec. 1.3, 2.1, 2.6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.kernels.gravity import body_accelerations, pair_potential
from orbits.lagrangians.newtonian import parameters

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DiscreteLagrangian:
    """L_d(q0, q1; h) with its two derivatives, for bodies with masses `gm` and Plummer `softening`.

    All functions take (q0, q1, h) with positions of shape (n, 3); `value` returns a float, `d1` and `d2` (n, 3).
    """

    name: str
    value: Callable[[Array, Array, float], float]
    d1: Callable[[Array, Array, float], Array]
    d2: Callable[[Array, Array, float], Array]


def trapezoidal(gm: Array, softening: float = 0.0) -> DiscreteLagrangian:
    """Return the trapezoidal discrete Lagrangian; its Euler–Lagrange equations are Störmer–Verlet."""
    mass, potential, force = _ingredients(gm, softening)

    def value(q0: Array, q1: Array, h: float) -> float:
        return _kinetic_action(mass, q0, q1, h) - h / 2 * (potential(q0) + potential(q1))

    def d1(q0: Array, q1: Array, h: float) -> Array:
        return -mass * (q1 - q0) / h + h / 2 * force(q0)

    def d2(q0: Array, q1: Array, h: float) -> Array:
        return mass * (q1 - q0) / h + h / 2 * force(q1)

    return DiscreteLagrangian("trapezoidal", value, d1, d2)


def midpoint(gm: Array, softening: float = 0.0) -> DiscreteLagrangian:
    """Return the midpoint discrete Lagrangian; its Euler–Lagrange equations are the implicit midpoint rule, Gauss with
    one stage.
    """
    mass, potential, force = _ingredients(gm, softening)

    def value(q0: Array, q1: Array, h: float) -> float:
        return _kinetic_action(mass, q0, q1, h) - h * potential((q0 + q1) / 2)

    def d1(q0: Array, q1: Array, h: float) -> Array:
        return -mass * (q1 - q0) / h + h / 2 * force((q0 + q1) / 2)

    def d2(q0: Array, q1: Array, h: float) -> Array:
        return mass * (q1 - q0) / h + h / 2 * force((q0 + q1) / 2)

    return DiscreteLagrangian("midpoint", value, d1, d2)


def euler_lagrange_residual(discrete: DiscreteLagrangian, path: Array, h: float) -> Array:
    """Return D2 L_d(q_{k-1}, q_k) + D1 L_d(q_k, q_{k+1}) at the inner points of a path with uniform spacing h.

    path : (N, n, 3) with N >= 3; the result is (N - 2, n, 3), in units of momentum
    A path that solves the equations leaves round-off: about 2^-53 |q| GM / h, because neighbouring positions are
    subtracted. Raises InputError for a path of another shape.
    """
    if path.ndim != 3 or path.shape[2] != 3 or len(path) < 3:
        raise InputError(f"a path has shape (N, bodies, 3) with N >= 3 points, got {path.shape}")
    return np.array(
        [discrete.d2(a, b, h) + discrete.d1(b, c, h) for a, b, c in zip(path[:-2], path[1:-1], path[2:], strict=True)]
    )


def _kinetic_action(mass: Array, q0: Array, q1: Array, h: float) -> float:
    return float(np.sum(mass * (q1 - q0) ** 2)) / (2 * h)


def _ingredients(gm: Array, softening: float) -> tuple[Array, Callable[[Array], float], Callable[[Array], Array]]:
    gm = np.asarray(gm, dtype=np.float64)
    if not np.all(gm > 0.0):
        raise InputError("a discrete Lagrangian is that of the massive bodies, all GM > 0; leave the massless ones out")
    strength = parameters(gm, softening)
    mass = gm[:, None]

    def potential(q: Array) -> float:
        return float(pair_potential(strength, q.T.ravel()))

    def force(q: Array) -> Array:
        out = np.zeros(q.size + 8)
        body_accelerations(strength, np.concatenate([q.T.ravel(), np.zeros(8)]), out)
        acceleration: Array = out[: q.size].reshape(3, -1).T
        return mass * acceleration

    return mass, potential, force
