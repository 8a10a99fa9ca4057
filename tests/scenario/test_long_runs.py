"""Scenarios over thousands and millions of years by Wisdom–Holman maps, shortened: what they demand, what fails it."""

import struct

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.scenario import load, perform

GIANTS = ("Sun", "Jupiter", "Saturn", "Uranus", "Neptune")


def trojans(monkeypatch, count=80, **changes):
    scenario = load("trojans").with_changes(**{"duration": 2000 * u.yr, "samples": 201, **changes})
    monkeypatch.setitem(scenario.checks.__globals__, "COUNT", count)
    return scenario


def giants(monkeypatch, **changes):
    """Two million years of the giants in steps of two hundred days, 22 to Jupiter's year."""
    settings = {"dt": 200 * u.day, "duration": 2.1e6 * u.yr, "samples": 2101}
    scenario = load("secular").with_changes(**{**settings, **changes})
    monkeypatch.setitem(scenario.checks.__globals__, "BODIES", GIANTS)
    return scenario


def failed(outcome):
    return [check.claim for check in outcome.checks if not check.ok]


def seen_at_readers_size(path):
    width, height = struct.unpack(">II", path.read_bytes()[16:24])
    return width >= 1300 and height >= 800


@pytest.mark.nightly
def test_trojans_librate_with_the_centres_and_periods_of_theory(tmp_path, monkeypatch):
    outcome = perform(trojans(monkeypatch), out=tmp_path)
    assert outcome.ok, outcome.failures
    assert len(outcome.checks) == 7
    assert seen_at_readers_size(tmp_path / "trojans.png")
    names = outcome.scenario.checks.__globals__
    seen = names["librations"](outcome.run)
    assert (seen.period > 140.0).all()
    assert (np.abs(seen.mean - 65.0) < 10.0).all()
    hektor, patroclus = (seen.names.index(name) for name in ("Hektor", "Patroclus"))
    assert (bool(seen.leads[hektor]), bool(seen.leads[patroclus])) == (True, False)


def test_asteroids_that_are_not_in_resonance_fail_the_trojans(tmp_path, monkeypatch):
    """With two per cent added to their semi-major axes they circulate instead, as all bodies that are no Trojans do."""
    scenario = trojans(monkeypatch, 8)
    names = scenario.checks.__globals__
    stolen = names["system"]().elements(primary="Sun", frame="ecliptic")
    bodies = orbits.System.solar_system(epoch=names["EPOCH"], bodies=list(GIANTS))
    rows = slice(len(GIANTS) - 1, None)
    chosen = {key: getattr(stolen, key)[rows] for key in ("e", "inc", "Omega", "omega", "M")}
    moved = bodies.add(list(stolen.names[rows]), primary="Sun", frame="ecliptic", a=1.05 * stolen.a[rows], **chosen)
    outcome = perform(scenario.with_changes(system=moved), out=tmp_path, plot=False)
    assert "the Trojans stay about L4 and L5" in failed(outcome)


@pytest.mark.nightly
def test_a_short_or_a_coarse_run_of_trojans_is_not_judged_by_what_it_cannot_show(tmp_path, monkeypatch):
    few = perform(trojans(monkeypatch, 16, duration=400 * u.yr, samples=41), out=tmp_path, plot=False)
    coarse = perform(trojans(monkeypatch, 16, duration=20_000 * u.yr, samples=201), out=tmp_path)
    assert few.ok, few.failures
    assert coarse.ok, coarse.failures
    assert (len(few.checks), len(coarse.checks)) == (1, 5)


def test_the_averaged_problem_has_the_widest_tadpole_and_the_period_of_small_librations():
    names = load("trojans").checks.__globals__
    mu = 1 / 1048.0
    amplitude, mean, period = names["theory"](mu)
    assert period[0] == pytest.approx(1 / np.sqrt(6.75 * mu), rel=1e-4)
    assert mean[0] == pytest.approx(60.0, abs=0.01)
    for each in (amplitude, mean, period):
        assert (np.diff(each) > 0).all()
    # The separatrix is at 23.906 degrees, where U is that at 180.
    nearest = 2 * np.arcsin((np.sqrt(2) - 1) / 2)
    assert np.degrees(nearest) == pytest.approx(23.906, abs=5e-4)
    assert names["potential"](nearest) == pytest.approx(names["potential"](np.pi), rel=1e-12)


@pytest.mark.nightly
def test_frequencies_of_the_giants_are_those_published(tmp_path, monkeypatch):
    """To 0.002 arcseconds a year, in 2.1 million years that resolve 0.6; demanded is 0.05."""
    outcome = perform(giants(monkeypatch), out=tmp_path)
    assert outcome.ok, outcome.failures
    names = outcome.scenario.checks.__globals__
    found = names["frequencies"](outcome.run)
    assert set(found) == {"g5", "g6", "g7", "g8", "s6", "s7", "s8"}
    assert max(abs(found[name] - names["PUBLISHED"][name]) for name in found) < 0.02
    assert seen_at_readers_size(tmp_path / "secular.png")


@pytest.mark.nightly
def test_a_jupiter_two_per_cent_heavier_fails_the_frequencies(tmp_path, monkeypatch):
    scenario = giants(monkeypatch, duration=5e5 * u.yr, samples=1001)
    monkeypatch.setitem(scenario.checks.__globals__, "LONG_ENOUGH", 4e5)
    system = scenario.checks.__globals__["system"]()
    x = system.values
    gm = np.where(np.array(system.names) == "Jupiter", 1.02 * x.gm, x.gm)
    heavier = orbits.System(system.names, gm, x.q, x.v, units=system.units, epoch=system.epoch)
    outcome = perform(scenario.with_changes(system=heavier), out=tmp_path, plot=False)
    assert any(claim.startswith("g6 is the published one") for claim in failed(outcome))
    assert any(claim.startswith("s6 is the published one") for claim in failed(outcome))


def test_planes_and_perihelia_are_counted_in_the_invariable_plane():
    """A planet alone with its star moves in it: its inclination is 0, however its orbit lies; and e is its own."""
    names = load("secular").checks.__globals__
    system = orbits.System.from_elements(
        {"Sun": {"mass": 1 * u.M_sun}, "a": {"mass": 1e-3 * u.M_sun, "a": 1 * u.au, "e": 0.3, "inc": 50 * u.deg,
         "Omega": 20 * u.deg, "omega": 70 * u.deg}}
    )  # fmt: skip
    run = orbits.propagate(system, orbits.WisdomHolman(), dt=5 * u.day, duration=2 * u.yr, samples=5, progress=False)
    turning = names["turning"](run)
    assert np.abs(turning["s"]["a"]).max() < 1e-7
    assert np.abs(turning["g"]["a"]) == pytest.approx(0.3, abs=1e-12)
    assert np.angle(turning["g"]["a"] / turning["g"]["a"][0]) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["secular", "trojans"])
def test_each_long_run_gives_all_that_it_demands_in_full(name, tmp_path):
    outcome = perform(load(name), out=tmp_path)
    assert outcome.ok, outcome.failures
