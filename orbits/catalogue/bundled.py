"""Asteroids of the main belt and Jupiter's Trojans, from JPL's Small-Body Database.

    asteroids(1000)                                  # the thousand brightest
    asteroids(classes="belt", brighter_than=10)      # the belt without the Trojans
    asteroids(names=["Ceres", "Vesta"])
    asteroids(numbers=range(1, 11))

It has 2,284 asteroids of the belt and 497 Trojans, all with absolute magnitude H < 12, with osculating elements at
MJD 59800 TDB and no masses. `.details["G"]` has the slope parameter of their brightness, nan if it is unknown.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from functools import cache

import numpy as np

from orbits.catalogue.catalogue import Catalogue, Floats, choose
from orbits.catalogue.names import parts, rows_by_name
from orbits.resources import data_path

FILE = "jpl_sbdb_belt_and_trojans.csv"
LARGEST_ASTEROID = 1e-9
"""Bodies of a larger GM, in that of the Sun, are no asteroids, such as Jupiter's Europa; Ceres has half of it."""

EPOCH_MJD = 59800.0
"""The epoch of the elements, MJD TDB (2022-08-09); two asteroids with another epoch are returned only by name."""


def asteroids(
    count: int | None = None,
    *,
    names: str | Iterable[str] | None = None,
    numbers: int | Iterable[int] | None = None,
    classes: str | Iterable[str] | None = None,
    brighter_than: float | None = None,
) -> Catalogue:
    """Return real asteroids with their osculating elements, the brightest first.

    count : at most the brightest `count` of those that the other arguments select
    names : only these, in this order: "Ceres", "1 Ceres" or a designation such as "2000 SN209"; case is ignored
    numbers : only these, in this order, after those selected by name
    classes : "belt", "trojan", or codes of the Small-Body Database: "MBA", "OMB", "IMB", "MCA", "TJN"
    brighter_than : only absolute magnitudes H below this

    Two asteroids have elements of another epoch, and are left out unless they are selected by name.
    Raises UnknownNameError, with close matches, for an unknown name, number or class; InputError for a count that is
    not a whole number >= 1, or exceeds what is available.
    """
    table, ways = _table()
    brightest = [row for row in np.argsort(table.H, kind="stable").tolist() if table.epoch[row] == EPOCH_MJD]
    return choose(
        table,
        ways,
        rows=brightest,
        count=count,
        names=names,
        numbers=numbers,
        classes=classes,
        brighter_than=brighter_than,
    )


@cache
def _table() -> tuple[Catalogue, dict[str, int]]:
    """Return the whole catalogue in the order of the file, and the row of every form of an asteroid's name.

    The forms are "ceres", "1 ceres", "1", "a801 aa" and "1 ceres a801 aa".
    """
    with data_path(FILE).open(encoding="ascii", newline="") as stream:
        next(stream)  # the line with the source of the file
        header, *rows = csv.reader(stream)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    known = [parts(full) for full in columns["full_name"]]

    def floats(column: str) -> Floats:
        return np.array(columns[column], dtype=np.float64)

    table = Catalogue(
        names=tuple(name for _, name, _ in known),
        numbers=np.array([number for number, _, _ in known], dtype=np.int64),
        a=floats("a"),
        e=floats("e"),
        inc=np.radians(floats("i")),
        Omega=np.radians(floats("om")),
        omega=np.radians(floats("w")),
        M=np.radians(floats("ma")),
        epoch=floats("epoch_mjd"),
        H=floats("H"),
        classes=columns["class"],
        details={"G": np.array([x or "nan" for x in columns["G"]], dtype=np.float64)},
        source="all of the belt or Trojans, H < 12",
    )
    return table, rows_by_name(columns["full_name"], known)
