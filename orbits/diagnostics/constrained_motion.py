"""Motions with constraints without a constrained method: the equations with the multipliers eliminated.

From g(q) = 0 twice differentiated, with W = G M^-1 and F = dL/dq,

    q'' = M^-1 F - W^T lambda,      (G W^T) lambda = W F + v . (d2g/dq2) v,

an ordinary differential equation that keeps g = 0. It is solved by Gauss collocation of order 16, in NumPy: a reference
for constrained methods, which has nothing in common with them.

Source: Hairer, Lubich & Wanner (2006), sec. VII.1.1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError
from orbits.lagrangians.base import Lagrangian
from orbits.lagrangians.constraints import constraint_hessians, constraint_values, directions
from orbits.tableaux import gauss

Array = NDArray[np.float64]
STAGES = 8
SWEEPS = 60


def acceleration(lagrangian: Lagrangian, mass: Array, q: Array, v: Array) -> Array:
    """Return q'', (d,), on the constraints; mass : the matrix d2L/dv dv."""
    F, _ = lagrangian.gradients(q, v)
    G, W = constraint_values(lagrangian, q)[1], directions(lagrangian, q)
    right = W @ F + np.einsum("i,aij,j->a", v, constraint_hessians(lagrangian, q), v)
    kept: Array = np.linalg.solve(mass, F) - W.T @ np.linalg.solve(G @ W.T, right)
    return kept


def motion(lagrangian: Lagrangian, q: Array, v: Array, time: float, steps: int) -> tuple[Array, Array, float]:
    """Return the changes of q and v, (d,), over a time, in so many steps, and the action. Raises ConvergenceError for
    steps that are too long.
    """
    tableau = gauss(STAGES)
    a, b, h = tableau.a, tableau.b, time / steps
    mass = lagrangian.hessians(q, v)[2]
    moved, faster, action = np.zeros_like(q), np.zeros_like(v), []
    start, speed = q, v
    for _ in range(steps):
        q, v = start + moved, speed + faster
        A = np.tile(acceleration(lagrangian, mass, q, v), (STAGES, 1))
        last = np.inf
        for _ in range(SWEEPS):
            V = v + h * a @ A
            Q = q + h * a @ V
            new = np.array([acceleration(lagrangian, mass, x, w) for x, w in zip(Q, V, strict=True)])
            size = h * float(np.max(np.abs(new - A)))
            A = new
            if size == 0.0 or (size >= 0.5 * last and size <= 1e-12 * max(1.0, float(np.max(np.abs(V))))):
                break
            last = size
        else:
            raise ConvergenceError(
                f"'{lagrangian.name}': collocation does not converge with steps of {h:.6g}; use shorter ones."
            )
        V = v + h * a @ A
        Q = q + h * a @ V
        action += [h * weight * lagrangian.value(x, w) for weight, x, w in zip(b, Q, V, strict=True)]
        moved, faster = moved + h * (b @ V), faster + h * (b @ A)
    return moved, faster, math.fsum(action)
