"""Double pendulum in the plane.

    L = (m1 + m2) l1^2 v1^2 / 2 + m2 l2^2 v2^2 / 2 + m2 l1 l2 v1 v2 cos(q1 - q2)
        + (m1 + m2) g l1 cos q1 + m2 g l2 cos q2

q1, q2 : angles from the vertical, radians. The mass matrix depends on q: not separable. Chaotic.
Source: Landau & Lifshitz, Mechanics, sec. 5, problem 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    total = p.m1 + p.m2
    kinetic = total * p.l1**2 * v[0] ** 2 / 2 + p.m2 * p.l2**2 * v[1] ** 2 / 2
    kinetic += p.m2 * p.l1 * p.l2 * v[0] * v[1] * sympy.cos(q[0] - q[1])
    return kinetic + total * p.g * p.l1 * sympy.cos(q[0]) + p.m2 * p.g * p.l2 * sympy.cos(q[1])


double_pendulum = shipped(
    name="double-pendulum",
    formula="two masses on rods, angles q1, q2",
    coordinates=("q1", "q2"),
    parameters={"m1": 1.0, "m2": 0.7, "l1": 1.0, "l2": 0.8, "g": 1.0},
    expression=_expression,
    example=Motion(q=(0.9, -0.4), v=(0.3, 0.5), dt=0.1),
    source_="Landau & Lifshitz, Mechanics, sec. 5",
)
