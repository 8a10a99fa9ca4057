"""Error-free transformations and compensated addition; float64 or `Lanes`.

A number of doubled precision is an unevaluated pair (hi, lo) with |lo| at most half a unit in the last place of hi.
Source: Dekker (1971); Knuth, The Art of Computer Programming 2, 4.2.2; Ogita, Rump & Oishi (2005); Joldes, Muller &
Popescu (2017), ACM TOMS 44, 15, algorithms 6 and 10.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import exact_add, exact_mul, exact_sub, fma, transposed


@kernel(inline=True, exact=True)
def two_sum(a, b):
    """Return (s, e) with s = fl(a + b) and s + e = a + b exactly."""
    s = exact_add(a, b)
    c = exact_sub(s, a)
    return s, exact_add(exact_sub(a, exact_sub(s, c)), exact_sub(b, c))


@kernel(inline=True, exact=True)
def quick_two_sum(a, b):
    """Return (s, e) with s = fl(a + b) and s + e = a + b exactly, for |a| >= |b| or a = 0."""
    s = exact_add(a, b)
    return s, exact_sub(b, exact_sub(s, a))


@kernel(inline=True, exact=True)
def two_product(a, b):
    """Return (p, e) with p = fl(a b) and p + e = a b exactly, unless e underflows."""
    p = exact_mul(a, b)
    return p, fma(a, b, -p)


@kernel(inline=True, exact=True)
def add_pairs(a, a_lo, b, b_lo):
    """Return (a, a_lo) + (b, b_lo)."""
    s, e = two_sum(a, b)
    t, f = two_sum(a_lo, b_lo)
    s, e = quick_two_sum(s, exact_add(e, t))
    return quick_two_sum(s, exact_add(e, f))


@kernel(inline=True, exact=True)
def multiply_pairs(a, a_lo, b, b_lo):
    """Return (a, a_lo) (b, b_lo)."""
    p, e = two_product(a, b)
    return quick_two_sum(p, exact_add(e, fma(a, b_lo, exact_mul(a_lo, b))))


@kernel(inline=True, exact=True)
def add_compensated(hi, lo, x):
    """Return the pair (hi, lo) + x, renormalized; x is a float64 or `Lanes` of smaller size than hi."""
    s, e = two_sum(hi, x)
    return quick_two_sum(s, exact_add(lo, e))


@kernel(inline=True, exact=True)
def accumulate(hi, lo, x):
    """Return the pair (hi, lo) + x with one rounding of the size of x: Kahan's addition, for an x itself rounded.

    If |hi| < |x|, the pair may have one more such rounding error.
    """
    y = exact_add(lo, x)
    s = exact_add(hi, y)
    return s, exact_sub(y, exact_sub(s, hi))


@kernel(inline=True, exact=True)
def add_product(hi, lo, h, x, x_lo):
    """Return the pair (hi, lo) + h (x, x_lo), renormalized; the product's rounding error is kept."""
    p, e = two_product(x, h)
    s, f = two_sum(hi, p)
    return quick_two_sum(s, exact_add(lo, exact_add(f, fma(x_lo, h, e))))


@kernel(inline=True)
def moved(h, q, q_lo, v, v_lo, drift):
    """Return (q, q_lo) + h (v, v_lo) + drift, where drift has the size of h v."""
    p, e = two_product(v, h)
    s, f = two_sum(p, fma(v_lo, h, e + drift))
    return add_compensated(q, q_lo + f, s)


@kernel(inline=True, exact=True)
def compensated_row_sums(rows, first):
    """Return the sums of rows `first` ... `first` + 7 of an (n, 8) array as pairs (hi, lo), one pair in each lane."""
    return _compensated(transposed(rows, first))


@kernel(inline=True, exact=True)
def _compensated(x):
    """Return the sum of eight `Lanes` as a pair."""
    a, a_lo = two_sum(x[0], x[1])
    b, b_lo = two_sum(x[2], x[3])
    c, c_lo = two_sum(x[4], x[5])
    d, d_lo = two_sum(x[6], x[7])
    ab, ab_lo = two_sum(a, b)
    cd, cd_lo = two_sum(c, d)
    hi, lo = two_sum(ab, cd)
    return hi, lo + (ab_lo + cd_lo) + (a_lo + b_lo + c_lo + d_lo)
