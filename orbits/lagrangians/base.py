"""What a Lagrangian is to the rest of the package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orbits.kernels.binding import Tag

SEPARABLE = "separable"
"""L(q, v) = T(v) - V(q) with a constant mass matrix: an explicit method can serve it."""

MASSLESS_PARTICLES = "massless particles"
"""It has a field in which each massless particle moves by a Lagrangian of its own."""


@dataclass(frozen=True)
class Lagrangian:
    """L(q, v) of a mechanical system, as kernels and traits.

    name : unique, as registered
    formula : L(q, v), for people
    tag : the compiled face (see `orbits.kernels.binding`)
    traits : what methods may ask of it: `SEPARABLE`, `MASSLESS_PARTICLES`
    symmetries : names of its continuous symmetries: "translation", "rotation"
    source : where it comes from
    """

    name: str
    formula: str
    tag: Tag
    traits: frozenset[str]
    symmetries: frozenset[str]
    source: str
