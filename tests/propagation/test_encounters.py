"""Target planes, places of entry and passages with their uncertainty: against runs from displaced starts, published
impacts and JPL's Apophis.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import InputError
from orbits.fitting.result import Fit
from orbits.resources import data_path
from orbits.results.covariance import FORMS, Covariance

from ..coverings import only

DATA = Path(__file__).parents[1] / "fitting" / "data"
END = {"2008TC3": "2008-10-08", "2024BX1": "2024-01-22"}


@cache
def apophis() -> orbits.System:
    """Apophis a hundred days before it passes the Earth, by JPL's solution 199, without the forces of sunlight."""
    data = json.loads(data_path("close_encounters.json").read_text(encoding="utf-8"))
    start = next(each for each in data["encounters"] if each["name"] == "Apophis")
    system = orbits.System.in_ephemeris(epoch=Time(start["epoch_jd_tdb"], format="jd", scale="tdb"))
    return system.add("Apophis", primary="Sun", q=start["q_au"] * u.au, v=start["v_au_per_d"] * u.au / u.day)


@cache
def run() -> orbits.Trajectory:
    return orbits.propagate(apophis(), until="2029-05-01", samples=2)


def some_covariance(size: float = 1e-9) -> np.ndarray:
    """A covariance with correlations, of `size` au and a hundredth of it a day, 150 m and 0.02 mm/s."""
    A = np.random.default_rng(3).normal(size=(6, 6)) + 2.0 * np.eye(6)
    scale = size * np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01])
    return A @ A.T * np.outer(scale, scale)


def displaced(system: orbits.System, covariance: np.ndarray, until: str, answer) -> np.ndarray:
    """The covariance of an answer, by differences of runs that begin one sigma off along six directions."""
    columns = []
    for way in np.linalg.cholesky(covariance / np.outer(*[np.sqrt(np.diag(covariance))] * 2)).T:
        way = way * np.sqrt(np.diag(covariance))
        pair = []
        for sign in (1.0, -1.0):
            q, v = system.values.q.copy(), system.values.v.copy()
            q[-1] += sign * way[:3]
            v[-1] += sign * way[3:]
            pair.append(answer(orbits.propagate(system.replaced(q=q, v=v), until=until, samples=2)))
        columns.append(0.5 * (pair[0] - pair[1]))
    D = np.array(columns).T
    return D @ D.T


def sunlight(A2: float) -> orbits.terms.NonGravitational:
    unit = u.au / u.day**2
    return orbits.terms.NonGravitational.yarkovsky(A2 * unit, A1=5e-13 * unit, bodies=["Apophis"])


def close(found: np.ndarray, known: np.ndarray) -> float:
    """The largest difference of two covariances, in units of the sigmas."""
    scale = np.sqrt(np.diag(known))
    return float(np.abs((found - known) / np.outer(scale, scale)).max())


@pytest.mark.nightly
def test_the_ellipse_is_the_spread_of_runs_from_displaced_starts() -> None:
    C, middle = some_covariance(), orbits.target_plane(run(), "Earth").date

    def answer(one: orbits.Trajectory) -> np.ndarray:
        plane = orbits.target_plane(one, "Earth")
        return np.array([plane.xi.value, plane.zeta.value, plane.distance.value, (plane.date - middle).to_value(u.s)])

    plane = orbits.target_plane(run(), "Earth", covariance=C)
    assert plane.matrix is not None
    assert close(plane.matrix, displaced(apophis(), C, "2029-05-01", answer)) < 4e-5  # 1.3e-5 found
    large, small, angle = plane.ellipse(1.0)
    a = np.deg2rad(angle.value)
    along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
    whole = large.value**2 * np.outer(along, along) + small.value**2 * np.outer(across, across)
    np.testing.assert_allclose(whole, plane.matrix[:2, :2], rtol=1e-9)


