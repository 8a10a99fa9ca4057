"""The observatories of the Minor Planet Center, by their codes.

The table gives the longitude and the parallax constants rho cos(phi') and rho sin(phi'), the distances from the axis of
the Earth and from the plane of its equator in units of its equatorial radius: to 1 to 100 m, as digits are given.
Source: data/mpc_observatories.txt, the MPC's list of codes.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import erfa
import numpy as np
from numpy.typing import NDArray

from orbits.ephemeris import AU_KM
from orbits.resources import data_path

EARTH_RADIUS = 6378.137
"""The equatorial radius of the Earth, km, of WGS84."""


class Station(NamedTuple):
    """An observatory.

    code, name : of the MPC
    x : its place in the axes of the Earth (ITRF), au, (3,); None where the MPC has none: in space, or roving
    """

    code: str
    name: str
    x: NDArray[np.float64] | None

    def __str__(self) -> str:
        return f"{self.code} {self.name}"


@cache
def stations() -> dict[str, Station]:
    """Return all observatories by their codes."""
    _, *lines = data_path("mpc_observatories.txt").read_text(encoding="utf-8").splitlines()
    return {line[:3]: Station(line[:3], line[30:].strip(), _place(line)) for line in lines}


def _place(line: str) -> NDArray[np.float64] | None:
    """Return the place of a line; figures may touch, so that columns alone tell them apart."""
    columns = line[4:13], line[13:21], line[21:30]
    if not all(column.strip() for column in columns):
        return None
    longitude, from_axis, above_equator = map(float, columns)
    turn = np.deg2rad(longitude)
    return np.array([from_axis * np.cos(turn), from_axis * np.sin(turn), above_equator]) * (EARTH_RADIUS / AU_KM)


WGS84 = 1
"""The number of the ellipsoid in ERFA."""


def on_the_ellipsoid(longitude: float, latitude: float, height: float) -> tuple[float, float, float]:
    """Return a place in the axes of the Earth, au: degrees east, degrees north, metres above WGS84."""
    x, y, z = erfa.gd2gc(WGS84, np.deg2rad(longitude), np.deg2rad(latitude), height) / (1e3 * AU_KM)
    return float(x), float(y), float(z)
