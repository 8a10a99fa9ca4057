"""Charged particle in a magnetic field along z that grows outwards, and in an electric one.

    L = m |v|^2 / 2 + e A(q) . v - e phi(q)
    A = (B0 / 2 + B2 (x^2 + y^2) / 4) (-y, x, 0),     B = curl A = (0, 0, B0 + B2 (x^2 + y^2))
    phi = E2 (2 z^2 - x^2 - y^2) / 2

Depends on velocities linearly: an implicit method in canonical form serves it. Invariant under rotations about z; its
canonical momentum p = m v + e A is not m v.
Parameters: mass m, charge e, the fields' B0, B2 and E2; any units in which e v B is a force.
Source: Landau & Lifshitz, The Classical Theory of Fields, sec. 16, for slow motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import rotation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    x, y, z = q
    across = x**2 + y**2
    turning = (p.B0 / 2 + p.B2 * across / 4) * (x * v[1] - y * v[0])
    potential = p.E2 * (2 * z**2 - across) / 2
    return p.m * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2 + p.e * turning - p.e * potential


charged_particle = shipped(
    name="charged-particle",
    formula="m |v|^2 / 2 + e A(q) . v - e phi(q)",
    coordinates=("x", "y", "z"),
    parameters={"m": 1.0, "e": 1.0, "B0": 1.0, "B2": 0.5, "E2": 0.2},
    expression=_expression,
    example=Motion(q=(0.8, 0.1, 0.3), v=(0.2, 0.5, 0.1), dt=0.2),
    symmetries=(rotation([0.0, 0.0, 1.0], name="rotation about z"),),
    source_="Landau & Lifshitz, The Classical Theory of Fields, sec. 16",
)
