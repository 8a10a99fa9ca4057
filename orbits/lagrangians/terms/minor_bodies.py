"""Minor bodies: massive bodies that do not attract each other, but all others, and are attracted by them.

    L = sum_{(i, j)} G m_i m_j / sqrt(r_ij^2 + eps^2)   over the pairs of which one body at least is no minor body

It stands in place of Newton's sum over all pairs: of n bodies, of which h attract all, h n pairs are left of n^2 / 2. A
pair is left out whole, with both its forces, so that momentum, angular momentum, the motion of the centre of mass and
the energy of this Lagrangian are conserved as ever. A massless particle is attracted by all massive bodies.
Parameters: a sign, the first and the end of the ranks whose pairs with all higher ranks are summed, then the row of the
body of each rank; bodies that attract all come first.
Source: as in N-body programs with semi-active particles; the rule is exact where the pairs left out are.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.errors import InputError, shown
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put, rsqrt_cubed, sqrt
from orbits.lagrangians.base import GRADIENTS, MASSLESS_PARTICLES, SEPARABLE
from orbits.lagrangians.terms.base import Summand, Term
from orbits.lagrangians.terms.pairs import add_pair_tide, difference

RANKS = 3
"""The index of the row of the first rank in the parameters."""


@kernel
def value(strength, own, t, q, v):
    """Return the sum over the pairs."""
    n, total = strength.shape[0] - 1, get(q, 0) * 0.0
    for a in range(int(own[1]), int(own[2])):
        i = int(own[RANKS + a])
        for b in range(a + 1, n):
            j = int(own[RANKS + b])
            x, y, z = difference(q, j, i, n)
            total = total + strength[1 + i] * strength[1 + j] / sqrt(strength[0] + x * x + y * y + z * z)
    return own[0] * total


@kernel(inline=True)
def _add_pairs(strength, own, q, out, forces):
    """Add the forces on all bodies, or their accelerations, each pair evaluated once; forces : a literal."""
    n = strength.shape[0] - 1
    for a in range(int(own[1]), int(own[2])):
        i = int(own[RANKS + a])
        x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
        fx, fy, fz = get(out, i), get(out, n + i), get(out, 2 * n + i)
        gm = own[0] * strength[1 + i]
        for b in range(a + 1, n):
            j = int(own[RANKS + b])
            dx, dy, dz = get(q, j) - x, get(q, n + j) - y, get(q, 2 * n + j) - z
            w = rsqrt_cubed(strength[0] + dx * dx + dy * dy + dz * dz)
            if forces:
                w_i = w_j = w * (gm * strength[1 + j])
            else:
                w_i, w_j = w * (own[0] * strength[1 + j]), w * gm
            fx, fy, fz = fx + w_i * dx, fy + w_i * dy, fz + w_i * dz
            put(out, j, get(out, j) - w_j * dx)
            put(out, n + j, get(out, n + j) - w_j * dy)
            put(out, 2 * n + j, get(out, 2 * n + j) - w_j * dz)
        put(out, i, fx)
        put(out, n + i, fy)
        put(out, 2 * n + i, fz)


@kernel
def gradients(strength, own, t, q, v, f, p):
    """Add the forces to f."""
    _add_pairs(strength, own, q, f, True)


@kernel
def accelerate_some(strength, own, q, out, start, stop):
    """Add the accelerations of bodies start ... stop - 1, of each in the order of the ranks of its partners."""
    n = strength.shape[0] - 1
    if start == 0 and stop == n:
        _add_pairs(strength, own, q, out, False)
        return
    first, end = int(own[1]), int(own[2])
    for b in range(n):
        i = int(own[RANKS + b])
        if start <= i < stop:
            x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
            ax, ay, az = get(out, i), get(out, n + i), get(out, 2 * n + i)
            for a in range(first, n if first <= b < end else min(b, end)):
                if a != b:
                    j = int(own[RANKS + a])
                    dx, dy, dz = get(q, j) - x, get(q, n + j) - y, get(q, 2 * n + j) - z
                    w = rsqrt_cubed(strength[0] + dx * dx + dy * dy + dz * dz) * (own[0] * strength[1 + j])
                    ax, ay, az = ax + w * dx, ay + w * dy, az + w * dz
            put(out, i, ax)
            put(out, n + i, ay)
            put(out, 2 * n + i, az)


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the tidal matrices of the pairs."""
    n = strength.shape[0] - 1
    for a in range(int(own[1]), int(own[2])):
        for b in range(a + 1, n):
            add_pair_tide(strength, own[0], q, int(own[RANKS + a]), int(own[RANKS + b]), out)


