"""Rotations as homogeneous quaternions: four numbers q = (a, b, c, d), not 0, of any length.

The rotation of q takes vectors from the axes of a body to those of space: x -> R x. Its rates, the angular velocity in
the axes of the body, are those of dR/dt = R S(rates), with S(w) x = w cross x.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import InputError, shown

Array = NDArray[np.float64]

NO_ROTATION = 1e-9
"""A matrix is a rotation if R^T R differs from 1 by no more than this."""


def product(p: ArrayLike, q: ArrayLike) -> Array:
    """Return the product of quaternions, (..., 4): the rotation by q, then that by p."""
    a, b, c, d = np.moveaxis(_quaternions(p, "p"), -1, 0)
    e, f, g, h = np.moveaxis(_quaternions(q, "q"), -1, 0)
    parts = (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def matrices(q: ArrayLike) -> Array:
    """Return the matrices of rotations, (..., 3, 3); q : (..., 4), not 0. Raises InputError for other shapes."""
    q = _quaternions(q, "q")
    size = np.linalg.norm(q, axis=-1)
    if not np.all(size > 0.0):
        raise InputError("q has quaternions that are 0, or not finite, which are no rotations.")
    a, b, c, d = np.moveaxis(q / size[..., None], -1, 0)
    rows = (
        (1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)),
        (2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)),
        (2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def body_rates(q: ArrayLike, v: ArrayLike) -> Array:
    """Return angular velocities in the axes of the body, (..., 3), from quaternions and their velocities, (..., 4)."""
    q, v = _quaternions(q, "q"), _quaternions(v, "v")
    conjugate = q * np.array([1.0, -1.0, -1.0, -1.0])
    return np.asarray(2.0 * product(conjugate, v)[..., 1:] / (q * q).sum(axis=-1)[..., None])


def start(rates: ArrayLike, attitude: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return a unit quaternion and its velocity, (4,) each.

    rates : the angular velocity in the axes of the body, (3,)
    attitude : a quaternion, (4,), or the matrix of a rotation, (3, 3); by default the axes are those of space

    Raises InputError for numbers that are not finite, and for a matrix that is no rotation, with its distance from one.
    """
    spin = np.asarray(rates, dtype=np.float64)
    if spin.shape != (3,) or not np.all(np.isfinite(spin)):
        raise InputError(f"rates is {shown(rates)}; expected three finite numbers.")
    q = np.array([1.0, 0.0, 0.0, 0.0]) if attitude is None else _attitude(attitude)
    return q, 0.5 * product(q, np.concatenate([[0.0], spin]))


def _attitude(given: ArrayLike) -> Array:
    """Return the unit quaternion of an attitude."""
    found = np.asarray(given, dtype=np.float64)
    if found.shape == (4,) and np.all(np.isfinite(found)) and found.any():
        return np.asarray(found / np.linalg.norm(found))
    if found.shape != (3, 3) or not np.all(np.isfinite(found)):
        raise InputError(
            f"attitude is {shown(given)}; expected a quaternion, (4,), not 0, or the matrix of a rotation, (3, 3)."
        )
    off = float(np.abs(found.T @ found - np.eye(3)).max())
    if off > NO_ROTATION or np.linalg.det(found) < 0.0:
        what = f"R^T R differs from 1 by {off:.2g}" if off > NO_ROTATION else "it is a reflection"
        raise InputError(f"attitude is a matrix that is no rotation: {what}. Rotations have R^T R = 1 and det R = 1.")
    # The largest of the four numbers is found from the diagonal, so that no division loses digits.
    squares = 0.25 * (1.0 + np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) @ np.diag(found))
    k = int(np.argmax(squares))
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = found
    products = np.array(
        [
            [4 * squares[0], zy - yz, xz - zx, yx - xy],
            [zy - yz, 4 * squares[1], yx + xy, xz + zx],
            [xz - zx, yx + xy, 4 * squares[2], zy + yz],
            [yx - xy, xz + zx, zy + yz, 4 * squares[3]],
        ]
    )
    return np.asarray(products[k] / np.linalg.norm(products[k]))


def _quaternions(given: Any, what: str) -> Array:
    found = np.asarray(given, dtype=np.float64)
    if found.ndim == 0 or found.shape[-1] != 4:
        raise InputError(f"{what} has the shape {found.shape}; expected quaternions, (..., 4).")
    return found
