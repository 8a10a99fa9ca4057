"""A method that is what it should be but for one thing, so that a diagnostic can be seen to find it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

from orbits.integrators.gauss import Gauss
from orbits.tableaux import SymplecticTableau, gauss


@dataclass(frozen=True)
class NearestGauss(Gauss):
    """`Gauss` with every coefficient rounded to the nearest float64, as other packages have it.

    It is symplectic to 1e-16 a step, and no better: round-off no longer averages out, and the energy drifts.
    Source: Hairer, McLachlan & Razakarivony (2008), BIT 48, 231.
    """

    name: ClassVar[str] = "gauss-nearest"
    summary: ClassVar[str] = "Gauss collocation with its coefficients rounded to nearest: a foil"

    @property
    def tableau(self) -> SymplecticTableau:
        """Collocation at the zeros of a Legendre polynomial, the floats not completed to a symplectic pair."""
        return _rounded(self.stages)


@lru_cache(maxsize=8)
def _rounded(stages: int) -> SymplecticTableau:
    return gauss(stages).rounded_to_nearest()
