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

from orbits.integrators.forms import Array
from orbits.kernels.binding import Tag
from orbits.kernels.clocks import CONSTANT_STEPS


class Place(NamedTuple):
    """Where a time lies in a march: so many whole steps, and the part of a step, a time of its sign, that is left."""

    steps: int
    rest: float


@dataclass(frozen=True)
class ConstantSteps:
    """Steps of one length: step k begins at k h.

    h : the length of a step, not 0; its sign is the direction of time
    """

    h: float

    timing: ClassVar[Tag] = CONSTANT_STEPS

    def __post_init__(self) -> None:
        object.__setattr__(self, "h", float(self.h))

    @property
    def direction(self) -> float:
        """1 forwards in time, -1 backwards."""
        return math.copysign(1.0, self.h)

    def numbers(self, start: float, steps: int) -> Array:
        """Return what compiled code needs to know after so many steps of a march that began at `start`."""
        return np.array([start, float(steps), self.h])

    def time(self, steps: Any) -> Any:
        """Return how long so many steps take; fractions of a step, and arrays of them, are allowed."""
        return steps * self.h

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


def clock_of(step: float | ConstantSteps) -> ConstantSteps:
    """Return a clock as it is, of a number the clock of steps of that length."""
    return step if isinstance(step, ConstantSteps) else ConstantSteps(step)
