"""The exact discrete Lagrangian of a free rigid body: the action of its motion from R0 to R1 in the time h.

S depends on F = R0^T R1 alone. The momentum Pi_0 of the motion from 1 to F is found by Newton's method; then, with
Pi_1 = F^T Pi_0,

    S = h/2 Pi_0 J^-1 Pi_0,     D1 S = -Pi_0,     D2 S = Pi_1

in the axes of the body. The derivative A of the turn by Pi_0 is that of the linear equation of neighbouring motions,

    W' = R J^-1 [R^T delta + Pi x R^T W],     W(0) = 0,     A delta = R(h)^T W(h)

and gives all second derivatives: for a further turn zeta of F,

    delta Pi_0 = A^-1 zeta,     delta Pi_1 = F^T delta Pi_0 + Pi_1 x zeta

Motions are those of Gauss collocation with twelve stages. They share nothing with the compiled closed form of
`orbits.kernels.rotation.free_rotation`, which they judge.

Source: Marsden & West (2001), sec. 1.6; Marsden, Pekarsky & Shkoller (1999), Nonlinearity 12, 1647.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from orbits.discrete.base import Array, Jet
from orbits.errors import ConvergenceError
from orbits.rotations import matrices, product
from orbits.tableaux.gauss import gauss

UNITS = np.zeros((4, 4, 4))
"""z_k = sum_ij UNITS[k, i, j] q0_i q1_j, the product q0_conjugate q1."""
for _i, _j, _k, _sign in (
    *((i, i, 0, 1.0) for i in range(4)),
    *((0, j, j, 1.0) for j in range(1, 4)),
    *((i, 0, i, -1.0) for i in range(1, 4)),
    *((1 + a, 1 + (a + 1) % 3, 1 + (a + 2) % 3, -1.0) for a in range(3)),
    *((1 + (a + 1) % 3, 1 + a, 1 + (a + 2) % 3, 1.0) for a in range(3)),
):
    UNITS[_k, _i, _j] = _sign

STAGES = 12
RADIANS = 0.7
"""Longest turn of one collocation: of order 24, it then has all digits."""

ROUNDS = 40


def exactly_turning(x: Array, y: Array, moments: Array, h: float) -> Jet:
    """Return S from one quaternion to another, with its derivatives by their four numbers.

    The motion found is the one that leads back to the shortest turn as moments become equal. Raises ConvergenceError if
    none is found: the turn is near half a revolution.
    """
    X, Y = float(x @ x), float(y @ y)
    z = product(x * _CONJUGATE, y) / math.sqrt(X * Y)
    z = -z if z[0] < 0.0 else z
    momentum, slope, after = _joining(z, moments, h)
    F = matrices(z)
    toward = np.linalg.inv(slope)  # dPi_0 by a further turn of F
    by_turn = F.T @ toward + _skew(after)  # dPi_1
    first, last = 2.0 / X * _axes(x), 2.0 / Y * _axes(y)
    d1, d2 = -first @ momentum, last @ after
    d11 = first @ (toward @ F.T) @ first.T - _spread(x, momentum)
    d12 = -first @ (by_turn @ F.T).T @ last.T
    d22 = last @ by_turn @ last.T + _spread(y, after)
    value = 0.5 * h * float(momentum @ (momentum / moments))
    return Jet(value, d1, d2, 0.5 * (d11 + d11.T), d12, 0.5 * (d22 + d22.T))


def _joining(z: Array, moments: Array, h: float) -> tuple[Array, Array, Array]:
    """Return Pi_0 of the motion from 1 to the rotation of z, the derivative of the turn by it, and Pi_1."""
    rates = _vector(z) / h
    last = np.inf
    for _ in range(ROUNDS):
        slope, end, after = _neighbours(rates, moments, h)
        missing = _vector(product(end * _CONJUGATE, z))
        change = np.linalg.solve(slope, missing) / moments
        size = float(np.max(np.abs(change)))
        if not math.isfinite(size):
            break
        near = size <= 1e-7 * float(np.max(np.abs(rates)))
        if size == 0.0 or (near and size >= 0.5 * last):
            return moments * rates, slope, after
        rates, last = rates + change, size
    raise ConvergenceError(
        f"no motion of a free body with the moments {moments.tolist()} was found that turns it by "
        f"{2.0 * math.acos(min(1.0, abs(float(z[0])))):.3g} radians in h = {h:.6g}. Use a smaller h."
    )


def _neighbours(rates: Array, moments: Array, h: float) -> tuple[Array, Array, Array]:
    """Return the derivative of the turn in the time h by Pi_0, the quaternion of the turn, and Pi_1."""
    pieces = max(1, math.ceil(abs(h) * float(np.linalg.norm(rates)) / RADIANS))
    small = h / pieces
    momentum, q, W = moments * rates, np.array([1.0, 0.0, 0.0, 0.0]), np.zeros((3, 3))
    for _ in range(pieces):
        momenta, momentum = _euler(momentum, moments, small)
        # q' = q (0, Omega)/2
        turning = 0.5 * np.stack([product(unit, _whole(momenta / moments)) for unit in np.eye(4)], axis=2)
        attitudes, ended = _linear(turning, np.zeros((len(momenta), 4, 1)), q[:, None], small)
        q = ended[:, 0]
        R = matrices(attitudes[..., 0])
        turned = np.swapaxes(R, 1, 2)
        mixed = (R / moments) @ np.cross(momenta[:, None, :], R).swapaxes(1, 2)
        _, W = _linear(mixed, (R / moments) @ turned, W, small)
    return matrices(q).T @ W, q, momentum


def _euler(momentum: Array, moments: Array, h: float) -> tuple[Array, Array]:
    """Return the momenta at the nodes of a step of Euler's equations, Pi' = Pi x J^-1 Pi, and at its end."""
    a, b = _table()
    s, one = len(b), np.eye(3)
    P, last = np.tile(momentum, (s, 1)), np.inf
    for _ in range(ROUNDS):
        slopes = np.cross(P, P / moments)
        # Rows are what a unit of each momentum does.
        by_P = (np.cross(one, (P / moments)[:, None, :]) + np.cross(P[:, None, :], one / moments)).swapaxes(1, 2)
        matrix = np.eye(3 * s) - h * np.einsum("ij,jab->iajb", a, by_P).reshape(3 * s, 3 * s)
        change = np.linalg.solve(matrix, (momentum + h * a @ slopes - P).ravel()).reshape(s, 3)
        P = P + change
        size = float(np.max(np.abs(change)))
        if size == 0.0 or not size < 0.5 * last:
            break
        last = size
    return P, momentum + h * b @ np.cross(P, P / moments)


def _linear(mixed: Array, forced: Array, y: Array, h: float) -> tuple[Array, Array]:
    """Return y at the nodes of a step of y' = mixed y + forced, and at its end; mixed : (s, n, n) at the nodes."""
    a, b = _table()
    s, n = mixed.shape[:2]
    matrix = np.eye(n * s) - h * np.einsum("ij,iab->iajb", a, mixed).reshape(n * s, n * s)
    slopes = np.linalg.solve(matrix, (forced + mixed @ y).reshape(n * s, -1)).reshape(s, n, -1)
    return y + h * np.einsum("ij,jab->iab", a, slopes), y + h * np.einsum("i,iab->ab", b, slopes)


