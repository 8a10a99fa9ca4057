"""The asteroids and trans-Neptunian objects of DE440: names, GM, and osculating elements at one date."""

from __future__ import annotations

import csv
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits import elements as kepler
from orbits import ephemeris
from orbits.catalogue.names import parts
from orbits.resources import data_path

Floats = NDArray[np.float64]

TABLE = "de440_small_bodies.csv"


class SmallBodies(NamedTuple):
    """The small bodies of DE440: 343 asteroids, then 30 trans-Neptunian objects.

    names : "Ceres", "2002 TC302"; keys : DE440's names of their GM, "MA0001", "MA8006"; gm : (n,) au^3/d^2
    """

    names: tuple[str, ...]
    keys: tuple[str, ...]
    gm: Floats

    @property
    def asteroids(self) -> int:
        """How many of them are asteroids."""
        return sum(key < "MA8" for key in self.keys)


@cache
def small_bodies() -> SmallBodies:
    """Return the table without elements."""
    rows = _rows()
    names = tuple(parts(row["full_name"])[1] for row in rows)
    return SmallBodies(names, tuple(row["key"] for row in rows), np.array([float(row["gm"]) for row in rows]))


def _rows() -> list[dict[str, str]]:
    with data_path(TABLE).open(encoding="ascii", newline="") as stream:
        next(stream)  # the line with the source of the file
        return list(csv.DictReader(stream))


def from_elements() -> tuple[float, Floats, Floats]:
    """Return the Julian date of the elements, and heliocentric q and v, (n, 3), au and au/d, ICRF."""
    rows = _rows()

    def column(name: str) -> Floats:
        return np.array([float(row[name]) for row in rows])

    known = (("inc", "i"), ("Omega", "om"), ("omega", "w"), ("M", "ma"))
    angles = {name: np.radians(column(key)) for name, key in known}
    gm = np.full(len(rows), ephemeris.gm(["Sun"])[0])  # JPL's elements are those of massless bodies
    q, v = kepler.state_from_elements(gm, a=column("a"), e=column("e"), **angles, names=small_bodies().names)
    (epoch,) = set(column("epoch_mjd").tolist())
    return 2400000.5 + epoch, kepler.from_frame(q, "ecliptic"), kepler.from_frame(v, "ecliptic")
