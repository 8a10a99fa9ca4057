"""What every march has in common: of one leg, of two that take turns, or of a chain of legs whose bodies change."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.marching.clocks.constant import Clock
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs.samples import Samples

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg
    from orbits.marching.legs.record import Record

T = TypeVar("T")


class March(ABC):
    """A march of a run.

    clock, step, time : the times of its steps, whole steps taken, and the time reached since the start of the run
    met : why the last block ended, see `orbits.marching.legs.lists_and_bounds.Bounds`
    changed : whether its bodies have changed; ended : the row of the collision that ended it, and the bodies there
    found : the event that interrupts it before its next collision; is_away : whether all bodies have left the map
    """

    clock: Clock
    changed = False
    ended: Any = None
    found: Any = None
    met: int | None = None

    @property
    def is_away(self) -> bool:
        """Whether all bodies have left the map."""
        return False

    @property
    @abstractmethod
    def step(self) -> int:
        """Whole steps taken."""

    @property
    @abstractmethod
    def time(self) -> float:
        """The time reached, since the start of the run."""

    @property
    @abstractmethod
    def reading(self) -> float:
        """The reading of the clock: whole steps, or the time."""

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
    def retired(self) -> list[Retirement]:
        """Return the particles that were retired, in the order of the bodies."""

    @abstractmethod
    def retired_by(self, time: float) -> list[Retirement]:
        """Return these, and those that cannot be followed up to a time less than a step ahead."""

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
    """A march whose bodies stay the same; block : the most steps of a block."""

    block: int

    @abstractmethod
    def pass_by(self) -> None:
        """Take the next step whatever pairs come to their bounds in it."""

    @abstractmethod
    def record(self, end: float) -> Record:
        """Return what was seen of passages up to a time; see `orbits.marching.legs.record`."""

    def after_next_step(self, read: Callable[[], T]) -> T:
        """Return what a function returns after the next step; the march does not change. Raises what `advance_to`
        raises.
        """
        loop, kept, block = self.home.loop, self.checkpoint(), self.block
        listeners, loop.listeners = loop.listeners, []
        try:
            self.pass_by()
            self.approach(self.home.times.next_place())
            return read()
        finally:
            self.restore(kept)
            self.block, loop.listeners, self.met = block, listeners, None
