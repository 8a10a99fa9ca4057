"""Free particle in space.

    L = m |v|^2 / 2

Parameter: the mass m. Its exact discrete Lagrangian is m |q1 - q0|^2 / (2h).
Source: Marsden & West (2001), sec. 1.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import Symmetry, boost, rotation, translation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    return p.m * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2


def _symmetries(parameters: Mapping[str, float]) -> tuple[Symmetry, ...]:
    axes = dict(zip("xyz", ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), strict=True))
    return (
        *(translation(u, name=f"translation along {x}") for x, u in axes.items()),
        *(boost(u, parameters["m"], name=f"boost along {x}") for x, u in axes.items()),
        rotation(axes["z"], name="rotation about z"),
    )


free_particle = shipped(
    name="free-particle",
    formula="m |v|^2 / 2",
    coordinates=("x", "y", "z"),
    parameters={"m": 1.0},
    expression=_expression,
    example=Motion(q=(0.3, -0.2, 0.5), v=(0.7, 0.4, -0.9), dt=0.1),
    symmetries=_symmetries,
    source_="Marsden & West (2001), sec. 1.1",
)