def _whole(x: Array) -> Array:
    """Return vectors, (s, 3), as quaternions."""
    return np.concatenate([np.zeros((len(x), 1)), x], axis=1)


@lru_cache(maxsize=1)
def _table() -> tuple[Array, Array]:
    tableau = gauss(STAGES)
    return tableau.a, tableau.b


def _vector(z: Array) -> Array:
    """Return the vector of a rotation, of the angle's length, from a unit quaternion; the shorter one."""
    length = float(np.linalg.norm(z[1:]))
    angle = 2.0 * math.atan2(length, abs(float(z[0])))
    turned: Array = math.copysign(angle / length, z[0]) * z[1:] if length > 0.0 else np.zeros(3)
    return turned


def _axes(x: Array) -> Array:
    """Return the products of a quaternion with the units from the right, (4, 3)."""
    return np.asarray(np.einsum("kij,i->jk", UNITS, x)[:, 1:])


def _spread(x: Array, momentum: Array) -> Array:
    """Return the derivative of 2 x (0, momentum)/|x|^2 by x, (4, 4): rows belong to the result."""
    X = float(x @ x)
    whole = np.concatenate([[0.0], momentum])
    by_x = np.stack([product(unit, whole) for unit in np.eye(4)], axis=1)
    return np.asarray(2.0 / X * (by_x - 2.0 / X * np.outer(product(x, whole), x)))


def _skew(x: Array) -> Array:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
