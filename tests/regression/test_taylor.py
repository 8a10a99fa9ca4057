"""The Taylor series of the reference solution: 31 digits, in any direction, through encounters."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import pytest

from orbits.errors import SingularityError
from orbits.point_masses import PointMasses
from orbits.regression import reference
from orbits.regression.taylor import taylor
from orbits.resources import data_path

from ..problems import kepler, three_bodies

# Burrau's problem at t = 63 by heyoka's Taylor series in 128-bit floats.
BURRAU = [
    [2.8394339724915003, 8.112854424695952, 0.0],
    [-0.4634202799751191, -2.8522283629340026, 0.0],
    [-1.332924159514805, -2.585929964470369, 0.0],
]
AT_REST = PointMasses(
    np.array([3.0, 4.0, 5.0]), np.array([[1.0, 3, 0], [-2, -1, 0], [1, -1, 0]]), np.zeros((3, 3)), 0.0
)


@pytest.mark.parametrize("e", [0.0, 0.6, 0.99, 0.9999])
def test_two_bodies_are_where_keplers_equation_in_60_digits_has_them_to_every_bit(e):
    start = PointMasses(*kepler(e), 0.0)
    times = np.linspace(0.0, 50.0, 9)
    found = taylor(start, times)
    # Coordinates that the exact solution rounds to 0 are the last digits of doubled precision here.
    np.testing.assert_allclose(found.q, reference.exact(start, times).q, rtol=0, atol=1e-25 / (1 - e))
    back = taylor(start, -times)
    np.testing.assert_allclose(back.q, reference.exact(start, -times).q, rtol=0, atol=1e-25 / (1 - e))


def test_ten_bodies_over_ten_years_agree_with_quadruple_precision_to_its_printed_digits():
    """4e-22 au is the difference; the bundled reference has a tolerance of 1e-26 a step."""
    data = json.loads(data_path("solar_system_10body.json").read_text(encoding="utf-8"))
    start = PointMasses(*(np.array(data[key], dtype=float) for key in ("gm_au3_d2", "q", "v")), 0.0)
    found = taylor(start, np.array([3652.5]))
    for body, row in enumerate(data["reference_years"]["10"]):
        for values, lows, expected in ((found.q, found.q_lo, row[:3]), (found.v, found.v_lo, row[3:])):
            for x, low, text in zip(values[0, body].tolist(), lows[0, body].tolist(), expected, strict=True):
                assert abs(Fraction(x) + Fraction(low) - Fraction(text)) < 2e-21


def test_burraus_problem_comes_out_to_every_bit_through_encounters_that_cost_others_ten_digits():
    times = np.array([20.0, 63.0])
    found = taylor(AT_REST, times)
    np.testing.assert_array_equal(found.q[-1], BURRAU)
    other = taylor(AT_REST, times, order=28)
    missed = np.abs(other.from_positions(found.q) + found.q_lo).max()
    assert 0.0 < missed < 1e-16  # 2e-18: two series do not agree by sharing their errors
    assert other.steps > 1.5 * found.steps


def test_samples_between_steps_change_nothing():
    start = PointMasses(*three_bodies(), 0.01)
    few, many = taylor(start, np.array([0.7, 3.0])), taylor(start, np.linspace(0.1, 3.0, 30))
    assert few.steps == many.steps
    np.testing.assert_array_equal(few.q[0], many.q[6])
    np.testing.assert_array_equal(few.q[1], many.q[-1])


def test_softened_motion_leads_back_to_its_start_in_every_digit():
    start = PointMasses(*three_bodies(particles=2), 0.1)
    there = taylor(start, np.array([10.0]))
    back = taylor(PointMasses(start.gm, there.q[0], there.v[0], 0.1), np.array([-10.0]))
    assert np.abs(back.q[0] - start.q).max() < 1e-12  # the rounding of the state in between to float64
    lighter = taylor(PointMasses(start.gm, start.q, start.v, 0.0), np.array([10.0]))
    assert np.abs(lighter.q - there.q).max() > 1e-3


def test_massless_particles_attract_nothing():
    gm, q, v = three_bodies(particles=2)
    all_of_them = taylor(PointMasses(gm, q, v, 0.0), np.array([5.0]))
    alone = taylor(PointMasses(gm[:3], q[:3], v[:3], 0.0), np.array([5.0]))
    # The steps are others: those of the particles count too.
    np.testing.assert_allclose(all_of_them.q[:, :3], alone.q, rtol=0, atol=1e-16)


def test_a_body_alone_moves_straight_on():
    found = taylor(PointMasses(np.array([1.0]), np.array([[1.0, 2, 3]]), np.array([[0.5, 0, 0]]), 0.0), np.array([8.0]))
    assert found.q[0].tolist() == [[5.0, 2.0, 3.0]]


def test_a_collision_ends_it_in_words():
    falling = PointMasses(np.ones(2), np.array([[-1.0, 0, 0], [1, 0, 0]]), np.zeros((2, 3)), 0.0)
    with pytest.raises(SingularityError, match=r"reference solution ends at t = 2\.22"):
        taylor(falling, np.array([3.0]))


def test_the_error_that_it_states_is_more_than_its_own_and_no_more_than_a_rounding():
    made = reference.series(PointMasses(*kepler(0.9), 0.0), np.linspace(0.0, 50.0, 9))
    exact = reference.exact(PointMasses(*kepler(0.9), 0.0), np.linspace(0.0, 50.0, 9))
    assert made.kind == "taylor"
    assert np.all(np.linalg.norm(made.q - exact.q, axis=-1).max(axis=0) <= made.error)
    assert np.all(made.error < 4e-16)
