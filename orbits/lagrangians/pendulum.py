"""Mathematical pendulum.

    L = m l^2 v^2 / 2 + m g l cos q

q : angle from the lowest point, radians. Parameters: mass m, length l, gravity g.
Its Störmer–Verlet map with m = l = g = 1 is Chirikov's standard map with K = h^2.
Source: Hairer, Lubich & Wanner (2006), sec. I.1.3; Chirikov (1979).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    return p.m * p.l**2 * v[0] ** 2 / 2 + p.m * p.g * p.l * sympy.cos(q[0])


pendulum = shipped(
    name="pendulum",
    formula="m l^2 v^2 / 2 + m g l cos q",
    coordinates=("q",),
    parameters={"m": 1.0, "l": 1.0, "g": 1.0},
    expression=_expression,
    example=Motion(q=(1.3,), v=(0.6,), dt=0.2),
    source_="Hairer, Lubich & Wanner (2006), sec. I.1.3",
)
