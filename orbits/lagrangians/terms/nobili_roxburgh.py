"""The potential of Nobili and Roxburgh: relativity's turning of pericentres, by one body, from positions alone.

    L = (1/c^2) sum_i m' 3 M^2/r^2,     r = |q_i - q_s|,  M = G (m_i + m_s),  m' = m_i m_s / (m_i + m_s)

for all massive bodies i other than the source s, which feels the reaction; a massless particle has 3 M^2/(c^2 r^2) per
unit mass, with M = G m_s. Pericentres advance by 6 pi M / (c^2 a (1 - e^2)) in a revolution, as by general relativity
to first order, but the mean motion is wrong by as much. With a softening eps, r^2 = |q_i - q_s|^2 + eps^2, as in the
attraction. Parameters: row of the source, 1/c^2.
Source: Nobili & Roxburgh (1986), in Kovalevsky & Brumberg (eds.), Relativity in Celestial Mechanics and Astrometry,
IAU Symposium 114, 105.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get
from orbits.lagrangians.base import ABOUT_ONE_BODY, GRADIENTS, MASSLESS_PARTICLES, SEPARABLE
from orbits.lagrangians.terms.base import Summand, Term, light_speed
from orbits.lagrangians.terms.pairs import (
    add_differences,
    add_with_reaction,
    difference,
    dot,
    put_acceleration,
    put_reaction,
    separation,
)


@kernel(inline=True)
def _acceleration(strength, own, gm, d):
    """Return the acceleration of a body with this GM at d from the source."""
    mu, r2 = strength[1 + int(own[0])], strength[0] + dot(d, d)
    f = -6.0 * (own[1] * (mu * (mu + gm))) / (r2 * r2)
    return f * d[0], f * d[1], f * d[2]


@kernel
def value(strength, own, t, q, v):
    """Return the sum over pairs with the source."""
    n, b = strength.shape[0] - 1, int(own[0])
    mu, total = strength[1 + b], get(q, 0) * 0.0
    for i in range(n):
        if i != b:
            d, gm = difference(q, i, b, n), strength[1 + i]
            total = total + 3.0 * (own[1] * (gm * (mu * (mu + gm)))) / (strength[0] + dot(d, d))
    return total


@kernel
def gradients(strength, own, t, q, v, f, p):
    """Add the forces, and the reaction on the source, to f."""
    n, b = strength.shape[0] - 1, int(own[0])
    for i in range(n):
        if i != b:
            gm = strength[1 + i]
            ax, ay, az = _acceleration(strength, own, gm, difference(q, i, b, n))
            add_with_reaction(f, (gm * ax, gm * ay, gm * az), i, b, n)


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the second derivatives."""
    n, b = strength.shape[0] - 1, int(own[0])
    mu = strength[1 + b]
    for i in range(n):
        if i != b:
            d, gm = difference(q, i, b, n), strength[1 + i]
            r2 = strength[0] + dot(d, d)
            f = -6.0 * (own[1] * (gm * (mu * (mu + gm)))) / (r2 * r2)
            for a in range(3):
                for c in range(3):
                    same = 1.0 if a == c else 0.0
                    add_differences(out, 0, f * (same - 4.0 * d[a] * d[c] / r2), a, c, i, b, n)


@kernel
def accelerate_some(strength, own, q, out, start, stop):
    """Add the accelerations of bodies start ... stop - 1; that of the source is due to all others."""
    n, b = strength.shape[0] - 1, int(own[0])
    whole = start <= b < stop
    bx, by, bz = get(q, 0) * 0.0, get(q, 0) * 0.0, get(q, 0) * 0.0
    for i in range(0 if whole else start, n if whole else stop):
        if i != b:
            gm = strength[1 + i]
            ax, ay, az = _acceleration(strength, own, gm, difference(q, i, b, n))
            bx, by, bz = bx + gm * ax, by + gm * ay, bz + gm * az
            if start <= i < stop:
                put_acceleration(out, (ax, ay, az), i, n)
    if whole:
        put_reaction(out, (bx, by, bz), 1.0 / strength[1 + b], b, n)


@kernel
def field(strength, own, sources, x, y, z):
    """Return the acceleration of a massless particle at (x, y, z)."""
    n, b = strength.shape[0] - 1, int(own[0])
    return _acceleration(strength, own, 0.0, separation((x, y, z), sources, b, n))


@kernel(inline=True)
def about(strength, own, gm, r, w):
    """Return the acceleration at r from the source, and zeros for the momentum."""
    fx, fy, fz = _acceleration(strength, own, gm, r)
    none = fx * 0.0
    return fx, fy, fz, none, none, none


@kernel
def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return the force per unit mass, and zeros for the momentum."""
    fx, fy, fz = field(strength, own, sources, place[0], place[1], place[2])
    none = fx * 0.0
    return fx, fy, fz, none, none, none


TAG = Tag(
    "nobili-roxburgh",
    {
        "value": value,
        "gradients": gradients,
        "hessians": hessians,
        "accelerate_some": accelerate_some,
        "field": field,
        "particle_gradients": particle_gradients,
        "about": about,
    },
)


def nobili_roxburgh(row: int, c: float) -> Summand:
    """Return the term for the massive body of that row, counted from 0, as the source; c : a speed."""
    return Summand(
        name="Nobili–Roxburgh",
        formula="sum m' 3 M^2 / (c^2 r^2)",
        tag=TAG,
        parameters=np.array([row, 1.0 / (c * c)], dtype=np.float64),
        traits=frozenset({SEPARABLE, MASSLESS_PARTICLES, GRADIENTS, ABOUT_ONE_BODY}),
        axis=None,
    )


@dataclass(frozen=True)
class NobiliRoxburgh(Term):
    """A potential that turns pericentres as general relativity does, to first order, by one body.

        system.with_terms(orbits.NobiliRoxburgh("Sun"))

    body : the massive body whose field it is; by default the most massive one
    c : the speed of light; required if units are dimensionless

    It depends on positions alone, so that all methods take it, at the price of Newton's attraction by one body, and it
    is for secular work: **it gets the precession right and the mean motion wrong.** From the states of an ephemeris
    Mercury is three times as far off as by Newton alone. For positions, take `PostNewtonian`.
    """

    kind: ClassVar[str] = "nobili-roxburgh"
    alone: ClassVar[bool] = True
    c: Any = None

    def in_units(self, units: Any) -> Self:
        """Return this term with c in the system's units."""
        return replace(self, c=light_speed(self, units) * units.speed)

    def summand(self, row: int, units: Any) -> Summand:
        """Return the term for the massive body of that row."""
        return nobili_roxburgh(row, float(units.speed_value(self.c)))