@pytest.mark.slow
def test_the_ellipse_has_the_spread_by_parameters() -> None:
    six = some_covariance()
    scale = np.sqrt(np.diag(six))
    ways = np.zeros((7, 7))  # columns, one sigma each
    ways[:6, :6] = np.linalg.cholesky(six / np.outer(scale, scale)) * scale[:, None]
    ways[6] = 2e-12 * np.array([0.3, -0.3, 0.0, 0.0, 0.0, 0.3, 1.0])
    C = ways @ ways.T
    names, units = zip(*FORMS["cartesian"], strict=True)
    given = Covariance("cartesian", (*names, "Apophis.A2"), (*units, u.au / u.day**2), np.zeros(7), C)
    A2, until = -2.9e-14, "2029-05-01"
    nominal = orbits.propagate(apophis().with_forces(sunlight(A2)), until=until, samples=2)
    plane = orbits.target_plane(nominal, "Earth", covariance=given)

    def answer(way: np.ndarray) -> np.ndarray:
        q, v = apophis().values.q.copy(), apophis().values.v.copy()
        q[-1] += way[:3]
        v[-1] += way[3:6]
        system = apophis().replaced(q=q, v=v).with_forces(sunlight(A2 + way[6]))
        one = orbits.target_plane(orbits.propagate(system, until=until, samples=2), "Earth")
        return np.array([one.xi.value, one.zeta.value, one.distance.value, (one.date - plane.date).to_value(u.s)])

    D = np.array([0.5 * (answer(way) - answer(-way)) for way in ways.T]).T
    assert close(plane.matrix, D @ D.T) < 1e-4
    without = orbits.target_plane(nominal, "Earth", covariance=six)
    assert close(without.matrix, D @ D.T) > 0.1


def test_apophis_passes_as_jpl_has_it() -> None:
    plane = orbits.target_plane(run(), "Earth")
    # JPL's table of close approaches: 0.00025410 au, v_infinity 5.84 km/s; with sunlight and asteroids it is 38,011.5.
    assert plane.distance.to_value(u.km) == pytest.approx(38_011.4, abs=3.0)
    assert plane.v_infinity is not None
    assert plane.v_infinity.to_value(u.km / u.s) == pytest.approx(5.8414, abs=1e-4)
    assert plane.date.iso[:16] == "2029-04-13 21:46"
    escape = np.sqrt(2.0 * 398600.4354 / 6378.137)
    captured = 6378.137 * np.hypot(1.0, escape / plane.v_infinity.value)
    assert plane.capture_radius.value == pytest.approx(captured, rel=1e-7)
    with pytest.raises(InputError, match="has no covariance"):
        plane.ellipse()
    assert "sigma" in str(plane)
    assert "Target" not in plane._repr_html_()


def test_passages_have_the_sigmas_of_the_target_plane() -> None:
    C = some_covariance()
    passages = run().closest_approaches(covariance=C)
    plane = orbits.target_plane(run(), "Earth", covariance=C)
    earth = next(one for one in passages["Apophis"] if one.other == "Earth")
    assert earth.distance_sigma.to_value(u.km) == pytest.approx(plane.sigma["distance"].value, rel=1e-6)
    assert earth.time_sigma.to_value(u.s) == pytest.approx(plane.sigma["time"].value, rel=1e-6)
    moon = next(one for one in passages["Apophis"] if one.other == "Moon")

    def answer(one: orbits.Trajectory) -> np.ndarray:
        here = next(each for each in one.closest_approaches()["Apophis"] if each.other == "Moon")
        return np.array([here.distance.to_value(u.km), here.time.to_value(u.s)])

    known = displaced(apophis(), C, "2029-05-01", answer)
    found = np.array([moon.distance_sigma.to_value(u.km), moon.time_sigma.to_value(u.s)])
    # The time takes the acceleration of the Moon alone, while the Earth's is as large.
    assert np.all(np.abs(found / np.sqrt(np.diag(known)) - 1.0) < [1e-4, 3e-3])
    table = passages.to_table()
    assert {"distance_sigma", "time_sigma"} <= set(table.colnames)
    assert "with sigmas of" in str(earth)
    plain = run().closest_approaches()
    assert "distance_sigma" not in plain.to_table().colnames
    assert next(iter(plain)).distance_sigma is None


@cache
def first_observations(name: str) -> Fit:
    return orbits.fit(orbits.Observations.read(DATA / f"{name}_first.obs80"))


