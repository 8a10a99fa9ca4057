"""Times by the clocks of observers, UTC, or UT before there was one: in TDB, and how the Earth is turned then."""

from __future__ import annotations

import numpy as np
from astropy.time import Time
from numpy.typing import NDArray

from orbits.observing import earth

Array = NDArray[np.float64]

UTC_BEGINS = 2436934.5
"""1960-01-01. Earlier times are UT, in which observers had their clocks."""

FIRST_YEAR, STEP = 1890, 5
TT_LESS_UT = (
    *(-5.87, -6.47, -2.72, 3.86, 10.46, 17.20, 21.16, 23.62),
    *(24.02, 23.93, 24.33, 26.77, 29.15, 31.07, 33.15),
)
"""Seconds at the beginnings of the years 1890, 1895, ... 1960. Source: The Astronomical Almanac, section K."""


def dynamical(jd: Array, part: Array) -> Time:
    """Return the times of observations, Julian dates of UTC in two parts, in TDB.

    Before 1960 they are UT, with TT - UT from a table for every five years, which is within a second; before 1890 it is
    held, 10 s off by 1800.
    """
    early = jd + part < UTC_BEGINS
    out = np.array(part, dtype=np.float64)
    later = Time(jd[~early], _of_its_day(jd[~early], part[~early]), format="jd", scale="utc").tdb
    years = FIRST_YEAR + STEP * np.arange(len(TT_LESS_UT))
    year = 2000.0 + (jd[early] + part[early] - 2451544.5) / 365.25
    first = np.array(jd, dtype=np.float64)
    first[~early], out[~early] = later.jd1, later.jd2
    # TDB is within 2 ms of TT.
    out[early] += np.interp(year, years, TT_LESS_UT) / 86400.0
    return Time(first, out, format="jd", scale="tdb")


def _of_its_day(jd: Array, part: Array) -> Array:
    """Return which part of a day of UTC, from its midnight jd, is a part of 86,400 seconds: astropy divides days, of
    which those with a leap second are longer.
    """
    first, last = (Time(jd + day, format="jd", scale="utc").tai for day in (0.0, 1.0))
    leap = np.round(((last.jd1 - first.jd1 - 1.0) + (last.jd2 - first.jd2)) * 86400.0, 2)  # before 1972 also of 0.1 s
    return np.asarray(part * 86400.0 / (86400.0 + leap))


def carried(x: Array, times: Time, jd: Array, part: Array) -> Array:
    """Return where places in the axes of the Earth are in those of the ICRF, (m, 3).

    times : in TDB; jd, part : by the clocks, by which the Earth is turned before the tables of the IERS begin: they had
        UT, within 0.1 s
    """
    out = np.empty_like(x)
    early = times.jd - earth.MJD_ZERO < earth.tables()[0].first
    if early.any():
        pole = np.zeros(early.sum())  # it is within 0.6 arcseconds of this, 20 m
        out[early], _ = earth.turned_by(times[early], (jd[early], part[early]), (pole, pole)).carries(x[early])
    if not early.all():
        out[~early], _ = earth.turning(times[~early]).carries(x[~early])
    return out
