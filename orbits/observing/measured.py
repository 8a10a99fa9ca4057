"""What is measured of planets of other stars: times of transits, and radial velocities of the star; their files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.body_names import few, index_of
from orbits.checks import finite_number
from orbits.errors import InputError, UnknownNameError, counted, shown
from orbits.observing.transits import Linear, counted_transits, orbits_between
from orbits.units import date_text

Array = NDArray[np.float64]

MOST_LINES = 5
"""The most lines of a file that an error names."""

MOST_NUMBER = 2**53
"""Numbers of transits are below this, so that they are exact."""

LEFT_OUT = "-"
"""Stands for a column of a file that is not read."""


@dataclass(frozen=True, eq=False, repr=False)
class TransitTimes:
    """Times of the transits of planets: the middles, where planet and star are closest on the sky.

    planet : names, (m,), or one for all; time : (m,), a Time, or Julian dates, TDB; sigma : their uncertainties, times
    number : of each transit of its planet, (m,), whole; by default, and where all of a planet are NaN, they are counted
        by the longest period of which all intervals are whole numbers, to a twentieth

    times["b"] are those of one planet, times + others all of both, counted anew. Raises InputError for other shapes, if
    numbers of a planet do not increase with its times, and if there is no such period.
    """

    planet: Any
    time: Any
    sigma: Any
    number: Any = None

    def __post_init__(self) -> None:
        _made(self, "planet", {"sigma": u.day})
        number = _whole_numbers(self.number, len(self))
        counted_here = np.isnan(number)
        for name in self.planets:
            rows = np.flatnonzero(self.planet == name)[np.argsort(self.time.jd[self.planet == name])]
            if counted_here[rows].all():
                number[rows] = counted_transits(self.time.jd[rows], name)
            elif not (np.diff(number[rows]) > 0.0).all():
                lack = "; some have none" if counted_here[rows].any() else ""
                raise InputError(f"the numbers of the transits of {name!r} do not increase with their times{lack}.")
        object.__setattr__(self, "number", number.astype(np.int64))
        object.__setattr__(self, "_counted", counted_here)

    @classmethod
    def read(
        cls,
        path: str | PathLike[str],
        columns: Sequence[str] = ("planet", "number", "time", "sigma"),
        *,
        planet: str | None = None,
        names: Mapping[str, str] | None = None,
        zero: float = 0.0,
    ) -> Self:
        """Return those of a file with a line for each, its columns separated by blanks or commas.

        columns : what they are, in their order: "planet", "number", "time" (days, TDB), "sigma" (days); "-" is not read
        planet : the name of all, if no column has it; names : the planets by what the file calls them, {"1": "b"}
        zero : the Julian date from which times are counted

        Passed over are empty lines, what follows a "#", and a first line without numbers. Raises InputError that names
        each other line which does not have these columns, and UnknownNameError for a planet that is not in `names`.
        """
        found = _columns(path, columns, ("planet", "number", "time", "sigma"), {"planet": planet})
        given = found.get("planet", np.full(len(found["time"]), "" if planet is None else planet))
        if names is not None:
            unknown = sorted({str(x) for x in given} - {str(x) for x in names})
            if unknown:
                raise UnknownNameError(f"{path} has planets {few(unknown)}, which `names` lacks.")
            by_text = {str(key): name for key, name in names.items()}
            given = np.array([by_text[str(x)] for x in given])
        return cls(given, _dates(zero, found["time"]), found["sigma"] * u.day, found.get("number"))

    @property
    def planets(self) -> tuple[str, ...]:
        """The names of the planets, in the order in which they appear."""
        return tuple(dict.fromkeys(self.planet.tolist()))

    def linear(self, planet: str) -> Linear:
        """Return the linear ephemeris of a planet with the least squares: t0 (Julian date, TDB) and period, days."""
        one = self[planet]
        return Linear.of(one.number, one.time.jd, one.sigma.value)

    def check_orbits(self, planet: str, period: float) -> None:
        """Raise InputError unless a planet with about this period, days, goes round as often as its numbers say."""
        one = self[planet]
        order = np.argsort(one.time.jd)
        number, (found, _) = one.number[order], orbits_between(one.time.jd[order], period)
        for k in np.flatnonzero(np.diff(number) != found)[:1]:
            raise InputError(
                f"between the transits {number[k]} and {number[k + 1]} of {planet!r} are {found[k]} orbits with the "
                f"period {period:.6g} d, not {number[k + 1] - number[k]}; begin with about the period "
                f"{self.linear(planet).period:.6g} d, or give other numbers."
            )

    def __len__(self) -> int:
        return len(self.planet)

    def __getitem__(self, planet: str) -> Self:
        return type(self)(*_some(self, "planet", planet))

    def __add__(self, other: Self) -> Self:
        return type(self)(*_joined(self, other))

    def __repr__(self) -> str:
        return f"TransitTimes({counted(len(self), 'transit')} of {few(self.planets)}{_span(self.time)})"


@dataclass(frozen=True, eq=False, repr=False)
class RadialVelocities:
    """Radial velocities of a star, positive if it recedes.

    instrument : names, (m,), or one for all: each has a zero of its own
    time : (m,), a Time, or Julian dates, TDB; velocity, sigma : with their uncertainties, (m,)

    velocities["HIRES"] are those of one instrument, velocities + others all of both. Raises InputError for other
    shapes.
    """

    instrument: Any
    time: Any
    velocity: Any
    sigma: Any

    def __post_init__(self) -> None:
        _made(self, "instrument", {"velocity": u.m / u.s, "sigma": u.m / u.s})

    @classmethod
    def read(
        cls,
        path: str | PathLike[str],
        columns: Sequence[str] = ("time", "velocity", "sigma"),
        *,
        instrument: str | None = None,
        zero: float = 0.0,
        unit: Any = u.m / u.s,
    ) -> Self:
        """Return those of a file with a line for each, its columns separated by blanks or commas.

        columns : what they are, in their order: "time" (days, TDB), "velocity", "sigma", "instrument"; "-" is not read
        instrument : the name of all, if no column has it; by default the name of the file
        zero : the Julian date from which times are counted; unit : of the velocities

        Passed over are empty lines, what follows a "#", and a first line without numbers. Raises InputError that names
        each other line which does not have these columns.
        """
        found = _columns(path, columns, ("time", "velocity", "sigma", "instrument"), {"instrument": instrument})
        given = found.get("instrument", Path(path).stem if instrument is None else instrument)
        try:
            one = u.Unit(unit).to(u.m / u.s) * u.m / u.s
        except (u.UnitConversionError, TypeError, ValueError):
            raise InputError(f"unit is {shown(unit)}; expected one of speed, such as u.km / u.s.") from None
        return cls(given, _dates(zero, found["time"]), found["velocity"] * one, found["sigma"] * one)

    @property
    def instruments(self) -> tuple[str, ...]:
        """The names of the instruments, in the order in which they appear."""
        return tuple(dict.fromkeys(self.instrument.tolist()))

    def each(self, speed: Any, what: str) -> Array:
        """Return a speed, m/s, for each: one of all, or by instrument, 0 where there is none. Raises InputError, and
        UnknownNameError.
        """
        given = speed if isinstance(speed, Mapping) else dict.fromkeys(self.instruments, speed)
        of = {self.instruments[index_of(name, self.instruments, "instrument")]: x for name, x in given.items()}
        try:
            values = {name: float(u.Quantity(0.0 if x is None else x, u.m / u.s).value) for name, x in of.items()}
            if not all(np.isfinite(x) and x >= 0.0 for x in values.values()):
                raise ValueError
        except (u.UnitConversionError, TypeError, ValueError):
            got = shown(speed)
            raise InputError(f"{what} is {got}; expected a speed >= 0, such as 3 * u.m / u.s, or a dict.") from None
        return np.array([values.get(name, 0.0) for name in self.instrument.tolist()])

    def __len__(self) -> int:
        return len(self.instrument)

    def __getitem__(self, instrument: str) -> Self:
        return type(self)(*_some(self, "instrument", instrument))

    def __add__(self, other: Self) -> Self:
        return type(self)(*_joined(self, other))

    def __repr__(self) -> str:
        return f"RadialVelocities({counted(len(self), 'measurement')} of {few(self.instruments)}{_span(self.time)})"


def _made(one: Any, named: str, figures: Mapping[str, u.UnitBase]) -> None:
    """Check and convert the fields of measurements in place. Raises InputError."""
    for what in ("time", *figures):
        if _masked(getattr(one, what)):
            raise InputError(f"{what} has masked values; leave these measurements out.")
    time = _times(one.time)
    try:
        names = np.array(np.broadcast_to(np.asarray(getattr(one, named), dtype=str), time.shape))
    except ValueError:
        names = np.zeros(0, dtype=str)
    if names.shape != time.shape or _masked(getattr(one, named)) or (names == "").any():
        raise InputError(f"{named} is {shown(getattr(one, named))}; expected a name, or one for each of {time.size}.")
    made = {named: names, "time": time}
    for what, unit in figures.items():
        try:
            given = u.Quantity(getattr(one, what), unit)
            made[what] = u.Quantity(np.broadcast_to(given.value, time.shape), unit)
        except (u.UnitConversionError, TypeError, ValueError):
            got = shown(getattr(one, what))
            raise InputError(f"{what} is {got}; expected {time.size} figures in {unit}.") from None
    good = np.isfinite(time.jd) & np.isfinite([x.value for x in (made[what] for what in figures)]).all(axis=0)
    good &= made["sigma"].value > 0.0
    if not good.all():
        raise InputError(f"measurement {int(np.flatnonzero(~good)[0])} is not finite, or has no sigma above zero.")
    for what, value in made.items():
        object.__setattr__(one, what, value)


def _times(given: Any) -> Time:
    """Return dates, (m,), TDB, of a Time or of Julian dates. Raises InputError."""
    if isinstance(given, Time):
        return given.tdb.reshape(-1)
    try:
        return Time(u.Quantity(given, u.day).value, format="jd", scale="tdb").reshape(-1)
    except (u.UnitConversionError, TypeError, ValueError):
        raise InputError(f"time is {shown(given)}; expected a Time, or finite Julian dates, TDB.") from None


def _whole_numbers(given: Any, size: int) -> Array:
    """Return the numbers of transits, (m,), NaN where there are none. Raises InputError."""
    try:
        number = np.array(np.broadcast_to(np.nan, size) if given is None else given, dtype=np.float64)
    except (TypeError, ValueError):
        number = np.zeros(0)
    whole = np.isnan(number) | ((abs(number) < MOST_NUMBER) & (number == np.rint(number)))
    if number.shape != (size,) or _masked(given) or not whole.all():
        raise InputError(f"number is {shown(given)}; expected {size} whole numbers below 2^53.")
    return number


def _masked(given: Any) -> bool:
    """Return whether any of what is given is masked."""
    return isinstance(given, np.ndarray | Time) and bool(np.any(getattr(given, "mask", False)))


def _fields(one: Any) -> list[Any]:
    """Return what measurements are made of; numbers of transits that were counted as NaN."""
    values = [getattr(one, field.name) for field in fields(one)]
    if isinstance(one, TransitTimes):
        values[-1] = np.where(vars(one)["_counted"], np.nan, one.number)
    return values


def _some(one: Any, named: str, name: str) -> list[Any]:
    """Return the fields of the measurements with a name. Raises UnknownNameError."""
    rows = getattr(one, named) == name if isinstance(name, str) else np.zeros(0)
    if not rows.any():
        known = few(list(dict.fromkeys(getattr(one, named).tolist())))
        raise UnknownNameError(f"there is no {named} {shown(name)}; expected one of {known}.")
    return [value[rows] for value in _fields(one)]


def _joined(one: Any, other: Any) -> list[Any]:
    """Return the fields of two sets of measurements together."""
    if type(other) is not type(one):
        raise InputError(f"{type(one).__name__} and {shown(other)} cannot be joined; give a fit both in a list.")
    joined = []
    for a, b in zip(_fields(one), _fields(other), strict=True):
        if isinstance(a, Time):
            joined.append(Time(np.append(a.jd1, b.jd1), np.append(a.jd2, b.jd2), format="jd", scale="tdb"))
        else:
            joined.append(np.concatenate([a, b]))
    return joined


def _dates(zero: float, days: Array) -> Time:
    return Time(np.full(len(days), finite_number(zero, "zero")), days, format="jd", scale="tdb")


def _span(time: Time) -> str:
    first, last = (date_text(x).partition(" ")[0] for x in (time.min(), time.max())) if len(time) else ("", "")
    return f", {first} to {last}" if first else ""


def _columns(
    path: str | PathLike[str], columns: Sequence[str], known: Sequence[str], texts: Mapping[str, Any]
) -> dict[str, NDArray[Any]]:
    """Return the columns of a file by name. Raises InputError that names the lines which do not have them.

    texts : those that are no numbers, with what is given for all lines, or None
    """
    listed = np.iterable(columns) and not isinstance(columns, str | set | frozenset)  # a set has no order
    columns = [*columns] if listed else columns
    wrong = [x for x in columns if x not in (*known, LEFT_OUT)] if listed else [columns]
    missing = [x for x in known if listed and x not in columns and x not in ("planet", "number", "instrument")]
    if wrong or missing:
        raise InputError(f"columns is {shown(columns)}; expected {', '.join(known)}, '-' for others, in their order.")
    for name, given in texts.items():
        if given is not None and name in columns:
            raise InputError(f"{name} is {shown(given)}, but a column has it, too; expected columns without {name!r}.")
    rows, bad, first = [], [], True
    for number, line in enumerate(_lines(path), 1):
        words = line.split("#")[0].replace(",", " ").split()
        head, first = first and not any(map(_is_number, words)), first and not words
        if not words or head:
            continue
        of = dict(zip(columns, words, strict=False))
        not_numbers = [x for name, x in of.items() if name not in (*texts, LEFT_OUT) and not _is_number(x)]
        if len(words) != len(columns):
            bad.append(f"line {number}: {counted(len(words), 'column')}")
        elif not_numbers:
            bad.append(f"line {number}: {not_numbers[0]!r} is no number")
        elif not float(of.get("sigma", 1.0)) > 0.0:
            bad.append(f"line {number}: sigma {of['sigma']} is not above zero")
        elif float(of.get("number", 0)) % 1.0:
            bad.append(f"line {number}: number {of['number']} is not whole")
        else:
            rows.append(of)
    if bad or not rows:
        said = "; ".join(bad[:MOST_LINES]) + (f"; and {len(bad) - MOST_LINES} more" if len(bad) > MOST_LINES else "")
        expected = f"{counted(len(columns), 'column')}: {', '.join(columns)}"
        raise InputError(f"{path}: {said or 'no lines'}; expected {expected}.")
    return {
        name: np.array([row[name] if name in texts else float(row[name]) for row in rows])
        for name in columns
        if name != LEFT_OUT
    }


def _lines(path: str | PathLike[str]) -> list[str]:
    try:
        return Path(path).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"the measurements in {shown(path)} cannot be read: {error}") from None


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
