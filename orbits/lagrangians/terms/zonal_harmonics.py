"""Zonal harmonics: the field of a body that is flattened along its axis.

    L = -sum_i m_i V(q_i - q_b),     V(d) = (G m_b / r) sum_n J_n (R / r)^n P_n(s),     s = d . pole / r

for all massive bodies i other than the body b, which feels the reaction; a massless particle has -V per unit mass. With
a softening eps, r^2 = |d|^2 + eps^2, as in the attraction.

    a = A d / r + B pole,     A = (G m_b / r^2) sum J_n (R/r)^n [(n + 1) P_n + s P_n']
                              B = -(G m_b / r^2) sum J_n (R/r)^n P_n'

The pole is fixed: the spin of the body takes up no torque, so only the angular momentum along the pole is conserved.
Parameters: row of the body, pole (3), then J_n R^n for n = 2, 3, ...
Source: Vallado (2013), sec. 8.6; Kaula (1966).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.checks import pole_direction
from orbits.errors import InputError, with_unit
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import rsqrt_cubed
from orbits.lagrangians.base import ABOUT_ONE_BODY, GRADIENTS, MASSLESS_PARTICLES, SEPARABLE
from orbits.lagrangians.terms.about_one_body import kernels_from
from orbits.lagrangians.terms.base import Summand, Term, Vector, number
from orbits.lagrangians.terms.pairs import add_differences, difference

HARMONICS = 4
"""The index of J_2 R^2 in the parameters."""


@kernel(inline=True)
def _potential(own, mu, r2, s_r):
    """Return V at the distance sqrt(r2) and d . pole = s_r."""
    near = rsqrt_cubed(r2) * r2
    s = s_r * near
    before, legendre = r2 * 0.0 + 1.0, s
    power, total = mu * near * near, r2 * 0.0
    for k in range(HARMONICS, own.shape[0]):
        n = k - HARMONICS + 2
        before, legendre = legendre, ((2 * n - 1) * s * legendre - (n - 1) * before) * (1.0 / n)
        power = power * near
        total = total + own[k] * power * legendre
    return total


@kernel(inline=True)
def _acceleration(own, mu, r2, x, y, z):
    """Return the acceleration at d = (x, y, z) from the body."""
    near = rsqrt_cubed(r2) * r2
    s = (own[1] * x + own[2] * y + own[3] * z) * near
    before, legendre, slope = r2 * 0.0 + 1.0, s, r2 * 0.0 + 1.0
    power = mu * near * near * near
    along, towards = r2 * 0.0, r2 * 0.0
    for k in range(HARMONICS, own.shape[0]):
        n = k - HARMONICS + 2
        before, legendre, slope = (
            legendre,
            ((2 * n - 1) * s * legendre - (n - 1) * before) * (1.0 / n),
            n * legendre + s * slope,
        )
        power = power * near
        weight = own[k] * power
        along = along + weight * ((n + 1) * legendre + s * slope)
        towards = towards - weight * slope
    along = along * near
    return along * x + towards * own[1], along * y + towards * own[2], along * z + towards * own[3]


@kernel(inline=True)
def part(strength, own, gm, r, w):
    """Return the part of L of a body at r from the flattened one."""
    x, y, z = r
    r2 = strength[0] + x * x + y * y + z * z
    return -(gm * _potential(own, strength[1 + int(own[0])], r2, own[1] * x + own[2] * y + own[3] * z))


@kernel(inline=True)
def about(strength, own, gm, r, w):
    """Return the acceleration at r from the body, and zeros for the momentum."""
    r2 = strength[0] + r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    fx, fy, fz = _acceleration(own, strength[1 + int(own[0])], r2, r[0], r[1], r[2])
    none = fx * 0.0
    return fx, fy, fz, none, none, none


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the tidal matrices -GM_i d2V/dd dd of each body and the flattened one."""
    n, b = strength.shape[0] - 1, int(own[0])
    mu = strength[1 + b]
    for i in range(n):
        if i != b:
            x, y, z = difference(q, i, b, n)
            r2 = strength[0] + x * x + y * y + z * z
            near = rsqrt_cubed(r2) * r2
            s = (own[1] * x + own[2] * y + own[3] * z) * near
            zero = r2 * 0.0
            before, legendre, slope, bend = zero + 1.0, s, zero + 1.0, zero
            power = mu * near * near
            # First and second derivatives of V with respect to r and s.
            vr, vs, vrr, vrs, vss = zero, zero, zero, zero, zero
            for k in range(HARMONICS, own.shape[0]):
                m = k - HARMONICS + 2
                before, legendre, slope, bend = (
                    legendre,
                    ((2 * m - 1) * s * legendre - (m - 1) * before) * (1.0 / m),
                    m * legendre + s * slope,
                    (m + 1) * slope + s * bend,
                )
                power = power * near
                weight = own[k] * power
                vr = vr - (m + 1) * weight * legendre
                vs = vs + weight * slope
                vrr = vrr + (m + 1) * (m + 2) * weight * legendre
                vrs = vrs - (m + 1) * weight * slope
                vss = vss + weight * bend
            scale = strength[1 + i] * near * near
            for a in range(3):
                ea = near * (x if a == 0 else (y if a == 1 else z))
                wa = own[1 + a] - s * ea
                for c in range(3):
                    ec = near * (x if c == 0 else (y if c == 1 else z))
                    wc = own[1 + c] - s * ec
                    same = 1.0 if a == c else 0.0
                    bent = vrr * ea * ec + vrs * (ea * wc + ec * wa) + vss * wa * wc + vr * (same - ea * ec)
                    bent = bent + vs * (3.0 * s * ea * ec - s * same - own[1 + a] * ec - own[1 + c] * ea)
                    add_differences(out, 0, -(scale * bent), a, c, i, b, n)


