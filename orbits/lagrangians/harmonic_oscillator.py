"""Harmonic oscillator.

    L = m v^2 / 2 - k q^2 / 2

Parameters: mass m and stiffness k. Linear: methods may converge faster on it than their order.
Source: Landau & Lifshitz, Mechanics, sec. 21.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orbits.lagrangians.base import Motion
from orbits.lagrangians.symbolic import shipped


def _expression(q: Sequence[Any], v: Sequence[Any], t: Any, p: Any) -> Any:
    return p.m * v[0] ** 2 / 2 - p.k * q[0] ** 2 / 2


harmonic_oscillator = shipped(
    name="harmonic-oscillator",
    formula="m v^2 / 2 - k q^2 / 2",
    coordinates=("q",),
    parameters={"m": 1.0, "k": 0.5},
    expression=_expression,
    example=Motion(q=(0.5,), v=(0.2,), dt=0.2),
    source_="Landau & Lifshitz, Mechanics, sec. 21",
)
