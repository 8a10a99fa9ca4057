"""Times as callers give them, and steps: steps stay on t = k h, a time is so many whole steps and an exact remainder.

Whatever takes a time (`until`, `samples`, `run.at`) reads it by `times_since`: dates become floats since the epoch, in
the system's unit of time, here and nowhere else.
"""

from __future__ import annotations

import math
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.checks import checked_flag
from orbits.errors import EpochError, InputError, shown
from orbits.units import UnitSystem, as_epochs, quantity_from_text

if TYPE_CHECKING:
    from orbits.system import System

Array = NDArray[np.float64]

STEP_BITS = 24
MOST_STEPS = 2**53
MOST_SAMPLES = 10**8


def times_since(system: System, value: Any, what: str) -> Array:
    """Return times since the epoch of `system` as float64 in its unit of time, in the shape they are given in.

    value : quantities or numbers since the epoch; dates: a Time, "2030-01-01" or any text that `System` takes as an
        epoch, a datetime64, TDB where no scale is said; a text with a unit ("10 yr"); or a list of such

    Raises InputError, naming `what`, for anything else, and EpochError for dates where the system has no epoch.
    """
    if isinstance(value, str):
        return _from_text(system, value, what)
    if isinstance(value, Time | np.datetime64):
        return _since_epoch(system, value, what)
    if isinstance(value, datetime):
        raise InputError(
            f"{what} is {shown(value)}, which does not say its scale of time; expected a Time: Time(x, scale='utc') as "
            "clocks have it, or Time(x, scale='tdb') as ephemerides have it, 69 s ahead."
        )
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if kind == "M":  # of NumPy, or of pandas and xarray, which have such columns of every run
        return _since_epoch(system, np.asarray(value), what)
    if kind in ("U", "O") and isinstance(value, np.ndarray):
        return times_since(system, value.tolist(), what)
    if isinstance(value, list | tuple) and any(isinstance(x, str | Time | np.datetime64) for x in value):
        if all(isinstance(x, str) for x in value) and not _is_quantity(value[0]):
            return _since_epoch(system, list(value), what)
        return np.array([single_number(times_since(system, x, f"{what}[{k}]"), what) for k, x in enumerate(value)])
    return np.array(system.units.time_value(value, what), dtype=np.float64)


def _from_text(system: System, text: str, what: str) -> Array:
    """Return a text with a unit, or a date, as a time since the epoch."""
    unit = system.units.time
    dates = ', a date ("2030-01-01")' if system.units.is_physical else ""
    expected = f'a quantity (10 * u.yr), a number in {unit or "units of time"}, a text with a unit ("10 yr"){dates}'
    try:
        found = quantity_from_text(text, what, expected)
    except InputError as no_quantity:
        try:
            return _since_epoch(system, text, what)
        except EpochError:
            if system.epoch is None and _is_date(text):
                raise
            raise no_quantity from None
    if system.units.is_physical and found.unit == u.dimensionless_unscaled:
        raise InputError(
            f'{what} = {shown(text)} has no unit; expected a time ("{text.strip()} {unit}") or a date ("2030-01-01").'
        )
    return np.array(system.units.time_value(found, what), dtype=np.float64)


def _since_epoch(system: System, dates: Any, what: str) -> Array:
    moments = as_epochs(dates, what)
    if system.epoch is None:
        raise EpochError(
            f"{what} is a date, {shown(dates)}, but the system has no epoch. Give it one, or times since its start."
        )
    return np.array(system.units.time_value((moments - system.epoch).to(u.day), what), dtype=np.float64)


def _is_quantity(text: str) -> bool:
    try:
        quantity_from_text(text, "time", "a quantity")
    except InputError:
        return False
    return True


def _is_date(value: Any) -> bool:
    """Whether a value is one or several dates, rather than a time since the epoch."""
    if isinstance(value, str):
        if _is_quantity(value):
            return False
        try:
            as_epochs(value)
        except EpochError:
            return False
        return True
    return isinstance(value, Time | np.datetime64)


