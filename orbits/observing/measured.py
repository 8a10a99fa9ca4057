"""What is measured of planets of other stars: times of transits, and radial velocities of the star; their files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.errors import InputError, UnknownNameError, counted, shown
from orbits.observing.transits import Linear, counted_transits

Array = NDArray[np.float64]

MOST_LINES = 5
"""The most lines of a file that an error names."""

LEFT_OUT = "-"
"""Stands for a column of a file that is not read."""


@dataclass(frozen=True, eq=False, repr=False)
class TransitTimes:
    """Times of the transits of planets: the middles, where planet and star are closest on the sky.

    planet : names, (m,), or one for all; time : (m,), a Time, or Julian dates, TDB; sigma : their uncertainties, times
    number : of each transit of its planet, (m,); by default counted by the median interval of each planet

    times["b"] are those of one planet, times + others all of both. Raises InputError for other shapes, and for numbers
    of a planet that are not in the order of its times.
    """

    planet: Any
    time: Any
    sigma: Any
    number: Any = None

    def __post_init__(self) -> None:
        _made(self, "planet", {"sigma": u.day})
        number = np.zeros(len(self), dtype=np.int64) if self.number is None else np.array(self.number, dtype=np.int64)
        for name in self.planets:
            rows = np.flatnonzero(self.planet == name)[np.argsort(self.time.jd[self.planet == name])]
            if self.number is None:
                number[rows] = counted_transits(self.time.jd[rows])
            elif number.shape != self.time.shape or (np.diff(number[rows]) <= 0).any():
                raise InputError(f"the numbers of the transits of {name!r} do not increase with their times.")
        object.__setattr__(self, "number", number)

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
        found = _columns(path, columns, ("planet", "number", "time", "sigma"), ("planet",))
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
        found = _columns(path, columns, ("time", "velocity", "sigma", "instrument"), ("instrument",))
        name = Path(path).stem if instrument is None else instrument
        given = found.get("instrument", np.full(len(found["time"]), name))
        return cls(given, _dates(zero, found["time"]), found["velocity"] * unit, found["sigma"] * unit)

    @property
    def instruments(self) -> tuple[str, ...]:
        """The names of the instruments, in the order in which they appear."""
        return tuple(dict.fromkeys(self.instrument.tolist()))

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
    time = one.time.tdb if isinstance(one.time, Time) else Time(np.asarray(one.time, float), format="jd", scale="tdb")
    time = time.reshape(-1)
    made = {named: np.array(np.broadcast_to(np.asarray(getattr(one, named), dtype=str), time.shape)), "time": time}
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


def _some(one: Any, named: str, name: str) -> list[Any]:
    """Return the fields of the measurements with a name. Raises UnknownNameError."""
    rows = getattr(one, named) == name
    if not rows.any():
        known = few(list(dict.fromkeys(getattr(one, named).tolist())))
        raise UnknownNameError(f"there is no {named} {shown(name)}; expected one of {known}.")
    return [value[rows] for value in vars(one).values()]


def _joined(one: Any, other: Any) -> list[Any]:
    """Return the fields of two sets of measurements together."""
    if type(other) is not type(one):
        raise InputError(f"{type(one).__name__} and {shown(other)} cannot be joined; give a fit both in a list.")
    joined = []
    for a, b in zip(vars(one).values(), vars(other).values(), strict=True):
        if isinstance(a, Time):
            joined.append(Time(np.append(a.jd1, b.jd1), np.append(a.jd2, b.jd2), format="jd", scale="tdb"))
        else:
            joined.append(np.concatenate([a, b]))
    return joined


def _dates(zero: float, days: Array) -> Time:
    return Time(np.full(len(days), float(zero)), days, format="jd", scale="tdb")


def _span(time: Time) -> str:
    return f", {time.min().iso[:10]} to {time.max().iso[:10]}" if len(time) else ""


def _columns(
    path: str | PathLike[str], columns: Sequence[str], known: Sequence[str], texts: Sequence[str]
) -> dict[str, NDArray[Any]]:
    """Return the columns of a file by name. Raises InputError that names the lines which do not have them."""
    wrong = [x for x in columns if x not in (*known, LEFT_OUT)]
    missing = [x for x in known if x not in columns and x not in ("planet", "number", "instrument")]
    if wrong or missing:
        raise InputError(f"columns is {shown(columns)}; expected {', '.join(known)}, '-' for others, in their order.")
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
        return Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"the measurements in {shown(path)} cannot be read: {error}") from None


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
