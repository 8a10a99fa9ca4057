"""Calls of the public interface with anything at all: a number, or an error in words; see `fuzz`."""

import contextlib

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, OrbitsError
from tests.faults.alarm import at_most
from tests.faults.fuzz import RUN, SECONDS, fuzz

from ..coverings import each


def test_a_few_calls_with_anything_at_all_give_numbers_or_errors_in_words():
    found = fuzz(seed=0, count=100)
    assert not found.wrong
    assert found.returned > 25, "good calls are among them"


SUN = orbits.System(["Sun", "rock"], [1.0, 0.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]],
                    units=orbits.DIMENSIONLESS)  # fmt: skip
SHORT = {"dt": 0.1, "duration": 0.2, "samples": 2}
ABSURD = {
    "a tolerance": lambda x: orbits.Adaptive(tolerance=x),
    "a step": lambda x: orbits.TimeTransformed(step=x),
    "vectors of a MEGNO": lambda x: orbits.megno(SUN, "stormer-verlet", vectors=x, **SHORT),
    "a number of clones": lambda x: orbits.ensemble.clones(SUN, "rock", covariance=np.eye(6), count=x),
    "a radius": lambda x: SUN.with_rigid({"Sun": orbits.RigidBody(A=0.4, B=0.4, C=0.4, radius=x)}),
    "an attitude": lambda x: SUN.with_rigid({"Sun": orbits.RigidBody(A=0.4, B=0.4, C=0.4, radius=1.0, attitude=x)}),
    "coordinates": lambda x: orbits.WisdomHolman(coordinates=x),
    "encounters": lambda x: orbits.methods.SABA(encounters=x),
    "a model": orbits.solar_model,
    "a spin": RUN.rotation.spin,
    "a source of relativity": lambda x: SUN.with_terms(orbits.terms.PostNewtonian(x, sources="Sun", c=1e3)),
    "a path": orbits.resume,
    "peers": lambda x: orbits.scenarios.Scenario(name="s", title="A", system=SUN, dt=0.1, duration=1.0, against=x),
}


@each(
    "absurd", [10**400, 10**11, -1, -1.0 * u.yr, np.nan, np.inf, "x", [], np.zeros(0), np.array("x")]
)
@each("what", ABSURD)
def test_absurd_values_are_refused_in_words_and_at_once(what, absurd):
    with at_most(SECONDS), contextlib.suppress(OrbitsError):
        ABSURD[what](absurd)
        good = what == "a radius" and absurd == 10**11
        assert good or (what == "peers" and len(absurd) == 0), "the only ones of them that can be"


@pytest.mark.parametrize("ask", [orbits.megno, orbits.state_transition])
def test_variations_of_a_method_that_needs_a_dt_are_refused_without_one(ask):
    with pytest.raises(InputError, match=r"StormerVerlet\(\) needs a dt"):
        ask(SUN, "stormer-verlet", duration=1.0)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(1, 11))
def test_many_calls_with_anything_at_all_give_numbers_or_errors_in_words(seed):
    """32,000 in all, each with an alarm."""
    found = fuzz(seed, count=3200)
    assert not found.wrong
    assert found.returned > 800
