"""The closed form of a free rigid body at any times, against elliptic functions in 40 digits, and what is refused."""

import mpmath
import numpy as np
import pytest

from orbits import rotations
from orbits.diagnostics.free_top import free_top
from orbits.errors import InputError

from ..kernels.rotors import drawn


def off(q, attitude):
    """How far the rotation of q is from a matrix of mpmath."""
    R = rotations.matrices(q)
    return max(abs(float(attitude[i, j] - mpmath.mpf(R[i, j]))) for i in range(3) for j in range(3))


def test_a_hundred_thousand_revolutions_in_one_leap_keep_ten_digits():
    for inertia, q, momentum in zip(*drawn(6, seed=4), strict=True):
        rates = momentum / inertia
        start, _ = rotations.start(rates, q)
        time = 2e5 * np.pi / np.linalg.norm(rates)
        found, turning = rotations.free_rotation(inertia, time, rates=rates, attitude=start)
        attitude, after = free_top(inertia, start, momentum, time)
        # The angle of 6e5 radians is rounded by up to 7e-11; 1.2e-10 was seen.
        assert off(found, attitude) < 3e-10
        assert max(abs(float(x) - y) for x, y in zip(after, turning * inertia, strict=True)) < 1e-10


def test_the_attitude_and_the_rates_at_t_10_are_those_of_elliptic_functions():
    q, rates = rotations.free_rotation((1.0, 2.0, 3.0), 10.0, rates=(0.4, 0.0, 0.9))
    known = (-0.3337316157383565, 0.2205067088699706, 0.8909502027504743)
    assert np.abs(rates - known).max() < 4e-16
    momentum = np.array([0.4, 0.0, 2.7])
    row = (-0.1222698036241977, 0.1615748147306903, 0.9792566948285027)
    assert np.abs(momentum / np.linalg.norm(momentum) @ rotations.matrices(q) - row).max() < 4e-16


def test_times_may_have_any_shape_and_sign_and_are_independent_of_each_other():
    start = {"rates": (0.3, 0.01, -1.0), "attitude": (1.0, 2.0, 3.0, 4.0)}
    times = np.linspace(-40.0, 40.0, 15).reshape(3, 5)
    q, rates = rotations.free_rotation((1, 1.5, 2), times, **start)
    assert q.shape == (3, 5, 4)
    assert rates.shape == (3, 5, 3)
    alone = [rotations.free_rotation((1, 1.5, 2), t, **start) for t in times.ravel()]
    assert np.array_equal(q.reshape(-1, 4), [one for one, _ in alone])
    assert np.array_equal(rates.reshape(-1, 3), [other for _, other in alone])
    assert rotations.free_rotation((1, 1.5, 2), [], **start)[0].shape == (0, 4)
    assert np.abs(q[1, 2] - rotations.start(start["rates"], start["attitude"])[0]).max() < 2e-16


def test_attitudes_stay_rotations_and_angular_momentum_stays_where_it_is_at_any_time():
    for inertia, q, momentum in zip(*drawn(5, seed=6), strict=True):
        times = np.random.default_rng(1).uniform(-1e4, 1e4, 4000)
        found, rates = rotations.free_rotation(inertia, times, rates=momentum / inertia, attitude=q)
        R = rotations.matrices(found)
        # Products of the entries, rounded: 1.6e-15 was seen.
        assert np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max() < 2e-15
        in_space = (R @ (rates * inertia)[..., None])[..., 0]
        want = rotations.matrices(q) @ momentum
        # The attitude and the momentum are rounded apart, after up to 1e4 radians; along the momentum nothing is lost.
        assert np.abs(in_space - want).max() < 2e-14 * np.linalg.norm(momentum)


def test_the_quaternion_is_continuous_through_whole_periods():
    times = np.linspace(0.0, 200.0, 4001)
    for rates in ((0.4, 0.1, 0.9), (0.9, 0.1, 0.2)):
        q, _ = rotations.free_rotation((1, 2, 3), times, rates=rates)
        assert np.abs(np.diff(q, axis=0)).max() < 0.03  # half the angle in 0.05, not 2


@pytest.mark.parametrize("unit", [1e-300, 1e300])
def test_moments_in_any_unit_are_the_same_body(unit):
    one, other = (rotations.free_rotation(x * np.array([1.0, 2, 3]), 3.0, rates=(0.4, 0.1, 0.9)) for x in (1.0, unit))
    assert max(np.abs(a - b).max() for a, b in zip(one, other, strict=True)) < 1e-14


@pytest.mark.parametrize(
    ("inertia", "times", "more", "words"),
    [
        ((1, 2, 4), 1.0, {}, "exceeds the sum of the others by 1"),
        ((1, 0, 1), 1.0, {}, "expected three principal moments of inertia > 0"),
        ((1, 2, 3), [1.0, np.inf], {}, r"times\[1\] is inf"),
        ((1, 2, 3), "soon", {}, "expected an array of real numbers"),
        ((1, 2, 3), 1.0, {"rates": (1, 2)}, "three finite numbers"),
        ((1, 2, 3), 1.0, {"rates": "fast"}, "rates is 'fast'; expected an array of real numbers"),
        ((1, 2, 3), 1.0, {"attitude": 1.01 * np.eye(3)}, "R\\^T R differs from 1 by 0.02"),
        ((1, 2, 3), 1e14, {}, "leaves no digits of its attitude"),
    ],
)
def test_what_is_no_body_no_time_or_no_rotation_is_refused(inertia, times, more, words):
    with pytest.raises(InputError, match=words):
        rotations.free_rotation(inertia, times, **{"rates": (0.4, 0.0, 0.9), **more})