def snapped(times: Array, first: float, last: float) -> Array:
    """Return times with those that lie outside first ... last by a rounding only (of a date, of a sum) at that end."""
    low, high = min(first, last), max(first, last)
    slack = np.spacing(max(abs(low), abs(high)))
    times = np.where((times < low) & (times >= low - slack), low, times)
    snapped: Array = np.where((times > high) & (times <= high + slack), high, times)
    return snapped


def rounded_step(dt: float) -> float:
    """Return dt rounded to 24 significant bits, so that k * dt is exact for every k below 2^29."""
    mantissa, exponent = math.frexp(dt)
    return math.ldexp(round(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)


def signed_step(units: UnitSystem, dt: Any, duration: float) -> float:
    """Return the step h in units.time, its sign that of `duration`, whatever that of dt is. Raises InputError unless dt
    is finite and not zero.
    """
    value = abs(single_number(units.time_value(dt, "dt"), "dt"))
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"dt must be finite and not zero, got {value:g}; it is the length of a step")
    h = rounded_step(value)
    if not (h > 0.0 and math.isfinite(h)):
        raise InputError(f"dt = {value:g} is out of the range of floats; choose units in which it is of ordinary size")
    if abs(duration) / h > MOST_STEPS:
        raise InputError(
            f"duration / dt is {abs(duration) / h:.3g} steps; at most 2^53 = 9.0e15 are possible. "
            "Use a longer dt or a shorter duration."
        )
    return math.copysign(h, duration)


def length_of_run(system: System, duration: Any, until: Any) -> float:
    """Return how far a run goes, in the system's unit of time; negative for backwards. One of the two is None.

    Raises InputError where both or none are given, and unless the length is finite and not zero.
    """
    if (duration is None) == (until is None):
        what = "neither duration nor until is" if until is None else "duration and until are both"
        raise InputError(
            f"{what} given; expected one of them: how long (duration=10 * u.yr), or up to when (until='2030-01-01')"
        )
    if until is None:
        return checked_duration(system.units, duration)
    value = single_number(times_since(system, until, "until"), "until")
    if not math.isfinite(value):
        raise InputError(f"until must be finite, got {value}; a run has to end")
    if value == 0.0:
        raise InputError(f"until = {shown(until)} is the epoch of the system, where the run begins; give another time")
    return value


def checked_duration(units: UnitSystem, duration: Any) -> float:
    """Return the duration in units.time. Raises InputError unless it is finite and not zero."""
    if _is_date(duration):
        raise InputError(f"duration = {shown(duration)} is a date; expected how long a run is. Its end is until=...")
    if isinstance(duration, str):
        unit = units.time or "units of time"
        expected = f'a quantity (10 * u.yr), a number in {unit}, or a text with a unit ("10 yr")'
        duration = quantity_from_text(duration, "duration", expected)
    value = single_number(units.time_value(duration, "duration"), "duration")
    if not math.isfinite(value):
        raise InputError(f"duration must be finite, got {value}; a run has to end")
    if value == 0.0:
        raise InputError("duration is 0; give a positive one to go forwards in time or a negative one to go backwards")
    return value


def checked_until(system: System, until: Any, h: float) -> float:
    """Return the time since the epoch to extend a run to, in the system's unit of time.

    Raises InputError unless it is finite and can be reached.
    """
    value = single_number(times_since(system, until, "until"), "until")
    if not math.isfinite(value) or abs(value / h) > MOST_STEPS:
        raise InputError(f"until = {value:g} cannot be reached with steps of {abs(h):g}; give a nearer time")
    return value


def sample_times(system: System, samples: Any, duration: float) -> Array:
    """Return the times of the samples in the system's unit of time, from a count with both ends or from times.

    samples : a count, or times in a row as `times_since` takes them, within the run of that duration

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
        raise InputError(
            f"samples[{k}] = {times[k]:.10g} lies outside the run from 0 to {duration:.10g} "
            f"(times count from the epoch, in {system.units.time or 'units of time'})"
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
