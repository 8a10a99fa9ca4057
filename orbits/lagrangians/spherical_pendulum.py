"""Spherical pendulum in spherical angles.

    L = m l^2 (theta'^2 + sin(theta)^2 phi'^2) / 2 + m g l cos theta

theta : angle from the lowest point, phi : azimuth, radians; singular at theta = 0 and pi. Invariant under
phi -> phi + s.
Source: Landau & Lifshitz, Mechanics, sec. 14, problem 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import translation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    kinetic = p.m * p.l**2 * (v[0] ** 2 + sympy.sin(q[0]) ** 2 * v[1] ** 2) / 2
    return kinetic + p.m * p.g * p.l * sympy.cos(q[0])


spherical_pendulum = shipped(
    name="spherical-pendulum",
    formula="m l^2 (theta'^2 + sin(theta)^2 phi'^2) / 2 + m g l cos theta",
    coordinates=("theta", "phi"),
    parameters={"m": 1.0, "l": 1.0, "g": 1.0},
    expression=_expression,
    example=Motion(q=(1.1, 0.3), v=(0.2, 0.8), dt=0.1),
    symmetries=(translation([0.0, 1.0], name="rotation about the vertical"),),
    source_="Landau & Lifshitz, Mechanics, sec. 14",
)
