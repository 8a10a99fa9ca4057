"""The arithmetic under the diagnostics, against mpmath at 60 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from orbits.diagnostics import doubledouble as dd

U = 2.0**-53
rng = np.random.default_rng(20240611)


def numbers(count: int) -> np.ndarray:
    """Floats of both signs over twenty decades."""
    return rng.normal(size=count) * 10.0 ** rng.integers(-10, 10, size=count)


def pairs(count: int) -> dd.Pair:
    hi = numbers(count)
    return dd.two_sum(hi, hi * U * rng.uniform(-0.5, 0.5, size=count))


def exact(x: dd.Pair, k: int) -> mpmath.mpf:
    return mpmath.mpf(float(x.hi[k])) + mpmath.mpf(float(x.lo[k]))


@pytest.fixture(autouse=True)
def sixty_digits():
    with mpmath.workdps(60):
        yield


def test_two_sum_and_two_product_are_exact():
    a, b = numbers(2000), numbers(2000)
    s, p = dd.two_sum(a, b), dd.two_product(a, b)
    for k in range(len(a)):
        x, y = mpmath.mpf(float(a[k])), mpmath.mpf(float(b[k]))
        assert exact(s, k) == x + y
        assert exact(p, k) == x * y


@pytest.mark.parametrize(
    ("operation", "reference", "bound"),
    [
        # Bounds: Joldes, Muller & Popescu (2017), table 1; the last two are one Newton step from a float64 estimate,
        # whose own error is 1.5 u (root) or 1 u, squared and rounded a few times.
        (dd.add, lambda x, y: x + y, 3),
        (dd.subtract, lambda x, y: x - y, 3),
        (dd.multiply, lambda x, y: x * y, 7),
        (dd.divide, lambda x, y: x / y, 12),
    ],
)
def test_a_double_double_operation_keeps_its_bound(operation, reference, bound):
    x, y = pairs(2000), pairs(2000)
    result = operation(x, y)
    worst = max(
        abs(exact(result, k) / reference(exact(x, k), exact(y, k)) - 1) for k in range(2000) if result.hi[k] != 0
    )
    assert worst <= bound * U**2


def test_the_reciprocal_root_is_good_to_a_few_u_squared():
    x = pairs(2000)
    x = dd.Pair(np.abs(x.hi), np.sign(x.hi) * x.lo)
    result = dd.reciprocal_root(x)
    worst = max(abs(exact(result, k) * mpmath.sqrt(exact(x, k)) - 1) for k in range(2000))
    assert worst <= 24 * U**2


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 64, 101])
def test_a_total_survives_cancellation_of_twenty_decades(count):
    x = pairs(count)
    result = dd.total(x)
    reference = mpmath.fsum(exact(x, k) for k in range(count))
    size = mpmath.fsum(abs(exact(x, k)) for k in range(count))
    got = mpmath.mpf(float(result.hi)) + mpmath.mpf(float(result.lo))
    assert abs(got - reference) <= 3 * max(1, np.log2(max(count, 1))) * U**2 * size
