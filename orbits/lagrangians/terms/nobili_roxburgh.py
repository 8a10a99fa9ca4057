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

from orbits.checks import light_speed
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.lagrangians.base import ABOUT_ONE_BODY, GRADIENTS, MASSLESS_PARTICLES, SEPARABLE
from orbits.lagrangians.terms.about_one_body import kernels_from
from orbits.lagrangians.terms.base import Summand, Term
from orbits.lagrangians.terms.pairs import add_differences, difference, dot


@kernel(inline=True)
def part(strength, own, gm, r, w):
    """Return the part of L of a body at r from the source."""
    mu = strength[1 + int(own[0])]
    return 3.0 * (own[1] * (gm * (mu * (mu + gm)))) / (strength[0] + dot(r, r))


@kernel(inline=True)
def about(strength, own, gm, r, w):
    """Return the acceleration at r from the source, and zeros for the momentum."""
    mu, r2 = strength[1 + int(own[0])], strength[0] + dot(r, r)
    f = -6.0 * (own[1] * (mu * (mu + gm))) / (r2 * r2)
    none = f * 0.0
    return f * r[0], f * r[1], f * r[2], none, none, none


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


TAG = Tag("nobili-roxburgh", kernels_from(part, about, hessians, static=True))


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

        system.with_terms(orbits.terms.NobiliRoxburgh("Sun"))

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
