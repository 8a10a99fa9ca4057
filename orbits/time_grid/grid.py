"""`TimeGrid`: the clock and the samples of a run as floats, and quantities derived from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.checks import single_number
from orbits.errors import InputError, shown, with_unit
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.constant import ConstantSteps, clock_of
from orbits.marching.clocks.step_times import Place, Places
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.time_grid.reading import is_date, snapped, times_since
from orbits.time_grid.step_length import step_length
from orbits.units import quantity_from_text, told_apart

if TYPE_CHECKING:
    from orbits.protocols import State

Array = NDArray[np.float64]

MOST_STEPS = 2**53
"""Limit of a run: step numbers up to it are exact as floats."""

MOST_SAMPLES = 10**8
"""Limit of a run."""

SLACK = 1e-9
"""Fraction of the spacing of samples by which an extension may miss the next one and still end with it."""


@dataclass(frozen=True, eq=False)
class TimeGrid:
    """The times of the steps and of the samples of a run; floats in the unit of time of a system.

    clock : the clock of the steps, which starts at the epoch; a number h is the clock of constant steps h, whose sign
        is the direction of the run (`TimeGrid.of` rounds h to 24 bits)
    times : (n,) of the samples since the epoch, in ascending order in that direction; read-only
    end : the time at which the run ends; by default that of the last sample

    Raises InputError for a step that is 0 or not finite, and for times that are not those of a run.
    """

    clock: Clock
    times: Array
    end: float = math.nan

    def __post_init__(self) -> None:
        clock, times = clock_of(self.clock), np.array(self.times, dtype=np.float64)
        h = clock.h
        if not clock.changes and not (math.isfinite(h) and h != 0.0):
            raise InputError(f"dt is {h}; expected a step that is finite and not 0.")
        if times.ndim != 1 or not times.size or not np.isfinite(times).all():
            raise InputError(f"times have shape {times.shape}; expected at least one time, all finite.")
        onward = times * clock.direction
        disorder = onward[1:] <= onward[:-1]
        if onward[0] < 0.0 or disorder.any():
            k = int(disorder.argmax()) + 1 if onward[0] >= 0.0 else 0
            raise InputError(
                f"times[{k}] is {times[k]:g}; expected times from 0 on, in ascending order in the direction of "
                + ("the run." if clock.changes else f"dt = {h:g}.")
            )
        end = float(times[-1] if math.isnan(self.end) else self.end)
        if not (math.isfinite(end) and end * clock.direction >= onward[-1]):
            raise InputError(f"the end of the run is {end:g}; expected one that is not before its last sample.")
        steps = 0.0 if clock.changes else abs(end) / abs(h)
        if not steps <= MOST_STEPS:
            raise InputError(f"the end of the run is {steps:.3g} steps of dt = {h:g} away; at most 2^53 are possible.")
        times.flags.writeable = False
        object.__setattr__(self, "clock", clock)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "end", end)

    @classmethod
    def of(cls, system: State, dt: Any, *, duration: Any = None, until: Any = None, samples: Any = 101) -> TimeGrid:
        """Return the grid of a run of `system`: the one place where dt is read, signed and rounded.

        dt, duration, until, samples : as in `orbits.propagate`; dt None means `Adaptive()`
        Raises InputError for invalid arguments, EpochError for dates if the system has no epoch.
        """
        length = _length(system, duration, until)
        if dt is None or isinstance(dt, ChangingSteps):
            clock = (dt or Adaptive()).towards(length)
            return cls(clock, _sample_times(system, samples, length), length)
        if dt is Adaptive or (isinstance(dt, str) and dt.strip().lower() == "adaptive"):
            raise InputError(
                f"dt = {shown(dt)}; for steps that are chosen one by one, expected dt=orbits.Adaptive(), or no dt."
            )
        if isinstance(dt, type) and issubclass(dt, ChangingSteps):
            raise InputError(
                "dt = orbits.TimeTransformed is the class; for constant steps of transformed time, expected "
                "dt=orbits.TimeTransformed(step=0.3)."
            )
        h = step_length(system, dt, length)
        if abs(length) / h > MOST_STEPS:
            raise InputError(
                f"duration / dt is {abs(length) / h:.3g} steps; at most 2^53 = 9.0e15 are possible. "
                "Use a longer dt or a shorter duration."
            )
        return cls(ConstantSteps(math.copysign(h, length)), _sample_times(system, samples, length), length)

    @property
    def h(self) -> float:
        """The length of a step, with the sign of the direction; NaN if steps differ."""
        return self.clock.h

    @property
    def dt(self) -> float:
        """The length of a step, > 0."""
        return abs(self.h)

    @property
    def direction(self) -> float:
        """1 forwards in time, -1 backwards."""
        return self.clock.direction

    @property
    def goes_on(self) -> bool:
        """Whether the run goes on after its last sample."""
        return self.end != float(self.times[-1])

    @cached_property
    def goals(self) -> Array:
        """The times up to which the run is marched one after the other: of the samples, and its end."""
        return np.append(self.times, self.end) if self.goes_on else self.times

    @property
    def whole_steps(self) -> int:
        """The number of whole steps up to the end."""
        return self.clock.place(self.end).steps

    @property
    def steps(self) -> NDArray[np.int64]:
        """The whole steps before each goal, (goals,)."""
        return self.places.steps

    def place(self, goal: int) -> Place:
        """Return the place of a goal in a march."""
        return self.places.at(goal)

    @cached_property
    def places(self) -> Places:
        """The places of the goals in a march."""
        return self.clock.places(self.goals)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.times)

    def is_that_of(self, other: TimeGrid) -> bool:
        """Return whether both have the same step, the same samples and the same end, to the last bit."""
        return self.clock == other.clock and np.array_equal(self.goals, other.goals) and len(self) == len(other)

    def with_step(self, system: State, dt: Any, what: str = "dt") -> TimeGrid:
        """Return the same samples with another step, as in `of`; an InputError calls it `what`."""
        h = math.copysign(step_length(system, dt, self.end, what), self.direction)
        return TimeGrid(ConstantSteps(h), self.times, self.end)

    def begun(self, steps: float) -> TimeGrid:
        """Return the beginning of the run: its start, and a sample after `steps` steps."""
        return TimeGrid(self.clock, np.array([0.0, self.clock.time(steps)]))

    def extended(self, system: State, until: Any) -> TimeGrid:
        """Return the grid up to a later time, with samples from the end on, as dense as before.

        until : a date or a time since the epoch of `system`, as in `orbits.propagate`
        Raises InputError if it cannot be reached, or lies before the end.
        """
        h, times, end = self.h, self.times, self.end
        most = math.inf if self.clock.changes else MOST_STEPS * abs(h)
        target = single_number(times_since(system, until, "until"), "until")
        if not math.isfinite(target):
            raise InputError(f"until must be finite, got {target:g}; a run has to end")
        if abs(target) > most:
            steps = "" if self.clock.changes else f" with steps of {abs(h):g}"
            raise InputError(f"until = {target:g} cannot be reached{steps}; give a nearer time")
        if (target - end) * self.direction < 0.0:
            ended = with_unit(f"{end:g}", system.units.time)
            expected = "a later time" if self.direction > 0 else "an earlier one, as the run goes backwards in time"
            raise InputError(
                f"until = {target:g} lies before the end of the run, {ended}; expected {expected}. States before the "
                "end are those of run.at(times)"
            )
        if target == end:
            return self
        if len(times) < 2:
            return TimeGrid(self.clock, np.append(times, target))
        spacing = (times[-1] - times[0]) / (len(times) - 1)
        count = int(np.floor((target - end) / spacing * (1 + 1e-12)))
        if count > MOST_SAMPLES:
            raise InputError(
                f"until = {target:g} asks for {count:.3g} more samples; at most {MOST_SAMPLES:.0e} are possible"
            )
        more = end + spacing * np.arange(1, count + 1)
        if count and abs(more[-1] - target) <= SLACK * abs(spacing):
            more[-1] = target
        else:
            more = np.append(more, target)
        return TimeGrid(self.clock, np.concatenate([times, more]))


def _length(system: State, duration: Any, until: Any) -> float:
    """Return the length of a run in the system's unit of time; negative for backwards. One of the two is None.

    Raises InputError if both or none are given, and unless the length is finite and not zero.
    """
    if (duration is None) == (until is None):
        what = "neither duration nor until is" if until is None else "duration and until are both"
        raise InputError(
            f"{what} given; expected one of them: how long (duration=10 * u.yr), or up to when (until='2030-01-01')"
        )
    if until is None:
        return _duration(system, duration)
    value = single_number(times_since(system, until, "until"), "until")
    if not math.isfinite(value):
        raise InputError(f"until must be finite, got {value}; a run has to end")
    if value == 0.0:
        raise InputError(f"until = {shown(until)} is the epoch of the system, where the run begins; give another time")
    return value


def _duration(system: State, duration: Any) -> float:
    if is_date(duration):
        raise InputError(f"duration = {shown(duration)} is a date; expected how long a run is. Its end is until=...")
    if isinstance(duration, str):
        unit = str(system.units.time) or "units of time"
        expected = f'a quantity (10 * u.yr), a number in {unit}, or a text with a unit ("10 yr")'
        duration = quantity_from_text(duration, "duration", expected)
    value = single_number(system.units.time_value(duration, "duration"), "duration")
    if not math.isfinite(value):
        raise InputError(f"duration must be finite, got {value}; a run has to end")
    if value == 0.0:
        raise InputError("duration is 0; give a positive one to go forwards in time or a negative one to go backwards")
    return value


def _sample_times(system: State, samples: Any, duration: float) -> Array:
    """Return the times of the samples in the system's unit of time, from a number that includes both ends or from
    times.

    samples : a number, or a sequence of times for `times_since`, within the run of that duration

    Raises InputError unless the times are finite, within the run and strictly ordered in the direction of the run.
    """
    if isinstance(samples, bool) or (isinstance(samples, float) and not samples.is_integer()):
        raise InputError(f"samples must be a whole number or an array of times, got {shown(samples)}")
    if isinstance(samples, int | np.integer | float) and not isinstance(samples, np.timedelta64):
        count = int(samples)
        if count < 2:
            raise InputError(
                f"samples = {shown(count)}: a count includes both ends, so at least 2; for the end alone: "
                "samples=[duration]"
            )
        if count > MOST_SAMPLES:
            raise InputError(f"samples = {shown(count)}: at most {MOST_SAMPLES:.0e} are possible; take fewer")
        times: Array = np.arange(count) * duration / (count - 1)
        times[-1] = duration
        return times + 0.0  # no -0 at the start of a backward run
    times = times_since(system, samples, "samples")
    if times.ndim != 1 or times.size == 0:
        raise InputError(
            f"samples must be a count or a one-dimensional array of times, got shape {times.shape}; a single time is "
            "[time]"
        )
    times = snapped(times, 0.0, duration)
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        raise InputError(f"samples[{bad[0]}] is {times[bad[0]]}; every sample time must be finite")
    direction = math.copysign(1.0, duration)
    outside = np.flatnonzero((times * direction < 0.0) | (times * direction > abs(duration)))
    if outside.size:
        k = outside[0]
        time, end = told_apart(times[k], duration, digits=10)
        raise InputError(
            f"samples[{k}] = {time} lies outside the run from 0 to {end} "
            f"(times count from the epoch, in {str(system.units.time) or 'units of time'})"
        )
    disorder = np.flatnonzero(np.diff(times) * direction <= 0.0)
    if disorder.size:
        k = disorder[0]
        raise InputError(
            f"samples[{k + 1}] = {times[k + 1]:g} does not come after samples[{k}] = {times[k]:g} in the direction of "
            "the run; sort the times and drop duplicates"
        )
    return times + 0.0
