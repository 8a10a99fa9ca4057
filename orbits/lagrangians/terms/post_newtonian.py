"""Relativity to first post-Newtonian order: the term `PostNewtonian`, and its form for one central body.

`orbits.lagrangians.terms.einstein_infeld_hoffmann` has the form for several bodies. By one it is Schwarzschild's field
for all others:

    L = (1/c^2) sum_i m' [w^4/8 + 3/2 M w^2/r - M^2/(2 r^2)],     r = |q_i - q_s|,  w = v_i - v_s,
        M = G (m_i + m_s),  m' = m_i m_s / (m_i + m_s)

for all massive bodies i other than the source s, which feels the reaction; a massless particle has [...] per unit mass,
with M = G m_s. This is the Lagrangian of Einstein, Infeld and Hoffmann, in harmonic coordinates, for light bodies about
s: what it leaves out is of the order of (mass of the planets) / (mass of the source) of it, such as the relativity by
Jupiter. With M and m' the periastron of a pair advances by 6 pi M / (c^2 a (1 - e^2)) in a revolution whatever its
masses, which is the result of general relativity to this order. Its part of the Hamiltonian, with H_K = p^2/2 - M/r per
unit of m', is that of Saha and Tremaine:

    H_1 = -(1/c^2) (p^4/8 + 3/2 M p^2/r - M^2/(2 r^2)) = (1/c^2) (3/2 H_K^2 - p^4/2 - M^2/r^2)

It depends on differences alone, and has no axis: momentum, the uniform motion of the centre of mass (by masses without
binding energies) and angular momentum are conserved exactly. The canonical momenta are m v + dL/dv; the energy is that
of the whole Lagrangian. With a softening eps, r^2 = |q_i - q_s|^2 + eps^2, as in the attraction.
Parameters: row of the source, 1/c^2.
Source: Einstein, Infeld & Hoffmann (1938), Ann. Math. 39, 65; Landau & Lifshitz (1975), sec. 106; Saha & Tremaine
(1994), AJ 108, 1962.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.body_names import few
from orbits.checks import light_speed
from orbits.errors import InputError, shown
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import rsqrt_cubed
from orbits.lagrangians.base import ABOUT_ONE_BODY, GRADIENTS, MASSLESS_PARTICLES
from orbits.lagrangians.terms.about_one_body import kernels_from
from orbits.lagrangians.terms.base import Summand, Term
from orbits.lagrangians.terms.einstein_infeld_hoffmann import einstein_infeld_hoffmann
from orbits.lagrangians.terms.pairs import add_differences, difference

TOO_STRONG = 1e-2
"""The largest (v/c)^2 for which the first order is taken."""


@kernel(inline=True)
def _derivatives(r2, M, size, r, w):
    """Return the derivatives of `size` times the bracket with respect to r and w, six numbers."""
    (x, y, z), (vx, vy, vz) = r, w
    pull = M * rsqrt_cubed(r2)
    depth, v2 = pull * r2, vx * vx + vy * vy + vz * vz
    f, p = size * pull * (depth - 1.5 * v2), size * (0.5 * v2 + 3.0 * depth)
    return f * x, f * y, f * z, p * vx, p * vy, p * vz


@kernel(inline=True)
def about(strength, own, gm, r, w):
    """Return the derivatives of a pair's part of L, per GM of the lighter body, with respect to r and w, six numbers.

    gm : GM of the body at r from the source, float64 or lanes; 0 for a massless particle
    """
    source = strength[1 + int(own[0])]
    M = gm + source
    r2 = strength[0] + r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    return _derivatives(r2, M, own[1] * (source / M), r, w)


@kernel(inline=True)
def part(strength, own, gm, r, w):
    """Return the part of L of a body at r from the source, with velocity w."""
    source = strength[1 + int(own[0])]
    M = gm + source
    r2 = strength[0] + r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    v2, depth = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], M * rsqrt_cubed(r2) * r2
    size = own[1] * (gm * (source / M))
    return size * (v2 * (0.125 * v2 + 1.5 * depth) - 0.5 * depth * depth)


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the second derivatives."""
    n, b = strength.shape[0] - 1, int(own[0])
    d = 3 * n
    for i in range(n):
        if i != b:
            r, w = difference(q, i, b, n), difference(v, i, b, n)
            M = strength[1 + i] + strength[1 + b]
            size = own[1] * (strength[1 + i] * (strength[1 + b] / M))
            r2 = strength[0] + r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
            pull = M * rsqrt_cubed(r2)
            depth, v2 = pull * r2, w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
            along, bend = size * pull * (depth - 1.5 * v2), size * pull * (4.5 * v2 - 4.0 * depth) / r2
            mixed, inert = -3.0 * (size * pull), size * (0.5 * v2 + 3.0 * depth)
            for a in range(3):
                for c in range(3):
                    same = 1.0 if a == c else 0.0
                    add_differences(out, 0, bend * r[a] * r[c] + along * same, a, c, i, b, n)
                    add_differences(out, d * d, mixed * r[a] * w[c], a, c, i, b, n)
                    add_differences(out, 2 * d * d, size * w[a] * w[c] + inert * same, a, c, i, b, n)


TAG = Tag("post-newtonian", kernels_from(part, about, hessians))


