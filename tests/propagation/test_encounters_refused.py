"""Target planes, places of entry, passages and clones: other units, and what is refused because its answer would be
wrong.
"""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import InputError, OrbitsWarning, UnknownNameError
from orbits.propagation.variations.deviations import Uncertain, warn_of_range
from orbits.propagation.variations.encounters import _relative
from orbits.results.chance import Chance, probability_in_disc
from orbits.results.covariance import FORMS, Covariance

C = np.diag([1e-8] * 3 + [1e-10] * 3) ** 2
"""Of a state, au and au/d: 1.5 km and 0.2 mm/s."""


@cache
def falling(*place: float) -> orbits.System:
    """A body before it falls on the Earth, by default a day; place : from its centre, km."""
    system = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Earth", "Moon"])
    earth = system["Earth"]
    q, v = earth.q + (place or (1e6, 2000.0, 3000.0)) * u.km, earth.v + [-12.0, 0.0, 0.0] * u.km / u.s
    return system.add("rock", q=q, v=v)


@cache
def fall() -> orbits.Trajectory:
    return orbits.propagate(falling(), duration=2 * u.day, samples=2)


def test_an_ellipse_on_the_ground_is_the_same_in_all_units() -> None:
    units = orbits.UnitSystem("km and s", length=u.km, time=u.s, mass=u.kg)
    one = falling()
    other = orbits.System(
        names=one.names, gm=one.gm, q=one.q, v=one.v, epoch=one.epoch, units=units,
    )  # fmt: skip
    scale = np.repeat([u.au.to(u.km), (u.au / u.day).to(u.km / u.s)], 3)
    known = orbits.entry(fall(), covariance=C)
    found = orbits.entry(orbits.propagate(other, duration=2 * u.day, samples=2), covariance=C * np.outer(scale, scale))
    for x, y in zip(found.ellipse(), known.ellipse(), strict=True):
        assert x.value == pytest.approx(y.value, rel=1e-6)
    assert known.ellipse()[0] < 1000 * u.km


def test_a_planet_may_be_called_earth() -> None:
    """"rock does not come down to 100 km above the Earth: in this run it is not near it"."""
    other = falling().replaced(names=["sun", "earth", "moon", "rock"])
    run = orbits.propagate(other, duration=2 * u.day, samples=2)
    known, found = orbits.entry(fall(), covariance=C), orbits.entry(run, covariance=C)
    assert (found.longitude, found.latitude, found.sigma_time) == (known.longitude, known.latitude, known.sigma_time)
    assert orbits.target_plane(run, "Earth").radius == orbits.target_plane(fall(), "Earth").radius


def test_a_run_that_ends_before_the_approach_has_none() -> None:
    early = orbits.propagate(falling(), duration=22 * u.h, samples=2)
    with pytest.raises(InputError, match="the run ends while rock still comes nearer to Earth"):
        orbits.target_plane(early, "Earth", covariance=C)
    with pytest.raises(InputError, match="the run ends while rock still comes nearer to Earth"):
        orbits.entry(early)
    passage = next(one for one in early.closest_approaches(covariance=C)["rock"] if one.other == "Earth")
    assert passage.time_sigma is None
    assert passage.distance_sigma > 0.0 * u.km
    assert "with a sigma of" in str(passage)
    assert np.isnan(early.closest_approaches(covariance=C).to_table("rock")["time_sigma"]).any()
    with pytest.raises(InputError, match="begins as rock parts from Earth"):
        orbits.target_plane(orbits.propagate(fall().at(1.0), duration=1 * u.day, samples=2), "Earth")


def test_states_that_are_not_there_and_probabilities_of_them() -> None:
    assert np.isnan(probability_in_disc(np.array([np.nan, 0.0]), np.eye(2), 1.0))
    assert np.isnan(probability_in_disc(np.zeros(2), np.full((2, 2), np.nan), 1.0))
    values = [probability_in_disc(np.zeros(2), np.diag([x, y]), 1.0) for x in (1e-6, 1e-3) for y in (1e-6, 1e-2, 3e-3)]
    assert max(values) <= 1.0
    nothing = Chance.of(0, 0)
    assert np.isnan(nothing.value)
    assert (nothing.low, nothing.high) == (0.0, 1.0)
    system = falling().replaced(radii=[695700, 6378, 1737, 1] * u.km)
    lost = orbits.propagate(
        system, duration=2 * u.day, samples=2, events=orbits.events.Collision(then=orbits.events.Merge())
    )
    with pytest.raises(InputError, match="no states of rock near its encounter with Earth, as a body was lost"):
        _relative(lost, "rock", "Earth", np.array([1.5]))


