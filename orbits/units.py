"""Unit systems: the one place where quantities become floats and floats become quantities.

Below this layer everything is float64 in one system of units. GM is known more precisely than masses, so a unit system
uses G only to convert GM to masses, energies and momenta.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import EpochError, InputError, shown

if TYPE_CHECKING:
    from astropy.time import Time

Floats = NDArray[np.float64]

GM_SUN = 0.00029591220828411956
"""GM of the Sun in au^3/d^2, the value of DE440's integration (Park et al. 2021, AJ 161, 105)."""

# G is known to 2e-5; a larger deviation than this is a mistake in the units, not another CODATA value.
G_TOLERANCE = 1e-3

LONGEST_TEXT = 200
"""Longest text, in characters, that is read as a quantity or unit."""

LARGEST_UNIT = 1e50
"""Largest unit, in m, s or kg. Beyond this, or below its inverse, GM and energies leave the range of floats."""


@dataclass(frozen=True)
class UnitSystem:
    """Units of length, time and mass, and G in them.

    name : its name in messages and files
    length, time, mass : astropy units; all three physical, or all three dimensionless
    G : the gravitational constant in length^3/(mass time^2); by default (None) CODATA's value in these units

    The methods `*_value` convert a quantity in any suitable unit to float64 in this system's unit. Plain numbers are
    taken to be in that unit already, and a bare unit, such as u.M_sun, means one of it. They raise InputError, naming
    the value, for other kinds of units and for anything that is not a real number.

    Raises InputError for units of another kind, dimensionless units without G, and physical units with a wrong G.
    """

    name: str
    length: u.UnitBase
    time: u.UnitBase
    mass: u.UnitBase
    G: float = cast(float, None)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"the name of a unit system is {shown(self.name)}; expected a text such as 'SI'.")
        kinds = {"length": u.m, "time": u.s, "mass": u.kg}
        for what, kind in kinds.items():
            object.__setattr__(self, what, _unit(getattr(self, what), f"the unit of {what} of {self.name!r}", kind))
        units = {what: getattr(self, what) for what in kinds}
        physical = [units[what].is_equivalent(kind) for what, kind in kinds.items()]
        plain = [unit == u.dimensionless_unscaled for unit in units.values()]
        if not (all(physical) or all(plain)):
            got = ", ".join(f"{what} {str(unit) or 'dimensionless'}" for what, unit in units.items())
            raise InputError(
                f"unit system {self.name!r} has {got}; expected units of length, time and mass such as u.au, u.day, "
                "u.M_sun, or u.dimensionless_unscaled three times."
            )
        object.__setattr__(self, "G", self._checked_G())

    def _checked_G(self) -> float:
        given = cast("float | None", self.G)
        try:
            G = math.nan if given is None else float(given)
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"unit system {self.name!r}: G = {shown(self.G)}; expected a number.") from error
        if not self.is_physical:
            if given is None:
                raise InputError(f"unit system {self.name!r} has no physical units; give G, usually G=1.")
            nature = None
        else:
            from astropy import constants

            nature = float(constants.G.to_value(self.gm / self.mass))
            G = nature if given is None else G
        if not (math.isfinite(G) and G > 0.0):
            raise InputError(f"unit system {self.name!r}: G = {shown(G)}; expected a finite number > 0.")
        if nature is not None and abs(G / nature - 1.0) > G_TOLERANCE:
            raise InputError(
                f"unit system {self.name!r}: G = {G!r}, but G is {nature:.6g} {self.gm / self.mass}. Leave out G to "
                "use that value, or use dimensionless units for another G."
            )
        return G

    @cached_property
    def is_physical(self) -> bool:
        """Whether the units are physical; False if they are dimensionless."""
        return bool(self.length != u.dimensionless_unscaled)

    @cached_property
    def speed(self) -> u.UnitBase:
        """The unit of velocity, length/time."""
        return self.length / self.time

    @cached_property
    def rate(self) -> u.UnitBase:
        """The unit of an angle per time."""
        return u.rad / self.time

    @cached_property
    def acceleration(self) -> u.UnitBase:
        """The unit of acceleration, length/time^2."""
        return self.length / self.time**2

    @cached_property
    def gm(self) -> u.UnitBase:
        """The unit of GM, length^3/time^2."""
        return self.length**3 / self.time**2

    @cached_property
    def momentum(self) -> u.UnitBase:
        """The unit of linear momentum, mass length/time."""
        return self.mass * self.speed

    @cached_property
    def angular_momentum(self) -> u.UnitBase:
        """The unit of angular momentum, mass length^2/time."""
        return self.mass * self.length * self.speed

    @cached_property
    def energy(self) -> u.UnitBase:
        """The unit of energy, mass length^2/time^2."""
        return self.mass * self.speed**2

    @cached_property
    def speed_of_light(self) -> float:
        """The speed of light in the unit of velocity. Raises InputError if the units are dimensionless."""
        if not self.is_physical:
            raise InputError(f"{self.name} has no physical units, hence no speed of light; give it as a number.")
        from astropy import constants

        return float(constants.c.to_value(self.speed))

    @cached_property
    def astronomical_unit(self) -> float:
        """The astronomical unit in the unit of length. Raises InputError if the units are dimensionless."""
        if not self.is_physical:
            raise InputError(f"{self.name} has no physical units, hence no astronomical unit; give a length.")
        return float(u.au.to(self.length))

    def length_value(self, x: Any, what: str = "length") -> Floats:
        """Return a length as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.length, what, "length")

    def time_value(self, x: Any, what: str = "time") -> Floats:
        """Return a time as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.time, what, "time")

    def speed_value(self, x: Any, what: str = "speed") -> Floats:
        """Return a velocity as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.speed, what, "velocity")

    def acceleration_value(self, x: Any, what: str = "acceleration") -> Floats:
        """Return an acceleration as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.acceleration, what, "an acceleration")

    def mass_value(self, x: Any, what: str = "mass") -> Floats:
        """Return a mass as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.mass, what, "mass")

    def gm_value(self, x: Any, what: str = "gm") -> Floats:
        """Return GM as float64 in this system's unit; `what` names it in errors. A mass is refused."""
        return self._value(x, self.gm, what, "GM")

    def angle_value(self, x: Any, what: str = "angle") -> Floats:
        """Return an angle as float64 in radians; plain numbers are radians. `what` names it in errors."""
        return self._value(x, u.rad, what, "angle")

    def rate_value(self, x: Any, what: str = "mean motion") -> Floats:
        """Return an angle per time as float64 in radians per unit of time; `what` names it in errors."""
        return self._value(x, self.rate, what, "angle per time")

    def frequency_value(self, x: Any, what: str = "rate") -> Floats:
        """Return a number per time as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.time**-1, what, "a number per time")

    def wavenumber_value(self, x: Any, what: str = "number per length") -> Floats:
        """Return a number per length as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.length**-1, what, "a number per length")

    def angular_momentum_value(self, x: Any, what: str = "angular momentum") -> Floats:
        """Return an angular momentum as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.angular_momentum, what, "angular momentum")

    def area_value(self, x: Any, what: str = "area") -> Floats:
        """Return a length squared as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.length**2, what, "length squared")

    def moment_value(self, x: Any, what: str = "moment of inertia") -> Floats:
        """Return a moment of inertia as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.mass * self.length**2, what, "a moment of inertia")

    def areal_rate_value(self, x: Any, what: str = "angular momentum per mass") -> Floats:
        """Return an angular momentum per unit of mass as float64 in this system's unit; `what` names it in errors."""
        return self._value(x, self.length * self.speed, what, "an angular momentum per unit of mass")

    def pure_value(self, x: Any, what: str = "number") -> Floats:
        """Return a number without a unit, such as an eccentricity, as float64; `what` names it in errors."""
        return self._value(x, u.dimensionless_unscaled, what, "number")

    def _value(self, x: Any, unit: u.UnitBase, what: str, kind: str) -> Floats:
        if type(x) is float or (type(x) is np.ndarray and x.dtype == np.float64):  # the usual case, quickly
            return np.asarray(x)
        if isinstance(x, np.ma.MaskedArray):
            raise InputError(f"{what} is a masked array; expected plain numbers, as masked values are undefined.")
        try:
            x = gathered(x)
            if isinstance(x, u.Quantity):
                x = x.to_value(unit)
            if isinstance(x, np.ndarray) and np.any(getattr(x, "mask", False)):
                raise TypeError("masked values are undefined")
            array = np.asarray(x)
            if array.dtype.kind not in "iuf":
                raise TypeError(f"got {kind_of(array)}")
            return np.asarray(array, dtype=np.float64)
        except u.UnitConversionError as error:
            got = str(getattr(x, "unit", "")) or "no unit"
            raise InputError(f"{what} is in {got}; expected {self._expected(unit, kind)}.{_remedy(x, unit)}") from error
        # The caller's object may raise anything when it is asked for its numbers.
        except Exception as error:
            raise InputError(
                f"{what} is {shown(x)}; expected real numbers, {self._expected(unit, kind)} ({error})."
            ) from error

    def _expected(self, unit: u.UnitBase, kind: str) -> str:
        if unit != u.dimensionless_unscaled:
            return f"{kind} in {unit} or a unit that converts to it, or plain numbers in {unit}"
        return "no unit" if self.is_physical else f"a plain number, as {self.name} has no units"


