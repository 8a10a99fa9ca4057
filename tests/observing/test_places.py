"""What `run.ephemeris` says, whatever the bodies, the origin and the steps of the run."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import OrbitsWarning
from orbits.events import Collision, Merge
from orbits.observing import earth
from orbits.observing.brightness import magnitude
from tests.observing.skies import ALL, PACHON, C, begun, mas

EPOCH = "2026-11-22"


@pytest.fixture(scope="module")
def run() -> orbits.Trajectory:
    """Two days of all bodies."""
    return orbits.propagate(orbits.System.solar_system(EPOCH, bodies=ALL), duration=2 * u.day, samples=5, dense=True)


def places_apart(one: orbits.observing.Ephemeris, other: orbits.observing.Ephemeris) -> float:
    return max(mas(getattr(one, x), getattr(other, x)) for x in ("ra", "dec", "apparent_ra", "apparent_dec"))


@pytest.mark.parametrize(
    "bodies",
    [
        ("Sun", "Jupiter"),
        ("Sun", "Earth", "Moon", "Jupiter"),
        ("Sun", "Earth-Moon barycenter", "Jupiter"),
        ("Jupiter",),
    ],
    ids=["no Earth", "Earth and Moon", "their barycentre", "no Sun"],
)
def test_places_do_not_depend_on_what_else_is_in_the_run_nor_on_its_origin(bodies):
    """Without the placing by DE440, 4 mas would be missing in the light time of the first, at 13 m/s."""
    true = begun(EPOCH).ephemeris("Jupiter", times=0.0)
    seen = begun(EPOCH, bodies, "barycentre").ephemeris("Jupiter", times=0.0)
    # Reached: 1e-5 mas; 0.03 without the Sun, whose pull on Jupiter is missing for the 45 minutes of the light.
    alone = len(bodies) == 1
    assert places_apart(seen, true) < (0.05 if alone else 3e-5)
    for column in ("distance", "sun_distance"):
        assert abs(getattr(seen, column) - getattr(true, column)).max() < (1 * u.km if alone else 5 * u.m)


def test_light_left_the_body_one_light_time_before(run):
    times = [0.5, 1.7] * u.day
    seen, epoch = run.ephemeris("Mars", times=times), run.system.epoch
    there = run.at(epoch + times - seen.light_time)["Mars"].q - run.at(epoch + times)["Earth"].q
    distance = np.linalg.norm(there, axis=1)
    assert abs(distance - seen.distance).max() < 1 * u.mm * 200  # the frame of the run moves by 4 cm in 10 minutes
    assert abs(seen.light_time * C - seen.distance).max() < 1 * u.mm
    assert mas(np.arcsin(there[:, 2] / distance), seen.dec) < 1e-3
    direction = seen.skycoord().cartesian.xyz.T
    assert abs(direction * seen.distance[:, None] - there).max() < 200 * u.mm


ORDER_8 = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Weights of central differences of order 8."""


@pytest.mark.parametrize(
    ("observer", "step", "sky", "speed"),
    [
        # Reached: 3e-10 arcseconds an hour and 2e-8 m/s, which is rounding in the columns.
        ("Earth", 0.05, 2e-9, 1e-7),
        ("Mars", 0.05, 2e-9, 1e-7),
        ("barycentre", 0.05, 2e-9, 1e-7),
        # The precession of the equator, 2e-5 m/s, is not in the velocity of a place; the Moon is near.
        (PACHON, 0.01, 2e-4, 5e-5),
    ],
    ids=["Earth", "Mars", "barycentre", "a place"],
)
def test_rates_are_those_of_the_columns(run, observer, step, sky, speed):
    """Light leaves later while the distance grows; without this they are v/c off: 0.009 arcseconds an hour, 1 m/s."""
    seen = run.ephemeris(["Venus", "Moon", "Jupiter"], observer, (1.0 + step * np.arange(-4, 5)) * u.day)

    def rate(column: str) -> u.Quantity:
        return (ORDER_8[:, None] * getattr(seen, column)).sum(axis=0) / (step * u.day)

    ra, dec = rate("ra") * np.cos(seen.dec[4]), rate("dec")
    off = np.hypot(ra - seen.ra_rate[4], dec - seen.dec_rate[4])
    assert off.max() < sky * u.arcsec / u.hour
    assert abs(rate("distance") - seen.distance_rate[4]).max() < speed * u.m / u.s
    assert abs(rate("light_time") * C - seen.distance_rate[4]).max() < speed * u.m / u.s
    # In the time of the body; the Sun is taken to move straight while the light is under way: 1.2e-3 m/s at Jupiter.
    of_body = rate("sun_distance") / (1.0 - (seen.distance_rate[4] / C).to_value(u.one))
    assert abs(of_body - seen.sun_range_rate[4]).max() < 2e-3 * u.m / u.s


