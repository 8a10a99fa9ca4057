"""A satellite in the field of an oblate body, with the zonal harmonic J2.

    L = |v|^2 / 2 + GM / r (1 - J2 (R / r)^2 (3 z^2 / r^2 - 1) / 2)

Parameters: GM (length^3 / time^2), J2 (a number) and the equatorial radius R of the body (length). Invariant under
rotations about its axis, z; nodes and pericentres precess.
Source: Vallado (2013), sec. 8.6; Kaula (1966).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import rotation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    x, y, z = q
    r = sympy.sqrt(x**2 + y**2 + z**2)
    potential = p.GM / r - p.GM * p.J2 * p.R**2 * (3 * z**2 / r**5 - 1 / r**3) / 2
    return (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2 + potential


oblate = shipped(
    name="oblate",
    formula="|v|^2 / 2 + GM / r (1 - J2 (R / r)^2 (3 z^2 / r^2 - 1) / 2)",
    coordinates=("x", "y", "z"),
    parameters={"GM": 1.0, "J2": 1.0826e-3, "R": 1.0},
    expression=_expression,
    example=Motion(q=(1.2, 0.1, 0.2), v=(-0.1, 0.8, 0.5), dt=0.2),
    symmetries=(rotation([0.0, 0.0, 1.0], name="rotation about z"),),
    source_="Vallado (2013), sec. 8.6",
)
