"""The Hénon–Heiles problem: a star in the meridian plane of a galaxy.

    L = |v|^2 / 2 - |q|^2 / 2 - k (x^2 y - y^3 / 3)

With k = 1, chaotic motion spreads above energies of about 1/12; orbits escape above 1/6.
Source: Hénon & Heiles (1964); Hairer, Lubich & Wanner (2006), sec. I.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    x, y = q
    return (v[0] ** 2 + v[1] ** 2 - x**2 - y**2) / 2 - p.k * (x**2 * y - y**3 / 3)


henon_heiles = shipped(
    name="henon-heiles",
    formula="|v|^2 / 2 - |q|^2 / 2 - k (x^2 y - y^3 / 3)",
    coordinates=("x", "y"),
    parameters={"k": 1.0},
    expression=_expression,
    example=Motion(q=(0.1, 0.3), v=(0.35, -0.1), dt=0.2),
    source_="Hénon & Heiles (1964)",
)
