"""Newton's method within brackets, for many functions at once."""

import numpy as np

from orbits.marching.roots import newton

POWERS, TARGETS = np.array([1.0, 2.0, 3.0, 9.0]), np.array([0.3, 0.5, 0.01, 1e-4])


def powers(slope_of=lambda n, x: n * x ** (n - 1.0)):
    """Return a function with zeros at `TARGETS ** (1 / POWERS)`, and the numbers of the calls of each."""
    calls = np.zeros(len(POWERS), dtype=int)

    def function(x, which):
        calls[which] += 1
        return x ** POWERS[which] - TARGETS[which], slope_of(POWERS[which], x)

    return function, calls


def ends(start):
    return np.zeros(len(POWERS)), np.ones(len(POWERS)), np.full(len(POWERS), start)


def test_zeros_are_found_to_round_off_and_each_function_is_computed_only_until_its_zero_is_known():
    function, calls = powers()
    at, following = newton(function, *ends(0.9))
    exact = TARGETS ** (1.0 / POWERS)
    assert np.abs(following - exact).max() < 1e-15  # measured: 2e-16
    assert np.abs(at - exact).max() < 1e-13  # the last step at most
    assert calls.tolist() == [2, 5, 9, 13]  # the straight line first, the ninth power last


def test_brackets_are_halved_where_newtons_method_leaves_them():
    # From 1e-3 the ninth power leads to 1e20; slopes of the other sign would lead away from all zeros.
    for slope_of in (lambda n, x: n * x ** (n - 1.0), lambda n, x: -np.ones_like(x)):
        function, calls = powers(slope_of)
        _, following = newton(function, *ends(1e-3))
        assert np.abs(following - TARGETS ** (1.0 / POWERS)).max() < 1e-13
        assert calls.max() < 60  # halving alone takes 44


def test_steps_that_are_round_off_end_the_search():
    rng = np.random.default_rng(1)

    def noisy(x, which):
        return x - 0.5 + 1e-12 * rng.standard_normal(len(x)), np.ones(len(x))

    at, following = newton(noisy, np.zeros(3), np.ones(3), np.full(3, 0.2))
    assert np.abs(following - 0.5).max() < 1e-11
    assert np.abs(at - 0.5).max() < 1e-11


def test_a_coarser_last_step_is_allowed():
    function, calls = powers()
    newton(function, *ends(0.9))
    fine = calls.sum()
    function, calls = powers()
    _, following = newton(function, *ends(0.9), 1e-6)
    assert calls.sum() < fine
    assert np.abs(following - TARGETS ** (1.0 / POWERS)).max() < 1e-11  # the square of the last step, times a curvature
