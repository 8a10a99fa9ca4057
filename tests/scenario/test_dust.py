"""The scenario of dust, shortened: what it demands, and what fails it."""

import struct

import numpy as np
import pytest
from astropy import units as u

from orbits.scenario import load, perform


def dust(**changes):
    return load("dust").with_changes(**{"duration": 60 * u.yr, "samples": 13, **changes})


@pytest.mark.nightly
def test_dust_falls_as_the_secular_formula_says(tmp_path):
    outcome = perform(dust(), out=tmp_path)
    assert outcome.ok, outcome.failures
    assert len(outcome.checks) == 10
    width, height = struct.unpack(">II", (tmp_path / "dust.png").read_bytes()[16:24])
    assert width >= 1300
    assert height >= 800


@pytest.mark.nightly
def test_a_drag_that_is_one_per_cent_off_fails(tmp_path, monkeypatch):
    scenario = dust(duration=100 * u.yr)
    names = scenario.checks.__globals__
    drag = names["drag"]
    monkeypatch.setitem(names, "expected", names["expected"].__wrapped__)
    system = scenario.system()
    monkeypatch.setitem(names, "drag", lambda *given: 1.01 * drag(*given))
    # The grains start where they would with the true drag, the formula goes on from there with the wrong one.
    starts = {(e, 1.01 * drag(beta, *names["constants"]()[1:])): a for (beta, e), a in zip(
        names["GRAINS"], (names["start"](e, drag(beta, *names["constants"]()[1:])) for beta, e in names["GRAINS"]),
        strict=True)}  # fmt: skip
    monkeypatch.setitem(names, "start", lambda e, eta: starts[e, eta])
    outcome = perform(scenario.with_changes(system=system), out=tmp_path, plot=False)
    assert sum(not check.ok for check in outcome.checks) == 9


@pytest.mark.parametrize("e", [0.05, 0.4, 0.8])
def test_the_secular_solution_solves_its_equations(e):
    secular = load("dust").checks.__globals__["secular"]
    eta, years = 1e-4, np.linspace(0.0, 500.0, 501)
    a, found = secular(1.0, e, eta, years)
    rate_a = -eta / a * (2 + 3 * found**2) / (1 - found**2) ** 1.5
    rate_e = -2.5 * eta / a**2 * found / np.sqrt(1 - found**2)
    # Central differences over a year, and an interpolation to 1e-9.
    assert np.allclose(np.gradient(a, years)[1:-1], rate_a[1:-1], rtol=2e-5, atol=0)
    assert np.allclose(np.gradient(found, years)[1:-1], rate_e[1:-1], rtol=2e-5, atol=0)
