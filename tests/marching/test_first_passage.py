"""Where the distance of two bodies first passes a bound, within a step of any length."""

import numpy as np
import pytest

from orbits.marching.first_passage import SPACING, Within, first_passage


def straight(way: float, phase: float, least: float):
    """Return the motion of a pair along a line, 2 `way` in the step, with the least distance at a phase of it."""

    def apart(s: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([2.0 * way * (s - phase), least, 0.0]), np.array([2.0 * way, 0.0, 0.0])

    return apart


@pytest.mark.parametrize("way", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("least", [0.0, 0.5, 1.0 - 1e-9])
def test_a_passage_far_shorter_than_the_step_is_found_to_round_off(way, least):
    half = np.sqrt((1.0 - least) * (1.0 + least)) / (2.0 * way)
    for phase in (0.1, 0.5, 0.93):
        found = first_passage(straight(way, phase, least), 1.0, 1.0)
        # The distance is rounded to 2^-53, which a graze magnifies by the inverse of its slope; s itself to 1e-16.
        assert found == pytest.approx(phase - half, abs=2e-16 + 2e-16 / (4.0 * way * way * half))


def test_a_pair_that_stays_apart_does_not_pass():
    assert first_passage(straight(1e6, 0.3, 1.0 + 1e-9), 1.0, 1.0) is None


@pytest.mark.parametrize("begun", [0.0, -1e-16, 1e-16])
def test_a_pair_that_leaves_its_bound_passes_it_where_it_comes_back(begun):
    def apart(s: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([1.0 + begun + s * (0.3 - s), 0.0, 0.0]), np.array([0.3 - 2.0 * s, 0.0, 0.0])

    assert first_passage(apart, 1.0, 1.0, noise=4e-16) == pytest.approx(0.3, abs=4e-15)


def test_a_contact_is_found_before_places_to_which_no_partial_step_leads():
    motion = straight(1.0, 0.6, 0.0)

    def apart(s: float) -> tuple[np.ndarray, np.ndarray]:
        q, v = motion(s)
        return (q, v) if s < 0.15 else (q + np.nan, v)

    assert first_passage(apart, 1.0, 1.0) == pytest.approx(0.1, abs=2e-16)


def test_where_partial_steps_move_bodies_otherwise_than_by_their_velocities_rates_are_those_of_their_places():
    """A parabola has the differences of its derivative, but for the rounding of its places: 1e-16 / SPACING."""
    begun, speed, bend = np.random.default_rng(1).normal(size=(3, 2, 3))
    length, elsewhere = 0.25, np.full((2, 3), np.nan)

    def at(part: float) -> tuple[np.ndarray, np.ndarray]:
        return begun + part * (speed + part * bend), elsewhere

    within = Within(length, at(0.0), at(1.0), at, moves_otherwise=True)
    for part in (0.5 * SPACING, 0.3, 1.0):  # where there is no room for a place on either side, too
        q, rate = within.motion(part)
        np.testing.assert_array_equal(q, at(part)[0])
        np.testing.assert_allclose(rate, (speed + 2.0 * part * bend) / length, rtol=0, atol=1e-10)  # 4e-11