def test_planets_and_radii_without_a_target_plane() -> None:
    with pytest.raises(InputError, match="Sun is the heaviest body of this system"):
        orbits.target_plane(fall(), "Sun")
    with pytest.raises(InputError, match="body and planet are both 'Earth'"):
        orbits.target_plane(fall(), "Earth", body="Earth")
    with pytest.raises(InputError, match=r"body is 'rock' without covariance; expected both.*approaches\(\)\[name\]"):
        fall().closest_approaches(body="rock")
    with pytest.raises(InputError, match="near must be a single number or quantity, got an array"):
        orbits.target_plane(fall(), "Earth", near=[1.0, 2.0])
    for radius, message in (
        (6378.0, "begins .* AU from Earth"),
        (-1 * u.km, r"radius is <Quantity -1\. km>; expected a finite number above 0"),
        (np.nan * u.km, "radius is"),
    ):
        with pytest.raises(InputError, match=message):
            orbits.target_plane(fall(), "Earth", radius=radius)


def test_a_slow_hyperbola_has_sigmas() -> None:
    """At 0.02 km/s far from the Earth, a displacement of 1e-5 of the speed beside it would bind the body."""
    system = orbits.System(
        names=["Sun", "Earth"],
        gm=falling().gm[:2],
        q=falling().q[:2],
        v=falling().v[:2],
        epoch="2020-01-01",
    )
    gm = float(system.gm[1].to_value(u.km**3 / u.s**2))
    r = 7000.0
    for v_infinity, plane in ((0.05, "target"), (0.005, "modified")):
        speed = np.sqrt(v_infinity**2 + 2.0 * gm / r)
        rock = system.add(
            "rock",
            q=system["Earth"].q + [r, 0.0, 0.0] * u.km,
            v=system["Earth"].v + speed * np.array([-0.6, 0.8, 0.0]) * u.km / u.s,
        )
        found = orbits.target_plane(
            orbits.propagate(rock, duration=20 * u.min, samples=2), "Earth", radius=10 * u.km, covariance=C
        )
        assert str(found).startswith(plane)
        assert all(np.isfinite(x.value) for x in found.sigma.values())


def test_a_covariance_is_of_the_orbit_that_it_is_given_for() -> None:
    names, units = zip(*FORMS["cartesian"], strict=True)
    here = falling().epoch

    def carried(matrix: np.ndarray, body: str | None = "rock", epoch: Time | None = here) -> np.ndarray:
        one = Covariance("cartesian", names, units, np.zeros(6), matrix, body, epoch)
        return Uncertain.of(falling(), one).matrix

    np.testing.assert_allclose(carried(C), C)
    np.testing.assert_allclose(carried(C, None, None), C)
    with pytest.raises(InputError, match=r"2020-01-02 .* TDB, but the system is at 2020-01-01"):
        carried(C, epoch=here + 1 * u.day)
    with pytest.raises(UnknownNameError, match="there is no body 'other'"):
        carried(C, "other")
    with pytest.raises(InputError, match=r"the covariance is of rock; expected one of Moon"):
        Uncertain.of(falling(), Covariance("cartesian", names, units, np.zeros(6), C, "rock", here), "Moon")
    km = Covariance("cartesian", names, (u.km,) * 3 + (u.km / u.s,) * 3, np.zeros(6), np.eye(6))
    assert np.sqrt(Uncertain.of(falling(), km).matrix[0, 0]) == pytest.approx(u.km.to(u.au))
    wrong = C.copy()
    wrong[3, 4] = wrong[4, 3] = 3.0 * C[3, 3]  # small beside positions, yet no correlation
    with pytest.raises(InputError, match="negative eigenvalue"):
        orbits.target_plane(fall(), "Earth", covariance=wrong)
    with pytest.raises(InputError, match="negative eigenvalue"):
        fall().closest_approaches(covariance=wrong)


