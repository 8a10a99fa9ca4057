"""Discrete Legendre transforms, the two-form of a discrete Lagrangian, and the exact derivative of its map.

    F-: (q0, q1) -> (q0, -D1 L_d(q0, q1)),      F+: (q0, q1) -> (q1, D2 L_d(q0, q1))
    omega = sum_ij (D1D2 L_d)_ij dq0_i ^ dq1_j, the pull-back of sum_i dp_i ^ dq_i by F- and by F+

F: (q0, q1) -> (q1, q2) preserves omega, and F~ = F- o F o (F-)^-1 = F+ o F o (F+)^-1 = F+ o (F-)^-1 is symplectic. L_d
is regular where D1D2 L_d is invertible; there F, F~ and the inverses exist.

Source: Marsden & West (2001), sec. 1.3.2, 1.5.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number
from orbits.discrete.base import Array, DiscreteLagrangian, time_step
from orbits.discrete.constrained import Constrained, require_constraints_kept
from orbits.discrete.evolution import advance, invert, step
from orbits.discrete.newton import solve
from orbits.errors import InputError, shown
from orbits.lagrangians.base import show

Sign = Literal["minus", "plus"]


def legendre_minus(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0
) -> tuple[Array, Array]:
    """Return (q0, p0) with p0 = -D1 L_d(q0, q1), each (d,)."""
    return discrete.vector(q0, "q0"), -discrete.d1(q0, q1, h, t)


def legendre_plus(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0
) -> tuple[Array, Array]:
    """Return (q1, p1) with p1 = D2 L_d(q0, q1), each (d,); t : time at q0."""
    return discrete.vector(q1, "q1"), discrete.d2(q0, q1, h, t)


def inverse_legendre_minus(
    discrete: DiscreteLagrangian, q0: ArrayLike, p0: ArrayLike, h: float, t: float = 0.0
) -> tuple[Array, Array]:
    """Return (q0, q1) with -D1 L_d(q0, q1) = p0, each (d,). Raises ConvergenceError, InputError."""
    return discrete.vector(q0, "q0"), step(discrete, q0, p0, h, t)[0]


def inverse_legendre_plus(
    discrete: DiscreteLagrangian, q1: ArrayLike, p1: ArrayLike, h: float, t: float = 0.0
) -> tuple[Array, Array]:
    """Return (q0, q1) with D2 L_d(q0, q1) = p1, each (d,); t : time at q0. Raises ConvergenceError, InputError."""
    x1, p = discrete.vector(q1, "q1"), discrete.vector(p1, "p1")
    h, t = time_step(h), finite_number(t, "t")
    require_constraints_kept(discrete)
    guess = discrete.guess(x1, p, -h, t + h)
    failure = f"{discrete.name}: no q0 leads to q1 = {show(x1)} with p1 = {show(p)}, h = {h:.6g}"
    if isinstance(discrete, Constrained):
        return discrete.previous_point(x1, p, h, t, guess, failure), x1

    def equations(x: Array) -> tuple[Array, Callable[[Array], Array]]:
        jet = discrete.jet(x, x1, h, t)
        return jet.d2 - p, lambda right: invert(discrete, jet.d12.T, right, x, x1)

    scale = max(float(np.max(np.abs(x1))), float(np.max(np.abs(guess))))
    return solve(equations, guess, scale=scale, failure=failure, time=t), x1


def momentum_mismatch(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, q2: ArrayLike, h: float, t: float = 0.0
) -> Array:
    """Return p+ - p- at q1, D2 L_d(q0, q1) + D1 L_d(q1, q2), (d,): 0 where the momenta match; t : time at q0."""
    mismatch: Array = discrete.d2(q0, q1, h, t) + discrete.d1(q1, q2, h, t + h)
    return mismatch


def phase_map(
    discrete: DiscreteLagrangian, q: ArrayLike, p: ArrayLike, h: float, t: float = 0.0, *, sign: Sign = "minus"
) -> tuple[Array, Array]:
    """Return F~(q, p) = F^sign o F o (F^sign)^-1, by way of Q x Q, (q1, p1); t : time at q.

    Both signs give the map of `step`. Each takes one step of F more than necessary, to demonstrate this.
    """
    h, t = time_step(h), finite_number(t, "t")
    if sign == "minus":
        q0, q1 = inverse_legendre_minus(discrete, q, p, h, t)
        return legendre_minus(discrete, *advance(discrete, q0, q1, h, t), h, t + h)
    if sign == "plus":
        q0, q1 = inverse_legendre_plus(discrete, q, p, h, t - h)
        return legendre_plus(discrete, *advance(discrete, q0, q1, h, t - h), h, t)
    raise InputError(f"sign must be 'minus' or 'plus'; got {shown(sign)}")


def require_regular(discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> None:
    """Raise InputError, with the reason, unless D1D2 L_d(q0, q1) is invertible."""
    matrix = discrete.d12(q0, q1, h, t)
    invert(discrete, matrix, np.zeros(len(matrix)), discrete.vector(q0, "q0"), discrete.vector(q1, "q1"))


def two_form(discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Array:
    """Return omega as a skew matrix on Q x Q, (2d, 2d): omega(x, y) = x . Omega y for tangent vectors (dq0, dq1)."""
    matrix = discrete.d12(q0, q1, h, t)
    zero = np.zeros_like(matrix)
    return np.block([[zero, matrix], [-matrix.T, zero]])


def canonical_form(d: int) -> Array:
    """Return sum_i dp_i ^ dq_i as a skew matrix on pairs (q, p), (2d, 2d)."""
    zero, one = np.zeros((d, d)), np.eye(d)
    return np.block([[zero, -one], [one, zero]])


def legendre_derivative(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0, *, sign: Sign
) -> Array:
    """Return the derivative of F- or F+ at (q0, q1), (2d, 2d), from the second derivatives of L_d."""
    d11, d12, d22 = discrete.hessian(q0, q1, h, t)
    zero, one = np.zeros_like(d11), np.eye(len(d11))
    if sign == "minus":
        return np.block([[one, zero], [-d11, -d12]])
    if sign == "plus":
        return np.block([[zero, one], [d12.T, d22]])
    raise InputError(f"sign must be 'minus' or 'plus'; got {shown(sign)}")


def pull_back(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0, *, sign: Sign
) -> Array:
    """Return the pull-back of the canonical form by F- or F+, (2d, 2d): equal to `two_form`."""
    T = legendre_derivative(discrete, q0, q1, h, t, sign=sign)
    pulled: Array = T.T @ canonical_form(len(T) // 2) @ T
    return pulled


def pair_derivative(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, q2: ArrayLike, h: float, t: float = 0.0
) -> Array:
    """Return the derivative of F at (q0, q1), F(q0, q1) = (q1, q2), (2d, 2d); t : time at q0. With constraints it is
    that for vectors tangent to them.
    """
    if isinstance(discrete, Constrained):
        x0, x1, x2 = discrete.vector(q0, "q0"), discrete.vector(q1, "q1"), discrete.vector(q2, "q2")
        return discrete.pair_derivative(x0, x1, x2, time_step(h), t)
    _, before12, before22 = discrete.hessian(q0, q1, h, t)
    after11, after12, _ = discrete.hessian(q1, q2, h, t + h)
    d = len(after12)
    right = np.hstack([before12.T, before22 + after11])
    lower = -invert(discrete, after12, right, discrete.vector(q1, "q1"), discrete.vector(q2, "q2"))
    return np.vstack([np.hstack([np.zeros((d, d)), np.eye(d)]), lower])


def phase_derivative(discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Array:
    """Return the derivative of F~ at (q0, p0), where the step goes from q0 to q1, (2d, 2d). With constraints it is that
    for vectors tangent to them.
    """
    if isinstance(discrete, Constrained):
        return discrete.phase_derivative(discrete.vector(q0, "q0"), discrete.vector(q1, "q1"), time_step(h), t)
    d11, d12, d22 = discrete.hessian(q0, q1, h, t)
    d = len(d12)
    x0, x1 = discrete.vector(q0, "q0"), discrete.vector(q1, "q1")
    upper = -invert(discrete, d12, np.hstack([d11, np.eye(d)]), x0, x1)
    return np.vstack([upper, np.hstack([d12.T, np.zeros((d, d))]) + d22 @ upper])
