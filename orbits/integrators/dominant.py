"""What methods on Kepler orbits about a dominant body have in common."""

from __future__ import annotations

from typing import Any

from orbits.errors import InputError
from orbits.kernels.lanes import WIDTH

DOMINANT = 0.9
"""Fraction of the total mass that the dominant body must have."""


def require_dominant(parameters: Any) -> None:
    """Raise InputError for softened gravity, and if no body dominates the others; parameters : softening^2, GM1, ..."""
    gm = parameters[1:]
    if parameters[0] > 0.0:
        raise InputError(
            "a Wisdom–Holman step moves the planets on Kepler orbits about point masses; got a softening. Use "
            "softening = 0, or a method such as Gauss(stages=8)."
        )
    if len(gm) < 2 or not gm.max() > DOMINANT * gm.sum():
        share = gm.max() / gm.sum()
        got = "a single body" if len(gm) < 2 else f"the heaviest of {len(gm)} bodies has {100 * share:.3g} %"
        raise InputError(
            f"a Wisdom–Holman step needs a body that dominates the others, with more than {100 * DOMINANT:.0f} % "
            f"of the mass; got {got}. Use a method such as Gauss(stages=8)."
        )


def registers(size: int) -> int:
    """Return the number of registers of eight planets of `size` coordinates of bodies."""
    return max(1, (size // 3 - 1 + WIDTH - 1) // WIDTH)
