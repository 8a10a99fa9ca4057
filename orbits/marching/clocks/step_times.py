"""When the steps of one leg are: all that its loop has to know of its clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array

if TYPE_CHECKING:
    from orbits.marching.clocks.clock import Clock

UNLIMITED = 1 << 62
"""The number of steps of a block that nothing limits."""


class Place(NamedTuple):
    """The place of a time in a march: a number of whole steps, and the remaining time, with the sign of a step.

    With a clock whose steps differ, there are no whole steps, and the rest is the time itself.
    """

    steps: int
    rest: float


class Places(NamedTuple):
    """The places of ascending times: whole steps (n,), and remaining times (n,); see `Place`."""

    steps: NDArray[np.int64]
    rests: Array

    def at(self, k: int) -> Place:
        """Return one of them."""
        return Place(int(self.steps[k]), float(self.rests[k]))

    def between(self, first: int, last: int) -> Places:
        """Return those from one up to, and without, another one."""
        return Places(self.steps[first:last], self.rests[first:last])


class StepTimes:
    """When the steps of one leg are: all that its loop has to know of its clock.

    clock : of the leg; start : the time at which it begins
    step : whole steps taken; counted after each block
    arrived : whether the last block ended before a step that would pass its limit
    """

    arrived = False

    def __init__(self, clock: Clock, start: float) -> None:
        self.clock, self.start, self.step = clock, start, 0

    def bind(self, state: Mapping[str, Array], room: Array, block: int) -> None:
        """Take the arrays of the leg; room : the workspace of the clock for blocks of `block` steps."""

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        raise NotImplementedError

    @property
    def reading(self) -> float:
        """The reading of the clock: whole steps, or the time."""
        raise NotImplementedError

    def numbers(self, state: Mapping[str, Array], clock: Clock) -> Array:
        """Return what compiled code needs to know of a clock, of this leg or of a part of a step, for a block that
        begins at a state.
        """
        raise NotImplementedError

    def pace(self, numbers: Array) -> tuple[float, float]:
        """Return the length of the steps of a block, or about that, and the time from which observers count: 0, as they
        count steps, or that at the beginning of the block.
        """
        raise NotImplementedError

    def failed_at(self, numbers: Array, done: int) -> float:
        """Return the time at which a step began that failed, after `done` steps of a block."""
        raise NotImplementedError

    def aim(self, place: Place) -> None:
        """Let the next blocks lead up to a place, and not beyond."""

    def most(self, place: Place) -> int:
        """Return how many whole steps there are at the most before a place; 0 or less if there is none."""
        raise NotImplementedError

    def note(self, count: int, numbers: Array) -> None:
        """Take note of a block of `count` steps of the leg that was just marched, and of its lengths."""
        raise NotImplementedError

    def forget(self) -> None:
        """Take note that there is no last block."""
        raise NotImplementedError

    def lengths(self) -> Array:
        """Return the lengths of the steps of the last block, (steps,)."""
        raise NotImplementedError

    def ends(self) -> Array:
        """Return the times at which the steps of the last block begin, and its end, as terms and forces see them,
        (steps + 1,).
        """
        raise NotImplementedError

    def pairs(self) -> Array:
        """Return these times, as the clock has them, each as the sum of two numbers, (steps + 1, 2)."""
        raise NotImplementedError

    def steps_in_block(self, readings: Array) -> NDArray[np.int64]:
        """Return the steps of the last block in which readings lie, counted from 0."""
        raise NotImplementedError

    @property
    def origin_now(self) -> float:
        """The time from which observers count at the end of a leg."""
        return 0.0

    def is_at(self, place: Place) -> bool:
        """Return whether a place, up to which the leg has advanced, is where it is."""
        raise NotImplementedError

    def ahead(self, offset: float) -> Place:
        """Return the place of a time after the one reached."""
        raise NotImplementedError

    def place_of(self, time: float) -> Place:
        """Return the place of a time less than a step ahead."""
        raise NotImplementedError

    def places_of(self, readings: Array) -> Places:
        """Return the places of ascending readings of the clock, (n,), in the march of the leg."""
        raise NotImplementedError

    def part_until(self, time: float) -> float:
        """Return the time from the one reached to another one, in steps; 0 for steps that are chosen to end there."""
        return 0.0

    def next_place(self) -> Place:
        """Return the place to which the next step leads, or one beyond it."""
        raise NotImplementedError

    def copy_at(self, leg: Any, place: Place) -> dict[str, Array]:
        """Return a copy of the state of the leg, marched from the whole steps taken to a place less than a step ahead,
        as it is seen. Raises an IntegrationError if a step on the way cannot be taken.
        """
        raise NotImplementedError

    def led_to(self, places: Places, steps: int) -> int:
        """Return up to how many of these places a block of `steps` steps may lead."""
        return len(places.steps)

    def passed(self, places: Places) -> int:
        """Return how many of these places do not lie ahead."""
        raise NotImplementedError

    def behind(self, places: Places) -> Behind:
        """Return where places in the last block lie behind the beginnings of its steps."""
        raise NotImplementedError

    def underway(self, places: Places) -> Behind:
        """The same for a block that is being marched, whose steps are noted, but not counted yet."""
        return self.behind(places)

    def ahead_of(self, leg: Any, places: Places, passed: Callable[[Array], None]) -> Ahead:
        """Return the next step of a leg in which there are any of these places. Raises an IntegrationError if it cannot
        be taken.

        passed : is given the numbers of the clock once the bodies have taken a step before it
        """
        raise NotImplementedError

    def way(self, time: float) -> Way:
        """Return how another leg gets from here to a time less than a step ahead, where it ends."""
        raise NotImplementedError

    def hand_on(self, leg: Any, end: Any) -> None:
        """Let a leg that ends within the next step of this one, see `way`, begin where this one is."""
        raise NotImplementedError

    def begin_at(self, time: float) -> None:
        """Begin at a time since the start of the run, before the first step."""
        raise NotImplementedError

    def end_exactly(self) -> None:
        """Let the last step end exactly at the place that is approached: from there the leg cannot go on."""

    def reading_in_part(self, reading: Any, time: float) -> Any:
        """Return the reading of this clock for one of a leg that covers the part of a step up to a time."""
        raise NotImplementedError


class Behind(NamedTuple):
    """Where places lie behind the beginnings of steps: the steps, counted from 0; the times at which these begin, as
    terms and forces see them; and the times from there to the places, all (n,).
    """

    steps: NDArray[np.int64]
    begun: Array
    parts: Array


class Ahead(NamedTuple):
    """A step in which there are places: the state at its beginning, and where they lie behind it.

    numbers : of the clock, see `StepTimes.numbers`, if the bodies have just taken this step
    """

    state: Mapping[str, Array]
    behind: Behind
    numbers: Array | None = None


class Way(NamedTuple):
    """The way to a time within a step, by a leg of its own: its clock, its start, and the place of that time in it.

    continued : the arrays of the state that it takes over as they are, besides positions and velocities
    """

    clock: Clock
    start: float
    place: Place
    continued: tuple[str, ...] = ()