TAG = Tag("zonal-harmonics", kernels_from(part, about, hessians, static=True))


def zonal_harmonics(row: int, radius: float, pole: Vector, harmonics: dict[int, float]) -> Summand:
    """Return the term for the massive body of that row, counted from 0.

    radius : R, a length; pole : unit vector; harmonics : J_n by n, from 2 on
    """
    powers = [harmonics.get(n, 0.0) * radius**n for n in range(2, max(harmonics) + 1)]
    return Summand(
        name="zonal harmonics",
        formula="-sum m (G M / r) sum J_n (R / r)^n P_n(s)",
        tag=TAG,
        parameters=np.array([row, *pole, *powers], dtype=np.float64),
        traits=frozenset({SEPARABLE, MASSLESS_PARTICLES, GRADIENTS, ABOUT_ONE_BODY}),
        axis=pole,
    )


@dataclass(frozen=True)
class ZonalHarmonics(Term):
    """The flattening of a body, by the zonal harmonics J2, J3, J4 of its field.

        pole = (286.13, 63.87) * u.deg
        system.with_terms(orbits.terms.ZonalHarmonics("Sun", J2=2.2e-7, radius=696000 * u.km, pole=pole))

    body : the massive body that is flattened; by default the most massive one
    J2, J3, J4 : numbers; radius : the equatorial radius in their definition, a length
    pole : of its axis, (right ascension, declination) in the ICRF or a vector in the axes of the system; it is fixed
    """

    kind: ClassVar[str] = "zonal-harmonics"
    of_body: ClassVar[tuple[str, ...]] = ("J2", "J3", "J4")
    J2: Any = 0.0
    J3: Any = 0.0
    J4: Any = 0.0
    radius: Any = None
    pole: Any = None

    def in_units(self, units: Any) -> Self:
        """Return this term with floats for J_n, the radius in the system's unit, and a unit vector for the pole."""
        whose = f" of {self.body!r}" if self.body else ""
        if self.radius is None:
            raise InputError(
                f"ZonalHarmonics{whose}: radius is missing; J_n belong to a radius, such as radius=696000 * u.km."
            )
        found: dict[str, Any] = {
            name: number(units.pure_value(getattr(self, name), f"{name}{whose}"), f"{name}{whose}")
            for name in ("J2", "J3", "J4")
        }
        if not any(found.values()):
            raise InputError(
                f"ZonalHarmonics{whose}: J2, J3 and J4 are all 0; expected one at least, such as J2=2.2e-7."
            )
        radius = number(units.length_value(self.radius, f"radius{whose}"), f"radius{whose}")
        if not radius > 0.0:
            shown = with_unit(f"{radius:g}", units.length)
            raise InputError(f"ZonalHarmonics{whose}: radius is {shown}; expected a length > 0.")
        pole = pole_direction(self.pole, f"pole{whose}", units)
        return replace(self, **found, radius=radius * units.length, pole=pole)

    def summand(self, row: int, units: Any) -> Summand:
        """Return the term for the massive body of that row."""
        harmonics = {2: self.J2, 3: self.J3, 4: self.J4}
        last = max(n for n, J in harmonics.items() if J != 0.0)
        radius = float(units.length_value(self.radius))
        return zonal_harmonics(row, radius, self.pole, {n: J for n, J in harmonics.items() if n <= last})