@pytest.mark.parametrize("method", [{}, {"integrator": "wisdom-holman", "dt": 1 * u.day}, {"dt": 2.5 * u.day}])
def test_light_may_have_left_before_the_run(method):
    """At the start of a run, and at the end of one backwards, as in the midst of one."""
    bodies = ("Sun", "Mercury", "Venus", "Earth-Moon barycenter", "Jupiter", "Neptune")
    long = orbits.propagate(orbits.System.solar_system("2026-11-20", bodies=bodies), duration=10 * u.day, **method)
    middle = long.at("2026-11-25")
    date = Time("2026-11-25", scale="tdb")
    seen = [orbits.propagate(middle, duration=x * u.day, **method).ephemeris(times=date) for x in (3, -3)]
    back = orbits.propagate(long.at("2026-11-28"), until="2026-11-25", **method).ephemeris(times=date)
    for each in (*seen, back):
        # Reached: 1.1e-3 mas by the barycentre of Earth and Moon, 4,700 km away, which is 26 micrometres: the last
        # digit of its distance from the Sun.
        assert places_apart(each, long.ephemeris(times=date)) < 2e-3


def test_venus_trails_the_sun_in_the_evening_and_leads_it_in_the_morning():
    """Greatest elongations of 2020: 46.1 degrees east on 24 March, 45.8 degrees west on 13 August."""
    for day, angle, side in (("2020-03-24 22:00", 46.1, 1), ("2020-08-13 00:00", 45.8, -1)):
        seen = begun(day).ephemeris("Venus", times=0.0)
        assert round(seen.elongation.value[0], 1) == angle
        assert seen.trails[0] == side
        assert abs(seen.phase - seen.sto).max() < 40 * u.arcsec


def test_from_the_sun_there_are_no_elongations_and_distances_are_heliocentric(run):
    seen = run.ephemeris("Mars", observer="heliocentric", times=1 * u.day)
    assert seen.elongation is None
    assert abs(seen.distance - seen.sun_distance).max() < 10 * u.km  # the Sun moves while its light is under way
    assert run.ephemeris(["Mars"], observer="barycentre").distance.shape == (5, 1)
    assert not np.isfinite(run.ephemeris("Sun").sun_distance or np.nan)


def test_a_planet_with_its_moons_is_placed_by_their_barycentre():
    gm = [869.3, 106.1] * u.km**3 / u.s**2
    q, v = [[0, 0, 0], [19_596, 0, 0]] * u.km, [[0, 0, 0], [0, 0.222, 0]] * u.km / u.s
    pair = orbits.System(["Pluto", "Charon"], gm, q, v, epoch=EPOCH)
    both = orbits.propagate(pair, duration=1 * u.min, samples=2).ephemeris(times=0.0)
    share = np.average(both.dec[0].value, weights=gm.value) * u.deg
    # Reached: 0.0001 mas. Pluto is 2,100 km from the barycentre: 24 mas in declination.
    assert mas(share, begun(EPOCH).ephemeris("Pluto", times=0.0).dec) < 1e-3
    assert both.head.notes[0].endswith("by its barycentre, as Pluto with its moons, and that of DE440")


def test_a_body_of_de440_that_the_run_has_not_can_be_the_observer():
    small = begun(EPOCH, ("Sun", "Jupiter"), "ssb").ephemeris("Jupiter", observer="Mars", times=0.0)
    assert places_apart(small, begun(EPOCH).ephemeris("Jupiter", observer="Mars", times=0.0)) < 3e-5
    assert any("Mars is that of DE440" in note for note in small.head.notes)


def test_beyond_de440_the_origin_is_taken_as_the_barycentre(run):
    system = run.system.replaced(epoch="4026-11-22")
    far = orbits.propagate(system, duration=1 * u.day, samples=2).ephemeris("Mars", times=0.0)
    assert mas(far.ra, run.ephemeris("Mars", times=0.0).ra) < 0.01
    assert far.head.notes[0] == "the origin of the run is taken as the barycentre of the Solar System"