def post_newtonian(row: int, c: float) -> Summand:
    """Return the term for the massive body of that row, counted from 0, as the source; c : a speed."""
    return Summand(
        name="post-Newtonian",
        formula="sum m' (w^4/8 + 3/2 M w^2/r - M^2/(2 r^2)) / c^2",
        tag=TAG,
        parameters=np.array([row, 1.0 / (c * c)], dtype=np.float64),
        traits=frozenset({MASSLESS_PARTICLES, GRADIENTS, ABOUT_ONE_BODY}),
        axis=None,
    )


@dataclass(frozen=True)
class PostNewtonian(Term):
    """General relativity to first post-Newtonian order: Mercury's 43" in a century, the Lagrangian of Einstein, Infeld
    and Hoffmann.

        system.with_terms(orbits.terms.PostNewtonian())
        system.with_terms(orbits.terms.PostNewtonian(sources=["Sun"]))

    sources : the names of the massive bodies whose fields are relativistic; by default all
    c : the speed of light; required if units are dimensionless

    By all bodies it takes two sums over pairs; with some of them as sources, over pairs with a source. With one source,
    the others move in its field of Schwarzschild, by their velocities relative to it, which `WisdomHolman` takes too;
    that leaves out 1e-3 of the effect for the planets, by Jupiter. `body` is the name of a single source, and need not
    be given.
    """

    kind: ClassVar[str] = "post-newtonian"
    alone: ClassVar[bool] = True
    sources: Any = None
    c: Any = None

    def __post_init__(self) -> None:
        """Raise InputError for anything but names, each once."""
        given = self.body if self.sources is None else self.sources
        if given is None:
            return
        named = [given] if isinstance(given, str) else given
        if not isinstance(named, list | tuple) or not all(isinstance(name, str) for name in named) or not named:
            raise InputError(
                f"PostNewtonian: sources is {shown(self.sources)}; expected names of massive bodies in a list, such as "
                "sources=['Sun'], or nothing for all of them."
            )
        alike = {name.casefold() for name in named}
        if len(alike) < len(named):
            raise InputError(f"PostNewtonian: sources names one body twice, {shown([*named])}; expected each once.")
        if self.body is not None and not (isinstance(self.body, str) and alike == {self.body.casefold()}):
            raise InputError(
                f"PostNewtonian: body is {shown(self.body)} and sources is {shown([*named])}; expected sources alone."
            )
        object.__setattr__(self, "sources", tuple(named))
        object.__setattr__(self, "body", named[0] if len(named) == 1 else None)

    @property
    def others(self) -> tuple[str, ...]:
        """The sources."""
        return ("sources",)

    @property
    def of_several(self) -> bool:
        """Whether it has several sources."""
        return self.body is None

    @property
    def whose(self) -> str:
        """The sources."""
        return "all bodies" if self.sources is None else few(self.sources, 3)

    def in_units(self, units: Any) -> Self:
        """Return this term with c in the system's units."""
        return replace(self, c=light_speed(self, units) * units.speed)

    def without(self, gone: Set[str]) -> Self | None:
        """Return this term with the sources that are left; None without any."""
        if self.sources is None:
            return self
        left = tuple(name for name in self.sources if name not in gone)
        return replace(self, sources=left, body=None) if left else None

    def check_start(self, system: Any) -> None:
        """Raise InputError if a body moves so fast, or is so deep in the field, that the next order is needed."""
        gm, q, v, _ = system.values
        c = float(system.units.speed_value(self.c))
        names = system.names if self.sources is None else self.sources
        for source in (system.index(name) for name in names):
            if not gm[source] > 0.0:
                continue
            others = np.arange(len(gm)) != source
            r = np.linalg.norm(q - q[source], axis=1)[others]
            v2 = (np.linalg.norm(v - v[source], axis=1) ** 2)[others]
            with np.errstate(divide="ignore"):
                strength = np.maximum(v2, 2.0 * (gm[source] + gm[others]) / r) / c**2
            if strength.size and not strength.max() <= TOO_STRONG:
                body, most = system.names[int(np.flatnonzero(others)[strength.argmax()])], float(strength.max())
                raise InputError(
                    f"{body!r} moves about {system.names[source]!r} with {100 * most**0.5:.3g} % of the speed of "
                    f"light, or would by falling there from far away: (v/c)^2 = {most:.3g}, and PostNewtonian leaves "
                    f"out its square. Expected at most {TOO_STRONG:g}; nothing here takes stronger fields."
                )
        speeds = np.linalg.norm(v, axis=1)
        if self.of_several and not (speeds.max() / c) ** 2 <= TOO_STRONG:
            body, most = system.names[int(speeds.argmax())], float(speeds.max() / c)
            raise InputError(
                f"{body!r} moves with {100 * most:.3g} % of the speed of light: (v/c)^2 = {most * most:.3g}, and "
                f"PostNewtonian leaves out its square. Expected at most {TOO_STRONG:g}. If all bodies move like that, "
                "system.barycentric() is the system as seen from its centre of mass."
            )

    def summand(self, row: int, units: Any) -> Summand:
        """Return the term for the massive body of that row as the only source."""
        return post_newtonian(row, float(units.speed_value(self.c)))

    def among(self, row: Callable[[str], int], bodies: int, units: Any) -> Summand:
        """Return the term with its sources."""
        if not self.of_several:
            return super().among(row, bodies, units)
        rows = range(bodies) if self.sources is None else [row(name) for name in self.sources]
        return einstein_infeld_hoffmann(rows, bodies, float(units.speed_value(self.c)))
