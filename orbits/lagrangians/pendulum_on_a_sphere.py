"""Spherical pendulum in Cartesian coordinates: a mass on a sphere.

    L = m |v|^2 / 2 - m g z        with x^2 + y^2 + z^2 = l^2

z : height. The motion of `spherical_pendulum`, without its singular points: it may pass the top and the bottom.
Invariant under rotations about the vertical.
Source: Hairer, Lubich & Wanner (2006), sec. VII.1.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import rotation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    return p.m * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2 - p.m * p.g * q[2]


def _constraints(q: Sequence[Any], p: Any) -> list[Any]:
    return [q[0] ** 2 + q[1] ** 2 + q[2] ** 2 - p.l**2]


pendulum_on_a_sphere = shipped(
    name="pendulum-on-a-sphere",
    formula="m |v|^2 / 2 - m g z",
    coordinates=("x", "y", "z"),
    parameters={"m": 1.0, "l": 1.0, "g": 1.0},
    expression=_expression,
    constraints=("x^2 + y^2 + z^2 - l^2",),
    constraint_expressions=_constraints,
    example=Motion(q=(0.48, 0.64, -0.6), v=(-0.24, 0.48, 0.32), dt=0.1),
    symmetries=(rotation([0.0, 0.0, 1.0], name="rotation about the vertical"),),
    source_="Hairer, Lubich & Wanner (2006), sec. VII.1.1",
)
