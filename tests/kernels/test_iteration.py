"""The iteration of an implicit step: when it continues, when it is at the floor, and when it has not converged."""

import numpy as np
import pytest

from orbits.kernels.sums import iteration


def rows(*values):
    """Changes of up to eight components: each value stands in one stage of its row, the other stages lie below."""
    change = np.zeros((8, 8))
    for k, value in enumerate(values):
        change[k] = 0.5 * value
        change[k, k % 8] = value
    return change


def begun(*scales):
    history = np.zeros((3, 8))
    iteration.begin(rows(*scales), history)
    return history


def test_a_change_that_falls_goes_on():
    history = begun(1.0)
    assert iteration.falling(rows(1e-3), history)
    assert iteration.falling(rows(1e-6), history)


def test_a_change_that_no_longer_falls_stops():
    history = begun(1.0)
    iteration.falling(rows(3e-16), history)
    assert not iteration.falling(rows(3e-16), history)


def test_a_fall_whose_next_change_vanishes_in_rounding_stops():
    """From 1e-6 to 1e-12 in one round: the next change would be 1e-18 of the scale."""
    history = begun(1.0)
    assert iteration.falling(rows(1e-6), history)
    assert not iteration.falling(rows(1e-12), history)


def test_one_falling_component_keeps_all_going():
    history = begun(1.0, 1.0, 0.0)
    assert iteration.falling(rows(0.0, 1e-2, 0.0), history)
    assert not iteration.falling(rows(0.0, 1e-2, 0.0), history)


def test_components_are_measured_on_their_own_scale():
    """A change of 1e-12 is nothing for a component of size 1 and everything for one of size 1e-9."""
    history = begun(1.0, 1e-9)
    iteration.falling(rows(1e-16, 1e-12), history)
    assert not iteration.settled(history, iteration.NEAR_FLOOR)
    assert not iteration.settled(history, 1e-4)
    assert iteration.settled(history, 1e-2)


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_the_body_that_did_not_converge_is_named(bad):
    """Coordinates lie x, y, z of three bodies; a tiny z is judged by the size of its body's whole vector."""
    scale = np.ones(9)
    scale[6:] = 1e-15
    least = np.full(9, 1e-14)
    least[bad] = 1e-3
    history = np.zeros((6, 8))
    for k in range(9):
        history[k // 8, k % 8] = least[k]
        history[4 + k // 8, k % 8] = scale[k]
    assert iteration.unsettled_body(history, 3, 3, iteration.CONVERGED) == bad
    history[0, bad] = 1e-14
    assert iteration.unsettled_body(history, 3, 3, iteration.CONVERGED) == -1


def test_a_change_that_is_not_a_number_does_not_count_as_falling():
    history = begun(1.0)
    assert not iteration.falling(rows(np.nan), history)
