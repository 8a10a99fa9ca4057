"""Sums over eight rows, with the additions that `sums_before`, `sums_after` and `total` make across eight lanes.

Where numbers change lanes between a product and a sum, the two are never fused. Where rows take the place of lanes they
would be: hence `plus`, `minus` and `times`.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import exact_add, exact_mul, exact_sub, full


@kernel(inline=True, exact=True)
def before_each(x):
    """Return the sums of those before each of eight rows: of none, of the first, of two, ..."""
    a, b, c, d, e, f, g, _ = x
    zero = full(0.0)
    ab, bc, cd, de, ef, fg = (
        exact_add(b, a),
        exact_add(c, b),
        exact_add(d, c),
        exact_add(e, d),
        exact_add(f, e),
        exact_add(g, f),
    )
    return (
        zero,
        exact_add(a, zero),  # lanes have the sum with a zero, never -0
        ab,
        exact_add(bc, a),
        exact_add(exact_add(cd, b), a),
        exact_add(exact_add(de, c), ab),
        exact_add(exact_add(ef, d), exact_add(c, ab)),
        exact_add(exact_add(fg, e), exact_add(exact_add(d, a), bc)),
    )


@kernel(inline=True, exact=True)
def sum_of_eight(x):
    """Return the sum of eight rows."""
    a, b, c, d, e, f, g, h = x
    ae, bf, cg, dh = exact_add(a, e), exact_add(b, f), exact_add(c, g), exact_add(d, h)
    return exact_add(exact_add(ae, cg), exact_add(bf, dh))


@kernel(inline=True, exact=True)
def plus_each(x, y):
    """Return the sums of two times eight rows."""
    return (
        exact_add(x[0], y[0]),
        exact_add(x[1], y[1]),
        exact_add(x[2], y[2]),
        exact_add(x[3], y[3]),
        exact_add(x[4], y[4]),
        exact_add(x[5], y[5]),
        exact_add(x[6], y[6]),
        exact_add(x[7], y[7]),
    )


@kernel(inline=True, exact=True)
def plus_all(x, y):
    """Return eight rows, each plus y."""
    return plus_each(x, (y, y, y, y, y, y, y, y))


@kernel(inline=True, exact=True)
def times_each(x, y):
    """Return the products of two times eight rows."""
    return (
        exact_mul(x[0], y[0]),
        exact_mul(x[1], y[1]),
        exact_mul(x[2], y[2]),
        exact_mul(x[3], y[3]),
        exact_mul(x[4], y[4]),
        exact_mul(x[5], y[5]),
        exact_mul(x[6], y[6]),
        exact_mul(x[7], y[7]),
    )


@kernel(inline=True, exact=True)
def plus(a, b):
    """Return a + b, not fused with what gives a or b."""
    return exact_add(a, b)


@kernel(inline=True, exact=True)
def minus(a, b):
    """Return a - b, not fused with what gives a or b."""
    return exact_sub(a, b)


@kernel(inline=True, exact=True)
def times(a, b):
    """Return a b, not fused with a sum."""
    return exact_mul(a, b)
