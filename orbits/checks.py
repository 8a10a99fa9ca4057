"""Validators of numbers, counts, flags and vectors: each is written once, here, and names what is wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown


def checked_flag(value: Any, what: str) -> bool:
    """Return True or False as it was given. Raises InputError, naming it, for anything else."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InputError(f"{what} is {shown(value)}; expected True or False")


def checked_choice(value: Any, what: str) -> bool | None:
    """Return True, False or None as it was given. Raises InputError, naming it, for anything else."""
    return None if value is None else checked_flag(value, what)


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number of Python or NumPy; True and False are none, nor is a span of time."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def whole_number(value: Any, what: str, *, least: int = 1) -> int:
    """Return a count. Raises InputError, naming it, for anything else than a whole number >= `least`."""
    if not is_whole(value) or value < least:
        raise InputError(f"{what} must be a whole number >= {least}, got {shown(value)}")
    return int(value)


def single_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, for an array, a text, and what is no real number."""
    try:
        if isinstance(value, str | bytes) or np.iscomplexobj(value):
            raise TypeError
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} must be a real number, got {shown(value)}") from None
    if array.ndim:
        raise InputError(f"{what} must be a single number or quantity, got an array of shape {array.shape}")
    return float(array)


def finite_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, for anything else than one finite real number."""
    number = single_number(value, what)
    if not math.isfinite(number):
        raise InputError(f"{what} must be finite, got {shown(value)}")
    return number


def positive_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, for anything else than one finite number above 0."""
    number = single_number(value, what)
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"{what} is {shown(value)}; expected a finite number above 0.")
    return number


def number_not_below_zero(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, for anything else than one finite number >= 0."""
    number = single_number(value, what)
    if not (math.isfinite(number) and number >= 0.0):
        raise InputError(f"{what} is {shown(value)}; expected a finite number >= 0.")
    return number


def direction(value: Any, what: str, *, width: int | None = None) -> NDArray[np.float64]:
    """Return a vector of finite numbers that are not all zero.

    width : how many it has; None for any number. Raises InputError, saying that `what` needs it, for anything else
    """
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        vector = np.empty(0)
    fits = vector.ndim == 1 and width in (None, len(vector))
    if not (fits and np.all(np.isfinite(vector)) and np.any(vector)):
        of = "" if width is None else f" of {width} numbers"
        raise InputError(f"{what} needs a direction, a finite vector{of} that is not zero; got {shown(value)}")
    return vector
