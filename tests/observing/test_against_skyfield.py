"""Places of the planets beside those of Skyfield, another implementation (after NOVAS), from the same DE440."""

from __future__ import annotations

from typing import Any

import pytest
from astropy import units as u

from orbits.resources import data_path
from tests.observing.skies import ALL, PACHON, begun, mas

NUMBERS = dict(zip(ALL, (10, 1, 2, 399, 301, 4, 5, 6, 7, 8, 9), strict=True))


@pytest.fixture(scope="module")
def planets() -> Any:
    jpllib = pytest.importorskip("skyfield.jpllib", reason="Skyfield is not installed")
    kernel = jpllib.SpiceKernel(str(data_path("de440_2000_2030.bsp")))
    yield kernel
    kernel.close()


def moment(run: Any) -> Any:
    from skyfield.api import load

    epoch = run.system.epoch
    return load.timescale(builtin=True).tdb_jd(epoch.jd1, epoch.jd2)


def seen_by_skyfield(run: Any, observer: Any, target: Any) -> tuple[Any, Any]:
    astrometric = observer.at(moment(run)).observe(target)
    return astrometric, astrometric.apparent(deflectors=(10,))


@pytest.mark.parametrize("epoch", ["2003-08-27 09:52", "2026-11-22", "2029-04-13 21:46"])
def test_from_the_geocentre_all_bodies_are_where_skyfield_sees_them(planets, epoch):
    run = begun(epoch)
    table = run.ephemeris(times=0.0)
    for name in table.names:
        body, (there, apparent) = table[name], seen_by_skyfield(run, planets[399], planets[NUMBERS[name]])
        ra, dec, distance = there.radec()
        # Reached: 6e-5 mas by the Moon, whose light left it before the run, and 1e-6 mas by all others; 1 mm.
        assert max(mas(body.ra, ra.radians * u.rad), mas(body.dec, dec.radians * u.rad)) < 1e-4, name
        assert abs(body.distance - distance.km * u.km).max() < 5 * u.mm, name
        assert abs(body.light_time - there.light_time * u.day).max() < 20 * u.ps, name
        # Reached: 0.006 mas, by nutation, which Skyfield adds up in fewer terms of time.
        ra, dec, _ = apparent.radec("date")
        places = mas(body.apparent_ra, ra.radians * u.rad), mas(body.apparent_dec, dec.radians * u.rad)
        assert max(places) < 0.01, name
        if name != "Sun":
            # Reached: 27 mas: Skyfield's Sun is where it was when the light left the body, not before.
            assert mas(body.phase, there.phase_angle(planets[10]).radians * u.rad) < 40, name


def test_from_a_place_on_the_earth_planets_are_where_skyfield_sees_them(planets):
    from skyfield.api import wgs84

    run = begun("2018-07-27 20:00")
    lon, lat, height = PACHON.geodetic
    site = planets[399] + wgs84.latlon(lat.deg, lon.deg, elevation_m=height.to_value(u.m))
    table = run.ephemeris(["Venus", "Mars", "Saturn"], observer=PACHON, times=0.0)
    for name in table.names:
        body, (there, apparent) = table[name], seen_by_skyfield(run, site, planets[NUMBERS[name]])
        ra, dec, _ = there.radec()
        # Reached: 0.03 mas by Mars, 0.4 au away: Skyfield leaves out the motion of the pole, 10 m.
        assert max(mas(body.ra, ra.radians * u.rad), mas(body.dec, dec.radians * u.rad)) < 0.05, name
        # Reached: 0.3 mas: Skyfield's light is bent by the Earth too.
        ra, dec, _ = apparent.radec("date")
        assert max(mas(body.apparent_ra, ra.radians * u.rad), mas(body.apparent_dec, dec.radians * u.rad)) < 0.5, name


def test_from_another_planet_apparent_places_are_those_of_skyfield_in_the_icrf(planets):
    run = begun("2026-11-22")
    table = run.ephemeris(["Earth", "Venus", "Jupiter"], observer="Mars", times=0.0)
    for name in table.names:
        body, (_, apparent) = table[name], seen_by_skyfield(run, planets[4], planets[NUMBERS[name]])
        ra, dec, _ = apparent.radec()
        # Reached: 0.0004 mas, the Sun's potential in aberration.
        assert max(mas(body.apparent_ra, ra.radians * u.rad), mas(body.apparent_dec, dec.radians * u.rad)) < 1e-3, name