def test_clones_that_hit_are_counted_and_those_of_which_it_is_not_known_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    members = orbits.ensemble.clones(falling(), "rock", covariance=C, count=5, seed=1)
    how = {"workers": 1, "progress": False, "samples": 2}
    campaign = orbits.ensemble.run(members, tmp_path / "whole", duration=2 * u.day, **how)
    size = 6378.137 * u.km
    assert orbits.ensemble.impact_probability(campaign, "earth", radius=size)[3:] == (5, 5)
    with pytest.raises(UnknownNameError, match="Did you mean 'Earth'"):
        orbits.ensemble.impact_probability(campaign, "Erth", radius=size)
    with pytest.raises(InputError, match="does not tell approaches to Sun, about which its members orbit"):
        orbits.ensemble.impact_probability(campaign, "Sun", radius=size)
    with pytest.raises(InputError, match=r"radius is <Quantity -1\. km>; expected a finite number above 0"):
        orbits.ensemble.impact_probability(campaign, "Earth", radius=-1 * u.km)
    for radius in (6378.137, 6378 * u.s, "large", None):
        with pytest.raises(InputError, match=r"radius is .* expected a length"):
            orbits.ensemble.impact_probability(campaign, "Earth", radius=radius)
    early = orbits.ensemble.run(members, tmp_path / "early", duration=22 * u.h, **how)
    with pytest.warns(OrbitsWarning, match="5 clones still come nearer to Earth at the end"):
        assert orbits.ensemble.impact_probability(early, "Earth", radius=size)[3:] == (0, 5)
    known = campaign.summary
    known["state"][1:3] = "failed"
    known["closest"][1:3] = np.inf * u.au
    monkeypatch.setattr(orbits.ensemble.Campaign, "summary", known)
    with pytest.warns(OrbitsWarning, match="2 clones failed, were lost or stopped before the end, and do not"):
        assert orbits.ensemble.impact_probability(campaign, "Earth", radius=size)[3:] == (3, 3)


def test_clones_that_are_lost_at_the_centre_of_a_planet_hit_it(tmp_path: Path) -> None:
    """Those that fall straight on a point mass have no step that is short enough, and no closest approach."""
    members = orbits.ensemble.clones(falling(1e5, 0.0, 0.0), "rock", covariance=1e-8 * C, count=2, seed=1)
    how = {"workers": 1, "progress": False, "samples": 2}
    campaign = orbits.ensemble.run(members, tmp_path / "head-on", duration=2 * u.day, **how)
    assert set(campaign.summary["state"][1:]) == {"lost"}
    assert orbits.ensemble.impact_probability(campaign, "Earth", radius=6378.137 * u.km)[3:] == (2, 2)
    without = orbits.ensemble.run(members, tmp_path / "no samples", duration=2 * u.day, trajectories=False, **how)
    with pytest.warns(OrbitsWarning, match="2 clones failed, were lost or stopped before the end, and do not"):
        assert orbits.ensemble.impact_probability(without, "Earth", radius=6378.137 * u.km)[3:] == (0, 0)


def pair_of_planets() -> orbits.System:
    """Two planets that merge at t = 7.6, and a massless body that falls towards b before; without units."""
    planets = {"a": {"a": 1.0, "e": 0.1, "gm": 1e-3, "radius": 0.05}}
    planets["b"] = {"a": 1.1, "e": 0.1, "gm": 2e-3, "radius": 0.14, "l": 1.0, "pomega": 3.0}
    system = orbits.System.from_elements({"star": {"gm": 1.0}, **planets}, units=orbits.DIMENSIONLESS)
    b = system["b"]
    return system.add("x", q=b.q.value + np.array([0.3, 0.1, 0.0]), v=b.v.value - np.array([0.24, 0.08, 0.0]))


