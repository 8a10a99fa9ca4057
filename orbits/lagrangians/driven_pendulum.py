"""Pendulum with a vertically oscillating pivot, which depends on time.

    L = v^2 / 2 + (g + a w^2 cos(w t)) cos q

q : angle from the lowest point, radians; the pivot moves by -a cos(w t), in the frame of the pivot, rod of length 1.
Fast shaking, a w > sqrt(2 g), makes the upright position stable (Kapitza).
Source: Landau & Lifshitz, Mechanics, sec. 5, problem 3; sec. 30, problem 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    return v[0] ** 2 / 2 + (p.g + p.a * p.w**2 * sympy.cos(p.w * t)) * sympy.cos(q[0])


driven_pendulum = shipped(
    name="driven-pendulum",
    formula="v^2 / 2 + (g + a w^2 cos(w t)) cos q",
    coordinates=("q",),
    parameters={"g": 1.0, "a": 0.2, "w": 1.7},
    expression=_expression,
    example=Motion(q=(1.1,), v=(0.4,), dt=0.1),
    source_="Landau & Lifshitz, Mechanics, sec. 5",
)
