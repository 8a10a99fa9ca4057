"""Three numbers at once, such as a place, a velocity or a force: float64, dual numbers or lanes, in a tuple."""

from __future__ import annotations

from numba import types

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    fma,
    get,
    halves,
    joined,
    load_like,
    put,
    select,
    store_like,
    sums_after,
    sums_before,
    total,
)
from orbits.kernels.sums.summation import accumulate

NOTHING = 0.0, 0.0, 0.0


@verb
def minus(a, b):
    """Return a - b; None of None."""
    return (lambda a, b: None) if a == types.none else _minus


@kernel(inline=True)
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel(inline=True)
def times(factor, a):
    """Return factor a."""
    return factor * a[0], factor * a[1], factor * a[2]


@kernel(inline=True)
def added(a, factor, b):
    """Return a + factor b."""
    return fma(factor, b[0], a[0]), fma(factor, b[1], a[1]), fma(factor, b[2], a[2])


@kernel(inline=True)
def dot(a, b):
    """Return the scalar product."""
    return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]))


@kernel(inline=True)
def accumulated(a, a_lo, change):
    """Return the sums and their low parts of three numbers in doubled precision and three others, rounded once."""
    x, x_lo = accumulate(a[0], a_lo[0], change[0])
    y, y_lo = accumulate(a[1], a_lo[1], change[1])
    z, z_lo = accumulate(a[2], a_lo[2], change[2])
    return (x, y, z), (x_lo, y_lo, z_lo)


@kernel(inline=True)
def chosen(condition, a, b):
    """Return a where the condition holds, and b elsewhere."""
    return select(condition, a[0], b[0]), select(condition, a[1], b[1]), select(condition, a[2], b[2])


@kernel(inline=True)
def totals(a):
    """Return the sums over the lanes."""
    return total(a[0]), total(a[1]), total(a[2])


@kernel(inline=True)
def inside_of(share, a):
    """Return the sums of `share` times a over the planets of a register that are further inside."""
    return sums_before(share * a[0]), sums_before(share * a[1]), sums_before(share * a[2])


@kernel(inline=True)
def outside_of(a):
    """Return the sums over the planets of a register that are further out."""
    return sums_after(a[0]), sums_after(a[1]), sums_after(a[2])


@kernel(inline=True)
def joined_three(a, b):
    """Return two times three `Lanes`, joined."""
    return joined(a[0], b[0]), joined(a[1], b[1]), joined(a[2], b[2])


@kernel(inline=True)
def half_of_three(a, which):
    """Return three `Lanes` of what `joined_three` returns; which : 0 or 1, a literal."""
    return halves(a[0])[which], halves(a[1])[which], halves(a[2])[which]


@kernel(inline=True)
def load_three(rows, first):
    """Return three rows, or three elements of a vector."""
    return get(rows, first), get(rows, first + 1), get(rows, first + 2)


@kernel(inline=True)
def store_three(rows, first, values):
    """Write to where `load_three` reads."""
    put(rows, first, values[0])
    put(rows, first + 1, values[1])
    put(rows, first + 2, values[2])


@kernel(inline=True)
def load_three_like(like, rows, first, apart):
    """Return three rows, for `like` of sixteen lanes joined with those that are `apart` further on."""
    return (
        load_like(like, rows, first, apart),
        load_like(like, rows, first + 1, apart),
        load_like(like, rows, first + 2, apart),
    )


@kernel(inline=True)
def store_three_like(rows, first, apart, values):
    """Write to where `load_three_like` reads."""
    store_like(rows, first, apart, values[0])
    store_like(rows, first + 1, apart, values[1])
    store_like(rows, first + 2, apart, values[2])
