"""Kepler's equation is solved to the floor that the rounding of its arguments sets."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest

from orbits.elements.kepler import (
    SERIES_BELOW,
    angle_minus_sine,
    eccentric_anomaly,
    positive_angle,
    reduced_angle,
    sinh_anomaly,
)

HALF_ULP = 2.0**-53
ANGLES = np.concatenate([10.0 ** np.arange(-15.0, 0.3, 0.7), [1e-300, 0.9, 2.0, 2.8, 3.1, 3.14159]])


@pytest.mark.parametrize(
    "e", [0.0, 1e-12, 1e-4, 0.1, 0.4, 0.5, 0.7, 0.9, 0.97, 0.99, 0.999, 0.9999, 1 - 1e-8, 1 - 1e-12]
)
def test_ellipse_is_solved_to_the_rounding_of_M_and_E(e: float, oracle: Any) -> None:
    E = eccentric_anomaly(ANGLES, np.full_like(ANGLES, e))
    for M, got in zip(ANGLES, E, strict=True):
        exact = oracle.anomaly(M, e)
        floor = HALF_ULP * (abs(exact) + M / (1 - mp.mpf(e) * mp.cos(exact)))
        # 1.1 was reached over 1,000 random arguments; two operations' worth of rounding.
        assert abs(got - exact) <= 1.5 * floor


@pytest.mark.parametrize("e", [1 + 1e-12, 1 + 1e-8, 1.0001, 1.01, 1.5, 3.0, 10.0, 100.0, 3000.0])
def test_hyperbola_is_solved_to_the_rounding_of_M_and_sinh_F(e: float, oracle: Any) -> None:
    angles = np.concatenate([10.0 ** np.arange(-15.0, 9.0, 0.9), [1e-300, 1e50]])
    for M, got in zip(angles, sinh_anomaly(angles, np.full_like(angles, e)), strict=True):
        exact = oracle.anomaly(M, e)
        floor = HALF_ULP * (mp.sinh(exact) + M / (mp.mpf(e) - 1 / mp.cosh(exact)))
        # 1.6 was reached, next to e = 1.
        assert abs(got - mp.sinh(exact)) <= 2.0 * floor


def test_anomalies_are_odd_in_M_and_vanish_with_it() -> None:
    e = np.full_like(ANGLES, 0.6)
    assert np.array_equal(eccentric_anomaly(-ANGLES, e), -eccentric_anomaly(ANGLES, e))
    assert np.array_equal(sinh_anomaly(-ANGLES, e + 1.0), -sinh_anomaly(ANGLES, e + 1.0))
    assert eccentric_anomaly(np.zeros(1), e[:1])[0] == 0.0
    assert sinh_anomaly(np.zeros(1), e[:1] + 1.0)[0] == 0.0


def test_a_million_turns_are_taken_off_without_losing_a_digit() -> None:
    x = np.random.default_rng(1).uniform(-6e6, 6e6, 500)
    with mp.workdps(40):
        for got, angle in zip(reduced_angle(x), x, strict=True):
            exact = mp.mpf(angle) - 2 * mp.pi * mp.nint(mp.mpf(angle) / (2 * mp.pi))
            # Two roundings of an angle of up to pi, 4.4e-16 apart.
            assert abs(got - exact) <= 9e-16


def test_positive_angle_stays_below_a_whole_turn() -> None:
    angles = positive_angle(np.array([-1e-300, -1e-17, -1e-16, 2 * np.pi, -2 * np.pi, 7.0, -1.0]))
    assert np.all((angles >= 0.0) & (angles < 2 * np.pi))
    assert angles[-1] == 2 * np.pi - 1.0


def test_x_minus_sin_x_keeps_its_digits_at_every_size() -> None:
    x = np.concatenate([10.0 ** np.linspace(-80, 0.5, 200), SERIES_BELOW + np.array([-1e-9, 0.0, 1e-9])])
    with mp.workdps(300):
        for got, argument in zip(angle_minus_sine(x), x, strict=True):
            exact = mp.mpf(argument) - mp.sin(mp.mpf(argument))
            # Cubing costs two roundings, the product a third; above the switch the sine's half ulp is doubled.
            assert abs(got - exact) <= 4 * HALF_ULP * exact
