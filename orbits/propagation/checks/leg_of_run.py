"""A leg of a run whose bodies change, as the checks of its passages see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from orbits.integrators.base import Integrator
from orbits.marching.clocks.clock import Clock
from orbits.system import System

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory
    from orbits.trajectory.excursions import Excursions


@dataclass(frozen=True)
class LegOfRun:
    """A leg of a run, with what the checks ask of a run.

    system : its bodies, with their masses and radii in this leg
    excursions : of the whole run; end : the time at which the run ended
    most : the most passages that are judged one by one
    """

    system: System
    integrator: Integrator
    clock: Clock
    excursions: Excursions | None
    end: float
    most: int

    @property
    def step(self) -> float:
        """The length of its steps, with the sign of the direction."""
        return self.clock.h


def listed_in(run: Trajectory | LegOfRun) -> str:
    """Return where all passages are listed that its steps did not resolve, in words; of legs they are not."""
    return "" if isinstance(run, LegOfRun) else ", in run.unresolved()"
