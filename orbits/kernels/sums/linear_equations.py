"""Dense linear equations inside a kernel: LU with partial pivoting, in place."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import load, store


@kernel
def factorize(matrix, n, pivots):
    """Replace the leading n x n block of `matrix` by its LU factors and write the row exchanges into `pivots` (n,).

    Returns False, with the block overwritten, if a pivot is zero, not finite, or below 1e-14 of the largest element of
    its original column: columns may differ in scale by any factor, as the masses of bodies do.
    """
    for column in range(n):
        pivots[column] = 0.0
        for row in range(n):
            pivots[column] = max(pivots[column], abs(matrix[row, column]))
    for column in range(n):
        scale = pivots[column]
        best = column
        for row in range(column + 1, n):
            if abs(matrix[row, column]) > abs(matrix[best, column]):
                best = row
        pivots[column] = best
        for k in range(n):
            matrix[column, k], matrix[best, k] = matrix[best, k], matrix[column, k]
        pivot = abs(matrix[column, column])
        if not (pivot > 1e-14 * scale and pivot * 0.0 == 0.0):
            return False
        inverse = 1.0 / matrix[column, column]
        for row in range(column + 1, n):
            factor = matrix[row, column] * inverse
            matrix[row, column] = factor
            if factor != 0.0:
                for k in range(column + 1, n):
                    matrix[row, k] -= factor * matrix[column, k]
    return True


@kernel
def solve(matrix, n, pivots, x):
    """Overwrite x (n,) with the solution of the factorized equations."""
    for k in range(n):
        other = int(pivots[k])
        x[k], x[other] = x[other], x[k]
    for row in range(1, n):
        for k in range(row):
            x[row] -= matrix[row, k] * x[k]
    for row in range(n - 1, -1, -1):
        for k in range(row + 1, n):
            x[row] -= matrix[row, k] * x[k]
        x[row] /= matrix[row, row]


@kernel
def solve_rows(matrix, n, pivots, x):
    """As `solve`, for eight right-hand sides: the lanes of the n rows of x."""
    for k in range(n):
        other = int(pivots[k])
        mine = load(x, k)
        store(x, k, load(x, other))
        store(x, other, mine)
    for row in range(1, n):
        value = load(x, row)
        for k in range(row):
            value = value - matrix[row, k] * load(x, k)
        store(x, row, value)
    for row in range(n - 1, -1, -1):
        value = load(x, row)
        for k in range(row + 1, n):
            value = value - matrix[row, k] * load(x, k)
        store(x, row, value / matrix[row, row])
