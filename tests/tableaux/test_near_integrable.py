"""Splittings of nearly integrable systems, and correctors: by all coefficients of their series in two operators."""

from fractions import Fraction
from math import factorial

import mpmath
import numpy as np
import pytest

from orbits.errors import InputError
from orbits.integrators.saba import SABA
from orbits.tableaux.correctors import corrector, corrector_lengths, second_corrector
from orbits.tableaux.near_integrable import KNOWN, binary_splitting, missed, splitting
from orbits.tableaux.partitioned import DIGITS

from ..coverings import each


class Series:
    """A series in A and B that do not commute, with at most so many A and B in a word: {word: coefficient}."""

    def __init__(self, words, limits):
        self.words, self.limits = {word: x for word, x in words.items() if x and self._fits(word, limits)}, limits

    @staticmethod
    def _fits(word, limits):
        return word.count("B") < len(limits) and len(word) <= limits[word.count("B")]

    def __mul__(self, other):
        if not isinstance(other, Series):
            return Series({word: x * other for word, x in self.words.items()}, self.limits)
        out = {}
        for one, x in self.words.items():
            for two, y in other.words.items():
                if self._fits(one + two, self.limits):
                    out[one + two] = out.get(one + two, 0) + x * y
        return Series(out, self.limits)

    def __add__(self, other):
        words = dict(self.words)
        for word, x in other.words.items():
            words[word] = words.get(word, 0) + x
        return Series(words, self.limits)

    def bracket(self, other):
        return self * other + other * self * -1

    def exp(self):
        term = total = Series({"": Fraction(1)}, self.limits)
        for n in range(1, max(self.limits) + 1):
            term = term * self * Fraction(1, n)
            total = total + term
        return total

    def log(self):
        rest = self + Series({"": Fraction(-1)}, self.limits)
        term, total = Series({"": Fraction(1)}, self.limits), Series({}, self.limits)
        for n in range(1, max(self.limits) + 1):
            term = term * rest
            total = total + term * Fraction((-1) ** (n + 1), n)
        return total


def exponential(letter, length, limits):
    """exp(length A) or exp(length B), to which mpmath numbers may be given."""
    return Series({letter * n: length**n / factorial(n) for n in range(max(limits) + 1)}, limits)


@pytest.mark.parametrize("orders", [orders for orders in KNOWN if orders[0] <= 10], ids=str)
def test_a_splitting_has_its_generalized_order_and_no_higher_one(orders):
    """Its series is that of exp(A + B), 1/n! for each word of n letters, for words with one B up to the first order,
    with two up to the second, with three up to the third; and beyond the first one some other number.
    """
    third = orders[2] if len(orders) > 2 else min(orders[1], 4)
    limits = [1, orders[0] + 1, orders[1], third]
    with mpmath.workdps(DIGITS):
        drifts, kicks = splitting(orders)
        series = exponential("A", drifts[0], [orders[0], *limits[1:]])
        for a, b in zip(drifts[1:], kicks, strict=True):
            series = series * exponential("B", b, series.limits) * exponential("A", a, series.limits)
        off = {word: abs(x * factorial(len(word)) - 1) for word, x in series.words.items()}
        beyond = {word for word in off if len(word) == orders[0] + 1 and word.count("B") == 1}
        assert max(x for word, x in off.items() if word not in beyond) < mpmath.mpf(10) ** (8 - DIGITS)
        assert max(off[word] for word in beyond) > 1e-6
        assert len(off) > 2 * orders[0]


@each("orders", KNOWN)
def test_coefficients_are_mirrored_to_the_last_bit_with_sums_that_are_the_step(orders):
    drifts, kicks = splitting(orders)
    with mpmath.workdps(DIGITS):
        assert max(map(abs, missed(drifts, kicks, orders)), default=0) < mpmath.mpf(10) ** (3 - DIGITS)
    for values in binary_splitting(orders, 3.1):
        assert np.array_equal(values, values[::-1])
    h = float(np.float32(3.1))
    for values in binary_splitting(orders, h):
        assert sum(map(Fraction, values.tolist())) == Fraction(h)
    assert len(drifts) == len(kicks) + 1
    assert (min(kicks) > 0) == (min(drifts) > 0) == (orders[1] == 2)


