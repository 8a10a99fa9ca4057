"""Where an observer stands: at the centre of a body, on the surface of the Earth, or at the barycentre."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits import ephemeris
from orbits.body_names import place_of
from orbits.errors import InputError, UnknownNameError, shown
from orbits.observing.stations import Station, stations

if TYPE_CHECKING:
    from astropy.coordinates import EarthLocation

EARTH, SUN, EARTH_MOON = "Earth", "Sun", "Earth-Moon barycenter"

WORDS = {
    "geocentre": EARTH,
    "geocenter": EARTH,
    "geocentric": EARTH,
    "heliocentric": SUN,
    "barycentre": None,
    "barycenter": None,
    "barycentric": None,
    "ssb": None,
}
"""What may be written for an observer besides names: the body that it means, None for the barycentre."""


@dataclass(frozen=True)
class Observer:
    """An observer.

    body : the name of the body at whose centre, or on which, it is: one of the run, or of DE440; None for the
        barycentre of the Solar System
    site : its place on the Earth, or None
    station : code and name of the observatory there, or ""
    """

    body: str | None
    site: EarthLocation | None = None
    station: str = ""

    @property
    def on_earth(self) -> bool:
        """Whether apparent places refer to the equator of the Earth."""
        return self.body is not None and known(self.body) == EARTH

    @property
    def at_sun(self) -> bool:
        """Whether it is the Sun itself."""
        return self.body is not None and known(self.body) == SUN

    def __str__(self) -> str:
        if self.station:
            return self.station
        if self.site is not None:
            lon, lat, height = self.site.geodetic
            east, north = "EW"[int(lon.deg < 0.0)], "NS"[int(lat.deg < 0.0)]
            return f"{abs(lon.deg):.5f}° {east}, {abs(lat.deg):.5f}° {north}, {height.to_value('m'):.0f} m"
        if self.body is None:
            return "the barycentre of the Solar System"
        return "the geocentre" if self.on_earth else f"the centre of {self.body}"


def observer_of(given: Any, names: Sequence[str]) -> Observer:
    """Return the observer that is meant.

    given : an `EarthLocation`; the name of a body of the run or of DE440; "geocentre", "heliocentric", "barycentre"; or
        the code of an observatory, such as "568"
    names : of the bodies of the run
    Raises UnknownNameError, and InputError for anything else.
    """
    from astropy.coordinates import EarthLocation

    if isinstance(given, EarthLocation):
        if given.shape != () or not np.isfinite(given.itrs.cartesian.xyz.value).all():
            raise InputError(f"observer is {shown(given)}; expected a single, finite EarthLocation.")
        return Observer(EARTH, given)
    if not isinstance(given, str):
        raise InputError(
            f"observer is {shown(given)}; expected a name, such as 'Earth' or 'Mars', 'barycentre', the code of an "
            "observatory, such as '568', or a place on the Earth: "
            "astropy.coordinates.EarthLocation.from_geodetic(lon, lat, height)."
        )
    place = place_of(given, names)
    if place is not None:
        return Observer(names[place])
    word = given.strip().lower()
    if word in WORDS:
        body = WORDS[word]
        return Observer(body if body is None else next((name for name in names if known(name) == body), body))
    body = known(given)
    if body is not None:
        return Observer(body)
    station = stations().get(given.strip())
    if station is not None:
        return _at(station)
    raise UnknownNameError(
        f"there is no observer {shown(given)}; expected a body of the run or of DE440, such as 'Earth' or 'Mars', "
        "'barycentre', the MPC's code of an observatory, such as '568', or a place on the Earth: "
        "astropy.coordinates.EarthLocation.from_geodetic(lon, lat, height)."
    )


def _at(station: Station) -> Observer:
    """Return an observatory as an observer. Raises InputError for one in space, or that roves."""
    from astropy.coordinates import EarthLocation

    if station.x is None:
        raise InputError(
            f"the observatory {station} has no place on the Earth: it is in space or moves; expected another one, or a "
            "body of the run that moves as it does."
        )
    if not station.x.any():
        return Observer(EARTH, station=str(station))
    return Observer(EARTH, EarthLocation.from_geocentric(*station.x, unit="au"), str(station))


def known(name: str) -> str | None:
    """Return DE440's name of a body, or None if it has none."""
    try:
        return ephemeris.canonical_name(name)
    except UnknownNameError:
        return None