@kernel
def field(strength, own, sources, x, y, z):
    """Return zeros: massless particles are attracted by all bodies, as ever."""
    return x * 0.0, x * 0.0, x * 0.0


@kernel
def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return zeros, as `field` does."""
    none = place[0] * 0.0
    return none, none, none, none, none, none


TAG = Tag(
    "minor-bodies",
    {
        "value": value,
        "gradients": gradients,
        "hessians": hessians,
        "accelerate_some": accelerate_some,
        "field": field,
        "particle_gradients": particle_gradients,
    },
)


def minor_bodies(rows: Set[int], bodies: int) -> Summand:
    """Return the attraction of `bodies` massive bodies, of which those of the rows, counted from 0, are minor ones."""
    ranks = [*(i for i in range(bodies) if i not in rows), *sorted(rows)]
    heavy = bodies - len(rows)
    return Summand(
        name="minor bodies",
        formula="- sum over pairs of minor bodies G m m' / r",
        tag=TAG,
        parameters=np.array([1.0, 0, heavy, *ranks], dtype=np.float64),
        traits=frozenset({SEPARABLE, MASSLESS_PARTICLES, GRADIENTS}),
        axis=None,
        beside_newton=np.array([-1.0, heavy, bodies, *ranks], dtype=np.float64),
    )


@dataclass(frozen=True)
class MinorBodies(Term):
    """Massive bodies that do not attract each other, but all others, and are attracted by these.

        system.with_terms(orbits.terms.MinorBodies(bodies=["Ceres", "Pallas", "Vesta"]))

    bodies : the names of massive bodies, in a list or tuple

    Asteroids are the case in point: of n bodies, of which h attract all, h n pairs are left of n^2 / 2, and what the
    pairs left out would do is the price. Pairs are left out whole, so that all conserved quantities stay exact; energy
    is that of the pairs that are left. Massless particles are attracted by all bodies. REBOUND's counterpart is
    testparticle_type = 1.
    """

    kind: ClassVar[str] = "minor-bodies"
    alone: ClassVar[bool] = True
    others: ClassVar[tuple[str, ...]] = ("bodies",)
    bodies: Any = ()

    def __post_init__(self) -> None:
        """Raise InputError unless there are names, each once."""
        if self.body is not None:
            raise InputError(
                f"MinorBodies belongs to several bodies, but body is {shown(self.body)}; expected bodies=[...], the "
                "names of massive bodies."
            )
        given = [self.bodies] if isinstance(self.bodies, str) else self.bodies
        if not isinstance(given, list | tuple) or not given or not all(isinstance(name, str) for name in given):
            raise InputError(
                f"MinorBodies: bodies is {shown(self.bodies)}; expected names of massive bodies in a list, such as "
                "bodies=['Ceres', 'Vesta']."
            )
        if len(set(given)) < len(given):
            twice = next(name for name in given if list(given).count(name) > 1)
            raise InputError(f"MinorBodies: bodies names {twice!r} twice; expected each name once.")
        object.__setattr__(self, "bodies", tuple(given))

    @property
    def of_several(self) -> bool:
        """It belongs to all bodies that it names."""
        return True

    @property
    def whose(self) -> str:
        """Their number, or the name of one."""
        return self.bodies[0] if len(self.bodies) == 1 else f"{len(self.bodies)} bodies"

    def in_units(self, units: Any) -> Self:
        """Return it unchanged: it has no numbers."""
        return self

    def among(self, row: Callable[[str], int], bodies: int, units: Any) -> Summand:
        """Return the attraction of all bodies without the pairs of those named."""
        return minor_bodies({row(name) for name in self.bodies}, bodies)

    def without(self, gone: Set[str]) -> Self | None:
        """Return it for the bodies that are left."""
        left = tuple(name for name in self.bodies if name not in gone)
        return replace(self, bodies=left) if left else None
