"""Back and forth, within the bounds that REBOUND's tests assert of its own methods, on its own problems."""

import json

import numpy as np
import pytest

import orbits
from orbits import diagnostics
from orbits.methods import LobattoIIIAB, RungeKutta4
from orbits.rebound import from_rebound
from orbits.resources import data_path

from ..problems import rebounds_outer_solar_system

BOUNDS = {row["name"]: row["asserts"] for row in json.loads(data_path("rebound_test_bounds.json").read_text())["tests"]}
METHODS = [orbits.StormerVerlet(), LobattoIIIAB(stages=3), orbits.Gauss(stages=2), orbits.Gauss(stages=8)]
IDS = [method.label for method in METHODS]


def planet(e, dt):
    """A planet of a thousandth at a = 1 (-1 for a hyperbola), at its pericentre; and dt times 2 pi."""
    gm = np.array([1.0, 1e-3])
    a = 1.0 if e < 1 else -1.0
    r, w = a * (1 - e), np.sqrt(1.001 / a * (1 + e) / (1 - e))
    q, v = np.array([[0.0, 0, 0], [r, 0, 0]]), np.array([[0.0, 0, 0], [0, w, 0]])
    return gm, q - gm @ q / gm.sum(), v - gm @ v / gm.sum(), 2 * np.pi * dt


@pytest.mark.parametrize("method", METHODS, ids=IDS)
def test_ten_steps_forth_and_back_on_the_outer_solar_system(method):
    """dt = 0.01232 periods of Jupiter: WHFast is asserted to 2e-11, SABA to 4e-14; here not a bit is missing."""
    assert "back-and-forth 10 steps <2e-11" in BOUNDS["test_whfast_advanced (15 settings)"]
    assert "back&forth 4e-14" in BOUNDS["test_saba"]
    x = from_rebound(rebounds_outer_solar_system()).values
    found = diagnostics.reversibility(x.gm, x.q, x.v, method, 0.0123235235 * 11.862 * 2 * np.pi, 10)
    assert found.ulps <= 2
    assert max(found.q, found.v) < 4e-14


@pytest.mark.parametrize(
    ("method", "dt", "steps"),
    [*((method, 0.00512, 1000) for method in METHODS), (orbits.Gauss(stages=8), 0.0512, 100)],
    ids=[*IDS, "Gauss(stages=8), WHFast's step"],
)
@pytest.mark.parametrize(("e", "bound"), [(2.5, 1e-14), (0.5, 1e-13)], ids=["hyperbolic", "eccentric"])
def test_a_hundred_steps_forth_and_back_on_an_orbit(method, dt, steps, e, bound):
    """REBOUND asserts 1e-14 on a hyperbola and 1e-13 on an ellipse of WHFast with steps of 0.0512 periods, which is
    exact for two bodies; methods of low order take ten times as many steps of a tenth.
    """
    assert "1e-14 / <1e-13" in BOUNDS["test_whfast.BackAndForth.test_whfast_hyperbolic / eccentric"]
    gm, q, v, h = planet(e, dt)
    found = diagnostics.reversibility(gm, q, v, method, h, steps)
    # 7e-14 at most on the ellipse, where an error in phase grows with the square of time; 4e-18 on the hyperbola.
    assert found.q / float(np.abs(q).max()) < bound
    assert found.v / float(np.abs(v).max()) < bound


def test_a_method_that_is_not_symmetric_misses_these_bounds_by_far():
    x = from_rebound(rebounds_outer_solar_system()).values
    dt = 0.0123235235 * 11.862 * 2 * np.pi
    assert diagnostics.reversibility(x.gm, x.q, x.v, RungeKutta4(), dt, 10).q > 1e-9
