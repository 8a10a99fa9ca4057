"""Linear equations inside kernels, against NumPy's."""

import numpy as np
import pytest

from orbits.kernels.lanes import WIDTH
from orbits.kernels.sums.linear_equations import factorize, solve, solve_rows

from ..coverings import each

EPS = 2.0**-53


def factorized(a):
    """LU factors of `a` in the corner of a larger array, whose rest must not be touched, and the row exchanges."""
    n = len(a)
    matrix, pivots = np.full((n + 2, n + 2), np.nan), np.full(n, np.nan)
    matrix[:n, :n] = a
    assert factorize(matrix, n, pivots)
    assert np.isnan(matrix[n:]).all()
    assert np.isnan(matrix[:, n:]).all()
    return matrix, pivots


@pytest.mark.parametrize("n", [1, 2, 3, 8, 24])
def test_the_solution_leaves_a_residual_of_a_few_roundings(n):
    rng = np.random.default_rng(n)
    worst = 0.0
    for _ in range(20):
        a, right = rng.normal(size=(n, n)), rng.normal(size=(n, WIDTH))
        matrix, pivots = factorized(a)
        rows, vector = right.copy(), right[:, 3].copy()
        solve(matrix, n, pivots, vector)
        solve_rows(matrix, n, pivots, rows)
        for x, b in ((rows, right), (vector[:, None], right[:, 3:4])):
            size = np.abs(a) @ np.abs(x) + np.abs(b)
            worst = max(worst, (np.abs(a @ x - b) / size).max() / EPS)
        # One register of right sides and one right side: sums in the same order.
        assert np.abs(rows[:, 3] - vector).max() <= 1e-12 * np.abs(vector).max()
    assert worst < 8  # 4.3 was reached, with 24 unknowns


def test_rows_are_exchanged_where_a_pivot_is_zero():
    a = np.array([[0.0, 0.0, 2.0], [0.0, 5.0, 1.0], [4.0, 1.0, 0.0]])
    matrix, pivots = factorized(a)
    x = a @ np.array([1.0, -2.0, 3.0])
    solve(matrix, 3, pivots, x)
    assert x.tolist() == [1.0, -2.0, 3.0]


def test_columns_of_any_size_are_regular():
    """Masses of a star and of a grain: 1e-30 is not zero relative to its own column."""
    matrix, pivots = factorized(np.diag([1e30, 1.0, 1e-30]))
    x = np.array([2e30, 3.0, 4e-30])
    solve(matrix, 3, pivots, x)
    assert x == pytest.approx([2.0, 3.0, 4.0], rel=4 * EPS)


SINGULAR = {
    "zero": np.zeros((2, 2)),
    "a zero column": np.array([[1.0, 0.0], [2.0, 0.0]]),
    "a zero row": np.array([[1.0, 2.0], [0.0, 0.0]]),
    "rank one": np.outer([1.0, 3.0, 0.7], [0.3, 0.2, 0.9]),
    "rank two": np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]),
    "nan": np.array([[np.nan, 1.0], [1.0, 2.0]]),
    "nan below": np.array([[2.0, 1.0], [np.nan, 2.0]]),
    "nan aside": np.array([[2.0, np.nan], [1.0, 2.0]]),
    "infinite": np.array([[np.inf, 1.0], [1.0, 2.0]]),
}


@each("case", SINGULAR)
def test_a_matrix_without_inverse_is_told(case):
    a = SINGULAR[case].copy()
    assert not factorize(a, len(a), np.zeros(len(a)))
