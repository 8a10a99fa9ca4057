"""Kepler's equation is solved to the floor that the rounding of its arguments sets."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest

from orbits.elements.kepler_equation import (
    SERIES_BELOW,
    angle_minus_sine,
    barker_anomaly,
    eccentric_anomaly,
    positive_angle,
    reduced_angle,
    sinh_anomaly,
)

from ..coverings import each

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


@each("side", [1, -1])
@each("distance", [2.0**-52, 1e-15, 1e-9, 1e-30, 1e-100])
def test_next_to_the_parabola_it_is_one_minus_e_that_counts(distance: float, side: int) -> None:
    rng = np.random.default_rng(3)
    M = np.concatenate([10.0 ** rng.uniform(-250, -20, 20), 10.0 ** rng.uniform(-20, 0.49, 20)])
    one_minus_e = np.full_like(M, side * distance)
    solve = eccentric_anomaly if side > 0 else sinh_anomaly
    for m, got in zip(M, solve(M, 1.0 - one_minus_e, one_minus_e), strict=True):
        with mp.workdps(40 - int(3 * np.log10(min(m, distance)))):
            d, x = mp.mpf(side * distance), mp.mpf(float(got)) if side > 0 else mp.asinh(mp.mpf(float(got)))
            # One step of Newton's in hundreds of digits, from a value that is good to sixteen.
            if side > 0:
                value, slope = x - (1 - d) * mp.sin(x) - m, 1 - (1 - d) * mp.cos(x)
                miss, size = value / slope, x
            else:
                value, slope = (1 - d) * mp.sinh(x) - x - m, (1 - d) - 1 / mp.cosh(x)
                miss, size = value / slope, mp.sinh(x)
            # 1.3 was reached.
            assert abs(miss) <= 1.6 * HALF_ULP * (size + m / slope)


def test_barkers_equation_is_solved_to_the_rounding_of_M_and_D() -> None:
    rng = np.random.default_rng(4)
    M = np.concatenate([10.0 ** rng.uniform(-300, 300, 100), 10.0 ** rng.uniform(-3, 3, 100)])
    for m, got in zip(M, barker_anomaly(M), strict=True):
        with mp.workdps(340):
            # At most as long as D for small M, where sinh and asinh cancel; hence the digits.
            D = 2 * mp.sinh(mp.asinh(mp.mpf(m) * 3 / 2) / 3)
            # 0.9 was reached.
            assert abs(got - D) <= 1.2 * HALF_ULP * (D + m / (1 + D * D))
    assert np.array_equal(barker_anomaly(-M), -barker_anomaly(M))
    assert barker_anomaly(np.zeros(1))[0] == 0.0


@pytest.mark.parametrize("M", [0.0, 5e-324, 1e-310, 1e-200, np.pi, 1e15, 1e22, 1e300])
def test_no_argument_makes_anything_but_numbers(M: float) -> None:
    near = np.array([2.0**-53, 1e-300, 0.5, 1.0])
    for sign in (1.0, -1.0):
        m = np.full(4, sign * M)
        with np.errstate(divide="raise", invalid="raise"):
            E = eccentric_anomaly(m, 1.0 - near, near)
        assert np.all(np.abs(E) <= np.pi)
        with np.errstate(divide="raise", invalid="raise", over="ignore"):
            S = sinh_anomaly(m, 1.0 + near, -near)
        assert np.all(np.isfinite(S) & (S * sign >= 0.0))
        assert np.all(np.isfinite(barker_anomaly(m)))


def test_angles_without_a_countable_number_of_turns_are_reduced_all_the_same() -> None:
    x = 10.0 ** np.random.default_rng(2).uniform(10, 300, 100)
    for got, angle in zip(reduced_angle(x), x, strict=True):
        with mp.workdps(360):
            exact = mp.mpf(angle) - 2 * mp.pi * mp.nint(mp.mpf(angle) / (2 * mp.pi))
            assert abs(got - exact) <= 9e-16
