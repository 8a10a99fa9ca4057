"""Drift as a fraction and in units in the last place."""

from __future__ import annotations

import numpy as np
import pytest

from orbits import diagnostics
from orbits.diagnostics import drift
from orbits.errors import InputError


def test_a_flat_series_has_no_drift_even_about_zero():
    for series in (np.full(5, -0.25), np.zeros(5), np.zeros((5, 3))):
        result = drift(series)
        assert (result.max_fraction, result.max_ulps, result.last_fraction) == (0.0, 0.0, 0.0)


def test_a_scalar_series_is_measured_against_its_first_value():
    result = drift([4.0, 4.0 + 3 * np.spacing(4.0), 5.0, 4.5])
    assert (result.max_fraction, result.last_fraction, result.scale) == (0.25, 0.125, 4.0)
    assert drift([4.0, 4.0 + 3 * np.spacing(4.0)]).max_ulps == 3.0


def test_a_vector_series_is_measured_by_the_size_of_the_difference():
    result = drift([[3.0, 4.0, 0.0], [3.0, 4.0, 2.5], [3.0, 4.0, -1.25]])
    assert (result.max_fraction, result.last_fraction, result.scale) == (0.5, 0.25, 5.0)


def test_a_given_scale_replaces_the_first_value():
    result = drift([0.0, 1e-20], scale=-2.0)
    assert (result.max_fraction, result.scale) == (5e-21, 2.0)
    assert drift([0.0, 1e-20]).max_fraction == float("inf")


@pytest.mark.parametrize(
    ("series", "scale", "words"),
    [
        ([], None, r"shape \(0,\)"),
        (np.zeros((2, 2, 3)), None, r"shape \(2, 2, 3\)"),
        ([1.0, 2.0, float("nan")], None, "at sample 2"),
        ([1.0], float("inf"), "the scale must be finite, got inf"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_words(series, scale, words):
    with pytest.raises(InputError, match=words):
        drift(series, scale)


def test_the_centre_of_mass_is_followed_on_its_uniform_motion():
    gm, t = np.array([3.0, 1.0, 0.0]), np.linspace(0.0, 10.0, 5)
    start, v = np.array([[1.0, 0, 0], [-3.0, 0, 0], [9.0, 9, 9]]), np.array([[0, 2.0, 0], [0, -2.0, 0], [0, 0, 0]])
    q = start + t[:, None, None] * np.array([0.0, 1.0, 0.0])  # the centre moves at (3 x 2 - 1 x 2) / 4 = 1
    assert diagnostics.centre_of_mass_drift(gm, t, q, v).max_fraction == 0.0
    q[3, 0, 2] += 4e-6  # moves the centre by 3e-6; it has gone 10 by then, farther than the bodies are apart
    found = diagnostics.centre_of_mass_drift(gm, t, q, v)
    assert found.max_fraction == pytest.approx(3e-7, rel=1e-6)
    assert found.last_fraction == 0.0
    rows = np.broadcast_to(v, q.shape)
    assert diagnostics.centre_of_mass_drift(gm, t, q, rows) == found
