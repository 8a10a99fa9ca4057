"""What methods on Kepler orbits about a dominant body have in common."""

from __future__ import annotations

from typing import Any

from orbits.errors import InputError
from orbits.kernels.lanes import WIDTH

DOMINANT = 0.9
"""Fraction of the total mass that the dominant body must have."""


def require_dominant(parameters: Any) -> None:
    """Raise InputError for softened gravity, and if no body dominates the others.

    parameters : softening^2, GM1, ...
    """
    gm = parameters[1:]
    if parameters[0] > 0.0:
        raise InputError(
            "a Wisdom–Holman step moves the planets on Kepler orbits about point masses; got a softening. Use "
            "softening = 0, or a method such as Gauss(stages=8)."
        )
    if not gm.max() > DOMINANT * gm.sum():
        got = f"the heaviest of these {len(gm)} has {100 * gm.max() / gm.sum():.3g} %"
        raise InputError(
            "a Wisdom–Holman step needs massive bodies of which one dominates the others, with more than "
            f"{100 * DOMINANT:.0f} % of the mass; {got}. Use a method such as Gauss(stages=8)."
        )


def registers_for(size: int) -> int:
    """Return the number of registers of eight planets of `size` coordinates of bodies."""
    return max(1, (size // 3 - 1 + WIDTH - 1) // WIDTH)
