"""Measured orders, with the plateau of round-off and the head of long steps cut off without being told where."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import orbits
from orbits import diagnostics
from orbits.errors import InputError

from ..problems import three_bodies


def curve(order, *, plateau=0.0, head=0.0, seed=1, points=33):
    """Errors h^order with a relative head h^2, and a plateau that scatters as round-off does."""
    h = 2.0 ** (-np.arange(points) / 4.0)
    noise = plateau * np.abs(np.random.default_rng(seed).normal(size=points))
    return h, h**order * (1.0 + head * h**2) + noise


@given(
    order=st.sampled_from([1, 2, 4, 6, 8]),
    plateau=st.sampled_from([0.0, 1e-13, 1e-11]),
    head=st.sampled_from([0.0, 1.0, 10.0]),
    seed=st.integers(0, 1000),
)
def test_the_order_is_found_whatever_stands_before_and_after(order, plateau, head, seed):
    h, errors = curve(order, plateau=plateau, head=head, seed=seed)
    found = diagnostics.convergence(h, errors)
    assert abs(found.order - order) < 0.08 * order + 0.02  # 0.04 x order was reached over 900 such curves
    assert found.uncertainty < 0.1 * found.order
    if plateau and order >= 6:
        assert 0.05 * plateau < found.plateau < 4 * plateau  # 0.19 to 2.1: the median of few scattered points


def test_a_plateau_alone_and_errors_that_do_not_fall_have_no_order():
    rng = np.random.default_rng(0)
    h = 2.0 ** -np.arange(20.0)
    for errors in (1e-15 * np.abs(rng.normal(size=20)), np.ones(20), np.full(20, np.nan), np.zeros(20)):
        found = diagnostics.convergence(h, errors)
        assert np.isnan(found.order)
        assert not found.used.any()


def test_a_fit_through_all_points_would_be_wrong():
    """The cut is needed: the plain slope misses order 8 by more than one, the window does not."""
    h, errors = curve(8, plateau=1e-13, head=10.0)
    assert np.polyfit(np.log(h), np.log(errors), 1)[0] < 6.8
    assert abs(diagnostics.convergence(h, errors).order - 8) < 0.3


METHODS = [
    (orbits.methods.ExplicitEuler(), 0.1, 1, 0.15),
    (orbits.methods.SymplecticEuler(), 0.1, 1, 0.05),
    (orbits.StormerVerlet(), 0.3, 2, 0.01),
    (orbits.methods.RungeKutta4(), 0.3, 4, 0.05),
    (orbits.Gauss(stages=2), 0.3, 4, 0.01),
    (orbits.methods.LobattoIIIAB(stages=4), 0.3, 6, 0.02),
    (orbits.Gauss(stages=4), 1.0, 8, 0.05),
]


@pytest.mark.parametrize(("method", "dt", "order", "slack"), METHODS, ids=[m.label for m, *_ in METHODS])
def test_the_order_of_a_method_is_measured_on_bodies(method, dt, order, slack):
    found = diagnostics.order(*three_bodies(particles=2), method, dt)
    assert method.order == order
    assert abs(found.order - order) < slack
    assert found.used.sum() >= 4


def test_a_method_with_a_wrong_coefficient_is_seen_to_have_a_lower_order():
    """Gauss with two stages with a node moved by a hundredth, completed to a symplectic pair: order 1 instead of 4."""
    r = np.sqrt(3.0) / 6.0
    a = ((0.25, 0.25 - r + 0.01), (0.25 + r, 0.25))
    found = diagnostics.order(*three_bodies(particles=2), orbits.methods.VPRK(a=a, b=(0.5, 0.5)), 0.02)
    assert found.order < 1.3


def test_lists_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="one shape"):
        diagnostics.convergence([0.1, 0.2], [1.0])
    with pytest.raises(InputError, match="h > 0"):
        diagnostics.convergence([0.1, 0.0], [1.0, 1.0])


def test_a_measured_order_is_printed_without_its_arrays():
    h = 0.5 ** (0.5 * np.arange(12))
    found = diagnostics.convergence(h, 3.0 * h**4)
    assert str(found).startswith("Convergence(order 4 ± ")
    steps = found.h[found.used]
    assert f"from {len(steps)} of 12 steps, {steps.min():.3g} to {steps.max():.3g})" in str(found)
    assert "no order" in str(diagnostics.convergence(h, np.ones(12)))


def test_a_body_at_rest_at_the_origin_has_no_errors_and_no_order():
    assert np.isnan(diagnostics.order([1.0], np.zeros((1, 3)), np.zeros((1, 3)), orbits.StormerVerlet(), dt=0.1).order)
