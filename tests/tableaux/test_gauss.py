"""Gauss tableaux: right to the last digit, and exactly symplectic in binary."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from orbits.errors import InputError
from orbits.tableaux.gauss import GaussTableau, gauss

STAGES = [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 16]


@pytest.mark.parametrize("stages", STAGES)
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


@pytest.mark.parametrize("stages", STAGES)
def test_rounded_coefficients_are_symplectic_without_any_error(stages):
    t = gauss(stages)
    assert t.symplecticity_residual() == 0
    assert t.symmetry_residual() == 0


@pytest.mark.parametrize("stages", STAGES)
def test_rounding_moves_no_coefficient_by_more_than_two_units(stages):
    # c and the lower triangle: 0.5 unit of 2^-53 each; the upper triangle inherits three of these.
    assert gauss(stages).rounding_residual() <= 1.5


def test_nearest_rounded_coefficients_are_not_symplectic():
    """What the exact form is for: the table one would type in misses the identity."""
    t = gauss(8)
    with mpmath.workdps(60):
        eta = np.array(
            [
                [float(sum(t.exact_a[i][k] * t.exact_a[k][j] for k in range(8)) / t.exact_b[j]) for j in range(8)]
                for i in range(8)
            ]
        )
        c = np.array([float(x) for x in t.exact_c])
    naive = GaussTableau(8, t.exact_a, t.exact_b, t.exact_c, t.b, c, 1.0 - c, eta, t.mu, t.extrapolation)
    assert Fraction(1, 2**56) < naive.symplecticity_residual() < Fraction(1, 2**50)


def test_two_stages_are_those_of_the_books():
    """Hairer, Lubich & Wanner (2006), table II.1.1."""
    t = gauss(2)
    r = np.sqrt(3.0) / 6
    assert np.allclose(t.c, [0.5 - r, 0.5 + r], rtol=0, atol=2e-16)
    assert np.allclose(t.mu * t.b, [[0.25, 0.25 - r], [0.25 + r, 0.25]], rtol=0, atol=2e-16)


def test_extrapolation_continues_polynomials_exactly():
    t = gauss(5)
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 0.7, 0.2, -0.4])
    now, later = t.b * polynomial(t.c), t.b * polynomial(1.0 + t.c)
    # Extrapolating one step ahead multiplies rounding errors by up to 541 at five stages.
    assert np.allclose(t.extrapolation @ now, later, rtol=0, atol=541 * 2e-16)


@pytest.mark.parametrize("stages", [0, -1, 2.0, True, "8", None])
def test_a_wrong_number_of_stages_is_refused(stages):
    with pytest.raises(InputError, match="stages"):
        gauss(stages)