def test_the_classic_scheme_of_four_kicks_is_by_gauss_and_legendre():
    """Against the nodes of Laskar and Robutel (2001), table 2: c_1 of SABA_4 is 1/2 - sqrt(525 + 70 sqrt(30))/70."""
    drifts, kicks = splitting((8, 2))
    with mpmath.workdps(DIGITS):
        root = mpmath.sqrt(30)
        assert abs(drifts[0] - (mpmath.mpf(1) / 2 - mpmath.sqrt(525 + 70 * root) / 70)) < 1e-55
        assert abs(kicks[0] - (mpmath.mpf(1) / 4 - root / 72)) < 1e-55


def corrected(order, second, limits):
    """The logarithm of the map with the modified kick between correctors, and A, B and [A, B]."""
    A, B = Series({"A": Fraction(1)}, limits), Series({"B": Fraction(1)}, limits)
    pairs = [(sign * a, sign * b / 2) for a, b in corrector(order) for sign in (1, -1)]
    stages = [*(second_corrector() if second else []), *pairs, *reversed(pairs)]

    def applied(stages, sign):
        out = Series({"": Fraction(1)}, limits)
        for a, b in stages:
            out = out * (A * a).exp() * (B * (sign * b)).exp() * (A * -a).exp()
        return out

    half = (B + B.bracket(A.bracket(B)) * Fraction(1, 24)) * Fraction(1, 2)
    step = applied(stages, 1) * half.exp() * A.exp() * half.exp() * applied(stages[::-1], -1)
    return step.log(), A, B, A.bracket(B)


def test_the_second_corrector_leaves_of_the_second_order_what_no_change_of_variables_removes():
    limits = [5, 5, 5]
    for second in (False, True):
        log, A, B, AB = corrected(7, second, limits)
        Z = A.bracket(AB.bracket(B))
        rest = A.bracket(AB).bracket(AB) * Fraction(1, 1440)
        if not second:
            rest = rest + A.bracket(Z) * Fraction(1, 1440)
        left = (log + (A + B + rest) * -1).words
        # The kicks of the second corrector are a square root, rounded.
        assert max(map(abs, left.values()), default=0) < (1e-18 if second else Fraction(1, 10**30))
    stages = corrector_lengths(17, second=True)
    assert abs(stages.sum(axis=0)).max() < 1e-14  # it ends where it begins
    assert len(stages) == 8 + len(corrector_lengths(17))
    nodes = [(a, b) for a, b in second_corrector()]
    assert all(sum(b for a, b in nodes if a == node) == 0 for node in (-1, 0, 1))  # nothing of the first order


def test_orders_may_be_typed_as_in_the_literature():
    texts = SABA("10,6,4"), SABA("10-6-4"), SABA("(10, 6, 4)")
    for same in (SABA(), SABA(10), SABA(10, 6), *texts, SABA((10, 6, 4)), SABA([10, 6, 4])):
        assert same == SABA(10, 6, 4)
    assert SABA(8, 6, 4).label == "SABA(8, 6, 4)"
    assert SABA(8, 2, encounters="retire").label == "SABA(8, 2, encounters='retire')"
    for orders, text in (
        ((4,), r"generalized order 4.*\(10, 6, 4\), \(8, 6, 4\), \(8, 4\), or \(2 n, 2\).*SABA_4 .* is SABA\(8, 2\)"),
        ((9, 9), r"generalized order \(9, 9\)"),
        (("ten",), r"generalized order 'ten'"),
        ((True,), r"generalized order True"),
        ((10.0, 6, 4), r"generalized order \(10\.0, 6, 4\)"),
        ((22, 2), r"n = 1 \.\.\. 10"),
    ):
        with pytest.raises(InputError, match=text):
            SABA(*orders)
    with pytest.raises(InputError, match="expected 'warn', 'retire particles'"):
        SABA(encounters="ignore")
