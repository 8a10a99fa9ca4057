"""Where and when a body comes down into the atmosphere."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import erfa
import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.ephemeris import AU_KM
from orbits.errors import InputError
from orbits.export import Valued
from orbits.observing.earth import turning
from orbits.observing.stations import WGS84

if TYPE_CHECKING:
    from astropy.time import Time

Array = NDArray[np.float64]


def height_and_vertical(fixed: Array) -> tuple[Array, Array, Array, Array]:
    """Return height, km, the vertical, (m, 3), longitude and latitude, radians, of places in the Earth's axes, km."""
    lon, lat, height = erfa.gc2gd(WGS84, fixed * 1e3)
    up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    return height / 1e3, up, lon, lat


@contextmanager
def _without_erfa() -> Iterator[None]:
    """Leave out ERFA's warnings of leap seconds to come: that of `turning` says what they may cost."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)
        yield


@dataclass(frozen=True, eq=False, repr=False)
class Entry(Valued):
    """Where and when a body comes down to an altitude above the Earth, without an atmosphere.

    body : its name; date : a Time, UTC; altitude : km, above the ellipsoid WGS84
    longitude : degrees east; latitude : geodetic, degrees; speed : relative to the turning Earth, km/s
    slope : the angle of the path below the horizon; azimuth : the direction it flies to, from north to east, degrees
    matrix : the covariance of the place at this altitude, towards east and north, km, and of the time, s, (3, 3), to
        first order; None without one
    """

    body: str
    date: Time
    altitude: u.Quantity
    longitude: u.Quantity
    latitude: u.Quantity
    speed: u.Quantity
    slope: u.Quantity
    azimuth: u.Quantity
    matrix: Array | None

    @classmethod
    def of(cls, body: str, date: Time, altitude: float, q: Array, v: Array, matrix: Array | None) -> Entry:
        """Return the entry of a state.

        date : (1,), TDB; q, v : (3,), relative to the Earth, axes of the ICRF, au and au/d; matrix : of them, (6, 6)
        """
        turned = turning(date)
        fixed = turned.matrix[0] @ q
        moved = turned.matrix[0] @ (v - turned.carries(fixed)[1][0])
        (_, up, lon, lat) = height_and_vertical(fixed[None] * AU_KM)
        east = np.array([-np.sin(lon[0]), np.cos(lon[0]), 0.0])
        axes = np.array([east, np.cross(up[0], east), up[0]])
        flight = axes @ moved
        if matrix is not None:
            # At another time by dt it is on the same height: the place moves by dq + v dt, whose height is 0.
            here = axes @ turned.matrix[0]
            delay = -here[2] / flight[2]
            by = np.zeros((3, 6))
            by[:, :3] = np.vstack([(here[:2] + np.outer(flight[:2], delay)) * AU_KM, delay * 86400.0])
            matrix = by @ matrix @ by.T
        size = float(np.linalg.norm(flight))
        with _without_erfa():
            when = date[0].utc
        return cls(
            body,
            when,
            u.Quantity(altitude, u.km),
            u.Quantity(lon[0], u.rad).to(u.deg),
            u.Quantity(lat[0], u.rad).to(u.deg),
            u.Quantity(size, u.au / u.day).to(u.km / u.s),
            u.Quantity(np.arcsin(-flight[2] / size), u.rad).to(u.deg),
            u.Quantity(np.arctan2(flight[0], flight[1]) % (2.0 * np.pi), u.rad).to(u.deg),
            matrix,
        )

    @property
    def sigma_time(self) -> u.Quantity:
        """The standard deviation of the time, s."""
        return u.Quantity(np.sqrt(self._known()[2, 2]), u.s)

    def ellipse(self, sigmas: float = 3.0) -> tuple[u.Quantity, u.Quantity, u.Quantity]:
        """Return the semi-axes of the uncertainty of the place, km, and the azimuth of the longer one."""
        values, vectors = np.linalg.eigh(self._known()[:2, :2])
        small, large = sigmas * np.sqrt(np.maximum(values, 0.0))
        azimuth = np.arctan2(vectors[0, 1], vectors[1, 1]) % np.pi
        return u.Quantity(large, u.km), u.Quantity(small, u.km), u.Quantity(azimuth, u.rad).to(u.deg)

    def _known(self) -> Array:
        if self.matrix is None:
            raise InputError("this entry has no covariance; expected entry(..., covariance=fit).")
        return self.matrix

    def _caption(self) -> str:
        with _without_erfa():
            when = f"{self.date.iso[:23]} UTC"
        return f"{self.body} comes down to {self.altitude.value:g} km on {when}, without an atmosphere"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        fields = ("longitude", "latitude", "speed", "slope", "azimuth")
        rows = [[name, str(getattr(self, name).unit), f"{getattr(self, name).value:.4f}"] for name in fields]
        if self.matrix is not None:
            large, small, azimuth = self.ellipse()
            text = f"{large.value:.3g} x {small.value:.3g} to azimuth {azimuth.value:.1f} deg"
            rows += [["ellipse, 3 sigma", "km", text], ["sigma of the time", "s", f"{self.sigma_time.value:.3g}"]]
        return ["", "unit", "value"], rows, 0
