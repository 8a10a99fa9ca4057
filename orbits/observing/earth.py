"""The orientation of the Earth: its equator of date, and the places of observers on its surface.

Precession and nutation are those of IAU 2006/2000A, the rotation and the motion of the pole those of the IERS, from the
tables that come with astropy. Nothing is downloaded. Beyond the tables the difference between dynamical time and the
rotation of the Earth is held, and a warning says what that may cost.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import erfa
import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.ephemeris import AU_KM
from orbits.finding import Finding

if TYPE_CHECKING:
    from astropy.coordinates import EarthLocation
    from astropy.time import Time

Array = NDArray[np.float64]

ROTATION = 7.292115146706979e-5 * 86400.0
"""Radians of the rotation of the Earth in a day of TT, about its pole (IAU 2000: 1.00273781191135448 turns of UT1)."""

MJD_ZERO = 2400000.5
DRIFT = 1.0
"""Seconds a year by which the rotation of the Earth may depart from what is held; it has not been faster since 1650."""

MOST_OFF = u.Quantity(1.0, u.arcsec)
"""By how much the precession may be off before a warning says so."""

KM_A_SECOND = 0.465
"""Kilometres by which the equator turns in a second."""


def equator_of_date(dates: Time) -> Array:
    """Return the matrices from the ICRF to the true equator and equinox of date, (m, 3, 3); dates in TDB. Warns of
    those at which the precession is off by more than an arcsecond.
    """
    if dates.size:
        _warn_of_precession(dates[np.argmax(np.abs(dates.jyear - 2000.0))])
    return np.asarray(erfa.pnm06a(dates.jd1, dates.jd2))  # TDB stands for TT, which is within 2 ms of it


def _warn_of_precession(farthest: Time) -> None:
    """Warn if the precession of IAU 2006, polynomials of the time, is far from that of Vondrák et al. (2011), which
    holds for 200,000 years.
    """
    long_term, used = erfa.ltpb(farthest.jyear), erfa.pmat06(farthest.jd1, farthest.jd2)
    off = u.Quantity(2.0 * np.arcsin(np.linalg.norm(long_term - used) / np.sqrt(8.0)), u.rad)
    if off > MOST_OFF:
        shown = off.to(u.arcsec if off < 2.0 * u.arcmin else u.arcmin if off < 2.0 * u.deg else u.deg)
        Finding(
            f"the precession of IAU 2006 holds for some thousand years about 2000; in the year {farthest.jyear:.0f} "
            f"that of Vondrak et al. (2011), for long spans, differs by {shown:.3g}: places of date, azimuth and "
            "elevation may be as far off. Right ascension and declination in the ICRF do not depend on it."
        ).warn()


class Site(NamedTuple):
    """A place on the Earth at m times.

    q, v : (m, 3), relative to the geocentre, in the axes of the ICRF, au and au/d
    horizon : (m, 3, 3), rows towards north, east and the zenith
    """

    q: Array
    v: Array
    horizon: Array


class Turning(NamedTuple):
    """How the Earth is turned at m times.

    matrix : from the axes of the ICRF to those of the Earth, (m, 3, 3)
    axis : that of the rotation, in the axes of the Earth, (m, 3)
    """

    matrix: Array
    axis: Array

    def carries(self, x: Array) -> tuple[Array, Array]:
        """Return where places on the Earth, (3,) or (m, 3) in its axes, are in those of the ICRF, and how they move by
        its rotation, per day of TT.
        """
        back = np.swapaxes(self.matrix, -1, -2)
        spin = ROTATION * np.cross(self.axis, x)
        return (back @ x[..., None])[..., 0], np.einsum("mij,mj->mi", back, spin)


def turning(dates: Time) -> Turning:
    """Return how the Earth is turned; dates in TDB. Warns of times beyond the IERS's tables."""
    return turned_by(dates, *rotation(dates))


