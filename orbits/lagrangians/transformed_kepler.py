"""Kepler's problem in the plane in transformed time, dt = g dtau, with g = r^(3/2).

    L~ = |q'|^2 / (2 g) + g (GM / r + E0) + (t' - g)^2 / 2

At the energy E0 its orbits are those of `kepler`, and the last coordinate is the time (see `time_transformed`, which
makes such Lagrangians from others). Equal steps of tau are short at the pericentre and long at the apocentre.

Parameters: GM, in length^3 / time^2 in the units of q and t; E0, in length^2 / time^2.
Source: Hairer, Lubich & Wanner (2006), sec. VIII.2.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from orbits.lagrangians.base import Array, Motion
from orbits.lagrangians.symbolic import shipped
from orbits.lagrangians.symmetry import Symmetry, translation


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    import sympy

    r2 = q[0] ** 2 + q[1] ** 2
    g = r2 ** sympy.Rational(3, 4)
    return (v[0] ** 2 + v[1] ** 2) / (2 * g) + g * (p.GM / sympy.sqrt(r2) + p.E0) + (v[2] - g) ** 2 / 2


def _turned(s: float, q: Array) -> Array:
    c, d = np.cos(s), np.sin(s)
    return np.array([c * q[0] - d * q[1], d * q[0] + c * q[1], q[2]])


def _turning(q: Array) -> Array:
    return np.array([-q[1], q[0], 0.0])


# From the pericentre of an orbit of a = 1 and e = 1/2, at which g = (1/2)^(3/2).
_G = 0.5**1.5

transformed_kepler = shipped(
    name="transformed-kepler",
    formula="|q'|^2 / (2 g) + g (GM / |q| + E0) + (t' - g)^2 / 2, g = |q|^(3/2)",
    coordinates=("x", "y", "t"),
    parameters={"GM": 1.0, "E0": -0.5},
    expression=_expression,
    example=Motion(q=(0.5, 0.0, 0.0), v=(0.0, _G * 3.0**0.5, _G), dt=0.15),
    symmetries=(
        Symmetry("rotation", _turned, _turning),
        translation((0.0, 0.0, 1.0), name="translation of time"),
    ),
    source_="Hairer, Lubich & Wanner (2006), sec. VIII.2.1",
)
