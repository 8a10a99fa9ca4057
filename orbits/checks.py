"""Validators of numbers, counts, flags, arrays and vectors: each is written once, here, and names what is wrong."""

from __future__ import annotations

import inspect
import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import InputError, OutOfRangeError, shown

Floats = NDArray[np.float64]

NOT_NUMBERS = str | bytes | bool | np.bool_ | np.timedelta64 | np.datetime64
"""Types that NumPy would convert to floats, but that are never meant as numbers."""

SAME_SPEED = 1e-4
"""The fraction by which a speed of light in physical units may differ from that of nature, as one that is rounded."""

LIGHT_KM_S = 299792.458


def checked_flag(value: Any, what: str, expected: str = "True or False") -> bool:
    """Return True or False as it was given. Raises InputError, naming it and what is expected, for anything else."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InputError(f"{what} is {shown(value)}; expected {expected}")


def check_physical(units: Any, what: str) -> None:
    """Raise InputError unless a unit system is physical, for `what` that needs dates and lengths of nature."""
    if not units.is_physical:
        raise InputError(
            f"{what} needs physical units and an epoch; the system is in {units.name}. Make it with "
            "units=orbits.SOLAR and epoch=..."
        )


def checked_choice(value: Any, what: str) -> bool | None:
    """Return True, False or None as it was given. Raises InputError, naming it, for anything else."""
    return None if value is None else checked_flag(value, what)


def is_whole(value: Any) -> bool:
    """Whether a value is an integer of Python or NumPy. True, False and time spans are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def is_one_of(value: Any, words: Collection[str]) -> bool:
    """Whether a value is one of some words; an array, which compares with each of its elements, is none."""
    return isinstance(value, str) and value in words


def whole_number(value: Any, what: str, *, least: int = 1, most: int | None = None) -> int:
    """Return a count. Raises InputError, naming it, unless it is a whole number from `least` to `most`."""
    if not is_whole(value) or value < least:
        raise InputError(f"{what} must be a whole number >= {least}, got {shown(value)}")
    if most is not None and value > most:
        raise InputError(f"{what} = {shown(value)}: at most {most:.0e} are possible; take fewer")
    return int(value)


def place_in(count: int, key: Any, known_as: str, kinds: str, expected: str) -> int:
    """Return the place that an index means in a sequence of `count`, negative ones counting from the end.

    known_as, kinds, expected : for messages, what is indexed, what it holds and what may be asked: "run.events",
        "events", "an index or a slice"
    Raises OutOfRangeError for a place that there is not, InputError for anything but a whole number.
    """
    if not is_whole(key):
        raise InputError(f"{known_as}[{shown(key)}]: expected {expected}.")
    if -count <= key < count:
        return int(key) % count
    places = f"expected a number from -{count} to {count - 1}" if count else f"expected {expected}"
    raise OutOfRangeError(f"{known_as}[{shown(key)}]: the number of {kinds} is {count:,}; {places}.")


def single_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, for arrays, texts, flags, units and complex numbers."""
    if isinstance(value, float):  # the usual case, quickly
        return float(value)
    try:
        if value is None or isinstance(value, NOT_NUMBERS) or np.iscomplexobj(value) or has_unit(value):
            raise TypeError
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} must be a real number, got {shown(value)}") from None
    if array.ndim:
        raise InputError(f"{what} must be a single number or quantity, got an array of shape {array.shape}")
    return float(array)


def has_unit(value: Any) -> bool:
    """Whether a value is a quantity with a unit, which a bare number would silently lose."""
    return bool(str(getattr(value, "unit", "")))


def finite_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, unless it is one finite real number."""
    number = single_number(value, what)
    if not math.isfinite(number):
        raise InputError(f"{what} must be finite, got {shown(value)}")
    return number


