"""Kepler's problem in the plane.

    L = |v|^2 / 2 + GM / |q|

Parameter: GM, in length^3 / time^2 in the units of q and t. L is per unit mass of the moving body.
Source: Hairer, Lubich & Wanner (2006), sec. I.2.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import rotation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    return (v[0] ** 2 + v[1] ** 2) / 2 + p.GM / sympy.sqrt(q[0] ** 2 + q[1] ** 2)


kepler = shipped(
    name="kepler",
    formula="|v|^2 / 2 + GM / |q|",
    coordinates=("x", "y"),
    parameters={"GM": 1.0},
    expression=_expression,
    example=Motion(q=(0.7, 0.2), v=(-0.3, 1.2), dt=0.1),
    symmetries=(rotation(name="rotation"),),
    source_="Hairer, Lubich & Wanner (2006), sec. I.2.1",
)
