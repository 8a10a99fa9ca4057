"""Schemes that raise the order of a method: a chain of its steps gamma_i h, or a new chain of kicks and drifts.

    composition    Phi(gamma_s h) ... Phi(gamma_1 h),  gamma_i = gamma_(s+1-i),  sum gamma_i = 1
    splitting      kick(k_s h) drift(d_s h) ... drift(d_1 h) kick(k_0 h),  both mirrored, sums 1

A composition of Störmer–Verlet is a splitting with k_i = (gamma_i + gamma_(i+1)) / 2 and d_i = gamma_i. Two schemes
raise the order p of any symmetric method by two:

    triple jump    gamma_1 = gamma_3 = 1 / (2 - 2^(1/(p+1))),  gamma_2 = 1 - 2 gamma_1
    suzuki         gamma_1 = gamma_2 = gamma_4 = gamma_5 = 1 / (4 - 4^(1/(p+1))),  gamma_3 = 1 - 4 gamma_1

The other schemes were found numerically by their authors, for methods of order 2; see `published.py`.

Source: Hairer, Lubich & Wanner (2006), sec. II.4, V.3; Yoshida (1990); Suzuki (1990); McLachlan (1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from math import ceil, frexp, log2
from typing import Any

import mpmath
import numpy as np

from orbits.checks import is_whole
from orbits.errors import InputError, shown
from orbits.many_digits import many_digits
from orbits.tableaux.partitioned import DIGITS, Array, Exact, PartitionedTableau
from orbits.tableaux.published import COMPOSITIONS, SPLITTINGS

ANY_BASE = {
    "triple-jump": "Yoshida (1990), Phys. Lett. A 150, 262; Creutz & Gocksch (1989), Phys. Rev. Lett. 63, 9",
    "suzuki": "Suzuki (1990), Phys. Lett. A 146, 319",
}
"""Schemes for symmetric methods of any order, with their sources."""

NOTHING = 1e-50
"""Numbers of `DIGITS` digits below this are zero."""

HIGHEST = 8
"""The most by which an order may be raised: each increase by two takes 3 or 5 times as many steps."""


@dataclass(frozen=True, eq=False)
class Scheme:
    """A composition or splitting scheme, to `DIGITS` digits.

    name, order, source : its name, the order of the composed method, and the publication
    steps : gamma_1 ... gamma_s, mpmath numbers; empty if kicks and drifts are not a chain of Störmer–Verlet steps
    kicks, drifts : k_0 ... k_s and d_1 ... d_s, mpmath numbers
    """

    name: str
    order: int
    source: str
    steps: Exact
    kicks: Exact
    drifts: Exact

    def binary_steps(self, h: float) -> Array:
        """Return gamma h, (s,), rounded symmetrically; their sum is exactly h if h has at most 48 bits."""
        return balanced(self.steps, h)

    def binary_kicks_and_drifts(self, h: float) -> tuple[Array, Array]:
        """Return k h, (s + 1,), and d h, (s,), rounded in the same way."""
        if not self.steps:
            return balanced(self.kicks, h), balanced(self.drifts, h)
        d = self.binary_steps(h)
        return 0.5 * (np.append(d, 0.0) + np.append(0.0, d)), d

    def composed(self, base: PartitionedTableau) -> PartitionedTableau:
        """Return the tableau of the scheme with a base method: the stages of all steps in sequence."""
        with many_digits(DIGITS):
            zero = mpmath.mpf(0)
            a: list[Any] = []
            a_bar: list[Any] = []
            before: list[Any] = []
            total = len(self.steps) * base.stages
            for gamma in self.steps:
                for table, rows in ((base.exact_a, a), (base.exact_a_bar, a_bar)):
                    for row in table:
                        own = [*before, *(gamma * x for x in row)]
                        rows.append(tuple(own + [zero] * (total - len(own))))
                before += [gamma * x for x in base.exact_b]
        return PartitionedTableau(f"{base.name}, {self.name}", tuple(a), tuple(a_bar), tuple(before), self.order)

    def split(self) -> PartitionedTableau:
        """Return the tableau of the kicks and drifts: one stage for each symplectic Euler step of the chain.

        kick-drift by b_1, drift-kick by b_2, kick-drift by b_3, ...: k_0 = b_1, d_1 = b_1 + b_2, k_1 = b_2 + b_3, ...
        """
        with many_digits(DIGITS):
            chain = [x for pair in zip(self.kicks, self.drifts, strict=False) for x in pair]
            weights: list[Any] = []
            for x in chain:
                weights.append(x - (weights[-1] if weights else 0))
            kept = [(b, k % 2 == 0) for k, b in enumerate(weights) if abs(b) > NOTHING]
            b = [w for w, _ in kept]
            zero, s = mpmath.mpf(0), len(b)
            a: list[Any] = []
            a_bar: list[Any] = []
            for i, (weight, kick_first) in enumerate(kept):
                before, after = b[:i], [zero] * (s - i - 1)
                a.append((*before, zero if kick_first else weight, *after))
                a_bar.append((*before, weight if kick_first else zero, *after))
        return PartitionedTableau(f"kicks and drifts, {self.name}", tuple(a), tuple(a_bar), tuple(b), self.order)


def scheme_names(base_order: int, order: int, *, splittings: bool) -> list[str]:
    """Return the names of schemes from `base_order` to `order`, with `splittings` also those of kicks and drifts."""
    published = [name for r, name in COMPOSITIONS if r == order and base_order == 2]
    published += [name for r, name in SPLITTINGS if r == order and splittings]
    return sorted([*ANY_BASE, *published])


def require_order(base_order: int, order: Any) -> None:
    """Raise InputError unless compositions can raise a symmetric method from `base_order` to `order`."""
    if not is_whole(order) or order % 2 or not base_order < order:
        raise InputError(
            f"a composition of a symmetric method of order {base_order} has an even order above {base_order}, got "
            f"{shown(order)}; use e.g. order={base_order + 2}"
        )
    if order > base_order + HIGHEST:
        raise InputError(
            f"order {shown(order)} from order {base_order} takes thousands of steps; expected at most "
            f"{base_order + HIGHEST}. Compose a method of higher order, such as Gauss(stages=4), or use it by itself."
        )


@lru_cache(maxsize=64, typed=True)
def scheme(base_order: int, order: int, name: str, *, splittings: bool = False) -> Scheme:
    """Return the named scheme that raises a symmetric method from `base_order` to `order`.

    Raises InputError for an order that is odd, not above that of the base, or too far above it, and for a name that no
    scheme for these orders has.
    """
    require_order(base_order, order)
    known = scheme_names(base_order, order, splittings=splittings)
    if name not in known:
        elsewhere = (order, name) in COMPOSITIONS or (order, name) in SPLITTINGS
        reason = "is made for Störmer–Verlet or methods of order 2" if elsewhere else "is not a scheme for these orders"
        raise InputError(f"{shown(name)} {reason}; order {order} from order {base_order} has {', '.join(known)}")
    with many_digits(DIGITS):
        if (order, name) in SPLITTINGS and splittings and name not in ANY_BASE:
            source, kicks, drifts, kick_in_the_middle = SPLITTINGS[order, name]
            return Scheme(
                name, order, source, (), _mirrored(kicks, kick_in_the_middle), _mirrored(drifts, not kick_in_the_middle)
            )
        if name in ANY_BASE:
            source, steps = ANY_BASE[name], _recursive(name, base_order, order)
        else:
            source, half = COMPOSITIONS[order, name]
            steps = _mirrored(half, True)
        ends = [mpmath.mpf(0), *steps, mpmath.mpf(0)]
        kicks = tuple((a + b) / 2 for a, b in pairwise(ends))
        return Scheme(name, order, source, steps, kicks, steps)


def _mirrored(half: Sequence[str], middle_once: bool) -> Exact:
    values = [mpmath.mpf(x) for x in half]
    return (*values, *reversed(values[:-1] if middle_once else values))


def _recursive(name: str, base_order: int, order: int) -> Exact:
    steps: tuple[Any, ...] = (mpmath.mpf(1),)
    for p in range(base_order, order, 2):
        root = mpmath.mpf(1) / (p + 1)
        outer = 1 / (2 - mpmath.mpf(2) ** root) if name == "triple-jump" else 1 / (4 - mpmath.mpf(4) ** root)
        many = 1 if name == "triple-jump" else 2
        whole = [outer] * many + [1 - 2 * many * outer] + [outer] * many
        steps = tuple(gamma * x for gamma in whole for x in steps)
    return steps


def balanced(values: Exact, h: float) -> Array:
    """Return `values` times h, rounded symmetrically to a grid; the middle value, or two, make the sum right."""
    n = len(values)
    bits = ceil(log2(2.0 * max(1.0, float(max(abs(x) for x in values)))))
    grid = Fraction(2) ** (frexp(h)[1] + bits - 53)
    out = np.empty(n)
    with many_digits(DIGITS):
        for i in range((n - 1) // 2):
            rounded = int(mpmath.nint(values[i] * mpmath.mpf(h) / (mpmath.mpf(grid.numerator) / grid.denominator)))
            out[i] = out[-1 - i] = float(rounded * grid)
    rest = Fraction(h) - 2 * sum((Fraction(x) for x in out[: (n - 1) // 2]), Fraction(0))
    if n % 2:
        out[n // 2] = float(rest)
    else:
        out[n // 2 - 1] = out[n // 2] = float(rest / 2)
    return out
