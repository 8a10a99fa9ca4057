"""The potential energy of a system to the last digit, so that a measured drift of the energy is one of the states.

Numbers are pairs hi + lo of about 32 digits, see `orbits.kernels.sums.summation`.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, lane, load, select, sqrt, unit
from orbits.kernels.sums.summation import add_pairs, multiply_pairs, quick_two_sum, two_product, two_sum

TOO_NEAR = 1e-290
"""Lower limit of a squared distance: 2^53 above the smallest float that can be split without loss."""


@kernel(inline=True)
def _add_square(r2, r2_lo, x, start, i):
    """Return a pair with the square of the distances of coordinate i from those of eight bodies."""
    d, e = two_sum(load(x, start), full(-x[i]))
    s, s_lo = multiply_pairs(d, e, d, e)
    return add_pairs(r2, r2_lo, s, s_lo)


@kernel
def doubled_attraction(gm, q, softening2, softening2_lo):
    """Return sum over i < j of gm_i gm_j / sqrt(r_ij^2 + softening^2) as (hi, lo).

    gm : (n + 8,) and q : (3, n + 8), with padding that is ignored; softening^2 as a pair
    NaN if some r_ij^2 + softening^2 is below 1e-290: its low part would underflow.
    """
    n = gm.shape[0] - WIDTH
    x, y, z = q[0], q[1], q[2]
    total, total_lo = 0.0, 0.0
    for i in range(n - 1):
        hi, lo = full(0.0), full(0.0)
        for start in range(i + 1, n, WIDTH):
            r2, r2_lo = full(softening2), full(softening2_lo)
            r2, r2_lo = _add_square(r2, r2_lo, x, start, i)
            r2, r2_lo = _add_square(r2, r2_lo, y, start, i)
            r2, r2_lo = _add_square(r2, r2_lo, z, start, i)
            # 1/sqrt(r2): an estimate u and one correction, u + u (1 - r2 u^2) / 2.
            u = 1.0 / sqrt(r2)
            s, s_lo = two_product(u, u)
            s, s_lo = multiply_pairs(r2, r2_lo, s, s_lo)
            w, w_lo = quick_two_sum(u, 0.5 * u * ((1.0 - s) - s_lo))
            p, e = two_product(load(gm, start), full(gm[i]))
            s, s_lo = multiply_pairs(p, e, w, w_lo)
            s = select(r2 < TOO_NEAR, full(math.nan), s)
            if start + WIDTH > n:
                valid = full(0.0)
                for j in range(start, n):
                    valid = valid + unit(j - start)
                s, s_lo = select(valid > 0.0, s, full(0.0)), select(valid > 0.0, s_lo, full(0.0))
            hi, lo = add_pairs(hi, lo, s, s_lo)
        for k in range(WIDTH):
            total, total_lo = add_pairs(total, total_lo, lane(hi, k), lane(lo, k))
    return total, total_lo
