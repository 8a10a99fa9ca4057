"""The figure of degree two of a body that is not axially symmetric: J2 and C22 in its principal axes.

    L = -sum_i m_i V(q_i - q_b),     V(d) = (G m_b R^2 / r^3) [J2 (3 s^2 - 1)/2 - 3 C22 (x^2 - y^2)]

for all massive bodies i other than the body b, which feels the reaction; a massless particle has -V per unit mass. With
d/r = x a + y b + s p, p is the pole, a the long axis in the equator, and b = p x a. Two attitudes are known:

- a points to another body, as far as it can in the equator: the figure of a moon locked to its planet, without
  librations. V then depends on the positions of three bodies, and the other body feels what turns the axis. L does not
  depend on time: energy, momentum and the angular momentum along p are conserved.
- a turns about p at a constant rate: a rotation known from elsewhere. L depends on time: momentum is conserved.

The spin takes up no torque. In terms of F, quadratic in d, V = G m_b F / r^5 with

    F = k_1 (d . p)^2 + k_2 (d . n)^2 / n^2 + k_3 d^2,     k = R^2 (3/2 J2 - 3 C22, -6 C22, 3 C22 - J2/2)

for n along a: for the first attitude the part of the direction e to the other body that is normal to the pole. With a
softening eps, r^2 = |d|^2 + eps^2 in r^5, as in the attraction.
Parameters: row of the body, row of the other body or -1, k (3), p (3), then two axes in the equator (6), the angle of a
from the first towards the second at the epoch, and its rate.
Source: Kaula (1966), sec. 1.2; Archinal et al. (2018), Celest. Mech. Dyn. Astron. 130, 22, for angles.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.checks import pole_direction
from orbits.errors import InputError, shown, with_unit
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, rsqrt_cubed
from orbits.kernels.lanes.functions import cos, sin
from orbits.lagrangians.base import GRADIENTS, MASSLESS_PARTICLES, SEPARABLE, TIME_DEPENDENT
from orbits.lagrangians.terms.base import Summand, Term, Vector, number
from orbits.lagrangians.terms.pairs import (
    add_between,
    add_differences,
    add_with_reaction,
    difference,
    dot,
    put_acceleration,
    put_reaction,
    separation,
)

UPRIGHT = 1e-2
"""The least sine of the angle between the pole and the direction to the body to which the long axis points."""


@kernel(inline=True)
def _pole(own):
    return own[5], own[6], own[7]


@kernel(inline=True)
def _without_pole(own, d):
    """Return the part of d normal to the pole."""
    along = dot(d, _pole(own))
    return d[0] - along * own[5], d[1] - along * own[6], d[2] - along * own[7]


@kernel(inline=True)
def _long_axis(own, t, q, n):
    """Return a vector along the long axis, and the square of its length."""
    b, other = int(own[0]), int(own[1])
    if other >= 0:
        axis = _without_pole(own, difference(q, other, b, n))
        return axis, dot(axis, axis)
    angle = own[14] + own[15] * (t + get(q, b) * 0.0)
    c, s = cos(angle), sin(angle)
    axis = c * own[8] + s * own[11], c * own[9] + s * own[12], c * own[10] + s * own[13]
    return axis, c * 0.0 + 1.0


@kernel(inline=True)
def _form(own, d, axis, length2):
    """Return F, d . p, and d . n / n^2."""
    up, along = dot(d, _pole(own)), dot(d, axis)
    turn = along / length2
    return own[2] * (up * up) + own[3] * (along * turn) + own[4] * dot(d, d), up, turn


@kernel(inline=True)
def _slope(own, d, axis, up, turn):
    """Return dF/dd."""
    k1, k2, k3 = 2.0 * own[2] * up, 2.0 * own[3] * turn, 2.0 * own[4]
    return (
        k1 * own[5] + k2 * axis[0] + k3 * d[0],
        k1 * own[6] + k2 * axis[1] + k3 * d[1],
        k1 * own[7] + k2 * axis[2] + k3 * d[2],
    )


@kernel(inline=True)
def _attraction(softening2, own, mu, d, axis, length2):
    """Return -dV/dd."""
    r2 = softening2 + dot(d, d)
    near3 = rsqrt_cubed(r2)
    near5 = mu * near3 / r2
    F, up, turn = _form(own, d, axis, length2)
    x, y, z = _slope(own, d, axis, up, turn)
    inwards = 5.0 * F / r2
    return near5 * (inwards * d[0] - x), near5 * (inwards * d[1] - y), near5 * (inwards * d[2] - z)


@kernel(inline=True)
def _pull_on_axis(softening2, own, mu, d, axis, length2):
    """Return -dV/de."""
    r2 = softening2 + dot(d, d)
    turn = dot(d, axis) / length2
    size, flat = -2.0 * own[3] * mu * turn * (rsqrt_cubed(r2) / r2), _without_pole(own, d)
    return size * (flat[0] - turn * axis[0]), size * (flat[1] - turn * axis[1]), size * (flat[2] - turn * axis[2])


@kernel
def value(strength, own, t, q, v):
    """Return -sum_i GM_i V(q_i - q_b)."""
    n, b = strength.shape[0] - 1, int(own[0])
    axis, length2 = _long_axis(own, t, q, n)
    total = get(q, 0) * 0.0
    for i in range(n):
        if i != b:
            d = difference(q, i, b, n)
            r2 = strength[0] + dot(d, d)
            total = total - strength[1 + i] * _form(own, d, axis, length2)[0] * (rsqrt_cubed(r2) / r2)
    return strength[1 + b] * total


@kernel
def gradients(strength, own, t, q, v, f, p):
    """Add the forces, and the reaction on the body and on that to which its long axis points, to f."""
    n, b, other = strength.shape[0] - 1, int(own[0]), int(own[1])
    mu = strength[1 + b]
    axis, length2 = _long_axis(own, t, q, n)
    for i in range(n):
        if i != b:
            d, gm = difference(q, i, b, n), strength[1 + i]
            x, y, z = _attraction(strength[0], own, mu, d, axis, length2)
            add_with_reaction(f, (gm * x, gm * y, gm * z), i, b, n)
            if other >= 0:
                x, y, z = _pull_on_axis(strength[0], own, mu, d, axis, length2)
                add_with_reaction(f, (gm * x, gm * y, gm * z), other, b, n)


@kernel
def accelerate_some(strength, own, q, out, start, stop):
    """Add the accelerations of bodies start ... stop - 1; those of the body and the other one are due to all."""
    n, b, other = strength.shape[0] - 1, int(own[0]), int(own[1])
    mu, zero = strength[1 + b], get(q, 0) * 0.0
    whole, turned = start <= b < stop, start <= other < stop
    axis, length2 = _long_axis(own, 0.0, q, n)
    bx, by, bz, ex, ey, ez = zero, zero, zero, zero, zero, zero
    for i in range(0 if whole or turned else start, n if whole or turned else stop):
        if i != b:
            d, gm = difference(q, i, b, n), strength[1 + i]
            x, y, z = _attraction(strength[0], own, mu, d, axis, length2)
            bx, by, bz = bx + gm * x, by + gm * y, bz + gm * z
            if start <= i < stop:
                put_acceleration(out, (x, y, z), i, n)
            x, y, z = _pull_on_axis(strength[0], own, mu, d, axis, length2)
            ex, ey, ez = ex + gm * x, ey + gm * y, ez + gm * z
    if turned:
        inertia = 1.0 / strength[1 + other]
        put_acceleration(out, (inertia * ex, inertia * ey, inertia * ez), other, n)
    if whole:
        put_reaction(out, (bx + ex, by + ey, bz + ez), 1.0 / mu, b, n)


@kernel(inline=True)
def _on_particle(strength, own, t, sources, x, y, z):
    n, b = strength.shape[0] - 1, int(own[0])
    axis, length2 = _long_axis(own, t, sources, n)
    return _attraction(strength[0], own, strength[1 + b], separation((x, y, z), sources, b, n), axis, length2)


@kernel
def field(strength, own, sources, x, y, z):
    """Return the acceleration of a massless particle at (x, y, z)."""
    return _on_particle(strength, own, 0.0, sources, x, y, z)


@kernel
def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return the force per unit mass, and zeros for the momentum."""
    fx, fy, fz = _on_particle(strength, own, t, sources, place[0], place[1], place[2])
    none = fx * 0.0
    return fx, fy, fz, none, none, none


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the second derivatives of -sum_i GM_i V with respect to positions."""
    n, b, other = strength.shape[0] - 1, int(own[0]), int(own[1])
    axis, length2 = _long_axis(own, t, q, n)
    pole = _pole(own)
    for i in range(n):
        if i != b:
            d = difference(q, i, b, n)
            r2 = strength[0] + dot(d, d)
            near5 = -strength[1 + i] * strength[1 + b] * (rsqrt_cubed(r2) / r2)
            F, up, turn = _form(own, d, axis, length2)
            slope, flat = _slope(own, d, axis, up, turn), _without_pole(own, d)
            for a in range(3):
                # Derivatives by e: of d . n / n^2, and of F.
                ta = (flat[a] - 2.0 * turn * axis[a]) / length2
                for c in range(3):
                    ec = 2.0 * own[3] * turn * (flat[c] - turn * axis[c])
                    tc = (flat[c] - 2.0 * turn * axis[c]) / length2
                    same = 1.0 if a == c else 0.0
                    level = same - pole[a] * pole[c]
                    bent = 2.0 * (own[2] * pole[a] * pole[c] + own[3] * axis[a] * axis[c] / length2 + own[4] * same)
                    bent = bent - 5.0 * (slope[a] * d[c] + d[a] * slope[c] + F * same) / r2
                    bent = bent + 35.0 * F * d[a] * d[c] / (r2 * r2)
                    add_differences(out, 0, near5 * bent, a, c, i, b, n)
                    if other >= 0:
                        mixed = 2.0 * own[3] * (axis[a] * tc + turn * level) - 5.0 * d[a] * ec / r2
                        add_between(out, near5 * mixed, a, c, i, b, other, n)
                        twice = 2.0 * own[3] * (length2 * ta * tc - turn * turn * level)
                        add_differences(out, 0, near5 * twice, a, c, other, b, n)


_KERNELS = {
    "value": value,
    "gradients": gradients,
    "hessians": hessians,
    "particle_gradients": particle_gradients,
}
LOCKED = Tag("locked-degree-two", {**_KERNELS, "accelerate_some": accelerate_some, "field": field})
TURNING = Tag("turning-degree-two", _KERNELS)


def degree_two(
    row: int,
    J2: float,
    C22: float,
    pole: Vector,
    *,
    towards: int | None = None,
    turning: tuple[float, float] = (0.0, 0.0),
) -> Summand:
    """Return the term for the massive body of that row, counted from 0.

    J2, C22 : times R^2; pole : unit vector
    towards : the row of the body to which the long axis points; or
    turning : its angle from the node of the equator at the epoch, and its rate
    """
    p = np.array(pole)
    ra = np.arctan2(p[1], p[0]) if np.hypot(p[0], p[1]) > 0.0 else 0.0
    node = np.array([-np.sin(ra), np.cos(ra), 0.0])
    locked = towards is not None
    other = -1 if towards is None else towards
    k = (1.5 * J2 - 3.0 * C22, -6.0 * C22, 3.0 * C22 - 0.5 * J2)
    common = {MASSLESS_PARTICLES, GRADIENTS}
    return Summand(
        name="figure of degree two",
        formula="-sum m (G M R^2 / r^3) [J2 P_2(s) - 3 C22 (x^2 - y^2)]",
        tag=LOCKED if locked else TURNING,
        parameters=np.array([row, other, *k, *pole, *node, *np.cross(p, node), *turning], dtype=np.float64),
        traits=frozenset(common | ({SEPARABLE} if locked else {TIME_DEPENDENT})),
        axis=pole if locked else (0.0, 0.0, 0.0),
    )


@dataclass(frozen=True)
class DegreeTwo(Term):
    """The figure of a body with three different axes, by J2 and C22: that of the Moon, or of an asteroid.

        pole = (269.9949, 66.5392) * u.deg
        system.with_terms(
            orbits.terms.DegreeTwo("Moon", J2=2.0322e-4, C22=2.2382e-5, radius=1738 * u.km, pole=pole, attitude="Earth")
        )

    body : the massive body with the figure; by default the most massive one
    J2, C22 : numbers, not normalized, in principal axes, so that C22 > 0; radius : that in their definition, a length
    pole : of its rotation, fixed: (right ascension, declination) in the ICRF or a vector in the axes of the system
    attitude : the name of the body to which the long axis points, as far as it can in the equator; or (W, rate), the
        angle of the long axis from the node of the equator on the xy-plane at the epoch, eastwards, and its rate, an
        angle per time, as the IAU's reports on rotation have them. Energy is conserved with the first alone.
    """

    kind: ClassVar[str] = "degree-two"
    of_body: ClassVar[tuple[str, ...]] = ("J2", "C22")
    J2: Any = 0.0
    C22: Any = 0.0
    radius: Any = None
    pole: Any = None
    attitude: Any = None

    @property
    def others(self) -> tuple[str, ...]:
        """The body to which the long axis points."""
        return ("attitude",) if isinstance(self.attitude, str) else ()

    def in_units(self, units: Any) -> Self:
        """Return this term with plain J2 and C22, the radius and the attitude in the system's units, and a unit vector
        for the pole.
        """
        whose = f" of {self.body!r}" if self.body else ""
        if self.radius is None:
            raise InputError(
                f"DegreeTwo{whose}: radius is missing; J2 and C22 belong to a radius, such as radius=1738 * u.km."
            )
        J2, C22 = (
            number(units.pure_value(getattr(self, name), f"{name}{whose}"), f"{name}{whose}") for name in ("J2", "C22")
        )
        if not C22 > 0.0:
            raise InputError(
                f"DegreeTwo{whose}: C22 is {C22:g}; expected a number > 0, as its long axis is the first in the "
                "equator. A figure that is symmetric about its pole is orbits.terms.ZonalHarmonics."
            )
        radius = number(units.length_value(self.radius, f"radius{whose}"), f"radius{whose}")
        if not radius > 0.0:
            raise InputError(
                f"DegreeTwo{whose}: radius is {with_unit(f'{radius:g}', units.length)}; expected a length > 0."
            )
        pole = pole_direction(self.pole, f"pole{whose}", units)
        found = replace(self, J2=J2, C22=C22, radius=radius * units.length, pole=pole)
        if isinstance(self.attitude, str):
            if self.attitude == self.body:
                raise InputError(f"DegreeTwo{whose}: attitude is {self.attitude!r} itself; expected another body.")
            return found
        if not isinstance(self.attitude, list | tuple) or len(self.attitude) != 2:
            raise InputError(
                f"DegreeTwo{whose}: attitude is {shown(self.attitude)}; expected the name of the body to which its "
                "long axis points, such as 'Earth', or an angle and a rate, such as (38 * u.deg, 13 * u.deg / u.day)."
            )
        angle = number(units.angle_value(self.attitude[0], f"attitude{whose}"), f"the angle of attitude{whose}")
        rate = number(units.rate_value(self.attitude[1], f"attitude{whose}"), f"the rate of attitude{whose}")
        return replace(found, attitude=(angle, rate * units.rate))

    def later(self, time: Any) -> Self:
        """Return this term with the angle at a later epoch."""
        if isinstance(self.attitude, str):
            return self
        angle, rate = self.attitude
        turned = float((rate * time).decompose().value)
        return replace(self, attitude=(float(np.remainder(angle + turned, 2.0 * np.pi)), rate))

    def without(self, gone: Set[str]) -> Self | None:
        """Return this term, or None without the body or that to which its long axis points."""
        return None if self.attitude in gone else super().without(gone)

    def check_start(self, system: Any) -> None:
        """Raise InputError if the long axis is to point along the pole."""
        if not isinstance(self.attitude, str):
            return
        q = system.values.q
        d = q[system.index(self.attitude)] - q[system.index(self.body)]
        if not np.linalg.norm(np.cross(d, self.pole)) > UPRIGHT * np.linalg.norm(d):
            raise InputError(
                f"{self.attitude!r} is above the pole of {self.body!r}, whose long axis cannot point there; expected a "
                "pole at right angles to that direction, nearly."
            )

    def among(self, row: Callable[[str], int], bodies: int, units: Any) -> Summand:
        """Return the term bound to the massive bodies of a system."""
        square = float(units.length_value(self.radius)) ** 2
        J2, C22 = self.J2 * square, self.C22 * square
        if isinstance(self.attitude, str):
            return degree_two(row(str(self.body)), J2, C22, self.pole, towards=row(self.attitude))
        angle, rate = self.attitude
        turning = float(units.angle_value(angle)), float(units.rate_value(rate))
        return degree_two(row(str(self.body)), J2, C22, self.pole, turning=turning)
