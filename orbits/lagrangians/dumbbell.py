"""Dumbbell: two masses on a rigid massless rod, in orbit about an attracting centre.

    L = m1 |v1|^2 / 2 + m2 |v2|^2 / 2 + GM m1 / |x1| + GM m2 / |x2|        with |x2 - x1|^2 = l^2

The simplest satellite whose attitude librates and tumbles, without angles. Invariant under rotations about the centre.
Source: Celletti & Sidorenko (2008), Celest. Mech. Dyn. Astron. 101, 105, for the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import rotation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    L = 0
    for m, k in ((p.m1, 0), (p.m2, 3)):
        r = sympy.sqrt(q[k] ** 2 + q[k + 1] ** 2 + q[k + 2] ** 2)
        L += m * (v[k] ** 2 + v[k + 1] ** 2 + v[k + 2] ** 2) / 2 + p.GM * m / r
    return L


def _constraints(q: Sequence[Any], p: Any) -> list[Any]:
    return [(q[3] - q[0]) ** 2 + (q[4] - q[1]) ** 2 + (q[5] - q[2]) ** 2 - p.l**2]


dumbbell = shipped(
    name="dumbbell",
    formula="m1 |v1|^2 / 2 + m2 |v2|^2 / 2 + GM m1 / |x1| + GM m2 / |x2|",
    coordinates=("x1", "y1", "z1", "x2", "y2", "z2"),
    parameters={"GM": 1.0, "m1": 1.0, "m2": 0.5, "l": 0.25},
    expression=_expression,
    constraints=("|x2 - x1|^2 - l^2",),
    constraint_expressions=_constraints,
    example=Motion(q=(1.0, 0.0, 0.0, 1.15, 0.2, 0.0), v=(-0.04, 0.93, 0.1, -0.12, 0.99, 0.3), dt=0.05),
    symmetries=tuple(
        rotation(axis, copies=2, name=f"rotation about {name}")
        for axis, name in (([1.0, 0.0, 0.0], "x"), ([0.0, 1.0, 0.0], "y"), ([0.0, 0.0, 1.0], "z"))
    ),
    source_="Celletti & Sidorenko (2008), Celest. Mech. Dyn. Astron. 101, 105",
)
