"""Double-double arithmetic on NumPy arrays: about 32 digits, so that a diagnostic's own round-off does not show.

A number is an unevaluated sum `hi + lo` of two float64 arrays with |lo| <= ulp(hi)/2. All functions are elementwise and
broadcast. Nothing is compiled: NumPy never contracts a product and a sum into one rounding, which these need.

Source: Dekker (1971), Numer. Math. 18, 224; Knuth, TAOCP 2, 4.2.2; Joldes, Muller & Popescu (2017), ACM TOMS 44, 15.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SPLITTER = 134217729.0  # 2**27 + 1: cuts 53 bits into 26 + 26 and a sign


class Pair(NamedTuple):
    """hi + lo: arrays of one shape."""

    hi: Floats
    lo: Floats

    def rounded(self) -> Floats:
        """The nearest float64."""
        return self.hi + self.lo


def two_sum(a: Floats, b: Floats) -> Pair:
    """Exact a + b. Source: Knuth."""
    s = a + b
    t = s - a
    return Pair(s, (a - (s - t)) + (b - t))


def _quick_two_sum(a: Floats, b: Floats) -> Pair:
    """Exact a + b for |a| >= |b|. Source: Dekker (1971)."""
    s = a + b
    return Pair(s, b - (s - a))


def two_product(a: Floats, b: Floats) -> Pair:
    """Exact a b, unless it over- or underflows (|a|, |b| < 1e300). Source: Dekker (1971), Veltkamp's splitting."""
    p = a * b
    t = _SPLITTER * a
    a_hi = t - (t - a)
    a_lo = a - a_hi
    t = _SPLITTER * b
    b_hi = t - (t - b)
    b_lo = b - b_hi
    return Pair(p, ((a_hi * b_hi - p) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo)


def add(x: Pair, y: Pair) -> Pair:
    """Sum x + y, relative error below 3 u^2 even under cancellation. Source: Joldes, Muller & Popescu, algorithm 6."""
    s = two_sum(x.hi, y.hi)
    t = two_sum(x.lo, y.lo)
    v = _quick_two_sum(s.hi, s.lo + t.hi)
    return _quick_two_sum(v.hi, t.lo + v.lo)


def subtract(x: Pair, y: Pair) -> Pair:
    """Difference x - y, as accurate as `add`."""
    return add(x, Pair(-y.hi, -y.lo))


def multiply(x: Pair, y: Pair) -> Pair:
    """Product x y, relative error below 7 u^2. Source: Joldes, Muller & Popescu, algorithm 10."""
    p = two_product(x.hi, y.hi)
    return _quick_two_sum(p.hi, p.lo + (x.hi * y.lo + x.lo * y.hi))


def scale(x: Pair, factor: Floats) -> Pair:
    """Product of x and a float64, relative error below 3 u^2. Source: Joldes, Muller & Popescu, algorithm 7."""
    p = two_product(x.hi, factor)
    return _quick_two_sum(p.hi, p.lo + x.lo * factor)


def reciprocal_root(x: Pair) -> Pair:
    """1 / sqrt(x) for x > 0: a float64 estimate y and one Newton correction, y + y (1 - x y^2) / 2."""
    y = 1.0 / np.sqrt(x.hi)
    t = multiply(x, two_product(y, y))
    residual = (1.0 - t.hi) - t.lo
    return _quick_two_sum(y, 0.5 * y * residual)


def divide(x: Pair, y: Pair) -> Pair:
    """Quotient x / y by one step of long division."""
    quotient = x.hi / y.hi
    remainder = subtract(x, scale(y, quotient))
    return _quick_two_sum(quotient, remainder.hi / y.hi)


def total(x: Pair) -> Pair:
    """Sum over the last axis, by halves: shape (..., n) to (...). An empty axis gives zero."""
    hi, lo = x
    while hi.shape[-1] > 1:
        half = hi.shape[-1] // 2
        folded = add(Pair(hi[..., :half], lo[..., :half]), Pair(hi[..., half : 2 * half], lo[..., half : 2 * half]))
        if hi.shape[-1] % 2:
            folded = Pair(
                np.concatenate([folded.hi, hi[..., 2 * half :]], axis=-1),
                np.concatenate([folded.lo, lo[..., 2 * half :]], axis=-1),
            )
        hi, lo = folded
    if hi.shape[-1] == 0:
        return Pair(np.zeros(hi.shape[:-1]), np.zeros(hi.shape[:-1]))
    return Pair(hi[..., 0], lo[..., 0])


def dot(a: Floats, b: Floats) -> Pair:
    """Scalar product of float64 vectors over the last axis of length 3."""
    xy = add(two_product(a[..., 0], b[..., 0]), two_product(a[..., 1], b[..., 1]))
    return add(xy, two_product(a[..., 2], b[..., 2]))
