"""What a run needs of those that can march it again: states between its samples, and what it passed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from orbits.propagation.approach import Approach
    from orbits.propagation.approaches import Approaches
    from orbits.trajectory.run import Trajectory

Array = NDArray[np.float64]


class March(Protocol):
    """A march under way, from the initial state of a run, with its method and its step."""

    @property
    def step(self) -> int:
        """Whole steps taken."""

    def advance(self, steps: int) -> Any:
        """Take so many steps more."""

    def state_after(self, rest: float) -> tuple[Array, Array]:
        """Return q and v, (bodies, 3), a part of a step from here, which changes nothing."""

    def close(self) -> None:
        """Give back what it holds."""


class MarchesAgain(Protocol):
    """What marches a run again, handed to a `Trajectory` by what made it; `orbits.propagation` has one."""

    def begun(self, run: Trajectory) -> March:
        """Return the march of the run from its initial state."""

    def at(self, run: Trajectory, t: Any) -> Any:
        """Return the state at a time, or the states at several; see `Trajectory.at`."""

    def closest_approaches(self, run: Trajectory) -> Approaches:
        """Return how close bodies came to one another; see `Trajectory.closest_approaches`."""

    def unresolved(self, run: Trajectory) -> list[Approach]:
        """Return the passages that the step could not resolve; see `Trajectory.unresolved`."""
