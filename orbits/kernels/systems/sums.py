"""Running sums over eight rows, with the additions that `sums_before` and `sums_after` make across eight lanes.

Where numbers change lanes between a product and a sum, the two are never fused. Where rows take the place of lanes they
would be: hence `plus`, `minus` and `times`.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import exact_add, exact_mul, exact_sub


@kernel(inline=True, exact=True)
def before_each(x):
    """Return the sums of those before each of seven rows and after them: the sum of none, of the first, of two, ..."""
    a, b, c, d, e, f, g = x
    ab, bc, cd, de, ef, fg = (
        exact_add(b, a),
        exact_add(c, b),
        exact_add(d, c),
        exact_add(e, d),
        exact_add(f, e),
        exact_add(g, f),
    )
    return (
        a,
        ab,
        exact_add(bc, a),
        exact_add(exact_add(cd, b), a),
        exact_add(exact_add(de, c), ab),
        exact_add(exact_add(ef, d), exact_add(c, ab)),
        exact_add(exact_add(fg, e), exact_add(exact_add(d, a), bc)),
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
