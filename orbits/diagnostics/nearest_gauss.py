"""A control for the diagnostics: a method with one known fault, which they must find."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

from orbits.integrators.gauss import Gauss
from orbits.tableaux import SymplecticTableau, gauss


@dataclass(frozen=True)
class NearestGauss(Gauss):
    """`Gauss` with every coefficient rounded to the nearest float64, as in other packages.

    It is symplectic only to about 1e-16 a step: its round-off has a bias, and the energy drifts.
    Source: Hairer, McLachlan & Razakarivony (2008), BIT 48, 231.
    """

    name: ClassVar[str] = "gauss-nearest"
    summary: ClassVar[str] = "Gauss collocation with its coefficients rounded to nearest: a control for diagnostics"

    @property
    def tableau(self) -> SymplecticTableau:
        """Collocation at the zeros of a Legendre polynomial; the floats are not completed to a symplectic pair."""
        return _rounded(self.stages)


@lru_cache(maxsize=8)
def _rounded(stages: int) -> SymplecticTableau:
    return gauss(stages).rounded_to_nearest()
