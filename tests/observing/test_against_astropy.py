"""Places of planets and of observers on the Earth beside those of astropy, from the same DE440."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u
from astropy.coordinates import TETE, AltAz, get_body, solar_system_ephemeris
from astropy.time import Time
from astropy.utils import iers

from orbits.observing.earth import site_at
from orbits.resources import data_path
from tests.observing.skies import PACHON, begun, mas

EPOCH = "2020-01-01 15:00"


@pytest.mark.parametrize("observer", ["Earth", PACHON], ids=["geocentre", "Pachon"])
def test_places_refer_to_the_equator_and_equinox_of_date_and_to_the_horizon(observer):
    run, site = begun(EPOCH), None if isinstance(observer, str) else observer
    date = run.system.epoch
    table = run.ephemeris(["Venus", "Mars", "Jupiter"], observer=observer, times=0.0)
    with iers.conf.set_temp("auto_download", False), solar_system_ephemeris.set(str(data_path("de440_2000_2030.bsp"))):
        for name in table.names:
            there, body = get_body(name.lower(), date, site), table[name]
            of_date = there.transform_to(TETE(obstime=date, location=site))
            # Reached: 0.005 mas by Venus, whose light astropy bends as that of a star.
            assert max(mas(body.apparent_ra, of_date.ra), mas(body.apparent_dec, of_date.dec)) < 0.01, name
            if site is not None:
                horizontal = there.transform_to(AltAz(obstime=date, location=site))
                # Reached: 0.9 mas, as astropy goes back to a place without aberration, and forth.
                assert mas(body.azimuth, horizontal.az) * np.cos(horizontal.alt.rad) < 2, name
                assert mas(body.elevation, horizontal.alt) < 2, name
                # Its places are directions: with a distance, astropy has them from the barycentre, and was 15 degrees
                # off. Reached: 18 mas by Jupiter beside the Sun, as it bends light as that of a star.
                star = body.skycoord().transform_to(AltAz(obstime=date, location=site))
                assert mas(body.azimuth, star.az) * np.cos(star.alt.rad) < 50, name
                assert mas(body.elevation, star.alt) < 50, name
    assert (table.azimuth is None) == (site is None)


def test_a_place_on_the_earth_turns_as_that_of_astropy():
    dates = Time(["1965-05-01", "1990-01-01 03:00", "2016-12-31 23:30", "2026-06-01 17:00"], scale="tdb")
    found = site_at(PACHON, dates)
    with iers.conf.set_temp("auto_download", False):
        # The default tables begin in 1973.
        q, v = PACHON.get_gcrs_posvel(dates[1:])
    # Reached: 2e-5 mm, and 0.5 mm/s, by the length of the day.
    assert abs(u.Quantity(found.q.T[:, 1:], u.au) - q.xyz).max() < 1e-4 * u.mm
    assert abs(u.Quantity(found.v.T[:, 1:], u.au / u.day) - v.xyz).max() < 1 * u.mm / u.s
    assert abs(np.linalg.norm(found.q[0]) * u.au - np.linalg.norm(q.xyz[:, 0])) < 1 * u.mm
