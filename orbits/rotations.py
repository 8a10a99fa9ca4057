"""Rotations as homogeneous quaternions: four numbers q = (a, b, c, d), not 0, of any length.

The rotation of q takes vectors from the axes of a body to those of space: x -> R x. Its rates, the angular velocity in
the axes of the body, are those of dR/dt = R S(rates), with S(w) x = w cross x.

A body without torques moves by a closed form: `free_rotation`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_numbers, real_numbers
from orbits.errors import InputError, shown

__all__ = ["body_rates", "free_rotation", "matrices", "product", "start"]

Array = NDArray[np.float64]

SLACK = 1e-12
"""The triangle inequality of moments of inertia may be violated by this fraction: rounding of flat bodies."""

NO_ROTATION = 1e-9
"""A matrix is a rotation if R^T R differs from 1 by no more than this."""


MOST_RADIANS = 1e13
"""Longest rotation in closed form: 1e-16 of its angle is 1e-3 radians."""


def product(p: ArrayLike, q: ArrayLike) -> Array:
    """Return the product of quaternions, (..., 4): the rotation by q, then that by p.

    Raises InputError for other shapes, and for shapes that do not go together.
    """
    a, b, c, d = np.moveaxis(_quaternions(p, "p"), -1, 0)
    e, f, g, h = np.moveaxis(_quaternions(q, "q"), -1, 0)
    _require_pairs(a, e, "p", "q")
    parts = (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def matrices(q: ArrayLike) -> Array:
    """Return the matrices of rotations, (..., 3, 3); q : (..., 4), not 0. Raises InputError for other shapes."""
    q, _ = _near_one(_quaternions(q, "q"))
    a, b, c, d = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = (
        (1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)),
        (2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)),
        (2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def body_rates(q: ArrayLike, v: ArrayLike) -> Array:
    """Return angular velocities in the axes of the body, (..., 3), from quaternions, not 0, and their velocities,
    (..., 4). Raises InputError for other shapes, and for shapes that do not go together.
    """
    q, v = _quaternions(q, "q"), _quaternions(v, "v")
    _require_pairs(q[..., 0], v[..., 0], "q", "v")
    q, power = _near_one(q)
    v = np.ldexp(v, -power)
    conjugate = q * np.array([1.0, -1.0, -1.0, -1.0])
    return np.asarray(2.0 * product(conjugate, v)[..., 1:] / (q * q).sum(axis=-1)[..., None])


def start(rates: ArrayLike, attitude: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return a unit quaternion and its velocity, (4,) each.

    rates : the angular velocity in the axes of the body, (3,)
    attitude : a quaternion, (4,), or the matrix of a rotation, (3, 3); by default the axes are those of space

    Raises InputError for numbers that are not finite, and for a matrix that is no rotation, with its distance from one.
    """
    spin = real_numbers(rates, "rates")
    if spin.shape != (3,) or not np.all(np.isfinite(spin)):
        raise InputError(f"rates is {shown(rates)}; expected three finite numbers.")
    q = np.array([1.0, 0.0, 0.0, 0.0]) if attitude is None else _attitude(attitude)
    return q, 0.5 * product(q, np.concatenate([[0.0], spin]))


