"""Symplectic correctors of Wisdom–Holman maps, for kick–drift–kick: coefficients from their definition.

With X = h L_A the Kepler motion and Y = h L_B the interaction as Lie operators, the map is to first order in Y

    log(e^(Y/2) e^X e^(Y/2)) = X + g(ad_X) Y,     g(x) = (x/2) coth(x/2),

and the corrector e^K, K = ((g(x) - 1) / x) Y at x = ad_X, makes it X + Y. It is approximated by kicks among Kepler
motions, two for each a_k,

    e^(a_k X) e^(b_k Y) e^(-a_k X)  e^(-a_k X) e^(-b_k Y) e^(a_k X) = exp(2 b_k sinh(a_k x) Y) to first order in Y,

so that n pairs can match the first n terms of (g(x) - 1) / x = x/12 - x^3/720 + ...: a corrector of order 2 n + 1. The
a_k are free; equidistant ones give a linear system for the b_k, which is solved exactly.

To second order in Y, the corrected map with the modified kick, Y + [Y, [X, Y]] / 24 for Y, is

    X + Y + ([X, Z] + [[X, [X, Y]], [X, Y]]) / 1440 + O(h^7),     Z = [X, [[X, Y], Y]]

whose first bracket a second corrector e^(Z / 1440) removes: by kicks of +-b at Kepler motions of -1, 0 and 1 step, the
sum of which is 0 to first order in Y, and b^2 Z to second order. The second bracket no change of variables removes.

Source: Wisdom, Holman & Touma (1996), Fields Inst. Commun. 10, 217; Wisdom (2006), AJ 131, 2294, for drift–kick–drift.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache
from math import factorial

import numpy as np
from numpy.typing import NDArray

SPACING = Fraction(1, 3)
"""a_k = k SPACING. With a smaller one shorter periods are resolved, but the kicks are larger: the sum of the 2 |b_k| of
order 17 is 3 here, and 28 for a spacing of 1/4."""

PAIRS = {0: 0, 3: 1, 5: 2, 7: 3, 11: 5, 17: 8}
"""The number of pairs of kicks of a corrector, by its order."""

SECOND = math.sqrt(1.0 / 1440.0)
"""Kicks of the second corrector, in fractions of a step."""


@lru_cache(maxsize=8)
def corrector(order: int) -> tuple[tuple[Fraction, Fraction], ...]:
    """Return (a_k, b_k) of the corrector of this order, in fractions of a step."""
    pairs = PAIRS[order]
    a = [SPACING * k for k in range(1, pairs + 1)]
    rows = [[2 * x ** (2 * j + 1) / factorial(2 * j + 1) for x in a] + [_wanted(j)] for j in range(pairs)]
    return tuple(zip(a, _solved(rows), strict=True))


def corrector_lengths(order: int, second: bool = False) -> NDArray[np.float64]:
    """Return the stages of a corrector, (stages, 2): each a Kepler motion and then a kick, in fractions of a step.

    second : whether the second corrector is applied before it

    The pairs are applied with half of their kicks each, then once more in reverse: a palindrome of exponentials has no
    terms of second order in Y. The last kick is 0. Reversed with the opposite signs, the stages are the inverse.
    """
    forth = [(sign * a, sign * b / 2) for a, b in corrector(order) for sign in (1, -1)]
    drifts, kicks = list[Fraction](), list[Fraction]()
    at = Fraction(0)
    for a, b in [*(second_corrector() if second else []), *forth, *reversed(forth)]:
        if kicks and a == at:
            kicks[-1] += b
        else:
            drifts.append(a - at)
            kicks.append(b)
        at = a
    drifts.append(-at)
    return np.array([[float(d), float(k)] for d, k in zip(drifts, [*kicks, Fraction(0)], strict=True)])


def second_corrector() -> list[tuple[Fraction, Fraction]]:
    """Return (a_k, b_k), kicks b_k after Kepler motions of a_k, of the second corrector."""
    b = Fraction(SECOND)
    return [(Fraction(sign * a), s * b) for sign in (1, -1) for a, s in ((0, 1), (1, -1), (0, -1), (1, 1))]


def _wanted(j: int) -> Fraction:
    """Return the coefficient of x^(2j + 1) in (g(x) - 1) / x: Bernoulli's number B_(2j + 2) / (2j + 2)!."""
    numbers = [Fraction(1)]
    for m in range(1, 2 * j + 3):
        numbers.append(-sum((_choose(m + 1, k) * numbers[k] for k in range(m)), Fraction(0)) / (m + 1))
    return numbers[2 * j + 2] / factorial(2 * j + 2)


def _choose(n: int, k: int) -> int:
    return factorial(n) // (factorial(k) * factorial(n - k))


def _solved(rows: list[list[Fraction]]) -> list[Fraction]:
    """Return the solution of a linear system, given with its right-hand side, by elimination."""
    n = len(rows)
    for i in range(n):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in range(n):
            if k != i:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[n] for row in rows]