PUBLISHED = {
    # JPL's final prediction for 50 km: Chesley, Chodas & Yeomans (2008), "Asteroid 2008 TC3 strikes Earth: predictions
    # and observations agree". The airburst at 37 km was at 02:45:45.
    "2008TC3": (50.0, 31.804, 20.858, "2008-10-07 02:45:42"),
    # Spurny et al. (2024), A&A 686, A67: the fireball began at 00:32:38, at 15.20 km/s with a slope of 75.6 degrees.
    "2024BX1": (100.0, None, None, "2024-01-21 00:32:38"),
}


@pytest.mark.parametrize("name", only(("2024BX1",), PUBLISHED))
def test_twenty_observations_tell_an_impact_its_time_and_its_place(name: str) -> None:
    fit, (altitude, lon, lat, date) = first_observations(name), PUBLISHED[name]
    plane = orbits.target_plane(fit, "Earth", until=END[name])
    assert plane.impact_probability > 0.99
    assert plane.b + plane.ellipse()[0] < plane.capture_radius
    assert plane.clones_needed() == 1
    place = orbits.entry(fit, until=END[name], altitude=altitude * u.km)
    # Within three sigmas of the published time, and of the place on both axes of the ellipse.
    assert abs((place.date - Time(date, scale="utc")).to_value(u.s)) < 3.0 * place.sigma_time.value
    if lon is None:
        assert place.speed.value == pytest.approx(15.20, abs=0.02)
        assert place.slope.value == pytest.approx(75.6, abs=0.2)
    else:
        km = 111.2 * np.array([(place.longitude.value - lon) * np.cos(np.deg2rad(lat)), place.latitude.value - lat])
        large, small, azimuth = place.ellipse(1.0)
        a = azimuth.to_value(u.rad)
        assert abs(km @ [np.sin(a), np.cos(a)]) < 3.0 * large.value
        assert abs(km @ [np.cos(a), -np.sin(a)]) < 3.0 * small.value
        assert np.hypot(*km) < 25.0  # 20 km found


@pytest.mark.slow
def test_clones_hit_as_the_ellipse_says(tmp_path: Path) -> None:
    C = some_covariance(1e-5)
    plane = orbits.target_plane(run(), "Earth", covariance=C)
    members = orbits.ensemble.clones(apophis(), "Apophis", covariance=C, count=500, seed=2)
    campaign = orbits.ensemble.run(members, tmp_path / "clones.campaign", until="2029-05-01")
    found = orbits.ensemble.impact_probability(campaign, "Earth", radius=6378.137 * u.km)
    assert found[3:] == (58, 500)  # four of them lost 8 to 12 km from the centre of the Earth
    assert plane.clones_needed(0.05) == pytest.approx((1 / plane.impact_probability - 1) / 0.05**2, abs=1)
    assert found.low < plane.impact_probability < found.high  # 0.084 to 0.138 for 0.1065
    with pytest.raises(InputError, match="no number of clones"):
        orbits.target_plane(run(), "Earth", covariance=some_covariance()).clones_needed()


def test_entry_is_where_astropy_has_the_body() -> None:
    from astropy.coordinates import GCRS, ITRS, CartesianRepresentation

    fit = first_observations("2024BX1")
    one = orbits.propagate(fit.system, until=END["2024BX1"], samples=2)
    place = orbits.entry(one)
    state = one.at(place.date.tdb)
    apart = state.q[state.index(fit.name)] - state.q[state.index("Earth")]
    seen = GCRS(CartesianRepresentation(apart), obstime=place.date).transform_to(ITRS(obstime=place.date))
    where = seen.earth_location.to_geodetic()
    assert where.height.to_value(u.km) == pytest.approx(100.0, abs=0.01)
    assert where.lon.to_value(u.deg) == pytest.approx(place.longitude.value, abs=1e-5)  # a metre
    assert where.lat.to_value(u.deg) == pytest.approx(place.latitude.value, abs=1e-5)
    assert "100 km" in str(place)
    with (
        pytest.warns(orbits.errors.OrbitsWarning, match="the rotation of the Earth"),
        pytest.raises(InputError, match=r"Apophis does not come down to 100 km above the Earth: .* 38,0"),
    ):
        orbits.entry(run())


