"""Terms of N-body Lagrangians, one file each: `ZonalHarmonics`, ... They are registered by being in this folder."""

from __future__ import annotations

from orbits.lagrangians.terms.base import Term
from orbits.registered import registered

__all__ = ["registry"]


def registry() -> dict[str, type[Term]]:
    """Return every term of the package by its kind."""
    return dict(registered(__name__, Term, "kind"))
