"""The growth of round-off: random walks and drifts told apart, in numbers made up and in those of real methods."""

import numpy as np
import pytest

import orbits
from orbits import diagnostics
from orbits.diagnostics.growth import energy_errors as exact_energy_errors
from orbits.diagnostics.nearest_gauss import NearestGauss
from orbits.diagnostics.stepping import Bodies, march_finely
from orbits.errors import InputError

from ..problems import random_kepler

TIMES = np.unique(np.round(np.geomspace(10, 10_000, 16)).astype(int))


def walks(starts, drift=0.0, seed=3):
    """Random walks of unit steps, with a drift per step, at TIMES; and their sums, which are phases."""
    steps = np.random.default_rng(seed).normal(size=(starts, TIMES[-1])) + drift
    energy = np.cumsum(steps, axis=1)
    return energy[:, TIMES - 1], np.cumsum(energy, axis=1)[:, TIMES - 1]


def test_a_random_walk_grows_with_the_root_of_time_and_its_sum_with_the_power_three_halves():
    energy, phase = (diagnostics.growth(TIMES, x) for x in walks(64))
    assert energy.consistent_with(0.5)
    assert phase.consistent_with(1.5)
    assert not energy.consistent_with(1.0)
    assert not phase.consistent_with(2.0)
    assert energy.uncertainty < 0.08
    assert abs(energy.bias) < 3.5
    assert energy.rms == pytest.approx(np.sqrt(TIMES), rel=0.35)


def test_a_drift_grows_with_time_and_its_sum_with_the_square():
    energy, phase = (diagnostics.growth(TIMES, x) for x in walks(64, drift=1.0))
    assert energy.exponent == pytest.approx(1.0, abs=0.03)
    assert phase.exponent == pytest.approx(2.0, abs=0.03)
    assert not energy.consistent_with(0.5)
    assert energy.bias > 100


def test_the_uncertainty_is_what_the_exponent_varies_by_from_ensemble_to_ensemble():
    found = [diagnostics.growth(TIMES, walks(32, seed=seed)[0]) for seed in range(40)]
    scatter = np.std([each.exponent for each in found])
    assert 0.6 < np.median([each.uncertainty for each in found]) / scatter < 1.6
    assert np.mean([each.consistent_with(0.5) for each in found]) > 0.92


def energy_errors(method, starts, periods=1000, per_period=30):
    rng = np.random.default_rng(1)
    steps = np.unique(np.round(np.geomspace(100 * per_period, periods * per_period, 10)).astype(int))
    errors = []
    for _ in range(starts):
        gm, q, v = random_kepler(rng)
        errors.append(exact_energy_errors(gm, *march_finely(Bodies(gm, q, v), method, float(np.float32(0.2)), steps)))
    return steps, np.array(errors)


def test_gauss_with_exact_coefficients_walks_at_random_and_with_rounded_ones_drifts():
    """16 starts on Kepler's problem with e = 0.2 over 1,000 orbits: Brouwer's law is a matter of the last bit."""
    exact = diagnostics.growth(*energy_errors(orbits.Gauss(stages=8), 16))
    rounded = diagnostics.growth(*energy_errors(NearestGauss(stages=8), 16))
    assert exact.consistent_with(0.5)  # 0.41; 0.50 +- 0.04 over 3,000 orbits
    assert not exact.consistent_with(1.0)
    assert exact.rms[-1] < 2e-16  # 4e-17, in states with all their digits
    assert rounded.exponent > 0.95
    assert not rounded.consistent_with(0.5)
    assert abs(rounded.bias) > 50
    assert rounded.rms[-1] > 200 * exact.rms[-1]  # 1,300 times


WRONG = [
    ((TIMES, np.ones((8, 3))), "errors must be"),
    ((TIMES, np.ones((7, len(TIMES)))), "at least 8 and 4"),
    (([1.0, 2.0, 3.0], np.ones((8, 3))), "at least 8 and 4"),
    (([0.0, 1.0, 2.0, 3.0], np.ones((8, 4))), "times must be positive"),
    (([1.0, 2.0, 3.0, 4.0], np.full((8, 4), np.nan)), "errors finite"),
    (([2.0, 2.0, 2.0, 2.0], np.ones((8, 4))), "all times are 2; expected different ones"),
    (([1.0, 2.0, 3.0, 4.0], np.zeros((8, 4))), "no start has any error at t = 1"),
]


@pytest.mark.parametrize(("given", "message"), WRONG, ids=[m for _, m in WRONG])
def test_ensembles_too_small_to_tell_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        diagnostics.growth(*given)


def test_the_bias_is_that_of_the_latest_time_in_whatever_order_times_are_given():
    errors = np.random.default_rng(3).normal(size=(20, 4)).cumsum(axis=1) + 0.2
    given, turned = (diagnostics.growth(TIMES[:4][::k], errors[:, ::k]) for k in (1, -1))
    assert turned.bias == given.bias
    assert turned.t.tolist() == TIMES[:4].tolist()
