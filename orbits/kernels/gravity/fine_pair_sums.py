"""Newtonian attractions in doubled precision, where they matter: those of the heaviest body, or of few bodies.

An acceleration of float64 operations is wrong by some 2e-16 of itself: by the rounding of the separation, of r^-3, of
the products, and of a sum that begins with its largest summand. Here separations, squares and products are pairs
(hi, lo). For r^-3 this costs nothing: `rsqrt_cubed` is the sum of a number of 51 bits and a small correction anyway.

Source: Dekker (1971) for the arithmetic.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.gravity.pair_sums import add_other_pair_accelerations
from orbits.kernels.lanes import any_lane, exact_add, exact_sub, fma, full, get, put, rsqrt_cubed_pair
from orbits.kernels.sums.summation import quick_two_sum, two_product, two_sum

FEW = 4
"""Up to this number of bodies all pairs are in doubled precision; of more bodies, those of the heaviest."""

LIGHT = 0.01
"""The attraction of a body on one more than a hundred times as heavy is in plain precision: that is its share of their
relative motion."""

DISTANT = 1e-26
"""The square of the low part of a separation, as a fraction of the square of the separation, above which it is more
than its rounding error, and moved into the high part."""


@kernel
def add_fine_pair_accelerations(strength, q, q_lo, close, out, out_lo):
    """Add the accelerations of n mutually attracting bodies to `out`, as pairs with `out_lo`, for positions in doubled
    precision.

    q, q_lo, out, out_lo : (3n, 8) lanes; strength : (1 + n,)
    close : whether the distances of all bodies are those of (q, q_lo), also in plain precision
    `out` may hold the accelerations by other terms, which are smaller. Every sum from there on is one of pairs: the
    rounding error of a float64 sum would move the centre of mass, by as much for a light third body as for a heavy one.
    """
    n = strength.shape[0] - 1
    heaviest = 0
    for i in range(1, n):
        if strength[1 + i] > strength[1 + heaviest]:
            heaviest = i
    zero = get(q, 0) * 0.0
    for k in range(3 * n):
        put(out_lo, k, zero)
    if n > FEW:
        if close:
            add_other_pair_accelerations(strength, q, q_lo, heaviest, out)
        else:
            add_other_pair_accelerations(strength, q, None, heaviest, out)
        for i in range(n):
            if i != heaviest:
                _add_pair(strength, q, q_lo, heaviest, i, out, out_lo)
    else:
        for j in range(n):
            for i in range(j):
                _add_pair(strength, q, q_lo, j, i, out, out_lo)


@kernel(inline=True)
def _add_pair(strength, q, q_lo, j, i, out, out_lo):
    """Add the accelerations of bodies i and j by each other."""
    n, gm_i, gm_j = strength.shape[0] - 1, strength[1 + i], strength[1 + j]
    x, x_lo = _apart(get(q, j), get(q_lo, j), get(q, i), get(q_lo, i))
    y, y_lo = _apart(get(q, n + j), get(q_lo, n + j), get(q, n + i), get(q_lo, n + i))
    z, z_lo = _apart(get(q, 2 * n + j), get(q_lo, 2 * n + j), get(q, 2 * n + i), get(q_lo, 2 * n + i))
    r2, r2_lo = _squared(x, x_lo, y, y_lo, z, z_lo)
    if any_lane(x_lo * x_lo + y_lo * y_lo + z_lo * z_lo > DISTANT * r2):
        # Bodies far from the origin, compared with their separation: what follows leaves out products of low parts,
        # and what reads the high parts of the forces alone, such as the error signal of a step, needs all digits there.
        (x, x_lo), (y, y_lo), (z, z_lo) = two_sum(x, x_lo), two_sum(y, y_lo), two_sum(z, z_lo)
        r2, r2_lo = _squared(x, x_lo, y, y_lo, z, z_lo)
    w, w_lo = rsqrt_cubed_pair(r2 + strength[0], r2_lo)
    if gm_j > LIGHT * gm_i:
        pull, pull_lo = _times(w, w_lo, gm_j)
        _add(pull, pull_lo, x, x_lo, out, out_lo, i)
        _add(pull, pull_lo, y, y_lo, out, out_lo, n + i)
        _add(pull, pull_lo, z, z_lo, out, out_lo, 2 * n + i)
    else:
        _add_plainly(n, (w + w_lo) * gm_j, x, y, z, out, out_lo, i)
    if gm_i > LIGHT * gm_j:
        pull, pull_lo = _times(w, w_lo, -gm_i)
        _add(pull, pull_lo, x, x_lo, out, out_lo, j)
        _add(pull, pull_lo, y, y_lo, out, out_lo, n + j)
        _add(pull, pull_lo, z, z_lo, out, out_lo, 2 * n + j)
    else:
        _add_plainly(n, (w + w_lo) * -gm_i, x, y, z, out, out_lo, j)


@kernel(inline=True)
def _add_plainly(n, pull, x, y, z, out, out_lo, i):
    """Add the float64 numbers pull (x, y, z) to the acceleration of body i of n."""
    _add_number(pull * x, out, out_lo, i)
    _add_number(pull * y, out, out_lo, n + i)
    _add_number(pull * z, out, out_lo, 2 * n + i)


@kernel(inline=True, exact=True)
def _add_number(own, out, out_lo, k):
    """Add a float64 number to component k of (out, out_lo)."""
    s, e = two_sum(get(out, k), own)
    put(out, k, s)
    put(out_lo, k, get(out_lo, k) + e)


@kernel(inline=True, exact=True)
def _apart(a, a_lo, b, b_lo):
    """Return (a, a_lo) - (b, b_lo) as a pair."""
    s, lost = two_sum(a, -b)
    return s, exact_add(lost, exact_sub(a_lo, b_lo))


@kernel(inline=True, exact=True)
def _squared(x, x_lo, y, y_lo, z, z_lo):
    """Return x^2 + y^2 + z^2 as a pair."""
    xx, a = two_product(x, x)
    yy, b = two_product(y, y)
    zz, c = two_product(z, z)
    s, d = two_sum(xx, yy)
    s, e = two_sum(s, zz)
    cross = fma(x, x_lo, fma(y, y_lo, z * z_lo))
    return s, ((a + b) + (c + d)) + (e + (cross + cross))


@kernel(inline=True, exact=True)
def _times(w, w_lo, gm):
    """Return gm (w, w_lo) as a pair; w_lo may be 2e-4 of w."""
    pull, lost = two_product(w, full(gm))
    return quick_two_sum(pull, fma(w_lo, full(gm), lost))


@kernel(inline=True, exact=True)
def _add(pull, pull_lo, x, x_lo, out, out_lo, k):
    """Add (pull, pull_lo) (x, x_lo) to component k of (out, out_lo)."""
    own, own_lo = two_product(pull, x)
    s, e = two_sum(get(out, k), own)
    put(out, k, s)
    put(out_lo, k, get(out_lo, k) + (e + fma(pull_lo, x, fma(pull, x_lo, own_lo))))
