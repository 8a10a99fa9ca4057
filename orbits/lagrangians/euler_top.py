"""A free rigid body, Euler's top, in a homogeneous quaternion; see `orbits.lagrangians.rigid_bodies`.

    L = 2 (I0 w0^2 + I1 w1^2 + I2 w2^2 + I3 w3^2),     w = (q_conjugate q') / |q|^2

I1, I2, I3 : principal moments of inertia; I0 moves nothing if |q| does not change. Its spatial angular momentum is
conserved in all directions; a body that spins about its middle axis turns over again and again (Dzhanibekov).
Source: Landau & Lifshitz, Mechanics, sec. 37; Hairer, Lubich & Wanner (2006), sec. VII.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion, Rotor
from orbits.lagrangians.rigid_bodies import in_space, spinning, stretching
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    return spinning(q, v, (p.I1, p.I2, p.I3), p.I0)


euler_top = shipped(
    name="euler-top",
    formula="2 (I0 w0^2 + I1 w1^2 + I2 w2^2 + I3 w3^2),  w = (q_conjugate q') / |q|^2",
    coordinates=("a", "b", "c", "d"),
    parameters={"I1": 1.0, "I2": 2.0, "I3": 3.0, "I0": 2.0},
    expression=_expression,
    example=Motion(q=(1.0, 0.2, -0.1, 0.3), v=(0.0, 0.2, 0.1, 0.4), dt=0.1),
    symmetries=(*(in_space(k) for k in range(3)), stretching()),
    rotors=(Rotor(0, ("I1", "I2", "I3")),),
    source_="Hairer, Lubich & Wanner (2006), sec. VII.5",
)