def quantity_from_text(value: Any, what: str, expected: str) -> Any:
    """Return a text such as "6 d" as a quantity, anything else unchanged. Raises InputError for other texts."""
    if not isinstance(value, str):
        return value
    if len(value) > LONGEST_TEXT:  # astropy would search for similar units, in quadratic time
        raise InputError(f"{what} = {shown(value)}, a text of {len(value):,} characters; expected {expected}.")
    try:
        return u.Quantity(value)
    # UnitScaleError, RecursionError and whatever else a text of units may cause.
    except Exception as error:
        raise InputError(f"{what} = {shown(value)}; expected {expected}.{unit_meant(error)}") from None


def unit_meant(error: Exception) -> str:
    """Return astropy's suggestion for an unknown unit, from its error, as a sentence; "" if it has none."""
    found = re.search(r"(\S+) is not a valid unit\.\s+Did you mean (.+?)\?", str(error))
    return "" if found is None else f" {found[1]!r} is not a unit; did you mean {found[2]}?"


def kind_of(array: NDArray[Any]) -> str:
    """Return the content of an array in words, if it is not real numbers."""
    words = {"U": "text", "S": "bytes", "c": "complex numbers", "b": "true or false", "M": "dates", "m": "time spans"}
    return words.get(array.dtype.kind, "objects")


