"""The spin of a moon in the plane of its Kepler orbit, which it does not change: the planar spin–orbit problem.

    L = (x'^2 + y'^2)/2 + GM/r + eps [theta'^2/2 + GM alpha^2 ((x^2 - y^2) cos 2 theta + 2 x y sin 2 theta)/(4 r^5)]

x, y : the orbit; theta : the direction of the long axis; alpha^2 = 3 (B - A)/C. For eps -> 0 the spin does not act back
on the orbit; 1e-12 is below its last digits. Mercury is near theta' = 3n/2, the Moon at n, Hyperion tumbles.
Source: Goldreich & Peale (1966), AJ 71, 425; Wisdom, Peale & Mignard (1984), Icarus 58, 137.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import Symmetry


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    x, y, theta = q
    r = sympy.sqrt(x**2 + y**2)
    figure = (x**2 - y**2) * sympy.cos(2 * theta) + 2 * x * y * sympy.sin(2 * theta)
    spin = v[2] ** 2 / 2 + p.GM * p.alpha**2 * figure / (4 * r**5)
    return (v[0] ** 2 + v[1] ** 2) / 2 + p.GM / r + p.eps * spin


def _turned(s: float, q: Any) -> Any:
    import numpy as np

    c, d = np.cos(s), np.sin(s)
    return np.array([c * q[0] - d * q[1], d * q[0] + c * q[1], q[2] + s])


def _generator(q: Any) -> Any:
    import numpy as np

    return np.array([-q[1], q[0], 1.0])


spin_orbit = shipped(
    name="spin-orbit",
    formula="|v|^2/2 + GM/r + eps (theta'^2/2 + GM alpha^2 ((x^2 - y^2) cos 2 theta + 2 x y sin 2 theta)/(4 r^5))",
    coordinates=("x", "y", "theta"),
    parameters={"GM": 1.0, "alpha": 0.89, "eps": 1e-12},
    expression=_expression,
    example=Motion(q=(0.9, 0.1, 0.3), v=(-0.1, 1.1, 1.3), dt=0.1),
    symmetries=(Symmetry("rotation", _turned, _generator),),
    source_="Wisdom, Peale & Mignard (1984), Icarus 58, 137",
)
