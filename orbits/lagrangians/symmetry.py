"""One-parameter groups of symmetries and their generators.

A group acts on configurations by q -> flow(s, q), flow(0, q) = q; its generator is xi(q) = d/ds flow(s, q) at s = 0. If
L is invariant under the group, Noether's theorem gives the conserved momentum map J = p . xi(q); if a discrete
Lagrangian is invariant, the discrete theorem keeps p_k . xi(q_k) along its discrete trajectories, exactly.

Source: Marsden & West (2001), sec. 1.2.3, 1.3.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import InputError, shown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Symmetry:
    """A one-parameter group that acts on the configurations of a mechanical system.

    name : for tables
    flow : (s, q) -> q moved by the group, q a vector of shape (d,)
    generator : q -> xi(q) of shape (d,), the derivative of `flow` at s = 0
    """

    name: str
    flow: Callable[[float, Array], Array]
    generator: Callable[[Array], Array]

    def defect(self, q: Array) -> float:
        """Return by how much `generator` misses the derivative of `flow` at q, relative to their size.

        A central difference of eighth order: what is left of a correct pair is about 1e-12.
        """
        q = np.asarray(q, dtype=np.float64)
        step = 0.01
        weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
        slope = sum(w * (self.flow(m * step, q) - self.flow(-m * step, q)) for m, w in weights.items()) / step
        xi = self.generator(q)
        return float(np.max(np.abs(slope - xi)) / max(np.max(np.abs(xi)), np.max(np.abs(slope)), 1e-300))


def translation(direction: ArrayLike, *, copies: int = 1, name: str = "translation") -> Symmetry:
    """Return the translation q -> q + s u by one vector u, repeated for each of `copies` bodies.

    direction : (k,), not zero; the configuration is a vector of copies * k coordinates, body after body
    """
    u = np.tile(np.asarray(direction, dtype=np.float64), copies)
    if u.ndim != 1 or not np.all(np.isfinite(u)) or not np.any(u):
        raise InputError(f"a translation needs a direction, a finite vector that is not zero; got {shown(direction)}")

    def flow(s: float, q: Array) -> Array:
        moved: Array = q + s * u
        return moved

    return Symmetry(name, flow, lambda q: u.copy())


def rotation(axis: ArrayLike | None = None, *, copies: int = 1, name: str = "rotation") -> Symmetry:
    """Return the rotation of every body about an axis through the origin; in the plane without `axis`.

    axis : (3,), not zero, for bodies in space; None for bodies in the plane, with two coordinates each
    The configuration is a vector, body after body. The generator of a body at x is axis x x, |axis| = 1.
    """
    if axis is None:
        width, spin = 2, np.array([[0.0, -1.0], [1.0, 0.0]])
    else:
        n = np.asarray(axis, dtype=np.float64)
        if n.shape != (3,) or not np.all(np.isfinite(n)) or not np.any(n):
            raise InputError(f"a rotation needs an axis, three finite numbers not all zero; got {shown(axis)}")
        n = n / np.sqrt(n @ n)
        width, spin = 3, np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])

    def flow(s: float, q: Array) -> Array:
        # Rodrigues: exp(s S) = 1 + sin(s) S + (1 - cos(s)) S^2, also in the plane, where S^2 = -1.
        turn = np.eye(width) + np.sin(s) * spin + 2.0 * np.sin(s / 2.0) ** 2 * (spin @ spin)
        moved: Array = (q.reshape(copies, width) @ turn.T).ravel()
        return moved

    def generator(q: Array) -> Array:
        xi: Array = (q.reshape(copies, width) @ spin.T).ravel()
        return xi

    return Symmetry(name, flow, generator)
