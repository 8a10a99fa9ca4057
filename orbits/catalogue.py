"""Asteroids of the main belt and Jupiter's Trojans, from JPL's Small-Body Database.

    asteroids(1000)                                  # the thousand brightest
    asteroids(classes="belt", brighter_than=10)      # the belt without the Trojans
    asteroids(names=["Ceres", "Vesta"])
    asteroids(numbers=range(1, 11))

2,284 of the belt and 497 Trojans, all with absolute magnitude H < 12, osculating elements at MJD 59800 TDB. No masses.
"""

from __future__ import annotations

import csv
import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, UnknownNameError
from orbits.resources import data_path

Floats = NDArray[np.float64]

FILE = "jpl_sbdb_belt_and_trojans.csv"
EPOCH_MJD = 59800.0
"""The epoch of the elements, MJD TDB (2022-08-09), of all but two asteroids, which are given only when named."""

CLASSES = {"IMB": "inner belt", "MBA": "main belt", "OMB": "outer belt", "MCA": "Mars crosser", "TJN": "Jupiter Trojan"}
"""The classes of the Small-Body Database that occur."""

FLOATS = ("a", "e", "inc", "Omega", "omega", "M", "epoch", "H")
GROUPS = {"belt": ("IMB", "MBA", "OMB", "MCA"), "trojan": ("TJN",), "trojans": ("TJN",)}


@dataclass(frozen=True, eq=False, repr=False)
class Catalogue:
    """Osculating heliocentric elements of asteroids, one row each; arrays of shape (n,), read-only.

    names : unique names, "Ceres", or the provisional designation where there is no name, "2000 SN209"
    numbers : int64; 0 for an asteroid without a number
    a : semi-major axis, au;  e : eccentricity
    inc, Omega, omega, M : inclination, node, argument of perihelion, mean anomaly at the epoch, radians
    epoch : MJD, TDB
    H : absolute magnitude
    classes : codes of the Small-Body Database, see `CLASSES`
    frame : what the angles refer to, "ecliptic" for the ecliptic and equinox of J2000

    catalogue[:100] and catalogue[catalogue.a > 3] are catalogues too; catalogue["Ceres"] is one of a single row.
    """

    names: tuple[str, ...]
    numbers: NDArray[np.int64]
    a: Floats
    e: Floats
    inc: Floats
    Omega: Floats
    omega: Floats
    M: Floats
    epoch: Floats
    H: Floats
    classes: tuple[str, ...]
    frame: str = "ecliptic"

    def __post_init__(self) -> None:
        for array in (self.numbers, *(getattr(self, what) for what in FLOATS)):
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, key: str | int | slice | Sequence[int] | NDArray[np.int64] | NDArray[np.bool_]) -> Catalogue:
        """Return the rows chosen by name, index, slice, mask or array of indices, in that order."""
        if isinstance(key, str):
            return self[[_row_of_name(key, {_plain(name): row for row, name in enumerate(self.names)}, self.names)]]
        if isinstance(key, int | np.integer):
            key = [range(len(self))[int(key)]]
        rows = np.arange(len(self))[key]
        return Catalogue(
            names=tuple(self.names[row] for row in rows),
            classes=tuple(self.classes[row] for row in rows),
            numbers=self.numbers[rows],
            **{what: getattr(self, what)[rows] for what in FLOATS},
            frame=self.frame,
        )

    def __repr__(self) -> str:
        if not len(self):
            return "Catalogue of 0 asteroids"
        shown = ", ".join(self.names[:4]) + (", ..." if len(self) > 4 else "")
        trojans = self.classes.count("TJN")
        kinds = f"{len(self) - trojans} in the belt, {trojans} Trojans"
        epochs = " and ".join(f"{epoch:g}" for epoch in sorted(set(self.epoch.tolist())))
        return (
            f"Catalogue of {len(self)} asteroid{'s' * (len(self) != 1)}: {shown}\n  {kinds}; "
            f"a {self.a.min():.3f} ... {self.a.max():.3f} au, e up to {self.e.max():.3f}, H {self.H.min():g} ... "
            f"{self.H.max():g}; {self.frame} of J2000, epoch MJD {epochs} TDB"
        )


def asteroids(
    count: int | None = None,
    *,
    names: str | Iterable[str] | None = None,
    numbers: int | Iterable[int] | None = None,
    classes: str | Iterable[str] | None = None,
    brighter_than: float | None = None,
) -> Catalogue:
    """Return real asteroids with their osculating elements, the brightest first.

    count : no more than the brightest `count` of those that the other arguments leave
    names : these alone, in this order: "Ceres", "1 Ceres" or a designation such as "2000 SN209"; case does not matter
    numbers : these alone, in this order, after those called by name
    classes : "belt", "trojan", or codes of the Small-Body Database: "MBA", "OMB", "IMB", "MCA", "TJN"
    brighter_than : absolute magnitudes H below this

    Two asteroids have elements of another epoch and are left out unless they are called by name.
    Raises UnknownNameError for a name, number or class that is not there, with close matches; InputError for a count
    that is not a positive integer or is more than there are.
    """
    table, rows_by_name = _table()
    if names is None and numbers is None:
        rows = [row for row in np.argsort(table.H, kind="stable").tolist() if table.epoch[row] == EPOCH_MJD]
    else:
        by_name = [] if names is None else _strings(names, "names")
        by_number = [] if numbers is None else list(numbers) if isinstance(numbers, Iterable) else [numbers]
        chosen = [_row_of_name(name, rows_by_name, table.names) for name in by_name]
        chosen += [_row_of_number(number, table.numbers) for number in by_number]
        rows = list(dict.fromkeys(chosen))
    if classes is not None:
        wanted = {code for name in _strings(classes, "classes") for code in _codes(name)}
        rows = [row for row in rows if table.classes[row] in wanted]
    if brighter_than is not None:
        if not isinstance(brighter_than, int | float) or not math.isfinite(brighter_than):
            raise InputError(f"brighter_than = {brighter_than!r}; expected an absolute magnitude, such as 10.5")
        rows = [row for row in rows if table.H[row] < brighter_than]
    if count is not None:
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise InputError(f"count = {count!r}; expected a whole number of asteroids, 1 or more")
        if count > len(rows):
            raise InputError(
                f"count = {count}, but there are only {len(rows)} such asteroids here, all with H < 12. Ask for fewer, "
                "or leave out count to have them all"
            )
        rows = sorted(rows, key=lambda row: float(table.H[row]))[:count]
    return table[rows]