def free_rotation(
    inertia: ArrayLike, times: ArrayLike, *, rates: ArrayLike, attitude: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Return the attitudes and rates of a rigid body without torques, in closed form: the motion of Euler's top.

        q, rates = orbits.rotations.free_rotation((1, 2, 3), np.linspace(0, 100, 1001), rates=(0.01, 1, 0))
        orbits.rotations.matrices(q)

    inertia : the principal moments of inertia, (3,), in any order; equal ones too
    times : since the start, of any shape (...), of either sign and any length
    rates : the angular velocity at the start, in the axes of the body, (3,)
    attitude : that at the start: a quaternion, (4,), or the matrix of a rotation, (3, 3); by default the axes are those
        of space then

    Returns unit quaternions, (..., 4), continuous in time, and angular velocities in the axes of the body, (..., 3).
    Each time is computed from the start, to the rounding of the angle by which the body has turned: 1e-10 radians after
    100,000 revolutions.

    Raises InputError for moments that no body has, numbers that are not finite, and an attitude that is no rotation,
    with its distance from one.

    Source: Whittaker (1937), Analytical Dynamics, sec. 69-71; see `orbits.kernels.rotation.free_rotation`.
    """
    from orbits.kernels.rotation.free_rotation import rotated_at

    found = np.array(checked_moments(inertia))
    moments = np.ldexp(found, -np.frexp(found.max())[1])  # only their ratios count, and squares stay within floats
    q, _ = start(rates, attitude)
    when = finite_numbers(times, "times")
    angle = float(np.abs(when).max(initial=0.0)) * float(np.linalg.norm(np.asarray(rates, dtype=np.float64)))
    if angle > MOST_RADIANS:
        raise InputError(
            f"times: at the farthest the body has turned by some {angle:.2g} radians, which leaves no digits of its "
            f"attitude; expected rotations by up to {MOST_RADIANS:.0e} radians."
        )
    room = -(-max(when.size, 1) // 8) * 8
    flat = np.zeros(room)
    flat[: when.size] = when.ravel()
    attitudes, momenta = np.empty((4, room)), np.empty((3, room))
    momentum = moments * np.asarray(rates, dtype=np.float64)
    rotated_at(moments, q, momentum, flat, attitudes, momenta)
    spins = momenta[:, : when.size].T / moments
    return np.ascontiguousarray(attitudes[:, : when.size].T).reshape(*when.shape, 4), spins.reshape(*when.shape, 3)


def checked_moments(inertia: Any) -> tuple[float, float, float]:
    """Return principal moments of inertia. Raises InputError for those that no body has."""
    found = real_numbers(inertia, "inertia")
    if found.shape != (3,) or not np.all(np.isfinite(found)) or not np.all(found > 0.0):
        raise InputError(f"inertia is {shown(inertia)}; expected three principal moments of inertia > 0.")
    least = found.sum() - 2.0 * found.max()
    if least < -SLACK * found.max():
        raise InputError(
            f"inertia is {shown(found.tolist())}: the largest moment exceeds the sum of the others by {-least:.3g}, "
            "which no body has."
        )
    return float(found[0]), float(found[1]), float(found[2])


def _attitude(given: ArrayLike) -> Array:
    """Return the unit quaternion of an attitude."""
    found = real_numbers(given, "attitude")
    if found.shape == (4,) and np.all(np.isfinite(found)) and found.any():
        near, _ = _near_one(found)
        return np.asarray(near / np.linalg.norm(near))
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


def _near_one(q: Array) -> tuple[Array, NDArray[np.int32]]:
    """Return quaternions times powers of two, which leaves them of a length near 1, whose square is no infinity and no
    0, and these powers, (..., 1). Raises InputError for those that are no rotations.
    """
    size = np.abs(q).max(axis=-1, keepdims=True)
    if not np.all(np.isfinite(size) & (size > 0.0)):
        raise InputError("q has quaternions that are 0, or not finite, which are no rotations.")
    power = np.frexp(size)[1]
    return np.ldexp(q, -power), power


def _require_pairs(one: Array, other: Array, first: str, second: str) -> None:
    try:
        np.broadcast_shapes(one.shape, other.shape)
    except ValueError:
        raise InputError(
            f"{first} has {one.shape} quaternions, and {second} {other.shape}; expected as many, or one."
        ) from None


def _quaternions(given: Any, what: str) -> Array:
    found = real_numbers(given, what)
    if found.ndim == 0 or found.shape[-1] != 4:
        raise InputError(f"{what} has the shape {found.shape}; expected quaternions, (..., 4).")
    return found


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
