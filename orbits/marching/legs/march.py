"""What every march has in common: of one leg, of two that take turns, or of a chain of legs whose bodies change."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.marching.clocks.constant import Clock
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs.samples import Samples

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg
    from orbits.marching.legs.problem import Problem
    from orbits.marching.legs.record import Record


class March(ABC):
    """A march of a run.

    clock, step, time : the times of its steps, whole steps taken, and the time reached since the start of the run
    changed : whether its bodies have changed; ended : the row of the collision that ended it, and the bodies there
    found : the event that interrupts it before its next collision
    covers_parts : whether it begins within a step of a map, which it leaves for that
    """

    clock: Clock
    changed = False
    ended: Any = None
    found: Any = None
    covers_parts = False

    @property
    @abstractmethod
    def step(self) -> int:
        """Whole steps taken."""

    @property
    @abstractmethod
    def time(self) -> float:
        """The time reached, since the start of the run."""

    @abstractmethod
    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3); NaN for bodies that are gone."""

    @abstractmethod
    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) at a time less than a step ahead, without changing the march."""

    @abstractmethod
    def accounts(self) -> Array:
        """Return what is known of each force at the state returned last."""

    @abstractmethod
    def retired(self, by: float | None = None) -> list[Retirement]:
        """Return the particles that were retired, in the order of the bodies.

        by : a time less than a step ahead, up to which particles are followed; None for the time reached
        """

    @abstractmethod
    def compile(self) -> None:
        """Compile, or load from the cache, all that `approach` needs."""

    @abstractmethod
    def close(self) -> None:
        """Release the threads."""

    @property
    @abstractmethod
    def home(self) -> Leg:
        """The leg whose clock the march has."""

    @cached_property
    def samples(self) -> Samples:
        """Its states at samples."""
        return Samples(self)

    @property
    def current(self) -> Any:
        """The march of the bodies that are there now."""
        return self

    def changes(self) -> Any:
        """Return the changes of its bodies so far; None if they stay the same."""
        return None

    def excursions(self) -> tuple[NDArray[np.int64], int] | None:
        """Return the excursions from the map, and their number; None if there can be none."""
        return None

    @abstractmethod
    def is_before(self, place: Place) -> bool:
        """Return whether there may be steps left before a place."""

    @abstractmethod
    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place."""

    def advance_to(self, place: Place) -> None:
        """March on by all steps before a place. Raises ConvergenceError or SingularityError; the state is then that
        before the step that failed.
        """
        while self.is_before(place):
            self.approach(place)

    @abstractmethod
    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced."""

    @abstractmethod
    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit."""

    @abstractmethod
    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a checkpoint."""


class MarchOfSameBodies(March):
    """A march whose bodies stay the same: of one leg, or of two that take turns."""

    problem: Problem

    @property
    def leg(self) -> Leg:
        """The leg that marches now."""
        return self.home

    @property
    def last(self) -> Leg:
        """The leg that marched the last block."""
        return self.home

    @abstractmethod
    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""

    def go_on_from(self, old: Any, step: int, time: float) -> None:
        """Follow a march of bodies that change at a time, with what outlives them: what was retired, and counts.

        step : whole steps taken, of this march
        """
        home = self.home
        home.losses.go_on_from(home, old.home)
        home.stepper.take_counts(old.home.stepper)
        home.times.step = step
        home.bounds.beware()

    @abstractmethod
    def record(self, end: float) -> Record:
        """Return what was seen of passages up to a time; see `orbits.marching.legs.record`."""
