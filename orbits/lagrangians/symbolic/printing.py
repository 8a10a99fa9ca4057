"""Printing of SymPy expressions as lines of a kernel, for float64 and lanes from one source.

The code is like good handwritten code: common subexpressions are shared, integer powers are products, half-integer ones
use one `rsqrt_cubed` or square root.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from orbits.errors import InputError

FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "atan2")
"""SymPy functions that have a kernel of the same name."""

GUARD = "positive"
"""A function that transformations of Lagrangians may put around an expression: NaN where it is not positive."""


class Printer:
    """Collects the statements that compute some expressions.

    names : the name of each symbol in the kernel
    """

    def __init__(self, names: dict[Any, str]) -> None:
        self.names = dict(names)
        self.lines: list[str] = []
        self._made: dict[str, str] = {}
        self._roots: dict[str, str] = {}

    def define(self, expressions: Sequence[Any]) -> list[str]:
        """Return the texts of the values of `expressions`, and collect the statements that they need."""
        import sympy

        fresh = sympy.numbered_symbols("cse_", cls=sympy.Dummy)
        shared, reduced = sympy.cse(list(expressions), symbols=fresh, list=True)
        for symbol, expression in shared:
            self.names[symbol] = self.atom(expression)
        return [self.text(expression) for expression in reduced]

    def atom(self, expression: Any) -> str:
        """Return a name or number that holds the value of `expression`."""
        text = self.text(expression)
        if text.isidentifier() or _is_number(text):
            return text
        return self._assigned(text)

    def _assigned(self, text: str) -> str:
        if text not in self._made:
            self._made[text] = f"x{len(self._made)}"
            self.lines.append(f"{self._made[text]} = {text}")
        return self._made[text]

    def text(self, e: Any) -> str:
        """Return the expression as Python text that can be an operand of + and -."""
        if e.is_Symbol:
            return str(self.names[e])
        if e.is_number:
            return _number(e)
        if e.is_Add:
            return self._sum(e)
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        name = type(e).__name__
        if name in FUNCTIONS or name == GUARD:
            return f"{name}({', '.join(self.text(a) for a in e.args)})"
        raise InputError(f"{name} cannot be compiled")

    def _sum(self, e: Any) -> str:
        text = ""
        for term in e.as_ordered_terms():
            negative = term.could_extract_minus_sign()
            part = self.text(-term if negative else term)
            if (-term if negative else term).is_Add:
                part = f"({part})"
            text += f" - {part}" if negative else (f" + {part}" if text else part)
        return text.strip() if not text.startswith(" - ") else "-" + text[3:]

    def _product(self, e: Any) -> str:
        if e.could_extract_minus_sign():
            return f"-{self._factor(-e)}"
        above, below = [], []
        for factor in e.args:
            base, exponent = factor.as_base_exp()
            if factor.is_Pow and exponent.is_Integer and exponent < 0:
                below.append(self._factor(base**-exponent))
            else:
                above.append(self._factor(factor))
        text = " * ".join(above) or "1.0"
        if not below:
            return text
        divisor = " * ".join(below)
        return f"{text} / ({divisor})" if " " in divisor else f"{text} / {divisor}"

    def _factor(self, e: Any) -> str:
        text = self.text(e)
        return f"({text})" if e.is_Add or text.startswith("-") or " / " in text else text

    def _power(self, base: Any, exponent: Any) -> str:
        import sympy

        if base == sympy.E:
            return f"exp({self.text(exponent)})"
        if exponent.is_Integer:
            n = int(exponent)
            return self._integer_power(self.atom(base), n) if n > 0 else self._inverse_power(self.atom(base), -n)
        if (2 * exponent).is_Integer:
            return self._half_integer_power(self.atom(base), int(2 * exponent))
        return f"power({self.text(base)}, {self.text(exponent)})"

    def _inverse_power(self, x: str, n: int) -> str:
        if x in self._roots:
            # 1/x = (w x)^2 with w = x^(-3/2), which exists already: products instead of a division.
            return self._integer_power(self._assigned(f"{self._roots[x]} * {x}"), 2 * n)
        return f"1.0 / ({self._integer_power(x, n)})"

    def _half_integer_power(self, x: str, twice: int) -> str:
        if twice > 0:
            root = self._assigned(f"sqrt({x})")
            return root if twice == 1 else f"{self._integer_power(x, twice // 2)} * {root}"
        if x not in self._roots:
            self._roots[x] = self._assigned(f"rsqrt_cubed({x})")
        w = self._roots[x]
        if twice == -3:
            return w
        inverse_root = self._assigned(f"{w} * {x}")
        if twice == -1:
            return inverse_root
        return f"{w} * {self._integer_power(inverse_root, -twice - 3)}"

    def _integer_power(self, x: str, n: int) -> str:
        if n == 1:
            return x
        if n == 2:
            return f"{x} * {x}"
        half = self._assigned(self._integer_power(x, n // 2))
        return f"{half} * {half}" + (f" * {x}" if n % 2 else "")


def _number(e: Any) -> str:
    try:
        value = complex(int(e.p) / int(e.q) if e.is_Rational else e.evalf(30))
    except OverflowError:
        value = complex("inf")
    if value.imag != 0.0:
        raise InputError(f"the number {e} is complex; a Lagrangian is real")
    if not math.isfinite(value.real):
        raise InputError(f"the number {str(e)[:40]} in L or its derivatives is beyond float64; choose other units")
    return repr(value.real)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