@pytest.mark.nightly
def test_entry_spreads_as_that_of_displaced_starts() -> None:
    fit, end = first_observations("2024BX1"), END["2024BX1"]
    C = 0.04**2 * fit.covariance().matrix  # what is linear
    place = orbits.entry(orbits.propagate(fit.system, until=end, samples=2), covariance=C)

    def answer(other: orbits.Trajectory) -> np.ndarray:
        here = orbits.entry(other)
        lat = place.latitude.to_value(u.rad)
        curved = 6378.137 / np.sqrt(1.0 - 0.00669438 * np.sin(lat) ** 2)
        meridian = curved**3 / 6378.137**2 * (1.0 - 0.00669438)
        off = [(x - y).to_value(u.rad) for x, y in ((here.longitude, place.longitude), (here.latitude, place.latitude))]
        east, north = (curved + 100.0) * np.cos(lat) * off[0], (meridian + 100.0) * off[1]
        return np.array([east, north, (here.date - place.date).to_value(u.s)])

    assert close(place.matrix, displaced(fit.system, C, end, answer)) < 1e-3


def test_what_is_no_covariance_or_no_encounter_is_refused() -> None:
    with pytest.raises(InputError, match="expected a fit, or a run"):
        orbits.target_plane(apophis(), "Earth")
    with pytest.raises(InputError, match="Apophis does not come near Mars"):
        orbits.target_plane(run(), "Mars", radius=3390 * u.km)
    with pytest.raises(InputError, match=r"shape \(3, 3\); expected \(6, 6\), of x, y, z"):
        orbits.target_plane(run(), "Earth", covariance=np.eye(3))
    assert orbits.target_plane(run(), "Moon").radius.value == pytest.approx(1737.4)
    fit = first_observations("2024BX1")
    with pytest.raises(InputError, match="expected until="):
        orbits.target_plane(fit, "Earth")
    with pytest.raises(InputError, match="expected one of the state"):
        orbits.propagate(fit.system, until="2024-01-22").closest_approaches(covariance=fit.covariance("cometary"))
    run_of_fit = orbits.propagate(fit.system, until="2024-01-22", samples=2)
    with pytest.raises(InputError, match=f"the covariance is of {fit.name}; expected one of Moon"):
        orbits.target_plane(run_of_fit, "Earth", covariance=fit, body="Moon")
    assert fit.covariance(at=fit.epoch).matrix.tolist() == fit.covariance().matrix.tolist()
    later = orbits.propagate(fit.system, until="2024-01-21 00:10").at("2024-01-21 00:05")
    with pytest.raises(InputError, match="does not begin with the orbit"):
        orbits.propagate(later, until="2024-01-22").closest_approaches(covariance=fit)


def test_a_picture_has_the_planet_and_the_ellipses_enlarged() -> None:
    plane = orbits.target_plane(run(), "Earth", covariance=some_covariance())
    whole, enlarged = plane.plot().axes
    assert len(whole.patches) == 2 + 3
    assert len(enlarged.patches) == 3
    assert len(orbits.target_plane(run(), "Earth").plot().axes) == 1


def test_a_covariance_at_another_time_is_the_spread_of_runs_from_displaced_starts() -> None:
    fit, later = first_observations("2024BX1"), "2024-01-21 00:20"

    def answer(one: orbits.Trajectory) -> np.ndarray:
        state = one.at(later)
        return np.concatenate([x[state.index(fit.name)] for x in state.values[1:3]])

    small = 0.01**2 * fit.covariance().matrix  # what is linear
    found = fit.covariance(at=later)
    assert found.form == "cartesian"
    assert close(0.01**2 * found.matrix, displaced(fit.system, small, END["2024BX1"], answer)) < 1e-4
    np.testing.assert_allclose(found.values, answer(orbits.propagate(fit.system, until=later)), rtol=1e-12)
    comet = fit.covariance("cometary", at=later)
    q = comet.names.index("q")
    # Beside the Earth its orbit about the Sun changes fast.
    assert abs(comet.values[q] - fit.covariance("cometary").values[q]) > 5.0 * comet.sigma[q]  # 8 found
