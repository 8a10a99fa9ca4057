"""A symmetric top on a fixed point in uniform gravity (Lagrange's top), in a homogeneous quaternion.

    L = 2 (I0 w0^2 + I1 (w1^2 + w2^2) + I3 w3^2) - m g l z3,     w = (q_conjugate q') / |q|^2

z3 : height of its axis on the unit sphere; see `orbits.lagrangians.rigid_bodies`. Conserved are the angular momenta
about the vertical and about its own axis.
Source: Landau & Lifshitz, Mechanics, sec. 35, problem 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion, Rotor
from orbits.lagrangians.rigid_bodies import in_space, of_body, spinning, stretching, turning
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    return spinning(q, v, (p.I1, p.I1, p.I3), p.I0) - p.mgl * turning(q)[2][2]


heavy_top = shipped(
    name="heavy-top",
    formula="2 (I0 w0^2 + I1 (w1^2 + w2^2) + I3 w3^2) - m g l z3,  w = (q_conjugate q') / |q|^2",
    coordinates=("a", "b", "c", "d"),
    parameters={"I1": 1.0, "I3": 0.4, "mgl": 1.5, "I0": 1.0},
    expression=_expression,
    example=Motion(q=(1.0, 0.2, -0.1, 0.3), v=(0.0, 0.2, 0.1, 1.0), dt=0.1),
    symmetries=(in_space(2), of_body(2), stretching()),
    rotors=(Rotor(0, ("I1", "I1", "I3")),),
    source_="Landau & Lifshitz, Mechanics, sec. 35",
)
