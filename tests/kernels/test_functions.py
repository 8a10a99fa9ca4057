"""Elementary functions: eight lanes against single numbers against the C library, bit for bit."""

import math

import numpy as np
import pytest

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import functions, get, put

from ..coverings import every, first

UNARY = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log")
EDGE = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, -2.2e-308, 710.0, -745.0, 1e22, np.pi / 2]
RNG = np.random.default_rng(3)


def bits(x):
    """The patterns of the numbers; one for all NaN."""
    return np.where(np.isnan(x), np.nan, x).view(np.uint64)


def by_library(function, *x):
    """The results of the C library, by NumPy's object loop; NaN and infinities where Python would raise."""

    def one(*x):
        try:
            return function(*x)
        except ValueError:
            return None
        except OverflowError:
            return None

    return [one(*(float(y) for y in row)) for row in zip(*x, strict=True)]


@pytest.mark.parametrize("name", every(3, UNARY))
def test_a_function_of_lanes_has_the_bits_of_the_function_of_numbers_and_of_the_library(name):
    function = getattr(functions, name)

    @kernel
    def run(x, out):
        for k in range(x.shape[0]):
            put(out, k, function(get(x, k)))

    x = np.concatenate([RNG.normal(size=51) * 10.0 ** RNG.uniform(-9, 1, 51), RNG.uniform(-1, 1, 64), EDGE])
    single, wide = np.empty(128), np.empty((16, 8))
    run(x, single)
    run(x.reshape(16, 8), wide)
    assert np.array_equal(bits(single), bits(wide.ravel()))
    library = by_library(getattr(math, name), x)
    known = [k for k, y in enumerate(library) if y is not None]
    assert len(known) > 40
    assert np.array_equal(bits(single[known]), bits(np.array([library[k] for k in known])))


@pytest.mark.parametrize("name", first(1, ["power", "atan2"]))
def test_a_function_of_two_arguments_has_the_same_bits_with_lanes_in_either_place(name):
    function = getattr(functions, name)

    @kernel
    def both(x, y, out):
        for k in range(x.shape[0]):
            put(out, k, function(get(x, k), get(y, k)))

    @kernel
    def left(x, y, out):
        for k in range(x.shape[0]):
            put(out, k, function(get(x, k), y))

    @kernel
    def right(x, y, out):
        for k in range(x.shape[0]):
            put(out, k, function(y, get(x, k)))

    pairs = np.array([(a, b) for a in EDGE for b in EDGE][:144])
    x = np.concatenate([np.abs(RNG.normal(size=112)), pairs[:, 0]])
    y = np.concatenate([RNG.normal(size=112), pairs[:, 1]])
    single, wide = np.empty(256), np.empty((32, 8))
    both(x, y, single)
    both(x.reshape(32, 8), y.reshape(32, 8), wide)
    assert np.array_equal(bits(single), bits(wide.ravel()))
    library = by_library({"atan2": math.atan2, "power": math.pow}[name], x, y)
    known = [k for k, z in enumerate(library) if z is not None]
    assert len(known) > 200
    assert np.array_equal(bits(single[known]), bits(np.array([library[k] for k in known])))
    for run in (left, right):
        run(x, 0.7, single)
        run(x.reshape(32, 8), 0.7, wide)
        assert np.array_equal(bits(single), bits(wide.ravel()))
