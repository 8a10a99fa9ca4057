"""Observatories by the codes of the Minor Planet Center."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u
from astropy.coordinates import EarthLocation

from orbits.observing.observers import observer_of
from orbits.observing.stations import stations
from orbits.resources import data_path
from tests.observing.skies import begun, mas

from ..coverings import each


def test_the_table_has_every_line_of_the_file():
    lines = data_path("mpc_observatories.txt").read_text(encoding="utf-8").splitlines()[1:]
    table = stations()
    assert len(table) == len(lines) == 2712
    assert sum(station.x is None for station in table.values()) == 26
    # Nothing on the ground is further than 1 % from the surface, so that no column is read amiss.
    far = [np.linalg.norm(s.x) * u.au / (6378.137 * u.km) for s in table.values() if s.x is not None and s.x.any()]
    assert 0.996 < min(far) < max(far).to_value(u.one) < 1.002


@each(
    ("code", "lon", "lat", "height"),
    [
        # Published geodetic places, in degrees and metres: Cerro Pachon (LSST's survey) and Palomar (Hale telescope).
        ("X05", -70.74942, -30.24464, 2663.0),
        ("675", -116.86490, 33.35635, 1706.0),
        ("950", -17.88167, 28.75833, 2326.0),
    ],
)
def test_codes_are_where_the_observatories_are(code, lon, lat, height):
    site = observer_of(code, ()).site
    assert site is not None
    there = EarthLocation.from_geodetic(lon * u.deg, lat * u.deg, height * u.m)
    apart = np.linalg.norm([(a - b).to_value(u.m) for a, b in zip(site.geocentric, there.geocentric, strict=True)])
    assert apart < 600.0  # an observatory is several hundred metres across, and the codes are of one telescope


def test_a_code_sees_what_its_place_sees_in_skyfield():
    """The parallax constants alone, turned by Skyfield, which has a rotation of the Earth of its own."""
    api = pytest.importorskip("skyfield.api", reason="Skyfield is not installed")
    from skyfield.framelib import itrs
    from skyfield.jpllib import SpiceKernel

    run = begun("2018-07-27 20:00")
    seen = run.ephemeris("Mars", observer="568", times=0.0)
    epoch = run.system.epoch
    timescale = api.load.timescale(builtin=True)
    moment = timescale.tdb_jd(epoch.jd1, epoch.jd2)
    # Maunakea in the MPC's list.
    turn, radius = np.deg2rad(204.5278), 6378.137
    x = radius * np.array([0.94171 * np.cos(turn), 0.94171 * np.sin(turn), 0.33725])
    kernel = SpiceKernel(str(data_path("de440_2000_2030.bsp")))
    here, delay = kernel[399].at(moment).position.km + itrs.rotation_at(moment).T @ x, 0.0
    for _ in range(4):
        way = kernel[4].at(timescale.tdb_jd(epoch.jd1, epoch.jd2 - delay / 86400)).position.km - here
        delay = float(np.linalg.norm(way)) / 299792.458
    kernel.close()
    dec = np.arcsin(way[2] / np.linalg.norm(way)) * u.rad
    ra = np.arctan2(way[1], way[0]) * u.rad
    assert seen.head.observer == "568 Maunakea"
    # Reached: 0.03 mas: Skyfield leaves out the motion of the pole, 10 m.
    assert max(mas(seen.ra, ra), mas(seen.dec, dec)) < 0.06
    geocentre = run.ephemeris("Mars", observer="500", times=0.0)
    assert mas(geocentre.ra, run.ephemeris("Mars", times=0.0).ra) == 0.0
    assert mas(geocentre.dec, seen.dec) > 300.0
