"""Dual numbers: a kernel for float64 and lanes gives its derivative, too."""

import numpy as np

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, exact_sub, fma, get, maximum, minimum, put, rint, rsqrt_cubed, select, sqrt
from orbits.kernels.lanes.dual import NUMBERS, duals
from orbits.kernels.lanes.functions import (
    acos,
    asin,
    atan,
    atan2,
    cos,
    cosh,
    exp,
    log,
    power,
    sin,
    sinh,
    tan,
    tanh,
)  # fmt: skip


@kernel
def functions(own, q, out):
    x, y = get(q, 0), get(q, 1)
    put(out, 0, (x * y - 2.0) / (1 + y) + own[0] * x)
    put(out, 1, fma(x, y, -x) + abs(x - 1.0) + abs(y))
    put(out, 2, select(x < y, sin(x), cos(y)) + select((x > y) * (y > 0.0), tan(x), tanh(y)))
    put(out, 3, sqrt(x * x + y * y) * rsqrt_cubed(x + y))
    put(out, 4, maximum(x, y) - minimum(x, 2.0) + rint(x) + exact_sub(y, x))
    put(out, 5, power(x, y) + power(x, -1.5) + power(2.0, y) + atan2(y, x))
    put(out, 6, asin(x) + acos(0.5 * y) + atan(x) + sinh(x) + cosh(y))
    put(out, 7, exp(x) * log(y))
    put(out, int(own[1]), get(out, int(own[1])) + own[2] * (own[2] != 0.0))


@kernel
def on_duals(own, q, out):
    functions(duals(own), duals(q), duals(out))


def dual_numbers(x):
    """Return numbers without derivatives as rows of an array."""
    return np.pad(np.array(x)[:, None], ((0, 0), (0, NUMBERS - 1)))


def values(x):
    out = np.zeros(9)
    functions(x[:3], x[3:], out)
    return out


def test_each_function_has_its_derivative_by_variables_and_by_constants():
    """Against differences of eighth order, whose error is 1e-12 here."""
    x = np.array([0.3, 8.0, 0.7, 0.4, 0.8])
    moved = dual_numbers(x)
    for lane, k in enumerate((0, 2, 3, 4)):
        moved[k, WIDTH + lane] = 1.0
    out = np.zeros((9, NUMBERS))
    on_duals(moved[:3], moved[3:], out)
    assert np.abs(out[:, 0] - values(x)).max() < 4e-16 * 8
    assert not out[:, WIDTH + 4 :].any()
    for lane, k in enumerate((0, 2, 3, 4)):
        h, unit = 2e-3, np.eye(5)[k]
        weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
        truth = sum(w * (values(x + m * h * unit) - values(x - m * h * unit)) for m, w in weights.items()) / h
        assert np.abs(out[:, WIDTH + lane] - truth).max() < 1e-11, k


def test_a_number_that_is_0_but_about_to_change_is_not_0():
    own, q, out = dual_numbers([0.3, 8.0, 0.0]), dual_numbers([0.4, 0.8]), np.zeros((9, NUMBERS))
    own[2, WIDTH + 5] = 1.0
    on_duals(own, q, out)
    assert out[8, [0, *range(WIDTH, NUMBERS)]].tolist() == own[2, [0, *range(WIDTH, NUMBERS)]].tolist()


@kernel
def at_the_edges(q, out):
    x, y, one, zero = get(q, 0), get(q, 1), get(q, 2), get(q, 3)
    put(out, 0, power(x, zero) + power(zero, 2.0))
    put(out, 1, power(zero, y))
    put(out, 2, asin(one) + acos(one) + x)
    put(out, 3, log(one + x) + power(x, 1.0))


@kernel
def duals_at_the_edges(q, out):
    at_the_edges(duals(q), duals(out))


def test_what_does_not_change_has_a_derivative_where_functions_have_none():
    q, out = dual_numbers([0.0, 2.0, 1.0, 0.0]), np.zeros((4, NUMBERS))
    q[:2, WIDTH] = 1.0  # x = 0 and y = 2 change, 1 and 0 do not
    duals_at_the_edges(q, out)
    np.testing.assert_allclose(out[:, WIDTH], [0.0, 0.0, 1.0, 2.0], rtol=0, atol=1e-15)
    assert not out[:, WIDTH + 1 :].any()
