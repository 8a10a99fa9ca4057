"""What the kernels of `collocation` share: the table of coefficients, its registers, and sums over stages."""

from __future__ import annotations

from numba import types

from orbits.kernels.binding import kernel_of
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, fma, full, load, store
from orbits.kernels.sums.summation import two_sum

# Rows of the table of one register of stages, the stages in the lanes. ETA is the first of 8 R rows: row j holds column
# j of the matrix; START follows, in the same form. NODES and WEIGHTS are c and b, BARYCENTRIC the weights of the
# polynomial through the stages over those of the quadrature, LAST those of its last Legendre coefficient.
HC, HC_LO, HB, REST, NODES, WEIGHTS, BARYCENTRIC, LAST, ETA = 0, 1, 2, 3, 4, 5, 6, 7, 8


@verb
def registers(method):
    """Return R, a constant of the form."""
    count = kernel_of(method.types[0], "registers")
    return lambda method: count


def is_close(method):
    """Return whether the positions of stages have low parts, from the Numba type of a method."""
    return bool(kernel_of(method.types[0], "close"))


@verb
def layers(method):
    """Return the number of rows of stages for each coordinate: 2 if their positions have low parts, else 1."""
    count = 2 if is_close(method) else 1
    return lambda method: count


@verb
def columns(method, table, first):
    """Return the matrix whose column j is row first + j of the table, as `combine` takes it: with one register the
    columns themselves, which then stay in registers for all coordinates; otherwise the number of its first row.
    """
    if kernel_of(method.types[0], "registers") > 1:
        return lambda method, table, first: first
    return lambda method, table, first: (
        load(table, first),
        load(table, first + 1),
        load(table, first + 2),
        load(table, first + 3),
        load(table, first + 4),
        load(table, first + 5),
        load(table, first + 6),
        load(table, first + 7),
    )


@verb
def combine(matrix, R, table, rows, block, k):
    """Return sum_j column_j * rows[.., j] over R registers, whose rows are `block` apart."""
    if isinstance(matrix, types.BaseTuple):

        def of_one(matrix, R, table, rows, block, k):
            even, odd = matrix[0] * rows[k, 0], matrix[1] * rows[k, 1]
            even, odd = fma(matrix[2], full(rows[k, 2]), even), fma(matrix[3], full(rows[k, 3]), odd)
            even, odd = fma(matrix[4], full(rows[k, 4]), even), fma(matrix[5], full(rows[k, 5]), odd)
            even, odd = fma(matrix[6], full(rows[k, 6]), even), fma(matrix[7], full(rows[k, 7]), odd)
            return even + odd

        return of_one

    def of_several(matrix, R, table, rows, block, k):
        even = odd = full(0.0)
        for r in range(R):
            at, row = matrix + WIDTH * r, r * block + k
            for j in range(0, WIDTH, 2):
                even = even + load(table, at + j) * rows[row, j]
                odd = odd + load(table, at + j + 1) * rows[row, j + 1]
        return even + odd

    return of_several


@verb
def place(method, Q, at, lows, x, increment):
    """Write the position x + increment of eight stages into row `at`, and its low part, if any, `lows` rows later."""
    if not is_close(method):
        return lambda method, Q, at, lows, x, increment: store(Q, at, x + increment)

    def with_low_part(method, Q, at, lows, x, increment):
        position, low = two_sum(full(x), increment)
        store(Q, at, position)
        store(Q, at + lows, low)

    return with_low_part
