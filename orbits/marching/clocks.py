"""Clocks: when the steps of a run are. A run asks its clock, so that nobody else multiplies steps by a length.

`ConstantSteps` is the clock of t = k h. What compiled code needs of a clock stands in `orbits.kernels.clocks`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import single_number
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.kernels.binding import Tag
from orbits.kernels.clocks import CONSTANT_STEPS


class Place(NamedTuple):
    """Where a time lies in a march: so many whole steps, and the part of a step, a time of its sign, that is left.

    For a clock whose steps differ there are no whole steps, and the rest is the time.
    """

    steps: int
    rest: float


class Clock:
    """When the steps of a run are: a frozen value.

    timing : the tag under which compiled code knows it
    direction : 1 forwards in time, -1 backwards
    h : the length of its steps with that sign; NaN where they differ

    A clock *reads* whole numbers of steps where these tell the time, and times elsewhere: readings stand in the records
    of a run, and `time` makes times of them.
    """

    timing: ClassVar[Tag]
    direction: float
    h: float

    @property
    def changes(self) -> bool:
        """Whether steps differ in length."""
        raise NotImplementedError

    def check(self, integrator: Integrator) -> None:
        """Raise InputError for a method whose steps this clock cannot choose."""

    def room(self, block: int, size: int) -> int:
        """Return how many numbers compiled code may use, for a block of steps of a state of so many numbers."""
        return 0

    def time(self, reading: Any) -> Any:
        """Return the time, since the start of the run, of a reading or of an array of them."""
        raise NotImplementedError

    def places(self, times: ArrayLike) -> tuple[NDArray[np.int64], Array]:
        """Return where times lie in a march, as whole steps (n,) and rests (n,); see `Place`."""
        raise NotImplementedError

    def place(self, time: float | Fraction) -> Place:
        """Return where a time lies in a march."""
        raise NotImplementedError


@dataclass(frozen=True)
class ConstantSteps(Clock):
    """Steps of one length: step k begins at k h.

    h : the length of a step, not 0; its sign is the direction of time
    """

    h: float

    timing: ClassVar[Tag] = CONSTANT_STEPS

    def __post_init__(self) -> None:
        object.__setattr__(self, "h", float(self.h))

    @property
    def direction(self) -> float:  # type: ignore[override]
        """1 forwards in time, -1 backwards."""
        return math.copysign(1.0, self.h)

    @property
    def changes(self) -> bool:
        """No."""
        return False

    def numbers(self, start: float, steps: int) -> Array:
        """Return what compiled code needs to know after so many steps of a march that began at `start`."""
        return np.array([start, float(steps), self.h])

    def time(self, reading: Any) -> Any:
        """Return how long so many steps take; fractions of a step, and arrays of them, are allowed."""
        return reading * self.h

    def places(self, times: ArrayLike) -> tuple[NDArray[np.int64], Array]:
        """Return (k, r) with times = k h + r exactly: k >= 0 whole steps and a rest of less than a step in the
        direction of h.
        """
        rest = np.fmod(times, self.h)
        steps = np.rint((times - rest) / self.h).astype(np.int64)
        return steps, rest

    def place(self, time: float | Fraction) -> Place:
        """Return where a time lies, the rest rounded once; of an exact time the exact steps."""
        if isinstance(time, Fraction):
            steps = max(0, math.floor(time / Fraction(self.h)))
            return Place(steps, float(time - steps * Fraction(self.h)))
        rest = math.fmod(time, self.h)
        return Place(round((time - rest) / self.h), rest)


def clock_of(step: float | Clock) -> Clock:
    """Return a clock as it is, for a number the clock of steps of that length. Raises InputError for anything else."""
    return step if isinstance(step, Clock) else ConstantSteps(single_number(step, "step"))
