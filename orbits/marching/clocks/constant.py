"""Clocks: the times of the steps of a run, for its loop, samples, archive and records.

`ConstantSteps` is the clock t = k h. The compiled part of a clock is described in `orbits.kernels.clocks`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import single_number
from orbits.errors import InputError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.kernels.binding import Tag
from orbits.kernels.clocks import CONSTANT_STEPS

STEP_BITS = 24
"""Bits of the significand of a step, so that k h is exact."""


def rounded_step(dt: float) -> float:
    """Return dt rounded to 24 significant bits, so that k * dt is exact for every k below 2^29."""
    mantissa, exponent = math.frexp(dt)
    return math.ldexp(round(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)


class Place(NamedTuple):
    """The place of a time in a march: a number of whole steps, and the remaining time, with the sign of a step.

    With a clock whose steps differ, there are no whole steps, and the rest is the time itself.
    """

    steps: int
    rest: float


class Clock:
    """The times of the steps of a run: a frozen value.

    timing : the tag by which compiled code identifies it
    refined_by : what is made smaller for more accuracy, in words
    direction : 1 forwards in time, -1 backwards
    h : the length of its steps, with that sign; NaN if they differ

    The *reading* of a clock is a number of steps if all have the same length, and otherwise a time. The records of a
    run contain readings, and `time` converts them to times.
    """

    timing: ClassVar[Tag]
    refined_by: ClassVar[str] = "dt"
    direction: float
    h: float

    @property
    def changes(self) -> bool:
        """Whether steps differ in length."""
        raise NotImplementedError

    def check(self, integrator: Integrator) -> None:
        """Raise InputError for a method whose steps this clock cannot choose."""

    def finer(self, integrator: Any, factor: float) -> Clock:
        """Return a clock whose steps are about `factor` < 1 times as long, for a companion of a run by that method.

        Raises InputError for a clock that has none.
        """
        raise InputError(f"the steps of {type(self).__name__} have no finer ones, with which a run could be compared.")

    def check_bodies(self, strength: Array, q: Array, v: Array, names: Sequence[str]) -> None:
        """Raise InputError for massive bodies at the start of a run for which this clock is unsuitable.

        strength : (1 + n,), see `orbits.kernels.gravity.pair_sums`; q, v : (n, 3); names : (n,)
        """

    def room(self, block: int, size: int) -> int:
        """Return the length of the workspace for a block of `block` steps and a state of `size` numbers."""
        return 0

    def time(self, reading: Any) -> Any:
        """Return the time, since the start of the run, of a reading or of an array of them."""
        raise NotImplementedError

    def places(self, times: ArrayLike) -> tuple[NDArray[np.int64], Array]:
        """Return the places of times in a march: whole steps (n,) and rests (n,); see `Place`."""
        raise NotImplementedError

    def place(self, time: float | Fraction) -> Place:
        """Return the place of a time in a march."""
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
        """False: all steps have the same length."""
        return False

    def finer(self, integrator: Any, factor: float) -> ConstantSteps:
        """Return constant steps of `factor` times this length, rounded to as many bits as that of a run."""
        return ConstantSteps(rounded_step(factor * self.h))

    def numbers(self, start: float, steps: int) -> Array:
        """Return the state of the clock for compiled code, after `steps` steps of a march that began at `start`."""
        return np.array([start, float(steps), self.h])

    def time(self, reading: Any) -> Any:
        """Return the duration of a number of steps, which may be fractional or an array."""
        return reading * self.h

    def places(self, times: ArrayLike) -> tuple[NDArray[np.int64], Array]:
        """Return (k, r) with times = k h + r exactly: k >= 0 whole steps, and a rest shorter than a step with the sign
        of h.
        """
        rest = np.fmod(times, self.h)
        steps = np.rint((times - rest) / self.h).astype(np.int64)
        return steps, rest

    def place(self, time: float | Fraction) -> Place:
        """Return the place of a time, with the rest rounded once; of an exact time, the exact number of steps."""
        if isinstance(time, Fraction):
            steps = max(0, math.floor(time / Fraction(self.h)))
            return Place(steps, float(time - steps * Fraction(self.h)))
        rest = math.fmod(time, self.h)
        return Place(round((time - rest) / self.h), rest)


def clock_of(step: float | Clock) -> Clock:
    """Return a clock unchanged; for a number, constant steps of that length. Raises InputError for anything else."""
    return step if isinstance(step, Clock) else ConstantSteps(single_number(step, "step"))
