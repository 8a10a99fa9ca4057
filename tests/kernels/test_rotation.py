"""The free rotation of a rigid body against a series of 40 digits, in lanes, over long times and for all moments."""

import numpy as np
import pytest

from ..coverings import cover
from .rotors import by_series, drawn, rotated, rotated_in_lanes

EDGES = {
    "a sphere": ((1.0, 1.0, 1.0), (0.3, 0.2, 0.1)),
    "an oblate top": ((1.0, 1.0, 1.5), (0.3, 0.2, 1.0)),
    "an oblate top about its first axis": ((1.5, 1.0, 1.0), (0.3, 0.2, -1.0)),
    "a needle": ((1.0, 1.0, 1e-3), (0.1, 0.2, 0.01)),
    "nearly equal moments": ((1.0, 2.0, 2.0 + 1e-9), (0.1, 0.2, 0.3)),
    "at rest": ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)),
    "about the first axis": ((1.0, 2.0, 3.0), (1.0, 0.0, 0.0)),
    "about the middle axis": ((1.0, 2.0, 3.0), (0.0, 1.0, 0.0)),
    "near the middle axis": ((1.0, 2.0, 3.0), (1e-9, 1.0, 1e-9)),
    "near the last axis": ((1.0, 2.0, 3.0), (1e-9, 1e-8, 1.0)),
    "near the first axis": ((1.0, 2.0, 3.0), (1.0, 1e-8, 1e-12)),
    "a flat body in disorder": ((2.0, 3.0, 1.0), (-0.4, 0.1, -0.9)),
}


def missed(moments, q, momentum, h):
    """Return the error of q, as it is with its sign, and of the momentum as a fraction of it."""
    new_q, new = np.array(q, dtype=float), np.array(momentum, dtype=float)
    rotated(np.array(moments, dtype=float), h, new_q, new, 1)
    want_q, want = by_series(moments, q, momentum, h)
    off = max(abs(float(x - y)) for x, y in zip(want, new, strict=True))
    return max(abs(float(x - y)) for x, y in zip(want_q, new_q, strict=True)), off / (np.abs(momentum).max() or 1.0)


@cover(("name", "h"), EDGES, [0.1, -0.7, 3.0], strength=1)
def test_a_step_of_any_body_has_all_digits(name, h):
    moments, rates = EDGES[name]
    # Measured: up to 6e-16 radians for turns by up to 3 radians.
    assert max(missed(moments, (0.5, 0.1, -0.7, 0.5), np.array(moments) * rates, h)) < 8e-16


@pytest.mark.nightly
def test_steps_over_many_periods_lose_no_more_than_the_rounding_of_the_angle():
    for moments, q, momentum in zip(*drawn(3), strict=True):
        angle = 10.0 * np.linalg.norm(momentum / moments)
        # Measured: 1.7e-16 of angles up to 60 radians.
        assert max(missed(moments, q, momentum, 10.0)) < 4e-16 * angle


def test_the_closed_form_gives_the_known_motion_at_t_10():
    q, momentum = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.4, 0.0, 2.7])
    rotated(np.array([1.0, 2.0, 3.0]), 10.0, q, momentum, 1)
    known = (-0.3337316157383565, 0.2205067088699706, 0.8909502027504743)
    assert np.abs(momentum / (1.0, 2.0, 3.0) - known).max() < 4e-16


@pytest.mark.parametrize("scale", [0.02, 0.5, 3.0, 300.0])
def test_lanes_have_the_bits_of_bodies_alone(scale):
    moments, q, momentum = drawn(8, seed=2)
    h = np.random.default_rng(3).uniform(-1.0, 1.0, (1, 8)) * scale
    in_q, in_momentum = q.T.copy(), momentum.T.copy()
    rotated_in_lanes(moments.T.copy(), h, in_q, in_momentum, 3)
    for k in range(8):
        rotated(moments[k], h[0, k], q[k], momentum[k], 3)
    assert np.array_equal(in_q.T, q)
    assert np.array_equal(in_momentum.T, momentum)
