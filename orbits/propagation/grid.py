"""Steps and sample times: steps stay on t = k h, and each sample is split into whole steps and an exact remainder."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.system.checks import checked_flag
from orbits.units import UnitSystem, quantity_from_text

Array = NDArray[np.float64]

STEP_BITS = 24
MOST_STEPS = 2**53
MOST_SAMPLES = 10**8


def rounded_step(dt: float) -> float:
    """Return dt rounded to 24 significant bits, so that k * dt is exact for every k below 2^29."""
    mantissa, exponent = math.frexp(dt)
    return math.ldexp(round(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)


def signed_step(units: UnitSystem, dt: Any, duration: float) -> float:
    """Return the step h in units.time, its sign that of `duration`. Raises InputError unless dt is positive and
    finite.
    """
    value = single_number(units.time_value(dt, "dt"), "dt")
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(
            f"dt must be positive and finite, got {value:g}; the sign of duration gives the direction of time"
        )
    h = rounded_step(value)
    if not (h > 0.0 and math.isfinite(h)):
        raise InputError(f"dt = {value:g} is out of the range of floats; choose units in which it is of ordinary size")
    if abs(duration) / h > MOST_STEPS:
        raise InputError(
            f"duration / dt is {abs(duration) / h:.3g} steps; at most 2^53 = 9.0e15 are possible. "
            "Use a longer dt or a shorter duration."
        )
    return math.copysign(h, duration)


def checked_duration(units: UnitSystem, duration: Any) -> float:
    """Return the duration in units.time. Raises InputError unless it is finite and not zero."""
    value = _time(units, duration, "duration")
    if not math.isfinite(value):
        raise InputError(f"duration must be finite, got {value}; a run has to end")
    if value == 0.0:
        raise InputError("duration is 0; give a positive one to go forwards in time or a negative one to go backwards")
    return value


def checked_until(units: UnitSystem, until: Any, h: float) -> float:
    """Return the time to extend a run to, in units.time. Raises InputError unless it is finite and can be reached."""
    value = _time(units, until, "until")
    if not math.isfinite(value) or abs(value / h) > MOST_STEPS:
        raise InputError(f"until = {value:g} cannot be reached with steps of {abs(h):g}; give a nearer time")
    return value


def sample_times(units: UnitSystem, samples: Any, duration: float) -> Array:
    """Return the times of the samples in units.time, from a count with both ends or from times within the run.

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
        return times + 0.0  # no -0 at the start of a run backwards
    times = np.array(units.time_value(samples, "samples"), dtype=np.float64)
    if times.ndim != 1 or times.size == 0:
        raise InputError(f"samples must be a count or a one-dimensional array of times, got shape {times.shape}")
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        raise InputError(f"samples[{bad[0]}] is {times[bad[0]]}; every sample time must be finite")
    direction = math.copysign(1.0, duration)
    outside = np.flatnonzero((times * direction < 0.0) | (times * direction > abs(duration)))
    if outside.size:
        k = outside[0]
        raise InputError(
            f"samples[{k}] = {times[k]:g} lies outside the run from 0 to {duration:g} "
            f"(times count from the epoch, in {units.time})"
        )
    disorder = np.flatnonzero(np.diff(times) * direction <= 0.0)
    if disorder.size:
        k = disorder[0]
        raise InputError(
            f"samples[{k + 1}] = {times[k + 1]:g} does not come after samples[{k}] = {times[k]:g} in the direction of "
            "the run; sort the times and drop duplicates"
        )
    return times + 0.0


def split(times: Array, h: float) -> tuple[NDArray[np.int64], Array]:
    """Return (k, r) with times = k h + r exactly, k >= 0 whole steps and a remainder of less than a step in the
    direction of h.
    """
    remainder = np.fmod(times, h)
    steps = np.rint((times - remainder) / h).astype(np.int64)
    return steps, remainder


def whole_steps(time: float, h: float) -> int:
    """Return how many whole steps of h there are up to a time in the direction of h."""
    return round((time - math.fmod(time, h)) / h)


def _time(units: UnitSystem, value: Any, what: str) -> float:
    if isinstance(value, str):
        unit = units.time or "units of time"
        expected = f'a quantity (10 * u.yr), a number in {unit}, or a text with a unit ("10 yr")'
        value = quantity_from_text(value, what, expected)
    return single_number(units.time_value(value, what), what)


def checked_progress(value: Any) -> bool | None:
    """Return True, False or None as it was given. Raises InputError for anything else."""
    return None if value is None else checked_flag(value, "progress")


def single_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, for an array."""
    try:
        if np.iscomplexobj(value):
            raise TypeError
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} must be a single real number, got {shown(value)}") from None
    if array.ndim:
        raise InputError(f"{what} must be a single number or quantity, got an array of shape {array.shape}")
    return float(array)
