"""Forces without a Lagrangian, one file each. They are registered by being in this folder."""

from __future__ import annotations

from orbits.forces.base import Force
from orbits.registered import registered

__all__ = ["registry"]


def registry() -> dict[str, type[Force]]:
    """Return every force of the package by its kind."""
    return dict(registered(__name__, Force, "kind"))
