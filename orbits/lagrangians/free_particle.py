"""Free particle in space.

    L = m |v|^2 / 2

Parameter: the mass m. Its exact discrete Lagrangian is m |q1 - q0|^2 / (2h).
Source: Marsden & West (2001), sec. 1.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import rotation, translation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    return p.m * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2


free_particle = shipped(
    name="free-particle",
    formula="m |v|^2 / 2",
    coordinates=("x", "y", "z"),
    parameters={"m": 1.0},
    expression=_expression,
    example=Motion(q=(0.3, -0.2, 0.5), v=(0.7, 0.4, -0.9), dt=0.1),
    symmetries=(
        translation([1.0, 0.0, 0.0], name="translation along x"),
        translation([0.0, 1.0, 0.0], name="translation along y"),
        translation([0.0, 0.0, 1.0], name="translation along z"),
        rotation([0.0, 0.0, 1.0], name="rotation about z"),
    ),
    source_="Marsden & West (2001), sec. 1.1",
)
