"""The discrete Lagrangian of Wisdom–Holman maps in Jacobi coordinates, without a corrector.

With the centre of mass Q, Jacobi coordinates and masses r'_i, m'_i = m_i M_(i-1)/M_i (`orbits.kernels.maps.jacobi`),
the Lagrangian of point masses is a free particle of mass M and Kepler problems of attracting masses M_i, less a
potential:

    V(q) = - sum_(i<j) m_i m_j / |q_i - q_j| + sum_i m_i M_(i-1) / |r'_i|,     m for GM as everywhere

    L_d(q, q+; h) = M |Q+ - Q|^2/(2h) + sum_i m'_i S_i(r'_i, r'_i+; h) - h/2 [V(q) + V(q+)]

S_i is the exact discrete Lagrangian of Kepler's problem per unit mass (`orbits.discrete.lambert`): for arcs below one
half of a revolution. The discrete Euler–Lagrange equations are half a kick, Kepler motions, half a kick.

Source: Wisdom & Holman (1991), AJ 102, 1528; Marsden & West (2001), sec. 1.6, 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbits.discrete.base import Array, DiscreteLagrangian, Mechanics
from orbits.discrete.lambert import ExactKepler, exact_kepler


@dataclass(frozen=True, eq=False, repr=False)
class KeplerSplittingLagrangian(DiscreteLagrangian):
    """See `kepler_splitting`.

    change : (n, n), makes the centre of mass and then r'_1 ... of the positions; parts : S_1 ...; total : M
    """

    name: str
    lagrangian: Mechanics
    change: Array
    parts: tuple[ExactKepler, ...]
    total: float

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        r0, r1 = self._jacobi(q0), self._jacobi(q1)
        way = r1[0] - r0[0]
        value = 0.5 * self.total * float(way @ way) / h
        d1, d2 = np.zeros_like(r0), np.zeros_like(r1)
        d1[0], d2[0] = -self.total / h * way, self.total / h * way
        for i, part in enumerate(self.parts, 1):
            one, d1[i], d2[i] = part.first(r0[i], r1[i], h)
            value += one
        (v0, f0), (v1, f1) = self._potential(q0), self._potential(q1)
        return (
            value - 0.5 * h * (v0 + v1),
            (self.change.T @ d1).ravel() - 0.5 * h * f0,
            (self.change.T @ d2).ravel() - 0.5 * h * f1,
        )

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        r0, r1 = self._jacobi(q0), self._jacobi(q1)
        n, out = len(r0), []
        free = self.total / h * np.eye(3)
        blocks = [(free, -free, free), *(part.hessian(r0[i], r1[i], h) for i, part in enumerate(self.parts, 1))]
        for k in range(3):
            whole = np.einsum("ia,ixy,ib->axby", self.change, np.array([block[k] for block in blocks]), self.change)
            out.append(whole.reshape(3 * n, 3 * n))
        return out[0] - 0.5 * h * self._tide(q0), out[1], out[2] - 0.5 * h * self._tide(q1)

    def _jacobi(self, q: Array) -> Array:
        """Return the centre of mass and r'_1 ..., (n, 3)."""
        return np.asarray(self.change @ q.reshape(-1, 3))

    def _potential(self, q: Array) -> tuple[float, Array]:
        """Return V and dV/dq."""
        rest = np.zeros_like(q)
        value, slope = -self.lagrangian.value(q, rest), -self.lagrangian.gradients(q, rest)[0]
        r = self._jacobi(q)
        pulls = np.zeros_like(r)
        for i, part in enumerate(self.parts, 1):
            distance = float(np.sqrt(r[i] @ r[i]))
            value += part.mass * part.gm / distance
            pulls[i] = -part.mass * part.gm * r[i] / distance**3
        return value, slope + (self.change.T @ pulls).ravel()

    def _tide(self, q: Array) -> Array:
        """Return d2V/dq dq."""
        r, n = self._jacobi(q), len(q) // 3
        blocks = np.zeros((n, 3, 3))
        for i, part in enumerate(self.parts, 1):
            d2 = float(r[i] @ r[i])
            blocks[i] = part.mass * part.gm * (3.0 * np.outer(r[i], r[i]) / d2 - np.eye(3)) / d2**1.5
        whole = np.einsum("ia,ixy,ib->axby", self.change, blocks, self.change).reshape(3 * n, 3 * n)
        return np.asarray(whole - self.lagrangian.hessians(q, np.zeros_like(q))[0])


def kepler_splitting(lagrangian: Mechanics, order: list[int]) -> KeplerSplittingLagrangian:
    """Return the discrete Lagrangian of `WisdomHolman(kernel="standard", corrector=0)`.

    lagrangian : that of point masses, with their GM as parameters GM1, GM2, ...
    order : the numbers of the bodies, the dominant one first, then the planets outwards
    Raises InputError, when it is evaluated, for arcs of half a revolution or more.
    """
    gm = np.array([value for name, value in lagrangian.parameters.items() if name.startswith("GM")])[order]
    inside = np.cumsum(gm)
    n = len(gm)
    change = np.zeros((n, n))
    change[0, order] = gm / inside[-1]
    for i in range(1, n):
        change[i, order[i]] = 1.0
        change[i, order[:i]] = -gm[:i] / inside[i - 1]
    parts = tuple(exact_kepler(inside[i], mass=gm[i] * inside[i - 1] / inside[i]) for i in range(1, n))
    return KeplerSplittingLagrangian("kepler-splitting", lagrangian, change, parts, float(inside[-1]))


__all__ = ["KeplerSplittingLagrangian", "kepler_splitting"]