def test_clones_that_merge_with_a_planet_at_its_surface_hit_it_also_without_units(tmp_path: Path) -> None:
    """They end at its radius up to round-off, on one side or the other."""
    members = orbits.ensemble.clones(pair_of_planets(), "x", covariance=1e-4 * np.eye(6), count=20, seed=1)
    how = {"workers": 1, "progress": False, "duration": 2.0}
    through = orbits.ensemble.run(members, tmp_path / "through", **how)
    assert orbits.ensemble.impact_probability(through, "b", radius=0.14)[3:] == (12, 20)
    merging = orbits.events.Collision(then=orbits.events.Merge())
    merged = orbits.ensemble.run(members, tmp_path / "merged", events=[merging], **how)
    assert orbits.ensemble.impact_probability(merged, "b", radius=0.14)[3:] == (12, 20)


def test_clones_among_planets_that_merge_are_told_where_no_trajectories_are_kept(tmp_path: Path) -> None:
    system = pair_of_planets().remove("x").add("far", primary="star", a=3.0)
    members = orbits.ensemble.clones(system, "far", covariance=1e-6 * np.eye(6), count=2, seed=1)
    merging = orbits.events.Collision(then=orbits.events.Merge())
    how = {"workers": 1, "progress": False, "duration": 20.0, "events": [merging], "trajectories": False}
    campaign = orbits.ensemble.run(members, tmp_path / "c", **how)
    with pytest.warns(OrbitsWarning, match="2 clones have no closest body; the campaign does not tell"):
        orbits.ensemble.impact_probability(campaign, "b", radius=0.14)


def test_clones_that_are_lost_when_a_planet_has_merged_do_not_hit_it(tmp_path: Path) -> None:
    bodies = pair_of_planets().remove("x").replaced(radii=[0.3, 0.05, 0.14])
    system = bodies.add("falls", primary="star", a=2.0, e=0.9, M=0.1)
    members = orbits.ensemble.clones(system, "falls", covariance=1e-6 * np.eye(6), count=2, seed=1)
    merging = orbits.events.Collision(then=orbits.events.Merge())
    how = {"workers": 1, "progress": False, "duration": 20.0, "events": [merging]}
    campaign = orbits.ensemble.run(members, tmp_path / "c", **how)
    assert set(campaign.summary["state"]) == {"lost"}
    with pytest.warns(OrbitsWarning, match="2 clones failed, were lost"):
        assert orbits.ensemble.impact_probability(campaign, "a", radius=0.05)[3:] == (0, 0)


def test_clones_whose_block_was_stopped_do_not_count_as_misses(tmp_path: Path) -> None:
    members = orbits.ensemble.clones(pair_of_planets(), "x", covariance=1e-4 * np.eye(6), count=2, seed=1)
    near = orbits.events.CloserThan(0.7, "a", "b")
    how = {"workers": 1, "progress": False, "duration": 2.0, "stop": [near]}
    campaign = orbits.ensemble.run(members, tmp_path / "c", **how)
    with pytest.warns(OrbitsWarning, match="2 clones failed, were lost or stopped before the end, and do not"):
        assert orbits.ensemble.impact_probability(campaign, "b", radius=0.14)[3:] == (0, 0)


def test_clones_that_pass_another_body_more_closely_hit_a_moon_or_are_told(tmp_path: Path) -> None:
    """They leave the Earth at 9,000 km and pass the Moon at 47,650 km: the summary has the Earth alone."""
    system = falling().remove("rock")
    earth, moon = system["Earth"], system["Moon"]
    way = (moon.q - earth.q) / np.linalg.norm(moon.q - earth.q)
    system = system.add("rock", q=earth.q + 9000 * u.km * way, v=earth.v + 12.0 * u.km / u.s * way)
    run = orbits.propagate(system, duration=16 * u.h, samples=961)
    apart = run.q[:, run.names.index("rock")] - run.q[:, run.names.index("Moon")]
    least = np.linalg.norm(apart, axis=1).min().to(u.km)  # of every minute: within 3 km
    members = orbits.ensemble.clones(system, "rock", covariance=1e-2 * C, count=2, seed=1)
    how = {"workers": 1, "progress": False, "samples": 2}
    campaign = orbits.ensemble.run(members, tmp_path / "whole", duration=16 * u.h, **how)
    assert set(campaign.summary["closest_to"]) == {"Earth"}
    for beyond, hits in ((100 * u.km, 2), (-100 * u.km, 0)):
        assert orbits.ensemble.impact_probability(campaign, "Moon", radius=least + beyond)[3:] == (hits, 2)
    with pytest.raises(InputError, match=r"radius is 0\.1.* AU, but approaches to Moon are recorded within 0\.0"):
        orbits.ensemble.impact_probability(campaign, "Moon", radius=0.1 * u.au)
    early = orbits.ensemble.run(members, tmp_path / "early", duration=4 * u.h, **how)
    with pytest.warns(OrbitsWarning, match="2 clones still come nearer to Moon at the end"):
        orbits.ensemble.impact_probability(early, "Moon", radius=least)
    without = orbits.ensemble.run(members, tmp_path / "no samples", duration=16 * u.h, trajectories=False, **how)
    with pytest.warns(OrbitsWarning, match="2 clones came relatively closer to Earth than to Moon"):
        orbits.ensemble.impact_probability(without, "Moon", radius=least)