def _unit(unit: Any, what: str, kind: u.UnitBase) -> u.UnitBase:
    try:
        if isinstance(unit, str) and len(unit) > LONGEST_TEXT:
            raise ValueError(f"a text of {len(unit):,} characters")
        found = u.Unit(unit)
        if found.is_equivalent(kind):
            size = float(found.to(kind))
            if not 1.0 / LARGEST_UNIT <= size <= LARGEST_UNIT:
                raise ValueError(f"it is {size:.3g} {kind}; expected {1 / LARGEST_UNIT:.0e} to {LARGEST_UNIT:.0e}")
        return found
    # When powers of a unit's scale over- or underflow, astropy raises errors of several kinds.
    except Exception as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise InputError(f"{what} is {shown(unit)}; expected an astropy unit such as u.km ({reason}).") from error


def gathered(x: Any) -> Any:
    """Return nested lists of quantities as one quantity, so a column of a table with a unit, and a bare unit as one of
    it; anything else unchanged.
    """
    if isinstance(x, u.UnitBase):
        return u.Quantity(1.0, x)
    if isinstance(getattr(x, "unit", None), u.UnitBase) and not isinstance(x, u.Quantity):
        return u.Quantity(x)
    if isinstance(x, list | tuple):
        rows = [gathered(row) for row in x]
        if any(isinstance(row, u.Quantity) for row in rows):
            return u.Quantity(rows)
    return x


def _remedy(x: Any, unit: u.UnitBase) -> str:
    got = getattr(x, "unit", None)
    if got is not None and got.is_equivalent(u.kg) and unit.is_equivalent(u.m**3 / u.s**2):
        return " This is a mass: use mass=... where it is accepted, or GM, such as astropy.constants.GM_sun."
    return ""


SOLAR = UnitSystem("SOLAR", length=u.au, time=u.day, mass=u.M_sun, G=GM_SUN)
"""au, days of TDB and solar masses; G is DE440's GM of the Sun, so that a body of this GM has mass 1."""

DIMENSIONLESS = UnitSystem(
    "DIMENSIONLESS", u.dimensionless_unscaled, u.dimensionless_unscaled, u.dimensionless_unscaled, G=1.0
)
"""Pure numbers with G = 1, so that GM and mass are equal."""


# From 4713 BC to the end of AD 9999, which is the range that astropy can write as dates.
JULIAN_DATES = (0.0, 5373484.5)
# Within these, 270 million years, the Julian date of a long run is known to a thousandth of a second.
FARTHEST_DATE = 1e11
# A plain number below this (1976 BC) is more likely a modified Julian date, or a year.
SMALLEST_PLAIN_JULIAN_DATE = 1e6
# What texts end with that are not meant as TDB, such as "2000-01-01T00:00:00Z" or "...+01:00".
UTC = re.compile(r"\d\s*(Z|UTC|UT|GMT|[+-]\d\d:\d\d)\s*$", re.IGNORECASE)
YEARS_AS_TEXT = ("jyear_str", "byear_str")
A_MOMENT = "expected a time: an astropy Time, a string such as '2022-08-09' or 'J2000', or a Julian date"


