"""Discrete mechanics of rigid bodies: L_d on SO(3) x SO(3), and on R^3 beside it, in homogeneous quaternions.

With z = q0_conjugate q1, the quaternion of F = R0^T R1, and I_1, I_2, I_3 the principal moments,

    L_d(q0, q1; h) = 2 (I_1 z_1^2 + I_2 z_2^2 + I_3 z_3^2)/(h |z|^2) - h/2 [U(q0) + U(q1)]

is tr[(1 - F) J_d]/h - h/2 (U + U+), that of Moser and Veselov, of Lee, Leok and McClamroch. It does not depend on the
lengths of q0 and q1; the action of their own free motion, 2 I_0 ln(|q1|/|q0|)^2/h, makes it regular. What
`orbits.discrete` has for R^d then serves rotations as well. With the exact action of a free body instead
(`free_rotor.py`), it is the L_d of kicks and exact rotations. On the group itself covectors are taken in the axes of
the body: for a turn by theta about these, dq = E(q) theta, and with Pi the angular momentum

    -E(q0)^T D1 L_d = Pi_0,     E(q1)^T D2 L_d = Pi_1,     E(q) theta = q (0, theta)/2

Source: Moser & Veselov (1991), Commun. Math. Phys. 139, 217; Marsden, Pekarsky & Shkoller (1999), Nonlinearity 12,
1647; Lee, Leok & McClamroch (2007), Comput. Methods Appl. Mech. Engrg. 196, 2907.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.discrete.base import Array, DiscreteLagrangian, Jet
from orbits.discrete.evolution import invert
from orbits.discrete.free_rotor import UNITS, exactly_turning
from orbits.errors import InputError
from orbits.lagrangians.base import Lagrangian


@dataclass(frozen=True, eq=False, repr=False)
class OfRotors(DiscreteLagrangian):
    """L_d = S(q0, q1; h) - h [before U(q0) + after U(q1)], with an action S of the motion without U; see
    `moser_veselov` and `kick_rotate_kick`.

    turning : S of one body, from its two quaternions, its moments and h
    """

    name: str
    lagrangian: Lagrangian
    turning: Callable[[Array, Array, Array, float], Jet]
    before: float = 0.5
    after: float = 0.5

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        jet = self._jet(q0, q1, h, t)
        return jet.value, jet.d1, jet.d2

    def _jet(self, q0: Array, q1: Array, h: float, t: float) -> Jet:
        L, d = self.lagrangian, self.lagrangian.dimension
        value, d1, d2 = 0.0, np.zeros(d), np.zeros(d)
        d11, d12, d22, rest = np.zeros((d, d)), np.zeros((d, d)), np.zeros((d, d)), np.zeros(d)
        for q, at, kick, first, second in ((q0, t, self.before, d1, d11), (q1, t + h, self.after, d2, d22)):
            value += h * kick * L.value(q, rest, at)
            first += h * kick * L.gradients(q, rest, at)[0]
            here, _, mass = L.hessians(q, rest, at)
            second += h * kick * here
        places = slice(0, L.rotors[0].at)
        # The mass matrix at q1 serves the places, whose masses are constant, and 4 I_0, which is.
        m, moved = mass[places, places] / h, q1[places] - q0[places]
        value += 0.5 * float(moved @ m @ moved)
        d1[places] -= m @ moved
        d2[places] += m @ moved
        d11[places, places] += m
        d12[places, places] -= m
        d22[places, places] += m
        for rotor in L.rotors:
            own = slice(rotor.at, rotor.at + 4)
            x, y = q0[own], q1[own]
            moments = np.array([L.parameters[name] for name in rotor.moments])
            for part in (self.turning(x, y, moments, h), _stretching(x, y, float(y @ mass[own, own] @ y), h)):
                value += part.value
                d1[own] += part.d1
                d2[own] += part.d2
                d11[own, own] += part.d11
                d12[own, own] += part.d12
                d22[own, own] += part.d22
        return Jet(value, d1, d2, d11, d12, d22)


def moser_veselov(lagrangian: Lagrangian) -> OfRotors:
    """Return the discrete Lagrangian of `LieGroupVariational` for a Lagrangian of rigid bodies.

        top = orbits.lagrangians.heavy_top
        L_d = orbits.discrete.moser_veselov(top)
        D1, D2 = orbits.discrete.body_covectors(L_d, q0, q1, h)

    Raises InputError for a Lagrangian of no rigid bodies.
    """
    _require_rotors(lagrangian)
    return OfRotors("moser-veselov", lagrangian, _turning)


def kick_rotate_kick(
    lagrangian: Lagrangian, *, before: float = 0.5, after: float = 0.5, name: str = "kick-rotate-kick"
) -> OfRotors:
    """Return the discrete Lagrangian of `StormerVerlet` for a Lagrangian of rigid bodies, which turn exactly.

    before, after : the kicks at both ends, as fractions of h; those of a composition's parts differ
    Without a potential it is the exact one. Raises InputError for a Lagrangian of no rigid bodies.
    """
    _require_rotors(lagrangian)
    return OfRotors(name, lagrangian, exactly_turning, before, after)


def body_frame(lagrangian: Lagrangian, q: ArrayLike) -> Array:
    """Return E(q), (d, m): dq = E (dx, theta_1, ...), for places and the turns of each body about its own axes.

    m : the number of places, and three for each body. Raises InputError for a Lagrangian of no rigid bodies.
    """
    _require_rotors(lagrangian)
    x = lagrangian.vector(q, "q")
    places = lagrangian.rotors[0].at
    frame = np.zeros((x.size, places + 3 * len(lagrangian.rotors)))
    frame[:places, :places] = np.eye(places)
    for k, rotor in enumerate(lagrangian.rotors):
        own = slice(rotor.at, rotor.at + 4)
        # z = q_conjugate y: the product from the left is the transposed of its derivative by y.
        frame[own, places + 3 * k : places + 3 * k + 3] = 0.5 * np.einsum("kij,i->jk", UNITS, x[own])[:, 1:]
    return frame


def body_covectors(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0
) -> tuple[Array, Array]:
    """Return D1 L_d and D2 L_d in the axes of the bodies, (m,) each: -Pi_0 and Pi_1, after the places' momenta.

    Raises InputError for a discrete Lagrangian of no rigid bodies.
    """
    L = _lagrangian_of(discrete)
    _, d1, d2 = discrete.first(q0, q1, h, t)
    return body_frame(L, q0).T @ d1, body_frame(L, q1).T @ d2


def body_two_form(discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Array:
    """Return the two-form of L_d as a skew matrix on pairs of turns (and shifts of places) at q0 and q1, (2m, 2m).

    It is `two_form` in the axes of the bodies: D1D2 L_d becomes E(q0)^T D1D2 L_d E(q1).
    """
    L = _lagrangian_of(discrete)
    matrix = body_frame(L, q0).T @ discrete.d12(q0, q1, h, t) @ body_frame(L, q1)
    zero = np.zeros_like(matrix)
    return np.block([[zero, matrix], [-matrix.T, zero]])


def body_pair_derivative(
    discrete: DiscreteLagrangian, q0: ArrayLike, q1: ArrayLike, q2: ArrayLike, h: float, t: float = 0.0
) -> Array:
    """Return the derivative of F: (R0, R1) -> (R1, R2) in turns about the axes of the bodies, (2m, 2m); t : time at q0.

    It preserves `body_two_form`. Raises InputError where L_d is not regular: the longest step that has a solution.
    """
    L = _lagrangian_of(discrete)
    E0, E1, E2 = (body_frame(L, q) for q in (q0, q1, q2))
    _, before12, before22 = discrete.hessian(q0, q1, h, t)
    after11, after12, _ = discrete.hessian(q1, q2, h, t + h)
    m = E0.shape[1]
    right = np.hstack([E1.T @ before12.T @ E0, E1.T @ (before22 + after11) @ E1])
    x1, x2 = discrete.vector(q1, "q1"), discrete.vector(q2, "q2")
    lower = -invert(discrete, E1.T @ after12 @ E2, right, x1, x2)
    return np.vstack([np.hstack([np.zeros((m, m)), np.eye(m)]), lower])


def _turning(x: Array, y: Array, moments: Array, h: float) -> Jet:
    """Return 2 (z I z)/(h |z|^2) with its derivatives, z = x_conjugate y."""
    by_x, by_y = np.einsum("kij,j->ki", UNITS, y), np.einsum("kij,i->kj", UNITS, x)
    z = by_y @ y
    N = float(z @ z)
    I = np.array([0.0, *moments])  # noqa: E741 - the symbol of moments of inertia
    value = float(I @ (z * z)) / N
    slope = 2.0 * (I - value) * z / N
    curved = 2.0 / N * (np.diag(I - value) - np.outer(z, slope) - np.outer(slope, z))
    scale = 2.0 / h
    return Jet(
        scale * value,
        scale * (slope @ by_x),
        scale * (slope @ by_y),
        scale * (by_x.T @ curved @ by_x),
        scale * (by_x.T @ curved @ by_y + np.einsum("k,kij->ij", slope, UNITS)),
        scale * (by_y.T @ curved @ by_y),
    )


def _stretching(x: Array, y: Array, spare: float, h: float) -> Jet:
    """Return 4 I_0 ln(|y|/|x|)^2/(2 h) with its derivatives; spare : 4 I_0."""
    X, Y, scale = float(x @ x), float(y @ y), spare / h
    change = float((y - x) @ (y + x)) / X
    grown = 0.5 * (math.log1p(change) if abs(change) < 0.5 else math.log(Y / X))
    one = np.eye(4)
    own = (np.outer(v, v) / s**2 * (1.0 - 2.0 * g) + g / s * one for v, s, g in ((x, X, -grown), (y, Y, grown)))
    d11, d22 = own
    return Jet(
        0.5 * scale * grown * grown,
        -scale * grown / X * x,
        scale * grown / Y * y,
        scale * d11,
        -scale / (X * Y) * np.outer(x, y),
        scale * d22,
    )


def _lagrangian_of(discrete: DiscreteLagrangian) -> Lagrangian:
    if not isinstance(discrete.lagrangian, Lagrangian):
        raise InputError(f"{discrete.name} is the discrete Lagrangian of no rigid bodies, so it has no axes of bodies")
    _require_rotors(discrete.lagrangian)
    return discrete.lagrangian


def _require_rotors(lagrangian: Lagrangian) -> None:
    if not lagrangian.rotors:
        raise InputError(
            f"'{lagrangian.name}' has no rigid body; expected orbits.lagrangians.rigid_body(...), full_two_body(...), "
            "euler_top or heavy_top."
        )
