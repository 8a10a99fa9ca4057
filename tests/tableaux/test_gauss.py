"""Gauss tableaux: right to the last digit, and exactly symplectic in binary."""

import dataclasses
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from orbits.errors import InputError
from orbits.tableaux import gauss

from ..coverings import each

STAGES = [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 16]


@each("stages", STAGES)
def test_order_conditions_hold_to_fifty_digits(stages):
    """B(2s) and C(s): sum b c^(k-1) = 1/k, sum_j a_ij c_j^(k-1) = c_i^k / k. They make the order 2s."""
    t = gauss(stages)
    b, c, a = t.exact_b, t.exact_c, t.exact_a
    with mpmath.workdps(60):
        for k in range(1, 2 * stages + 1):
            moment = sum(w * x ** (k - 1) for w, x in zip(b, c, strict=True))
            assert abs(moment - mpmath.mpf(1) / k) < mpmath.mpf(10) ** -50
        for k in range(1, stages + 1):
            for i in range(stages):
                left = sum(a[i][j] * c[j] ** (k - 1) for j in range(stages))
                assert abs(left - c[i] ** k / k) < mpmath.mpf(10) ** -50


@each("stages", STAGES)
def test_rounded_coefficients_are_symplectic_and_symmetric_without_any_error(stages):
    t = gauss(stages)
    assert t.symmetric
    assert t.binary_residual() == 0
    assert t.binary_asymmetry() == 0


@each("stages", STAGES)
def test_a_gauss_method_is_its_own_symplectic_partner_in_binary_too(stages):
    t = gauss(stages)
    assert np.array_equal(t.mu, t.mu_bar)
    assert np.array_equal(t.nodes + t.one_minus_nodes, np.ones(stages))


@each("stages", STAGES)
def test_rounding_moves_no_coefficient_by_more_than_two_units(stages):
    # c and the lower triangle of eta: 0.5 unit of 2^-53 each; the upper triangle inherits three of these. mu is as
    # large as 2, where a grid is coarser: 1.1 was reached.
    assert gauss(stages).rounding_residual() <= 2


def test_nearest_rounded_coefficients_are_not_symplectic():
    """What the exact form is for: the table one would type in misses the identity."""
    t = gauss(8)
    s = range(8)
    with mpmath.workdps(60):
        a, b = t.exact_a, t.exact_b
        eta = np.array([[float(sum(a[i][k] * a[k][j] for k in s) / b[j]) for j in s] for i in s])
        mu = np.array([[float(a[i][j] / b[j]) for j in s] for i in s])
    rounded_eta = dataclasses.replace(t, nodes=t.c, eta=eta)
    rounded_mu = dataclasses.replace(t, mu=mu, mu_bar=mu)
    for naive in (rounded_eta, rounded_mu):
        assert Fraction(1, 2**56) < naive.binary_residual() < Fraction(1, 2**50)
        assert naive.binary_asymmetry() > 0


def test_two_stages_are_those_of_the_books():
    """Hairer, Lubich & Wanner (2006), table II.1.1."""
    t = gauss(2)
    r = np.sqrt(3.0) / 6
    book = [[0.25, 0.25 - r], [0.25 + r, 0.25]]
    assert np.allclose(t.c, [0.5 - r, 0.5 + r], rtol=0, atol=2e-16)
    for table in (t.a, t.a_bar, t.mu * t.b, t.mu_bar * t.b):
        assert np.allclose(table, book, rtol=0, atol=2e-16)


def test_continuation_continues_polynomials_exactly():
    t = gauss(5)
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 0.7, 0.2, -0.4])
    # Continuing one step ahead multiplies rounding errors by up to 541 at five stages.
    assert np.abs(t.continuation @ polynomial(t.c) - polynomial(1.0 + t.c)).max() < 541 * 2e-16


@pytest.mark.parametrize("stages", [0, -1, 2.0, True, "8", None, 33])
def test_a_wrong_number_of_stages_is_refused(stages):
    with pytest.raises(InputError, match="stages"):
        gauss(stages)


def test_coefficients_which_all_methods_of_a_process_share_cannot_be_written_to():
    """A changed one was that of every method of these stages, whose certificates failed from then on."""
    tableau = gauss(4)
    for name in ("a", "a_bar", "b", "c", "nodes", "one_minus_nodes", "eta", "mu", "mu_bar", "continuation"):
        coefficients = getattr(tableau, name)
        with pytest.raises(ValueError, match="read-only"):
            coefficients *= 2.0
