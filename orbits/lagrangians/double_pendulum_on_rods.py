"""Double pendulum in the plane in Cartesian coordinates: two masses on two rigid rods.

    L = m1 (vx1^2 + vy1^2) / 2 + m2 (vx2^2 + vy2^2) / 2 - m1 g y1 - m2 g y2
        with x1^2 + y1^2 = l1^2, (x2 - x1)^2 + (y2 - y1)^2 = l2^2

y : height. The motion of `double_pendulum`, whose mass matrix depends on the angles; here it is constant. Chaotic.
Source: Hairer, Lubich & Wanner (2006), sec. VII.1.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    kinetic = p.m1 * (v[0] ** 2 + v[1] ** 2) / 2 + p.m2 * (v[2] ** 2 + v[3] ** 2) / 2
    return kinetic - p.m1 * p.g * q[1] - p.m2 * p.g * q[3]


def _constraints(q: Sequence[Any], p: Any) -> list[Any]:
    return [q[0] ** 2 + q[1] ** 2 - p.l1**2, (q[2] - q[0]) ** 2 + (q[3] - q[1]) ** 2 - p.l2**2]


double_pendulum_on_rods = shipped(
    name="double-pendulum-on-rods",
    formula="m1 |v1|^2 / 2 + m2 |v2|^2 / 2 - m1 g y1 - m2 g y2",
    coordinates=("x1", "y1", "x2", "y2"),
    parameters={"m1": 1.0, "m2": 0.7, "l1": 1.0, "l2": 0.75, "g": 1.0},
    expression=_expression,
    constraints=("x1^2 + y1^2 - l1^2", "|x2 - x1|^2 - l2^2"),
    constraint_expressions=_constraints,
    example=Motion(q=(0.8, -0.6, 0.35, -1.2), v=(0.24, 0.32, 0.64, 0.02), dt=0.05),
    source_="Hairer, Lubich & Wanner (2006), sec. VII.1.1",
)
