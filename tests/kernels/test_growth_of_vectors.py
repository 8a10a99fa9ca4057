"""The logarithm of a ratio, by which the growth of tangent vectors is summed."""

import mpmath
import numpy as np

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store
from orbits.kernels.tangents.growth import log_ratio


@kernel
def in_numbers(a, b, out):
    for k in range(len(a)):
        out[k] = log_ratio(a[k], b[k])


@kernel
def in_lanes(a, b, out):
    store(out, 0, log_ratio(load(a, 0), load(b, 0)))


def test_the_logarithm_of_a_ratio_has_all_digits_near_one_and_far_from_it():
    """Near one the ratio alone has lost them; 2.2e-16 at most was reached."""
    b = np.full(4 * WIDTH, 1.7)
    a = b * np.concatenate([1.0 + np.geomspace(1e-12, 0.6, 2 * WIDTH), np.geomspace(0.5, 1e-30, 2 * WIDTH)])
    with mpmath.workdps(40):
        truth = np.array([float(mpmath.log(mpmath.mpf(x) / mpmath.mpf(y))) for x, y in zip(a, b, strict=True)])
    found = np.zeros(len(a))
    in_numbers(a, b, found)
    assert np.max(np.abs(found - truth) / np.abs(truth)) < 6e-16
    for first in range(0, len(a), WIDTH):
        rows = np.zeros(WIDTH)
        in_lanes(a[first : first + WIDTH].copy(), b[first : first + WIDTH].copy(), rows)
        assert np.max(np.abs(rows - truth[first : first + WIDTH]) / np.abs(truth[first : first + WIDTH])) < 6e-16
