"""The Lie group variational integrator of rigid bodies (LGVI): the discrete action is a function of rotations.

    L_d(R, R+; h) = tr[(1 - F) J_d]/h - h/2 [U(R) + U(R+)],     F = R^T R+,   J_d = tr(J)/2 - J

without a potential the discrete rigid body of Moser and Veselov. With M the torque in the axes of the body, its
discrete Euler–Lagrange equations are

    Pi_half = Pi + h/2 M,     F J_d - J_d F^T = S(h Pi_half),     R+ = R F,     Pi+ = F^T Pi_half + h/2 M+

The equation for F is solved by Newton's method in c, F = (1 + S(c))(1 - S(c))^-1 (Cayley), with g = h Pi_half:

    G(c) = g + g x c + (g . c) c - 2 J c = 0,     from c = J^-1 g/2

F is the solution that leads back to 1 as h -> 0. About a principal axis, sin(angle) = h omega: it ends at a quarter
turn.

Source: Lee, Leok & McClamroch (2007), Comput. Methods Appl. Mech. Engrg. 196, 2907; Moser & Veselov (1991), Commun.
Math. Phys. 139, 217.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.discrete.base import DiscreteLagrangian
from orbits.discrete.rotors import moser_veselov
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator
from orbits.integrators.forms import Array, Form
from orbits.integrators.rigid.rotors import Turning, cross, times
from orbits.kernels.compile import kernel
from orbits.lagrangians.base import RIGID_BODIES, Lagrangian
from orbits.rotations import product

ROUNDS = 30
"""Limit of Newton's method: up to h|omega| = 1 at most 13 were needed, in 75,000 cases."""

NEAR = 1e-9
"""A change smaller than this, relative to c, is the last one: it leaves its square."""

FARTHEST = 2.5
"""Largest |c|: on the branch of the identity it reaches 1 for a principal axis, and 2.42 for others."""


CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@kernel(inline=True)
def dot(x, y):
    """Return x . y, of tuples."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@kernel
def turn(method, moments, h, attitude, momentum):
    """Solve the discrete Euler–Lagrange equation for F; returns the change of the attitude."""
    A, B, C = moments
    g = (h * momentum[0], h * momentum[1], h * momentum[2])
    x, y, z = 0.5 * g[0] / A, 0.5 * g[1] / B, 0.5 * g[2] / C
    det, settled = -1.0, False
    for _ in range(ROUNDS):
        c = (x, y, z)
        along, aside = dot(g, c), cross(g, c)
        G = (
            g[0] + aside[0] + along * x - 2.0 * A * x,
            g[1] + aside[1] + along * y - 2.0 * B * y,
            g[2] + aside[2] + along * z - 2.0 * C * z,
        )
        first = (along - 2.0 * A + x * g[0], x * g[1] - g[2], x * g[2] + g[1])
        second = (y * g[0] + g[2], along - 2.0 * B + y * g[1], y * g[2] - g[0])
        third = (z * g[0] - g[1], z * g[1] + g[0], along - 2.0 * C + z * g[2])
        one, two, three = cross(second, third), cross(third, first), cross(first, second)
        det = dot(first, one)
        dx = (G[0] * one[0] + G[1] * two[0] + G[2] * three[0]) / det
        dy = (G[0] * one[1] + G[1] * two[1] + G[2] * three[1]) / det
        dz = (G[0] * one[2] + G[1] * two[2] + G[2] * three[2]) / det
        x, y, z = x - dx, y - dy, z - dz
        if max(abs(dx), abs(dy), abs(dz)) <= NEAR * max(abs(x), abs(y), abs(z)):
            settled = True
            break
    square = x * x + y * y + z * z
    # The derivative has the sign of -(2 J)^3 on the branch of the identity.
    found = settled and det < 0.0 and square < FARTHEST * FARTHEST
    size = math.sqrt(1.0 + square)
    change = times(attitude, (-square / (size * (1.0 + size)), x / size, y / size, z / size))
    return found, change[0], change[1], change[2], change[3]


@dataclass(frozen=True)
class CayleyTurn(Turning):
    """Its form."""

    kernels: ClassVar[Mapping[str, Any]] = {**Turning.kernels, "turn": turn}


@dataclass(frozen=True)
class LieGroupVariational(Integrator):
    """The Lie group variational integrator (LGVI) for rigid bodies, on SO(3), order 2; compose it to orders 4, 6, 8.

    For `orbits.lagrangians.rigid_body`, `euler_top`, `heavy_top` and `full_two_body`. One evaluation of the torque in a
    step. Symplectic, symmetric; conserves angular momentum to round-off. A body may turn by h|omega| < 1 in a step, of
    a composition in its longest one.

        orbits.march(orbits.lagrangians.heavy_top, orbits.methods.LieGroupVariational(), dt=0.02, steps=1000)
        orbits.methods.Composition(orbits.methods.LieGroupVariational(), order=6)
    """

    name: ClassVar[str] = "lie-group-variational"
    summary: ClassVar[str] = "LGVI, the Lie group variational integrator of rigid bodies: order 2"
    requires: ClassVar[frozenset[str]] = frozenset({RIGID_BODIES})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    variational: ClassVar[bool] = True
    source: ClassVar[str] = "Lee, Leok & McClamroch (2007); Moser & Veselov (1991)"

    @property
    def order(self) -> int:
        """Order of convergence: 2."""
        return 2

    def form_of_rotors(self, lagrangian: Lagrangian) -> Form | None:
        """Kick, turn, kick."""
        return CayleyTurn.of(lagrangian)

    def discrete_lagrangian(self, lagrangian: Lagrangian) -> DiscreteLagrangian | None:
        """That of Moser and Veselov, with the potential at both ends."""
        return moser_veselov(lagrangian)

    def refusal(self, lagrangian: Lagrangian, q: Array, p: Array, dt: float, *, share: float = 1.0) -> str | None:
        """The angle of the step, and the longest step that has a solution."""
        f = lagrangian.gradients(q, np.zeros(lagrangian.dimension))[0]
        angles = []
        for rotor in lagrangian.rotors:
            own = slice(rotor.at, rotor.at + 4)
            moments = np.array([lagrangian.parameters[name] for name in rotor.moments])
            spin, pull = (0.5 * product(q[own] * CONJUGATE, x[own])[1:] / moments for x in (p, f))
            angles.append(lambda h, spin=spin, pull=pull: abs(h) * float(np.linalg.norm(spin + 0.5 * h * pull)))

        def angle(step: float) -> float:
            return max(of(share * step) for of in angles)

        if angle(dt) < 1.0:
            return None
        shorter = dt
        while angle(shorter) > 0.95:
            shorter *= 0.95
        which = "this step" if share == 1.0 else f"the longest step of the composition, {share:.3g} dt"
        return (
            f"a body would turn by {angle(dt):.3g} radians in {which}; the equation of the Lie group variational "
            f"integrator has a solution up to 1 radian, and none well beyond. Use dt = {shorter:.2g} or less, or "
            "orbits.StormerVerlet(), which turns bodies exactly, by any angle."
        )
