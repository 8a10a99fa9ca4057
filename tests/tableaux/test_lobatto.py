"""Lobatto pairs: the books' coefficients, symplectic and symmetric in exact arithmetic and in binary."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from orbits.errors import InputError
from orbits.tableaux import lobatto_iiia_iiib, lobatto_iiib_iiia

from ..coverings import each

STAGES = [2, 3, 4, 5, 6, 8, 12]
PAIRS = [lobatto_iiia_iiib, lobatto_iiib_iiia]

# Hairer, Lubich & Wanner (2006), tables II.1.2 and II.1.3: IIIA, IIIB and the weights.
BOOK = {
    2: ([[0, 0], ["1/2", "1/2"]], [["1/2", 0], ["1/2", 0]], ["1/2", "1/2"]),
    3: (
        [[0, 0, 0], ["5/24", "1/3", "-1/24"], ["1/6", "2/3", "1/6"]],
        [["1/6", "-1/6", 0], ["1/6", "1/3", 0], ["1/6", "5/6", 0]],
        ["1/6", "2/3", "1/6"],
    ),
}


def fractions(values):
    return np.vectorize(lambda x: mpmath.mpf(Fraction(x).numerator) / Fraction(x).denominator, otypes=[object])(values)


@pytest.mark.parametrize("stages", BOOK)
def test_two_and_three_stages_are_those_of_the_books(stages):
    with mpmath.workdps(60):
        a, a_bar, b = (fractions(x) for x in BOOK[stages])
        for pair, tables in ((lobatto_iiia_iiib, (a, a_bar)), (lobatto_iiib_iiia, (a_bar, a))):
            t = pair(stages)
            for mine, book in ((t.exact_a, tables[0]), (t.exact_a_bar, tables[1]), (t.exact_b, b)):
                assert np.abs(np.array(mine, dtype=object) - book).max() < mpmath.mpf(10) ** -50


@each("stages", STAGES)
@each("pair", PAIRS)
def test_a_pair_is_symplectic_and_symmetric_exactly_and_in_binary(pair, stages):
    t = pair(stages)
    assert t.symmetric
    assert t.symplecticity_residual() < 1e-50
    assert t.symmetry_residual() < 1e-50
    assert t.binary_residual() == 0
    assert t.binary_asymmetry() == 0


@each("stages", STAGES)
@each("pair", PAIRS)
def test_rounding_moves_no_coefficient_by_more_than_a_few_units(pair, stages):
    # mu = a / b is large where a weight is small, 1 / (s (s - 1)) at the ends; its grid is as coarse as its largest
    # entry asks for. 6.6 was reached with 12 stages, 3.3 with 8.
    t = pair(stages)
    assert t.rounding_residual() <= 2 * max(1.0, np.abs(t.mu).max())


@pytest.mark.parametrize("stages", STAGES)
def test_the_nodes_are_both_ends_and_quadrature_has_degree_2s_minus_3(stages):
    t = lobatto_iiia_iiib(stages)
    assert (t.nodes[0], t.nodes[-1]) == (0.0, 1.0)
    with mpmath.workdps(60):
        for k in range(1, 2 * stages - 1):
            moment = sum(w * x ** (k - 1) for w, x in zip(t.exact_b, t.exact_c, strict=True))
            assert abs(moment - mpmath.mpf(1) / k) < mpmath.mpf(10) ** -50
        last = 2 * stages - 1
        moment = sum(w * x ** (last - 1) for w, x in zip(t.exact_b, t.exact_c, strict=True))
        assert abs(moment - mpmath.mpf(1) / last) > mpmath.mpf(10) ** -30  # no more than that


@each("pair", PAIRS)
@each("stages", [1, 0, -2, 3.0, True, "3", None])
def test_a_wrong_number_of_stages_is_refused(pair, stages):
    with pytest.raises(InputError, match=r"stages of a Lobatto method must be a whole number >= 2, got"):
        pair(stages)
