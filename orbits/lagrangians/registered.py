"""The registry of the Lagrangians of this package, by name."""

from __future__ import annotations

from orbits.lagrangians.base import Lagrangian

FOUND: dict[str, Lagrangian] = {}
"""Filled when `orbits.lagrangians` loads."""


def registry() -> dict[str, Lagrangian]:
    """Return every Lagrangian of the package by its name."""
    return dict(FOUND)
