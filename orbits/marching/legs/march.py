"""What every march has in common: of one leg, of two that take turns, or of a chain of legs whose bodies change."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.step_times import Place, Places
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs.samples import Samples

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg

AT_ONCE = 256
"""The most states that are asked for together."""

_NONE = np.empty((0, 1, 3)), np.empty((0, 1, 3))


class March(ABC):
    """A march of a run.

    clock, step, time : the times of its steps, whole steps taken, and the time reached since the start of the run
    home : the leg whose clock the march has
    current : the march of the bodies that are there now; its `leg` marches now, `last` marched the last block
    changed : whether its bodies have changed; ended : the row of the collision that ended it, and the bodies there
    found : the event that interrupts it before its next collision, if it seeks events itself
    """

    clock: Clock
    changed = False
    ended: Any = None
    found: Any = None

    @property
    @abstractmethod
    def step(self) -> int: ...

    @property
    @abstractmethod
    def time(self) -> float: ...

    @property
    @abstractmethod
    def home(self) -> Leg: ...

    @property
    def current(self) -> Any:
        """The march of the bodies that are there now."""
        return self

    @cached_property
    def samples(self) -> Samples:
        """Its states at samples."""
        return Samples(self)

    @abstractmethod
    def is_before(self, place: Place) -> bool:
        """Return whether there may be steps left before a place."""

    @abstractmethod
    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place. Raises what `advance_to` raises."""

    def advance_to(self, place: Place) -> None:
        """March on by all steps before a place. Raises ConvergenceError or SingularityError; the state is then that
        before the step that failed.
        """
        while self.is_before(place):
            self.approach(place)

    def along(self, places: Places) -> Iterator[tuple[slice, Array, Array]]:
        """March on to ascending places, and yield which are in the next block, or in the next step, and (q, v) there,
        each (m, n, 3), until all are passed; after a block with none of them, an empty slice, and no states. Raises
        what `advance_to` raises, after the states before that.
        """
        done, count, singly = 0, len(places.steps), 0
        while done < count:
            some = places.between(done, min(done + AT_ONCE, count))
            if not self.is_before(some.at(0)):
                q, v = self.samples.ahead(some)
                yield slice(done, done + len(q)), q, v
                done += len(q)
                continue
            last = done + self.samples.together(some.between(0, 1) if done < singly else some)
            failure: IntegrationError | None = None
            try:
                self.approach(places.at(last - 1))
            except IntegrationError as error:
                failure = error
            passed = self.samples.passed(places.between(done, last)) if last > done + 1 else 0
            q, v = _NONE
            if passed:
                try:
                    q, v = self.samples.in_block(places.between(done, done + passed))
                except IntegrationError:  # no partial step to one of them: blocks end before each
                    singly, passed, failure = last, 0, None
            yield slice(done, done + passed), q, v
            done += passed
            if failure is not None:
                raise failure

    @abstractmethod
    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3); NaN for bodies that are gone."""

    @abstractmethod
    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) at a time less than a step ahead, without changing the march."""

    @abstractmethod
    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced."""

    @abstractmethod
    def accounts(self) -> Array:
        """Return what is known of each force at the state returned last."""

    @abstractmethod
    def retired(self, by: float | None = None) -> list[Retirement]:
        """Return the particles that were retired, in the order of the bodies.

        by : a time less than a step ahead, up to which particles are followed; None for the time reached
        """

    def changes(self) -> Any:
        """Return the changes of its bodies so far; None if they stay the same."""
        return None

    def follow_events(self) -> None:  # noqa: B027
        """Seek the events of the bodies that are there now, after a change, or in a run that is resumed."""

    def excursions(self) -> tuple[NDArray[np.int64], int] | None:
        """Return the excursions from the map, and their number; None if there can be none."""
        return None

    @abstractmethod
    def compile(self) -> None:
        """Compile, or load from the cache, all that `approach` needs."""

    @abstractmethod
    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit."""

    @abstractmethod
    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a checkpoint."""

    @abstractmethod
    def close(self) -> None:
        """Release the threads."""