def test_bodies_that_merged_are_not_seen_any_more():
    system = orbits.System.solar_system(EPOCH, bodies=["Sun", "Earth", "Moon"])
    q, v = [30_000, 0, 0] * u.km, [-8, 0, 0] * u.km / u.s
    system = system.add("rock", primary="Earth", q=q, v=v, gm=1e-20).replaced(radii=[695_700, 6378, 1737, 1] * u.km)
    run = orbits.propagate(system, duration=4 * u.hour, samples=5, events=Collision(then=Merge()))
    seen = run.ephemeris(["rock", "Moon"])
    assert np.isfinite(seen["rock"].ra).tolist() == [True, False, False, False, False]
    assert np.isfinite(seen["Moon"].ra).all()


# ----------------------------------------------------------------------------------------------------------- brightness


def test_a_body_in_opposition_at_one_au_from_both_has_its_absolute_magnitude():
    assert magnitude(12.5, 0.15, np.array([1.0]), np.array([1.0]), np.array([0.0]))[0] == 12.5


def test_magnitudes_come_from_the_catalogue_for_asteroids_alone():
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Earth", "Moon", "Jupiter"])
    system = system.add_particles(orbits.asteroids(names=["Ceres", "Astraea"]))
    moon = {"q": [671_000, 0, 0] * u.km, "v": [0, 13.7, 0] * u.km / u.s, "gm": 3202.7 * u.km**3 / u.s**2}
    run = orbits.propagate(system.add("Europa", primary="Jupiter", **moon), duration=1 * u.min, samples=2)
    seen = run.ephemeris(times=0.0)
    assert np.isnan(seen["Europa"].V[0])  # 52 Europa is an asteroid
    assert seen.head.notes[-2:] == ("V of Ceres: H = 3.33, G = 0.12", "V of Astraea: H = 7.01, G = 0.15")
    ceres = run.ephemeris("Ceres", times=0.0, H=orbits.asteroids(names="Ceres"))
    given = run.ephemeris(times=0.0, H={"ceres": 3.33, "Europa": 5.0}, G={"Ceres": 0.12, "europa": 0.5})
    assert ceres.V[0] == given["Ceres"].V[0] == seen["Ceres"].V[0]
    assert np.isfinite(given["Europa"].V[0])


# ---------------------------------------------------------------------------------------------------- times and tables


def test_times_are_tdb_unless_they_say_otherwise_and_utc_is_shown_as_given(run):
    tdb = run.ephemeris("Mars", times=["2026-11-22 00:01:09.184", "2026-11-23"])
    utc = run.ephemeris("Mars", times=Time(["2026-11-22 00:00:00"]))
    assert abs(utc.ra[0] - tdb.ra[0]) < 0.05 * u.mas  # TDB and TT are up to 1.7 ms apart
    assert (utc.date.scale, tdb.date.scale) == ("utc", "tdb")
    assert utc.date.isot[0] == "2026-11-22T00:00:00.000"
    assert str(utc).splitlines()[1].startswith("date (UTC) ")
    assert "2026-11-22 00:01:09.184" in str(tdb)


@pytest.mark.parametrize("year", [-5000.0, 12000.0])
def test_places_are_told_in_julian_years_outside_those_of_calendars(year):
    """`ErfaError: unacceptable date`. From a Sun at the origin, potentials were infinite, and apparent places NaN."""
    epoch = Time(year, format="jyear", scale="tdb")
    system = orbits.System(["Sun", "p"], [1e-3, 0], [[0, 0, 0], [1.5, 0, 0]], [[0, 0, 0], [0, 0.02, 0]], epoch=epoch)
    seen = orbits.propagate(system, duration=1.0, samples=2, progress=False).ephemeris("p", observer="ssb")
    assert f"J{year:.6f}  " in str(seen)
    assert seen.date.jyear[0] == year
    np.testing.assert_allclose(seen.apparent_ra[1], seen.ra[1], rtol=1e-12)


