"""Charged particle in a magnetic field along z that grows outwards, and in an electric one.

    L = m |v|^2 / 2 + e A(q) . v - e phi(q)
    A = (B0 / 2 + B2 (x^2 + y^2) / 4) (-y, x, 0),     B = curl A = (0, 0, B0 + B2 (x^2 + y^2))
    phi = E2 (2 z^2 - x^2 - y^2) / 2

L is linear in the velocities in addition to m |v|^2 / 2: it needs an implicit method in canonical form. It is invariant
under rotations about z; the canonical momentum is p = m v + e A, not m v. Without the electric field (E2 = 0) it is
invariant under translations and boosts along z; if the magnetic field is also uniform (B2 = 0), a translation across it
changes L by a total derivative: p_x - e B0 y/2 and p_y + e B0 x/2 are conserved, the centre of gyration.
Parameters: mass m, charge e, the fields' B0, B2 and E2; any units in which e v B is a force.
Source: Landau & Lifshitz, The Classical Theory of Fields, sec. 16, for slow motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import Symmetry, boost, rotation, translation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    x, y, z = q
    across = x**2 + y**2
    turning = (p.B0 / 2 + p.B2 * across / 4) * (x * v[1] - y * v[0])
    potential = p.E2 * (2 * z**2 - across) / 2
    return p.m * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2) / 2 + p.e * turning - p.e * potential


def _symmetries(parameters: Mapping[str, float]) -> tuple[Symmetry, ...]:
    """Return the remaining symmetries; in a uniform magnetic field x -> x + s adds s e B0/2 dy/dt to L."""
    x, y, z = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
    found = [rotation(z, name="rotation about z")]
    if parameters["E2"] == 0.0:
        found += [translation(z, name="translation along z"), boost(z, parameters["m"], name="boost along z")]
        if parameters["B2"] == 0.0:
            half = parameters["e"] * parameters["B0"] / 2
            found += [
                translation(x, name="translation along x", gauge=lambda q: half * q[1]),
                translation(y, name="translation along y", gauge=lambda q: -half * q[0]),
            ]
    return tuple(found)


charged_particle = shipped(
    name="charged-particle",
    formula="m |v|^2 / 2 + e A(q) . v - e phi(q)",
    coordinates=("x", "y", "z"),
    parameters={"m": 1.0, "e": 1.0, "B0": 1.0, "B2": 0.5, "E2": 0.2},
    expression=_expression,
    example=Motion(q=(0.8, 0.1, 0.3), v=(0.2, 0.5, 0.1), dt=0.2),
    symmetries=_symmetries,
    source_="Landau & Lifshitz, The Classical Theory of Fields, sec. 16",
)
