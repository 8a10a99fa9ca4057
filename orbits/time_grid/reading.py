"""Times in the formats of callers: `until`, `samples` and `run.at` all read them by `times_since`.

Dates are converted to floats since the epoch, in the system's unit of time, only here.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.checks import single_number
from orbits.errors import EpochError, InputError, shown
from orbits.units import UTC, as_epochs, quantity_from_text

if TYPE_CHECKING:
    from orbits.protocols import State

Array = NDArray[np.float64]


def times_since(system: State, value: Any, what: str) -> Array:
    """Return times since the epoch of `system` as float64 in its unit of time, with the shape of the argument.

    value : quantities or numbers since the epoch; dates: a Time, "2030-01-01" or any text that `System` takes as an
        epoch, a datetime64, TDB if no scale is given; a text with a unit ("10 yr"); or a list of such

    Raises InputError, naming `what`, for anything else, and EpochError for dates if the system has no epoch.
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
    if kind == "M":  # of NumPy, or of the columns of pandas and xarray
        return _since_epoch(system, np.asarray(value), what)
    if kind in ("U", "O") and isinstance(value, np.ndarray):
        return times_since(system, value.tolist(), what)
    if isinstance(value, list | tuple) and any(isinstance(x, str | Time | np.datetime64) for x in value):
        if all(isinstance(x, str) for x in value) and not _is_quantity(value[0]):
            return _since_epoch(system, list(value), what)
        return np.array([single_number(times_since(system, x, f"{what}[{k}]"), what) for k, x in enumerate(value)])
    return np.array(system.units.time_value(value, what), dtype=np.float64)


def _from_text(system: State, text: str, what: str) -> Array:
    """Return a text with a unit, or a date, as a time since the epoch."""
    unit = system.units.time
    dates = ', a date ("2030-01-01")' if system.units.is_physical else ""
    number = f"a number in {str(unit) or 'units of time'}"
    expected = f'a quantity (10 * u.yr), {number}, a text with a unit ("10 yr"){dates}'
    try:
        found = quantity_from_text(text, what, expected)
    except InputError as no_quantity:
        try:
            return _since_epoch(system, text, what)
        except EpochError:
            if UTC.search(text) or (system.epoch is None and is_date(text)):
                raise
            raise no_quantity from None
    if system.units.is_physical and found.unit == u.dimensionless_unscaled:
        raise InputError(
            f'{what} = {shown(text)} has no unit; expected a time ("{text.strip()} {unit}") or a date ("2030-01-01").'
        )
    return np.array(system.units.time_value(found, what), dtype=np.float64)


def _since_epoch(system: State, dates: Any, what: str) -> Array:
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


def is_date(value: Any) -> bool:
    """Return whether a value is one or several dates, rather than a time since the epoch."""
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
    """Return times with those outside first ... last only by rounding errors (of a date, of a sum) moved to that
    end.
    """
    low, high = min(first, last), max(first, last)
    slack = np.spacing(max(abs(low), abs(high)))
    times = np.where((times < low) & (times >= low - slack), low, times)
    snapped: Array = np.where((times > high) & (times <= high + slack), high, times)
    return snapped