def turned_by(dates: Time, ut1: tuple[Array, Array], pole: tuple[Array, Array]) -> Turning:
    """Return how the Earth is turned; dates in TDB; ut1, pole : as of `rotation`."""
    # From the axes of the ICRF to those of the Earth; offsets of the pole of date, 0.3 mas, are 1 cm at the equator.
    turned = erfa.c2t06a(dates.jd1, dates.jd2, *ut1, *pole)
    # The axis of rotation is the pole of date, which is 15 m from that of the Earth's own axes.
    return Turning(turned, np.stack([pole[0], -pole[1], np.ones_like(pole[0])], axis=1))


def site_at(site: EarthLocation, dates: Time) -> Site:
    """Return where a place on the Earth is, and its horizon; dates in TDB. Warns of times beyond the IERS's tables."""
    turned = turning(dates)
    q, v = turned.carries(np.array([c.to_value(u.km) for c in site.geocentric]) / AU_KM)
    lon, lat = site.lon.rad, site.lat.rad
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    return Site(q, v, np.array([north, east, up]) @ turned.matrix)


def rotation(dates: Time) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return UT1 as Julian dates in two parts, and the coordinates of the pole in radians, (m,) each."""
    days = dates.jd - MJD_ZERO
    pieces = tables()
    first, last = pieces[0].first, pieces[-1].last
    ut1, pole = (np.empty((2, len(days))) for _ in range(2))
    for piece in pieces:
        rows = np.flatnonzero((days >= piece.first) & (days <= piece.last))
        if len(rows):
            utc = dates[rows].utc
            ut1[:, rows] = erfa.utcut1(utc.jd1, utc.jd2, piece.table.ut1_utc(utc).to_value(u.s))
            pole[:, rows] = [x.to_value(u.rad) for x in piece.table.pm_xy(utc)]
    for piece, end, rows in ((pieces[0], first, days < first), (pieces[-1], last, days > last)):
        if rows.any():
            ut1[0, rows] = dates.jd1[rows]
            ut1[1, rows] = dates.jd2[rows] - held(piece.table, end) / 86400.0
            pole[:, rows] = 0.0  # it is within 0.6 arcseconds of this, 20 m
    outside = np.maximum(first - days, days - last)
    if len(outside) and outside.max() > 0.0:
        _warn(first, last, float(outside.max()) / 365.25)
    return (ut1[0], ut1[1]), (pole[0], pole[1])


def _warn(first: float, last: float, years: float) -> None:
    from astropy.time import Time

    begin, end = (Time(day, format="mjd").iso[:10] for day in (first, last))
    seconds = max(DRIFT * years, 0.01)
    Finding(
        f"the rotation of the Earth is known from {begin} to {end}; beyond that TT - UT1 is held at its last value, so "
        f"that a place on the Earth may be up to {seconds:.2g} s of rotation, {seconds * KM_A_SECOND:.2g} km, off; "
        "right ascension and declination of the geocentre do not depend on it. A newer astropy-iers-data has later "
        "tables."
    ).warn()


class Piece(NamedTuple):
    """One table of the IERS, and the days that it serves, MJD."""

    table: Any
    first: float
    last: float


@cache
def tables() -> tuple[Piece, ...]:
    """Return the tables that come with astropy: final values from 1962 on, then predictions for a year."""
    import astropy_iers_data
    from astropy.utils import iers

    final = iers.IERS_B.read(astropy_iers_data.IERS_B_FILE)
    rapid = iers.IERS_A.read(astropy_iers_data.IERS_A_FILE)
    begin, middle, end = (float(u.Quantity(day).value) for day in (final["MJD"][0], final["MJD"][-1], rapid["MJD"][-1]))
    # A day less at both ends, as tables are of UTC.
    return Piece(final, begin + 1.0, middle - 1.0), Piece(rapid, middle - 1.0, end - 1.0)


def held(table: Any, day: float) -> float:
    """Return TT - UT1 at a day, MJD, in seconds."""
    from astropy.time import Time

    moment = Time(day, format="mjd", scale="utc")
    ut1 = erfa.utcut1(moment.jd1, moment.jd2, float(table.ut1_utc(moment).to_value(u.s)))
    tt = moment.tt
    return float((tt.jd1 - ut1[0]) + (tt.jd2 - ut1[1])) * 86400.0