def test_clones_share_parameters_and_take_covariances_of_their_orbit() -> None:
    names, units = zip(*FORMS["cartesian"], strict=True)
    seven = Covariance("cartesian", (*names, "rock.A2"), (*units, u.au / u.day**2), np.zeros(7), np.eye(7), "rock")
    with pytest.raises(InputError, match=r"parameters, rock\.A2"):
        orbits.ensemble.clones(falling(), "rock", covariance=seven, count=2)
    km = Covariance("cartesian", names, (u.km,) * 3 + (u.km / u.s,) * 3, np.zeros(6), np.eye(6), "rock")
    members = orbits.ensemble.clones(falling(), "rock", covariance=km, count=50)
    apart = u.Quantity(members.q[1:] - members.q[0], u.au).to_value(u.km)
    assert 0.7 < apart.std() < 1.3  # of 150 draws
    with pytest.raises(InputError, match=r"of which elements a matrix is; expected none .* covariance of a fit"):
        orbits.ensemble.clones(falling(), "rock", covariance=km, count=2, elements=dict.fromkeys("xyzabc", 1))
    with pytest.raises(InputError, match="is of rock; expected one of Moon"):
        orbits.ensemble.clones(falling(), "Moon", covariance=km, count=2)


def test_a_fit_with_a_wide_range_is_told_of() -> None:
    class Wide:
        name = "rock"
        range = ("one end", "the other")

    with pytest.warns(OrbitsWarning, match="observations of rock are a wide range"):
        warn_of_range(Wide())


def test_a_run_that_cannot_be_followed_is_refused_at_once() -> None:
    system = orbits.System.in_ephemeris(epoch="2020-01-01").add(
        "rock", primary="Sun", a=2 * u.au, gm=1e-18 * u.au**3 / u.day**2
    )
    run = orbits.propagate(system, duration=1 * u.day, samples=2)
    with pytest.raises(InputError, match="the variations of bodies with a mass"):
        run.closest_approaches(covariance=C, body="rock")


def test_an_entry_after_the_tables_of_the_earth_warns_once_in_words() -> None:
    later = falling().replaced(epoch="2035-01-01")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        str(orbits.entry(orbits.propagate(later, duration=2 * u.day, samples=2)))
    assert {one.category.__name__ for one in caught} == {"OrbitsWarning"}


def test_a_height_that_was_passed_long_before_the_approach_is_found() -> None:
    """Beyond 0.25 days it was said that the body is below at the start of the run."""
    for altitude in (400_000.0, 900_000.0):
        place = orbits.entry(fall(), altitude=altitude * u.km)
        state = fall().at(place.date.tdb)
        apart = np.linalg.norm((state.q[state.index("rock")] - state.q[state.index("Earth")]).to_value(u.km))
        assert apart - altitude == pytest.approx(6367.0, abs=12.0)  # the ellipsoid's radii
    with pytest.raises(InputError, match="rock is below at the start of the run"):
        orbits.entry(fall(), altitude=2e6 * u.km)
    with pytest.raises(InputError, match="altitude must be finite"):
        orbits.entry(fall(), altitude=np.nan * u.km)
