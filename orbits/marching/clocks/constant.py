"""The clock t = k h of steps of one length, and when these steps are in a leg."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import single_number
from orbits.errors import ConvergenceError, IntegrationError, with_unit
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form, coefficients_of
from orbits.kernels.binding import Tag
from orbits.kernels.clocks import CONSTANT_STEPS, LENGTH
from orbits.kernels.dense import times_reached
from orbits.kernels.steps import NOT_CONVERGED
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.step_times import Ahead, Behind, Place, Places, StepTimes, Way

STEP_BITS = 24
"""Bits of the significand of a step, so that k h is exact."""


def rounded_step(dt: float) -> float:
    """Return dt rounded to 24 significant bits, so that k * dt is exact for every k below 2^29."""
    mantissa, exponent = math.frexp(dt)
    return math.ldexp(round(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)


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

    def at(self, time: float) -> str:
        """Return a time and the length of the steps in words."""
        return f"t = {time:.10g}, dt = {abs(self.h):.6g}"

    def failure(
        self, status: int, integrator: Integrator, names: Sequence[str], *, momenta: bool, forces: bool
    ) -> tuple[type[IntegrationError], str] | None:
        """Return the error for stages that did not converge."""
        if status != NOT_CONVERGED:
            return None
        return ConvergenceError, (
            f"the stages of {integrator.name} did not converge for {', '.join(names)}; the result would not be "
            "symplectic. Use a smaller dt, or leave it out: steps are then chosen one by one, also where bodies come "
            "very close."
            + momenta * " A term that adds as much as m v to the momenta needs orbits.march, without particles."
        )

    def describe(self, integrator: Any, unit: object = "") -> str:
        """Return the length of the steps in words."""
        return f"dt = {with_unit(f'{abs(self.h):g}', unit)}" if math.isfinite(self.h) else ""

    def coefficients(self, form: Form) -> Any:
        """Return the coefficients of steps of this length."""
        return coefficients_of(form, self.h)

    def rate(self, angle: float) -> float:
        """Return the angular rate at which a step covers an angle."""
        return angle / abs(self.h)

    def are_readings(self, steps: Array, when: Array, taken: int) -> bool:
        """Return whether these can be numbers of steps, up to those taken, and readings within these steps."""
        whole = (steps == np.floor(steps)) & (steps >= 0) & (steps <= taken)
        return bool((whole & (when >= steps) & (when <= steps + 1)).all())

    def finer(self, integrator: Any, factor: float) -> ConstantSteps:
        """Return constant steps of `factor` times this length, rounded to as many bits as that of a run."""
        return ConstantSteps(rounded_step(factor * self.h))

    def numbers(self, start: float, steps: int) -> Array:
        """Return the state of the clock for compiled code, after `steps` steps of a march that began at `start`."""
        return np.array([start, float(steps), self.h])

    def begin(self, start: float, step: int) -> float:
        """Return the time at which a step begins of a march that began at `start`."""
        return start + float(self.time(step))

    def step_times(self, start: float) -> GridTimes:
        """Return what tells a leg that begins at `start` when its steps are."""
        return GridTimes(self, start)

    def most_steps(self, time: float) -> float:
        """Return the whole steps before a time."""
        return self.place(time).steps

    def step_begin(self, time: float) -> float:
        """Return the time at which the step at a time begins."""
        return float(self.time(self.place(time).steps))

    def begun_within(self, step: int, time: float) -> tuple[Clock, float, int]:
        """Return one step to the end of this one; at the very end of it, the next whole one."""
        rest = float(self.time(step + 1)) - time
        return (ConstantSteps(rest), time, 0) if rest * self.direction > 0.0 else (self, 0.0, step + 1)

    def time(self, reading: Any) -> Any:
        """Return the duration of a number of steps, which may be fractional or an array."""
        return reading * self.h

    def places(self, times: ArrayLike) -> Places:
        """Return (k, r) with times = k h + r exactly: k >= 0 whole steps, and a rest shorter than a step with the sign
        of h.
        """
        rest = np.fmod(times, self.h)
        steps = np.rint((times - rest) / self.h).astype(np.int64)
        return Places(steps, rest)

    def place(self, time: float | Fraction) -> Place:
        """Return the place of a time, with the rest rounded once; of an exact time, the exact number of steps."""
        if isinstance(time, Fraction):
            steps = max(0, math.floor(time / Fraction(self.h)))
            return Place(steps, float(time - steps * Fraction(self.h)))
        rest = math.fmod(time, self.h)
        return Place(round((time - rest) / self.h), rest)


class GridTimes(StepTimes):
    """When constant steps are: step k begins at start + k h, without rounding errors that accumulate."""

    clock: ConstantSteps

    def __init__(self, clock: ConstantSteps, start: float) -> None:
        super().__init__(clock, start)
        self._count = 0

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return self.clock.begin(self.start, self.step)

    @property
    def reading(self) -> float:
        """The reading of the clock: whole steps."""
        return self.step

    def numbers(self, state: Mapping[str, Array], clock: Any) -> Array:
        """Return the numbers of a clock of constant steps, see `ConstantSteps.numbers`."""
        return clock.numbers(self.start, self.step) if clock == self.clock else clock.numbers(self.time, 0)

    def pace(self, numbers: Array) -> tuple[float, float]:
        """Return the length of the steps of a block, and 0: observers count steps."""
        return float(numbers[LENGTH]), 0.0

    def failed_at(self, numbers: Array, done: int) -> float:
        """Return the time at which a step began that failed, after `done` steps of a block."""
        return self.clock.begin(self.start, self.step + done)

    def most(self, place: Place) -> int:
        """Return how many steps there are before a place; negative behind it."""
        return place.steps - self.step

    def note(self, count: int, numbers: Array) -> None:
        """Take note of a block of `count` steps."""
        self._count = count

    def forget(self) -> None:
        """Take note that there is no last block."""
        self._count = 0

    def lengths(self) -> Array:
        """Return the lengths of the steps of the last block, (steps,)."""
        return np.full(self._count, self.clock.h)

    def ends(self) -> Array:
        """Return the times at which the steps of the last block begin, and its end, (steps + 1,)."""
        return np.asarray(self.start + self.clock.time(self.step - self._count + np.arange(self._count + 1.0)))

    def pairs(self) -> Array:
        """Return the same times, each as the sum of two numbers, (steps + 1, 2)."""
        times = np.zeros((self._count + 1, 2))
        times[0, 0] = self.clock.begin(self.start, self.step - self._count)
        times_reached(self.lengths(), np.zeros(self._count), times)
        return times

    def steps_in_block(self, readings: Array) -> NDArray[np.int64]:
        """Return the steps of the block just marched in which readings lie, counted from 0."""
        return readings.astype(np.int64) - self.step

    def is_at(self, place: Place) -> bool:
        """Return whether there is no rest."""
        return place.rest == 0.0

    def ahead(self, offset: float) -> Place:
        """Return the place of a time after the one reached."""
        return Place(self.step, offset)

    def place_of(self, time: float) -> Place:
        """Return the place of a time less than a step ahead."""
        return Place(self.step, time - self.time)

    def places_of(self, readings: Array) -> Places:
        """Return whole steps of a leg that begins with a step of the clock, and rests of readings that are no whole
        numbers.
        """
        whole = np.floor(readings)
        steps = whole.astype(np.int64) - self.clock.place(self.start).steps
        return Places(steps, np.asarray(self.clock.time(readings - whole)))

    def part_until(self, time: float) -> float:
        """Return the time from the one reached to another one, in steps."""
        return (time - self.time) / self.clock.h

    def next_place(self) -> Place:
        """Return the place at the end of the next step."""
        return Place(self.step + 1, 0.0)

    def begin_at(self, time: float) -> None:
        """Begin at a time since the start of the run."""
        self.start = time

    def copy_at(self, leg: Any, place: Place) -> dict[str, Array]:
        """Return a copy after one step of the rest, with a cold start."""
        retired = leg.losses.retired.block
        copy: dict[str, Array] = leg.stepper.seen_copy(retired)
        leg.stepper.take_part(copy, self.time, place.rest, retired)
        return copy

    def led_to(self, places: Places, steps: int) -> int:
        """Return up to how many of these places a block of `steps` steps leads."""
        return int(np.searchsorted(places.steps, self.step + steps, side="right"))

    def passed(self, places: Places) -> int:
        """Return how many of these places do not lie ahead."""
        before, now = np.searchsorted(places.steps, [self.step, self.step + 1])
        return int(before + (before < now and places.rests[before] == 0.0))

    def behind(self, places: Places) -> Behind:
        """Return where places in the last block lie behind the beginnings of its steps."""
        return _behind(self, places, self.step - self._count)

    def underway(self, places: Places) -> Behind:
        """The same for a block that is being marched, whose steps are not counted yet."""
        return _behind(self, places, self.step)

    def ahead_of(self, leg: Any, places: Places, passed: Callable[[Array], None]) -> Ahead:
        """Return the state of the leg, and where the places before its next step lie behind it."""
        count = int(np.searchsorted(places.steps, self.step + 1))
        return Ahead(leg.stepper.state, _behind(self, places.between(0, count), self.step))

    def way(self, time: float) -> Way:
        """Return one step to that time."""
        return Way(ConstantSteps(time - self.time), self.time, Place(1, 0.0))

    def hand_on(self, leg: Any, end: Any) -> None:
        """Let a leg of a partial step begin without the particles that are retired."""
        end.losses.retired.take(leg.losses.retired)

    def reading_in_part(self, reading: Any, time: float) -> Any:
        """Return the reading of this clock for one of a leg that covers the part of a step up to a time."""
        return self.step + (time - self.time) / self.clock.h * reading


def _behind(times: GridTimes, places: Places, first: int) -> Behind:
    """Return where places lie behind the beginnings of steps, counted from the `first` one."""
    begun = times.start + np.asarray(times.clock.time(places.steps.astype(np.float64)))
    return Behind(places.steps - first, begun, places.rests)


def clock_of(step: float | Clock) -> Clock:
    """Return a clock unchanged; for a number, constant steps of that length. Raises InputError for anything else."""
    return step if isinstance(step, Clock) else ConstantSteps(single_number(step, "step"))
