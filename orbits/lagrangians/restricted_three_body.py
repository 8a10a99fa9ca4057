"""Circular restricted three-body problem in the rotating frame, in the plane.

    L = |v|^2 / 2 + (x v_y - y v_x) + (x^2 + y^2) / 2 + (1 - mu) / r1 + mu / r2
    r1, r2 : distances from the bodies of masses 1 - mu at (-mu, 0) and mu at (1 - mu, 0)

Units: the distance of the two bodies, their mass, and their angular speed are 1. The Coriolis term is that of a uniform
magnetic field; Jacobi's integral -2E is conserved. The example is near Arenstorf's closed orbits.
Source: Arenstorf (1963); Hairer, Nørsett & Wanner (1993), sec. II.0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    x, y = q
    r1 = sympy.sqrt((x + p.mu) ** 2 + y**2)
    r2 = sympy.sqrt((x - 1 + p.mu) ** 2 + y**2)
    rotating = x * v[1] - y * v[0] + (x**2 + y**2) / 2
    return (v[0] ** 2 + v[1] ** 2) / 2 + rotating + (1 - p.mu) / r1 + p.mu / r2


restricted_three_body = shipped(
    name="restricted-three-body",
    formula="|v|^2 / 2 + (x v_y - y v_x) + (x^2 + y^2) / 2 + (1 - mu) / r1 + mu / r2",
    coordinates=("x", "y"),
    parameters={"mu": 0.012277471},
    expression=_expression,
    example=Motion(q=(0.5, 0.1), v=(0.1, 0.9), dt=0.05),
    source_="Arenstorf (1963); Hairer, Nørsett & Wanner (1993), sec. II.0",
)
