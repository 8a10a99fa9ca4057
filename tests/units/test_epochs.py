"""Epochs: what is taken for a moment, and in which scale."""

from __future__ import annotations

import datetime
import math
from typing import Any

import pytest
from astropy.time import Time

from orbits.errors import EpochError
from orbits.units import as_epoch


@pytest.mark.parametrize(
    ("given", "mjd"),
    [
        ("2022-08-09", 59800.0),
        ("2022-08-09 12:00", 59800.5),
        (" J2000 ", 51544.5),
        ("J2000.0", 51544.5),
        ("J2010.0", 55197.0),  # ten Julian years of 365.25 d
        (2459800.5, 59800.0),
        (2451545, 51544.5),
        (Time(59800.25, format="mjd", scale="tdb"), 59800.25),
    ],
)
def test_a_moment_without_a_scale_is_tdb(given: Any, mjd: float) -> None:
    epoch = as_epoch(given)
    assert epoch.scale == "tdb"
    assert epoch.mjd == mjd


def test_a_time_in_utc_is_converted() -> None:
    # TDB - UTC was 32.184 + 37 leap seconds in 2022, and TDB - TT stays below 2 ms.
    epoch = as_epoch(Time("2022-08-09", scale="utc"))
    assert (epoch.mjd - 59800.0) * 86400 == pytest.approx(69.184, abs=2e-3)


def test_two_part_dates_keep_their_digits() -> None:
    epoch = as_epoch(Time(2459800.5, 1e-12, format="jd", scale="tdb"))
    # jd2 lies within half a day of zero, so it resolves 2^-54 d.
    assert (epoch.jd1 - 2459800.5) + epoch.jd2 == pytest.approx(1e-12, abs=2.0**-54)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (None, "a NoneType"),
        (True, "a bool"),
        ("yesterday", "'yesterday'; expected a time"),
        ("2000-13-01", "'2000-13-01'; expected a time"),
        ("", "''; expected a time"),
        ("2000-01-01T00:00:00Z", "texts are TDB; for UTC give astropy's Time"),
        ("2000-01-01 UTC", "texts are TDB; for UTC give astropy's Time"),
        (math.nan, "nan; expected a time"),
        (math.inf, "inf; expected a time"),
        (1e300, "after AD 9999"),
        (59800, "too small: a modified Julian date is written"),
        (2022, "too small"),
        ([2451545.0, 2451546.0], "a list"),
        (Time(["2000-01-01", "2000-01-02"]), "2 times"),
        (datetime.datetime(2000, 1, 1), "a datetime"),
    ],
)
def test_what_is_no_moment_is_refused(given: Any, message: str) -> None:
    with pytest.raises(EpochError, match=message):
        as_epoch(given)