def as_epoch(epoch: Any, what: str = "epoch") -> Time:
    """Return an epoch as a scalar astropy Time in the scale TDB.

    epoch : a Time in any scale; a string such as "2022-08-09", "2022-08-09 12:00" or "J2000", or a datetime64, taken as
        TDB; a plain number, taken as a Julian date, TDB.
    Raises EpochError, naming `what`, for anything else.
    """
    time = as_epochs(epoch, what)
    if not time.isscalar:
        raise EpochError(f"{what} is {shown(epoch)}; {A_MOMENT} (got {time.size} times).")
    return time


def date_text(time: Time, digits: int | None = None, between: str = " ") -> str:
    """Return a date as ISO text, cut after some characters; outside the years that have one, the Julian year, as in
    "J12345.678".

    between : what stands between day and hour
    """
    if not JULIAN_DATES[0] <= time.jd <= JULIAN_DATES[1]:
        return f"J{time.jyear:.3f}"
    return str(time.isot)[:digits].replace("T", between)


def told_apart(*numbers: float, digits: int = 6) -> list[str]:
    """Return numbers as text, with as many digits as tell different ones apart, and at least `digits`."""
    ways = ([f"{x:.{k}g}" for x in numbers] for k in range(digits, 18))
    return next(texts for texts in ways if len(set(texts)) >= len(set(numbers)))


def written(times: Time) -> Time:
    """Return dates in a format in which they can be written: Julian years, if some lie outside those of calendars."""
    dates = times.jd
    known = np.all((dates >= JULIAN_DATES[0]) & (dates <= JULIAN_DATES[1]))
    return times if known else times.copy(format="jyear")


def as_epochs(epochs: Any, what: str = "epoch") -> Time:
    """Return one epoch like `as_epoch`, or several from a Time, a list of strings or an array of datetime64."""
    from astropy.time import Time

    try:
        if isinstance(epochs, Time):
            time = epochs.tdb
        elif isinstance(epochs, str) or (isinstance(epochs, list) and all(isinstance(x, str) for x in epochs)):
            texts = [text.strip() for text in ([epochs] if isinstance(epochs, str) else epochs)]
            time = Time([text + ".0" if text == "J2000" else text for text in texts], scale="tdb")
            time = time[0] if isinstance(epochs, str) else time
        elif isinstance(epochs, np.datetime64 | np.ndarray) and epochs.dtype.kind == "M":
            if np.isnat(epochs).any():
                raise ValueError("NaT is not a date")
            time = Time(epochs, scale="tdb")
        elif isinstance(epochs, int | float | np.integer | np.floating) and not isinstance(epochs, bool):
            if epochs < SMALLEST_PLAIN_JULIAN_DATE:
                raise ValueError("too small: a modified Julian date is written Time(mjd, format='mjd', scale='tdb')")
            time = Time(float(epochs), format="jd", scale="tdb")
        else:
            raise TypeError(f"a {type(epochs).__name__}")
        if time.masked:
            raise ValueError("masked times are undefined")
        date = time.jd
        if not np.all((date >= JULIAN_DATES[0]) & (date <= JULIAN_DATES[1])):
            if not isinstance(epochs, Time) or not np.all(np.abs(date) <= FARTHEST_DATE):
                raise ValueError("before 4713 BC or after AD 9999, or not a number")
            return time.copy(format="jyear")
        # As a year, any time within nine hours would be printed as "J2000.000".
        return time.copy(format="isot") if time.format in YEARS_AS_TEXT else time
    # Astropy's errors for a date it cannot read have no common base class: ValueError, ErfaError, UnitsError, ...
    except Exception as error:
        reason = str(error).strip().partition("\n")[0].rstrip(".:")
        texts = [epochs] if isinstance(epochs, str) else epochs if isinstance(epochs, list) else []
        if any(isinstance(text, str) and UTC.search(text) for text in texts):
            reason = "texts are TDB; for UTC give astropy's Time('2000-01-01 00:00', scale='utc')"
        raise EpochError(f"{what} is {shown(epochs)}; {A_MOMENT} ({reason}).") from error