def test_tables_have_a_row_for_each_time_and_body_with_units(run):
    seen = run.ephemeris(["Mars", "Sun"], observer=PACHON)
    table, frame, data = seen.to_table(), seen.to_pandas(), seen.to_xarray()
    assert table.colnames[:5] == ["date", "time", "body", "ra", "dec"]
    assert (len(table), len(frame), data.ra.shape) == (10, 10, (5, 2))
    assert {key: table[key].unit for key in ("azimuth", "range_rate", "light_time", "ra_rate")} == {
        "azimuth": u.deg,
        "range_rate": u.km / u.s,
        "light_time": u.min,
        "ra_rate": u.arcsec / u.hour,
    }
    assert table["ra"][2:4].value.tolist() == seen.ra[1].value.tolist() == data.ra.values[1].tolist()
    assert frame.attrs["units"]["distance"] == "AU"
    assert table.meta["observer"] == "70.73660° W, 30.24070° S, 2663 m"
    assert seen.to_table("Mars")["body"].tolist() == ["Mars"] * 5
    assert np.array_equal(run.ephemeris("Mars", observer=PACHON).ra, seen["mars"].ra)
    copied = pickle.loads(pickle.dumps(seen))
    assert np.array_equal(copied.elongation, seen.elongation)
    assert "Mars, Sun as seen from 70.73660° W" in seen._repr_html_()
    none = run.ephemeris("Mars", times=[])
    assert len(none) == len(none.to_table()) == len(none.to_pandas()) == 0
    assert str(none).startswith("Mars as seen from the geocentre; 0 times")


def test_text_has_all_rows_under_what_was_assumed_and_prints_the_first(run):
    seen = run.ephemeris(["Mars", "Sun"], times=np.linspace(0, 2, 30))
    text = seen.text().splitlines()
    assert text[0].startswith("Mars, Sun as seen from the geocentre; 30 times; Gauss(stages=8)")
    assert text[1] == "the run is placed in the Solar System by its Sun and that of DE440"
    assert sum(line.startswith("2026-11-2") for line in text) == 60
    assert str(seen).endswith("... and 40 more")
    assert "delta [au]" in str(seen)


def test_right_ascensions_and_declinations_round_to_whole_seconds_and_degrees():
    from orbits.observing.table import sexagesimal

    assert sexagesimal(359.9999999999, -0.0000000001) == "00 00 00.000 -00 00 00.00"
    assert sexagesimal(188.70279819, 9.09829107) == "12 34 48.672 +09 05 53.85"
    assert sexagesimal(1.0, -9.9999999) == "00 04 00.000 -10 00 00.00"


# ------------------------------------------------------------------------------------------ the rotation of the Earth


@pytest.mark.parametrize("end", ["first", "last"])
def test_beyond_the_tables_the_rotation_of_the_earth_is_held_and_a_warning_says_so(end):
    pieces = earth.tables()
    day = pieces[0].first if end == "first" else pieces[-1].last
    sign = -1 if end == "first" else 1
    inside, outside, far = (Time(day + sign * x, format="mjd", scale="tdb") for x in (-1e-6, 1e-6, 730.5))
    near = earth.site_at(PACHON, inside[None])
    with pytest.warns(OrbitsWarning, match=r"up to 0.01 s of rotation, 0.0047 km"):
        held = earth.site_at(PACHON, outside[None])
    # The Earth turns by 7 cm in these 0.17 s; where the pole is not known it is up to 20 m elsewhere.
    assert np.linalg.norm(held.q - near.q) * u.au < 100 * u.m
    with pytest.warns(OrbitsWarning, match=r"up to 2 s of rotation, 0.93 km, off; right ascension"):
        earth.site_at(PACHON, far[None])


@pytest.mark.parametrize(("year", "off"), [(-4000.0, "40.6 arcsec"), (12000.0, "11.8 arcmin"), (50000.0, "107 deg")])
def test_where_the_precession_does_not_hold_a_warning_says_by_how_much(year, off):
    """By that of Vondrák et al. (2011), for long spans; from the year -600 to 4200 it holds to an arcsecond."""
    with pytest.warns(OrbitsWarning, match=f"in the year {year:.0f} .* differs by {off}: places of date"):
        earth.equator_of_date(Time([2000.0, year], format="jyear", scale="tdb"))


def test_where_the_precession_holds_nothing_is_said(recwarn):
    earth.equator_of_date(Time([-600.0, 2000.0, 4200.0], format="jyear", scale="tdb"))
    assert not recwarn
