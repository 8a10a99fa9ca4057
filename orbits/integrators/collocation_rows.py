"""What the kernels of `collocation` share: the table of coefficients, its registers, and sums over stages."""

from __future__ import annotations

from numba.extending import overload

from orbits.kernels.binding import OPTIONS, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, load

# Rows of the table of one register of stages, the stages in the lanes. ETA is the first of 8 R rows: row j holds column
# j of the matrix; START follows, in the same form. NODES and WEIGHTS are c and b, BARYCENTRIC the weights of the
# polynomial through the stages, LAST those of its last Legendre coefficient.
HC, HC_LO, HB, REST, NODES, WEIGHTS, BARYCENTRIC, LAST, ETA = 0, 1, 2, 3, 4, 5, 6, 7, 8


def registers(method):
    """Return R, a constant of the form."""
    raise NotImplementedError("registers() is for compiled code only")


@overload(registers, jit_options=OPTIONS)
def _registers(method):
    count = kernel_of(method.types[0], "registers")
    return lambda method: count


def is_close(method):
    """Return whether the positions of stages have low parts, from the Numba type of a method."""
    return bool(kernel_of(method.types[0], "close"))


def layers(method):
    """Return the number of rows of stages for each coordinate: 2 if their positions have low parts, else 1."""
    raise NotImplementedError("layers() is for compiled code only")


@overload(layers, jit_options=OPTIONS)
def _layers(method):
    count = 2 if is_close(method) else 1
    return lambda method: count


@kernel(inline=True)
def combine(R, table, first, rows, block, k):
    """Return sum_j column_j * rows[.., j] over R registers, whose rows are `block` apart."""
    even = odd = full(0.0)
    if R == 1:  # without adding to zero, which would be two more operations in each of many sums
        even = load(table, first) * rows[k, 0]
        odd = load(table, first + 1) * rows[k, 1]
        for j in range(2, WIDTH, 2):
            even = even + load(table, first + j) * rows[k, j]
            odd = odd + load(table, first + j + 1) * rows[k, j + 1]
        return even + odd
    for r in range(R):
        at, row = first + WIDTH * r, r * block + k
        for j in range(0, WIDTH, 2):
            even = even + load(table, at + j) * rows[row, j]
            odd = odd + load(table, at + j + 1) * rows[row, j + 1]
    return even + odd
