"""The scenarios about the model of the Solar System: the ladder against DE440, and Mercury's perihelion."""

import struct

import numpy as np
import pytest

import orbits
from orbits.regression.of_ephemeris import Residuals
from orbits.scenario import load, perform


def parts(name):
    """The functions and constants of a scenario's file."""
    return load(name).experiment.__globals__


def seen_at_readers_size(figure):
    width, height = figure.get_size_inches() * figure.dpi
    return width >= 1300 and height >= 800


@pytest.mark.slow
@pytest.mark.parametrize("name", ["de440", "mercury"])
def test_the_whole_scenario_gives_all_that_it_demands(name, tmp_path):
    outcome = perform(load(name), out=tmp_path)
    assert outcome.ok, outcome.failures
    width, height = struct.unpack(">II", (tmp_path / f"{name}.png").read_bytes()[16:24])
    assert width >= 1300
    assert height >= 800


def test_relativity_turns_mercurys_perihelion_by_43_arcseconds_a_century(monkeypatch):
    names = parts("mercury")
    monkeypatch.setitem(names, "CENTURIES", 0.25)
    sun_and_mercury = names["bodies"]()
    # In a quarter of a century a line through what turns within a revolution is good to some 1e-3 of the result.
    turned = names["rate"](names["turning"](sun_and_mercury.with_terms(orbits.terms.PostNewtonian())))
    assert turned == pytest.approx(42.98, abs=0.02)
    assert names["formula"]() == pytest.approx(42.980, abs=1e-3)
    assert abs(names["rate"](names["turning"](sun_and_mercury))) < 1e-4


@pytest.mark.nightly
def test_a_scenario_that_expects_another_angle_fails(monkeypatch):
    names = parts("mercury")
    for key, value in {"CENTURIES": 0.25, "PLANETS": ("Venus",), "RELATIVITY": 44.0}.items():
        monkeypatch.setitem(names, key, value)
    monkeypatch.setitem(names, "ORDER", ("Venus",))
    result = names["experiment"](lambda told: None)
    failed = [check.claim for check in result.checks if not check.ok]
    # Venus alone turns it by 277 arcseconds, and not by what all planets do.
    assert any(claim.startswith("relativity turns it by 44.000") for claim in failed)
    assert any(claim.startswith("the planets turn it") for claim in failed)
    assert not any(claim.startswith("two bodies without relativity") for claim in failed)
    assert seen_at_readers_size(result.figures["mercury"]())


@pytest.mark.nightly
def test_each_rung_of_the_ladder_has_one_thing_more():
    rungs = parts("de440")["ladder"]()
    bodies = [len(system) for system in rungs.values()]
    acting = [len(system.terms) + len(system.forces) for system in rungs.values()]
    assert bodies == [11, 11, 11, 11, 27, 354, 354, 354, 390, 420]
    assert acting == [0, 1, 2, 4, 4, 5, 6, 7, 7, 7]
    full = orbits.System.solar_system(epoch="2000-01-01", model="full")
    assert list(rungs.values())[-1] == full


def test_the_ladder_is_drawn():
    names = parts("de440")
    rng, years = np.random.default_rng(1), np.linspace(0.0, 30.0, 40)
    found, late = {}, {}
    rungs = [names["NEWTON"], "second", "third", names["FIGURES"], *map(str, range(5, 10)), names["FULL"]]
    assert len(rungs) == len(names["WORDS"])
    for k, name in enumerate(rungs):
        km = {body: 10.0 ** (3 - k) * years[:, None] * rng.normal(size=(40, 3)) for body in names["SHOWN"]}
        found[name] = Residuals("DE440", "Gauss(stages=8)", years, km, (), name)
        late[name] = found[name].last_tenth()
    assert seen_at_readers_size(names["draw"](found, late))
