"""Frame dragging by a spinning body (Lense and Thirring): a force linear in velocities, like that of a magnetic field.

    L = -(2 G / c^2) sum_i m_i S . (r_i x w_i) / r_i^3,     r_i = q_i - q_b,   w_i = v_i - v_b

for all massive bodies i other than the body b with the spin S, which feels the reaction; for a massless particle per
unit mass. It depends on differences alone: momentum, the uniform motion of the centre of mass, and the component of the
angular momentum along S are conserved. The canonical momenta are not m v; the energy is that without the term.
Parameters: row of the body, k = -(2 G / c^2) S (3).
Source: Lense & Thirring (1918), Phys. Z. 19, 156; Soffel & Langhans (2013), sec. 8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.checks import light_speed, pole_direction
from orbits.errors import InputError
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import rsqrt_cubed
from orbits.lagrangians.base import ABOUT_ONE_BODY, GRADIENTS, MASSLESS_PARTICLES
from orbits.lagrangians.terms.about_one_body import kernels_from
from orbits.lagrangians.terms.base import Summand, Term, Vector, number
from orbits.lagrangians.terms.pairs import add_differences, difference


@kernel(inline=True)
def about(strength, own, gm, r, w):
    """Return the derivatives of k . (r x w) / r^3 with respect to r and w, six numbers."""
    x, y, z = r
    vx, vy, vz = w
    kx, ky, kz = own[1], own[2], own[3]
    r2 = strength[0] + x * x + y * y + z * z
    near3 = rsqrt_cubed(r2)
    px, py, pz = near3 * (ky * z - kz * y), near3 * (kz * x - kx * z), near3 * (kx * y - ky * x)
    bx, by, bz = vy * kz - vz * ky, vz * kx - vx * kz, vx * ky - vy * kx
    inwards = 3.0 * (x * bx + y * by + z * bz) / r2
    return near3 * (bx - inwards * x), near3 * (by - inwards * y), near3 * (bz - inwards * z), px, py, pz


@kernel(inline=True)
def part(strength, own, gm, r, w):
    """Return the part of L of a body at r from the spinning one, with velocity w."""
    found = about(strength, own, gm, r, w)
    return gm * (found[3] * w[0] + found[4] * w[1] + found[5] * w[2])


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the second derivatives; those with respect to two velocities are zero."""
    n, b = strength.shape[0] - 1, int(own[0])
    d = 3 * n
    for i in range(n):
        if i != b:
            r, w = difference(q, i, b, n), difference(v, i, b, n)
            r2 = strength[0] + r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
            near3 = rsqrt_cubed(r2) * strength[1 + i]
            bx, by, bz = w[1] * own[3] - w[2] * own[2], w[2] * own[1] - w[0] * own[3], w[0] * own[2] - w[1] * own[1]
            mx, my, mz = own[2] * r[2] - own[3] * r[1], own[3] * r[0] - own[1] * r[2], own[1] * r[1] - own[2] * r[0]
            rb = (r[0] * bx + r[1] * by + r[2] * bz) / r2
            for a in range(3):
                ra = r[a] / r2
                ba = bx if a == 0 else (by if a == 1 else bz)
                for c in range(3):
                    rc = r[c]
                    bc = bx if c == 0 else (by if c == 1 else bz)
                    mc = mx if c == 0 else (my if c == 1 else mz)
                    same = 1.0 if a == c else 0.0
                    # Of k x r, the component c by the coordinate a: epsilon_cea k_e.
                    turn = 0.0 if a == c else (own[1 + 3 - a - c] if (c + 2) % 3 == a else -own[1 + 3 - a - c])
                    by_places = near3 * (15.0 * rb * ra * rc - 3.0 * (ba * (rc / r2) + ra * bc) - 3.0 * rb * same)
                    add_differences(out, 0, by_places, a, c, i, b, n)
                    add_differences(out, d * d, near3 * (turn - 3.0 * ra * mc), a, c, i, b, n)


TAG = Tag("frame-dragging", kernels_from(part, about, hessians))


def frame_dragging(row: int, k: Vector) -> Summand:
    """Return the term for the massive body of that row, counted from 0; k : -(2 G / c^2) S, length^3 / time."""
    length = float(np.linalg.norm(k))
    return Summand(
        name="frame dragging",
        formula="-(2 G / c^2) sum m S . (r x w) / r^3",
        tag=TAG,
        parameters=np.array([row, *k], dtype=np.float64),
        traits=frozenset({MASSLESS_PARTICLES, GRADIENTS, ABOUT_ONE_BODY}),
        axis=(k[0] / length, k[1] / length, k[2] / length),
    )


@dataclass(frozen=True)
class FrameDragging(Term):
    """The frame dragging by a spinning body, to first order in its spin.

        spin, pole = 1.9e41 * u.kg * u.m**2 / u.s, (286.13, 63.87) * u.deg
        system.with_terms(orbits.terms.FrameDragging("Sun", spin=spin, pole=pole))

    body : the massive body that spins; by default the most massive one
    spin : its angular momentum, > 0; pole : its direction, (right ascension, declination) or a vector
    c : the speed of light; required if units are dimensionless
    """

    kind: ClassVar[str] = "frame-dragging"
    spin: Any = None
    pole: Any = None
    c: Any = None

    def in_units(self, units: Any) -> Self:
        """Return this term with spin and c in the system's units, and a unit vector for the pole."""
        whose = f" of {self.body!r}" if self.body else ""
        if self.spin is None:
            raise InputError(
                f"FrameDragging{whose}: spin is missing; expected an angular momentum, such as 1.9e41 kg m2/s."
            )
        spin = number(units.angular_momentum_value(self.spin, f"spin{whose}"), f"spin{whose}")
        c = light_speed(self, units)
        if not spin > 0.0:
            raise InputError(
                f"FrameDragging{whose}: spin is {spin:g}; expected one > 0. A body that spins the other way has the "
                "opposite pole."
            )
        pole = pole_direction(self.pole, f"pole{whose}", units)
        return replace(self, spin=spin * units.angular_momentum, pole=pole, c=c * units.speed)

    def summand(self, row: int, units: Any) -> Summand:
        """Return the term for the massive body of that row."""
        spin, c = float(units.angular_momentum_value(self.spin)), float(units.speed_value(self.c))
        size = -2.0 * units.G * spin / (c * c)
        return frame_dragging(row, (size * self.pole[0], size * self.pole[1], size * self.pole[2]))