def _strings(given: str | Iterable[str], what: str) -> list[str]:
    """Return one or several strings as a list; raise InputError for anything else."""
    values = [given] if isinstance(given, str) or not isinstance(given, Iterable) else list(given)
    for value in values:
        if not isinstance(value, str):
            example = "'belt'" if what == "classes" else "'Ceres' (numbers= takes numbers)"
            raise InputError(f"{what} holds {value!r}; expected strings such as {example}")
    return values


def _codes(name: str) -> tuple[str, ...]:
    """Return the codes of the Small-Body Database that a class or group stands for."""
    if name.upper() in CLASSES:
        return (name.upper(),)
    if name.lower() in GROUPS:
        return GROUPS[name.lower()]
    raise UnknownNameError(
        f"there is no class {name!r} of asteroids here; expected 'belt', 'trojan' or one of "
        + ", ".join(f"{code} ({meaning})" for code, meaning in CLASSES.items())
    )


def _row_of_name(name: str, rows: Mapping[str, int], names: Sequence[str]) -> int:
    """Return rows[name], whatever the case; raise UnknownNameError with the names that come close."""
    key = _plain(name)
    if key in rows:
        return rows[key]
    close = dict.fromkeys(names[rows[k]] for k in difflib.get_close_matches(key, rows, n=3, cutoff=0.7))
    meant = f"; did you mean {' or '.join(map(repr, close))}?" if close else "."
    raise UnknownNameError(
        f"there is no asteroid {name!r} here{meant} Expected a name or designation of one of these {len(names)}, "
        "all of the belt or Trojans, H < 12"
    )


def _row_of_number(number: int, numbers: NDArray[np.int64]) -> int:
    """Return the row of an asteroid's number; raise UnknownNameError with the numbers that come close."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer):
        raise InputError(f"numbers holds {number!r}; expected whole numbers such as 1 for Ceres (names= takes names)")
    found = np.flatnonzero((numbers == number) & (numbers > 0))
    if len(found):
        return int(found[0])
    known = np.sort(numbers[numbers > 0])
    close = np.sort(known[np.argsort(np.abs(known - number), kind="stable")[:3]])
    raise UnknownNameError(
        f"there is no asteroid with number {number} here; the closest are {', '.join(map(str, close))}. Expected the "
        "number of an asteroid of the belt or a Trojan with H < 12"
    )


def _plain(name: str) -> str:
    """Return a name without parentheses, in lower case."""
    return " ".join(name.replace("(", " ").replace(")", " ").lower().split())


@cache
def _table() -> tuple[Catalogue, dict[str, int]]:
    """Return the whole catalogue in the order of the file, and the rows by every way to call an asteroid.

    Those are "ceres", "1 ceres", "1", "a801 aa" and "1 ceres a801 aa".
    """
    with data_path(FILE).open(encoding="ascii", newline="") as stream:
        next(stream)  # the line that says where the file is from
        header, *rows = csv.reader(stream)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    parts = [_parts(full) for full in columns["full_name"]]

    def floats(column: str) -> Floats:
        return np.array(columns[column], dtype=np.float64)

    table = Catalogue(
        names=tuple(name for _, name, _ in parts),
        numbers=np.array([number for number, _, _ in parts], dtype=np.int64),
        a=floats("a"),
        e=floats("e"),
        inc=np.radians(floats("i")),
        Omega=np.radians(floats("om")),
        omega=np.radians(floats("w")),
        M=np.radians(floats("ma")),
        epoch=floats("epoch_mjd"),
        H=floats("H"),
        classes=columns["class"],
    )
    rows_by_name: dict[str, int] = {}
    # Names last: should a designation ever read like another asteroid's name, the name wins.
    ways: list[tuple[str, ...]] = list(zip(columns["full_name"], (d for _, _, d in parts), strict=True))
    ways += [(str(number), f"{number} {name}", name) if number else (name,) for number, name, _ in parts]
    for i, called in enumerate(ways):
        rows_by_name.update((_plain(way), i % len(parts)) for way in called if way)
    return table, rows_by_name


def _parts(full: str) -> tuple[int, str, str]:
    """Return (number, name, designation) of "1 Ceres (A801 AA)", "36922 (2000 SN209)" or "(1927 LA)"."""
    match = re.fullmatch(r"(\d*)\s*(.*?)\s*(?:\(([^)]*)\))?", full)
    number, name, designation = match.groups(default="") if match else ("", full, "")
    return int(number or 0), name or designation, designation