def nonzero_number(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, unless it is one finite number other than 0."""
    number = single_number(value, what)
    if not (math.isfinite(number) and number != 0.0):
        raise InputError(f"{what} must be finite and not zero, got {shown(value)}")
    return number


def listed(given: object) -> list[Any] | None:
    """Return a list of several things; None for a text, a mapping, and what has no parts, as a quantity of one
    number.
    """
    if isinstance(given, str | bytes | Mapping) or not isinstance(given, Iterable):
        return None
    try:
        parts = iter(given)
    except TypeError:
        return None
    return list(parts)


def positive_number(value: Any, what: str, given: Any = None) -> float:
    """Return a scalar as float. Raises InputError, naming it, unless it is one finite number above 0.

    given : what messages show, if the value is that of a quantity in another unit
    """
    number = single_number(value, what)
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"{what} is {shown(value if given is None else given)}; expected a finite number above 0.")
    return number


def number_not_below_zero(value: Any, what: str) -> float:
    """Return a scalar as float. Raises InputError, naming it, unless it is one finite number >= 0."""
    number = single_number(value, what)
    if not (math.isfinite(number) and number >= 0.0):
        raise InputError(f"{what} is {shown(value)}; expected a finite number >= 0.")
    return number


def real_numbers(value: ArrayLike, what: str) -> Floats:
    """Return an array of any shape as float64. Raises InputError, naming it, unless it holds real numbers, unitless."""
    try:
        array = np.asarray(value)
        if array.dtype.kind in "biuf" and not hasattr(value, "unit") and not isinstance(value, np.ma.MaskedArray):
            return np.asarray(array, dtype=np.float64)
    # The caller's object may raise anything when it is asked for its numbers.
    except Exception:
        pass
    remedy = " Take the floats, such as system.values.q." if hasattr(value, "unit") else ""
    raise InputError(f"{what} is {shown(value)}; expected an array of real numbers.{remedy}")


def finite_numbers(value: ArrayLike, what: str) -> Floats:
    """Return an array of any shape as float64. Raises InputError, naming it and the place, unless all are finite."""
    values = real_numbers(value, what)
    bad = ~np.isfinite(values)
    if bad.any():
        place = [int(i) for i in np.argwhere(bad)[0]]
        raise InputError(f"{what}{place if place else ''} is {values[bad][0]}; expected finite numbers.")
    return values


def finite_vector(value: ArrayLike, what: str) -> Floats:
    """Return one or more finite numbers as a vector (d,). Raises InputError, naming it, for anything else."""
    values = finite_numbers(value, what)
    if values.ndim > 1 or values.size == 0:
        raise InputError(f"{what} has shape {values.shape}; expected a vector of one or more numbers, shape (d,).")
    return np.array(values).reshape(-1)


def direction(value: Any, what: str, *, width: int | None = None) -> Floats:
    """Return a vector of finite numbers that are not all zero.

    width : the number of its components; any number if None
    Raises InputError, saying that `what` needs a direction, for anything else.
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


def pole_direction(value: Any, what: str, units: Any) -> tuple[float, float, float]:
    """Return a unit vector from (right ascension, declination) or from three numbers.

    Raises InputError for anything else, and for a declination beyond a right angle (degrees without a unit).
    """
    expected = "expected (right ascension, declination), such as (286.13 * u.deg, 63.87 * u.deg), or a vector x, y, z"
    if value is None:
        raise InputError(f"{what} is missing; {expected}.")
    try:
        count = len(value)
    except TypeError:
        count = 0
    if count == 2:
        ra, dec = (single_number(units.angle_value(angle, what), what) for angle in value)
        if not abs(dec) <= np.pi / 2 + 1e-12:
            raise InputError(f"{what} has the declination {dec:g} rad; plain numbers are radians, degrees need u.deg.")
        found = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    else:
        found = np.asarray(units.pure_value(value, what)) if count == 3 else np.zeros(0)
    if found.shape != (3,):
        raise InputError(f"{what} is {shown(value)}; {expected}.")
    length = float(np.linalg.norm(found))
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"{what} is {shown(value)}; expected finite numbers, not all of them 0.")
    # A vector of length 1 is not changed, so that stored vectors are restored bit for bit.
    unit = found if abs(length - 1.0) <= 4e-16 else found / length
    return float(unit[0]), float(unit[1]), float(unit[2])


def light_speed(given: Any, units: Any) -> float:
    """Return c of a term or a force in the units of a system. Raises InputError if it is missing, no speed, or, in
    physical units, not that of light.
    """
    name = type(given).__name__
    if given.c is None and not units.is_physical:
        raise InputError(f"{name}: c is missing; {units.name} has no speed of light: give c=...")
    found = np.asarray(units.speed_of_light if given.c is None else units.speed_value(given.c, f"{name}: c"))
    if found.shape != () or not (np.isfinite(found) and found > 0.0):
        raise InputError(f"{name}: c is {shown(found.tolist())}; expected a speed > 0.")
    c = float(found)
    if units.is_physical and abs(c / units.speed_of_light - 1.0) > SAME_SPEED:
        got = f"{c / units.speed_of_light * LIGHT_KM_S:.9g} km/s"
        raise InputError(
            f"{name}: c is {c:.9g} {units.speed}, {got}; expected the speed of light, {LIGHT_KM_S} km/s. Leave out c, "
            "or use units=orbits.DIMENSIONLESS, in which c may be any speed."
        )
    return c


def check_kernel(function: Any, name: str, arguments: str, whose: str) -> None:
    """Raise InputError unless `function` is a compiled kernel with as many arguments; whose : for the message."""
    if not hasattr(function, "py_func"):
        raise InputError(f"{whose}: {name} is not compiled; put @orbits.kernel above its definition")
    taken = list(inspect.signature(function.py_func).parameters)
    if len(taken) != len(arguments.split(",")):
        raise InputError(f"{whose}: the kernel {name} takes ({', '.join(taken)}); expected {name}({arguments})")
