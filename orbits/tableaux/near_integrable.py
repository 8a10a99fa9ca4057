"""Splittings for a system that is nearly integrable, A + eps B: coefficients from their order conditions.

    e^(a_1 h A) e^(b_1 h eps B) e^(a_2 h A) ... e^(b_s h eps B) e^(a_(s+1) h A),     a and b mirrored, sums 1

has the error eps h^(r_1) + eps^2 h^(r_2) + eps^3 h^(r_3) + ..., its generalized order (r_1, r_2, r_3). Symmetric
schemes have no terms of odd orders. With the nodes c_i = a_1 + ... + a_i, the conditions are

    first order in B, r_1:    sum_i b_i c_i^p = 1/(p + 1),   p = 0 ... r_1 - 1    (a quadrature)
    second order, r_2:        sum_(i<j) b_i b_j c_i^p c_j^q + sum_i b_i^2 c_i^(p+q) / 2 = 1/((p + 1)(p + q + 2)),
                              p + q + 2 < r_2 odd, p < q

because B at the time t in the course of A is sum_p t^p ad_A^p B / p!. Those of the third order up to h^4 follow by
symmetry. Quadrature by Gauss and Legendre gives (2 s, 2) with s kicks, all coefficients positive. Schemes of higher
order in eps have negative ones; they are refined from the published ones.

Source: McLachlan (1995), BIT 35, 258; Laskar & Robutel (2001), Celest. Mech. Dyn. Astron. 80, 39; Blanes, Casas,
Farrés, Laskar, Makazaga & Murua (2013), Appl. Numer. Math. 68, 58.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import mpmath

from orbits.many_digits import many_digits
from orbits.tableaux.compositions import balanced
from orbits.tableaux.gauss import gauss
from orbits.tableaux.partitioned import DIGITS, Array, Exact

REFINED: dict[tuple[int, ...], tuple[int, tuple[float, ...], tuple[float, ...]]] = {
    (8, 4): (5, (0.0753469602698929, 0.5179168546882568), (0.1902259393736766, 0.8465240704435263)),
    (8, 6, 4): (
        7,
        (0.0711334264982231, 0.2411534279566401, 0.5214117617728148),
        (0.1830836874721972, 0.3107828598985749, -0.0265646185119588),
    ),
    (10, 6, 4): (
        8,
        (0.0380944974224122, 0.1452987161169137, 0.2076276957255413, 0.4359097036515262),
        (0.0958588808370752, 0.2044461531429988, 0.2170703479789911),
    ),
}
"""Schemes to be refined: the number of kicks, and a_1 ... and b_1 ... without those that follow from the sums."""

MOST = 10
"""The most kicks of a scheme by Gauss and Legendre."""

KNOWN = (*REFINED, *((2 * s, 2) for s in range(1, MOST + 1)))
"""All generalized orders."""


@lru_cache(maxsize=32)
def splitting(orders: tuple[int, ...]) -> tuple[Exact, Exact]:
    """Return a_1 ... a_(s+1) and b_1 ... b_s of a scheme of `KNOWN`, mpmath numbers to `DIGITS` digits."""
    with many_digits(DIGITS + 10):
        if orders in REFINED:
            kicks, a, b = REFINED[orders]

            def conditions(*x: Any) -> list[Any]:
                return missed(*_whole(kicks, x[: len(a)], x[len(a) :]), orders)

            x = list(mpmath.findroot(conditions, [*a, *b], tol=mpmath.mpf(10) ** (-2 * DIGITS - 10)))
            return _whole(kicks, x[: len(a)], x[len(a) :])
        return _by_gauss(orders[0] // 2)


def binary_splitting(orders: tuple[int, ...], h: float) -> tuple[Array, Array]:
    """Return h a, (s + 1,), and h b, (s,), rounded symmetrically; their sums are exactly h of at most 48 bits."""
    drifts, kicks = splitting(orders)
    return balanced(drifts, h), balanced(kicks, h)


def missed(drifts: Exact, kicks: Exact, orders: tuple[int, ...]) -> list[Any]:
    """Return what the coefficients of a symmetric scheme miss of the conditions for `orders`, but for the sums."""
    c = [mpmath.fsum(drifts[: i + 1]) for i in range(len(kicks))]
    out = [
        mpmath.fsum(b * x**p for b, x in zip(kicks, c, strict=True)) - mpmath.mpf(1) / (p + 1)
        for p in range(2, orders[0], 2)
    ]
    for both in range(1, orders[1] - 2, 2):
        for p in range((both + 1) // 2):
            q, total = both - p, mpmath.mpf(0)
            for j, (b, x) in enumerate(zip(kicks, c, strict=True)):
                before = mpmath.fsum(kicks[i] * c[i] ** p for i in range(j))
                total += b * x**q * before + b * b * x**both / 2
            out.append(total - mpmath.mpf(1) / ((p + 1) * (both + 2)))
    return out


def _whole(kicks: int, a: Any, b: Any) -> tuple[Exact, Exact]:
    """Return all coefficients of a symmetric scheme with the middle ones from the sums; `kicks` : their number."""
    return _mirrored(kicks + 1, a), _mirrored(kicks, b)


def _mirrored(count: int, half: Any) -> Exact:
    rest = 1 - 2 * mpmath.fsum(half)
    middle = (rest,) if count % 2 else (rest / 2, rest / 2)
    return (*half, *middle, *reversed(list(half)))


def _by_gauss(s: int) -> tuple[Exact, Exact]:
    """Return the scheme whose nodes and weights are those of quadrature by Gauss and Legendre."""
    table = gauss(s)
    nodes = [mpmath.mpf(0), *table.exact_c]
    a = [x - before for before, x in pairwise(nodes)]
    return _mirrored(s + 1, a[: s // 2]), _mirrored(s, table.exact_b[: (s - 1) // 2])
