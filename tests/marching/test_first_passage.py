"""Where the distance of two bodies first passes a bound, within a step of any length."""

import numpy as np
import pytest

from orbits.marching.first_passage import first_passage


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
