"""Exact discrete Lagrangians of linear motion, L = v.Mv/2 - q.Kq/2: the free particle and the harmonic oscillator.

In a normal mode x of frequency omega and unit mass, phi = omega h,

    L_d = omega/2 [(x1 - x0)^2 cot phi - 2 x0 x1 tan(phi/2)],      (x1 - x0)^2/(2h) for omega = 0,

which is omega/(2 sin phi) [(x0^2 + x1^2) cos phi - 2 x0 x1] without its cancellation for small phi.

Source: Marsden & West (2001), sec. 1.6; Feynman & Hibbs (1965), problem 3-8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number, real_numbers, whole_number
from orbits.discrete.base import Array, DiscreteLagrangian, Mechanics
from orbits.errors import InputError
from orbits.lagrangians.base import show

CONJUGATE = 1e-8
"""Nearer than this to a whole number of half periods, the ends determine the motion to less than half of all digits."""


@dataclass(frozen=True, eq=False, repr=False)
class ExactLinear(DiscreteLagrangian):
    """The exact discrete Lagrangian in normal modes; see `exact_linear`.

    modes : (d, d), q = modes x; kinetic energy |x'|^2/2; omega : (d,) frequencies
    """

    name: str
    lagrangian: Mechanics | None
    modes: Array
    inverse: Array
    omega: Array

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        stretch, turn = self._coefficients(q0, h)
        x0, x1, dx = self.inverse @ q0, self.inverse @ q1, self.inverse @ (q1 - q0)
        value = 0.5 * float(stretch @ (dx * dx)) - float(turn @ (x0 * x1))
        return value, self.inverse.T @ (-stretch * dx - turn * x1), self.inverse.T @ (stretch * dx - turn * x0)

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        stretch, turn = self._coefficients(q0, h)
        own: Array = (self.inverse.T * stretch) @ self.inverse
        mixed: Array = (self.inverse.T * (-stretch - turn)) @ self.inverse
        return own, mixed, own.copy()

    def guess(self, q: Array, p: Array, h: float, t: float) -> Array:
        """Return the exact q1 that p leads to."""
        x, y, phi = self.inverse @ q, self.modes.T @ p, self.omega * h
        moved: Array = self.modes @ (np.cos(phi) * x + h * np.sinc(phi / np.pi) * y)
        return moved

    def _coefficients(self, q0: Array, h: float) -> tuple[Array, Array]:
        """Return omega cot phi and omega tan(phi/2) of the modes."""
        if q0.size != self.omega.size:
            raise InputError(f"{self.name} has {self.omega.size} coordinates; got points with {q0.size}")
        phi = self.omega * h
        bad = (np.abs(np.sin(phi)) < CONJUGATE) & (np.abs(phi) > 1.0)
        if np.any(bad):
            raise InputError(
                f"{self.name}: h = {h!r} is a whole number of half periods of the mode with omega = "
                f"{show(self.omega[bad])}: q0 and q1 do not determine a motion (conjugate points). Use another h."
            )
        moving = phi != 0.0
        safe = np.where(moving, phi, 1.0)
        return np.where(moving, self.omega / np.tan(safe), 1.0 / h), self.omega * np.tan(0.5 * phi)


def exact_linear(mass: ArrayLike, stiffness: ArrayLike, *, lagrangian: Mechanics | None = None) -> ExactLinear:
    """Return the exact discrete Lagrangian of L = v.Mv/2 - q.Kq/2.

    mass : (d, d), symmetric, positive definite; stiffness : (d, d), symmetric, positive semi-definite
    Raises InputError for other matrices and, when it is used, for h at a whole number of half periods, where the ends
    do not determine a motion.
    """
    M, K = real_numbers(mass, "mass"), real_numbers(stiffness, "stiffness")
    if M.ndim != 2 or M.shape[0] != M.shape[1] or M.shape != K.shape or not np.all(np.isfinite([M, K])):
        raise InputError(
            f"mass and stiffness must be finite matrices of the same shape (d, d); got {M.shape} and {K.shape}"
        )
    if np.any(M.T != M) or np.any(K.T != K):
        raise InputError("mass and stiffness must be symmetric matrices")
    try:
        root = np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        raise InputError(f"the mass matrix {show(M)} is not positive definite: the Lagrangian is not regular") from None
    unit = np.linalg.inv(root)
    square, axes = np.linalg.eigh(unit @ K @ unit.T)
    if square[0] < -1e-14 * max(abs(square[0]), abs(square[-1])):
        raise InputError(f"the stiffness {show(K)} is not positive semi-definite: the motion does not oscillate")
    name = "exact-harmonic-oscillator" if np.any(K) else "exact-free-particle"
    inverse = axes.T @ root.T
    return ExactLinear(name, lagrangian, unit.T @ axes, inverse, np.sqrt(np.maximum(square, 0.0)))


def exact_free_particle(mass: float = 1.0, dimension: int = 1, *, lagrangian: Mechanics | None = None) -> ExactLinear:
    """Return mass |q1 - q0|^2 / (2h), the exact discrete Lagrangian of L = mass |v|^2/2."""
    return exact_harmonic_oscillator(mass, 0.0, dimension, lagrangian=lagrangian)


def exact_harmonic_oscillator(
    mass: float = 1.0, stiffness: float = 1.0, dimension: int = 1, *, lagrangian: Mechanics | None = None
) -> ExactLinear:
    """Return the exact discrete Lagrangian of L = mass |v|^2/2 - stiffness |q|^2/2."""
    one = np.eye(whole_number(dimension, "dimension"))
    return exact_linear(
        finite_number(mass, "mass") * one, finite_number(stiffness, "stiffness") * one, lagrangian=lagrangian
    )
