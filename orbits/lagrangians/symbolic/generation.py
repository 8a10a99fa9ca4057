"""Generation of the source of a module of kernels from L(q, v, t; parameters) in SymPy."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orbits.errors import InputError
from orbits.lagrangians.base import CONSTRAINED, GRADIENTS, SEPARABLE, TIME_DEPENDENT
from orbits.lagrangians.symbolic.printing import FUNCTIONS, GUARD, Printer
from orbits.many_digits import many_digits

HEADER = '''"""Made by orbits from a Lagrangian in SymPy; made anew when it is missing, not to be edited."""

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put, rsqrt_cubed, sqrt
from orbits.kernels.lanes.functions import (
    acos, asin, atan, atan2, cos, cosh, exp, log, positive, power, sin, sinh, tan, tanh,
)

TRAITS = {traits!r}
DIMENSION = {d}
'''

POINTS = 12
"""The number of random points at which a mass matrix is singular before it is taken to be so everywhere."""


@dataclass(frozen=True)
class Formula:
    """A Lagrangian in SymPy, checked.

    L : the expression; q, v : (d,) symbols or functions of t and their derivatives; t : symbol or None
    parameters : symbols, in the order of the parameter vector
    constraints : expressions of q and the parameters that are 0 along motions
    """

    name: str
    L: Any
    q: tuple[Any, ...]
    v: tuple[Any, ...]
    t: Any
    parameters: tuple[Any, ...]
    constraints: tuple[Any, ...] = ()


def module_text(formula: Formula) -> str:
    """Return the module's source. Raises InputError for a Lagrangian that cannot be used, with the reason."""
    import sympy

    q, v, t = _plain_symbols(formula)
    L = _in_plain_symbols(formula, formula.L, q, v, t)
    _check_functions(formula.name, [L])
    f, p = [L.diff(x) for x in q], [L.diff(x) for x in v]
    d = len(q)
    qq = [[L.diff(a, b) for b in q] for a in q]
    qv = [[L.diff(a, b) for b in v] for a in q]
    vv = [[L.diff(a, b) for b in v] for a in v]
    _check_functions(formula.name, [*f, *p, *_flat(qq), *_flat(qv), *_flat(vv)])
    mass = sympy.Matrix(vv)
    _check_regular(formula, mass)
    moving = {*q, *v, t}
    separable = (
        not mass.free_symbols & moving
        # Only T(v) = v.Mv/2: with a term linear in v, momenta are not M v.
        and all(sympy.simplify(x.xreplace(dict.fromkeys(v, sympy.Integer(0)))) == 0 for x in p)
        and all(sympy.simplify(x) == 0 for x in _flat(qv))
        and all(not x.free_symbols & {*v, t} or not sympy.simplify(x).free_symbols & {*v, t} for x in f)
        and t not in L.free_symbols
    )
    traits = [GRADIENTS, *([SEPARABLE] if separable else []), *([TIME_DEPENDENT] if t in L.free_symbols else [])]
    traits += [CONSTRAINED] if formula.constraints else []
    text = [HEADER.format(traits=tuple(traits), d=d)]
    kernels = _Kernels(formula, q, v, t)
    text.append(kernels.value(L))
    text.append(kernels.filling("gradients", "parameters, t, q, v, f, p", {"f": f, "p": p}))
    text.append(kernels.filling("hessians", "parameters, t, q, v, out", {"out": [*_flat(qq), *_flat(qv), *_flat(vv)]}))
    if separable:
        force = sympy.Matrix([sympy.simplify(x) if x.free_symbols & {*v, t} else x for x in f])
        g = list(mass.inv() * force)
        text.append(kernels.filling("accelerate", "parameters, q, out", {"out": g}))
    if formula.constraints:
        text += _constraints(formula, kernels, mass if separable else None)
    return "\n\n".join(text)


def _constraints(formula: Formula, kernels: _Kernels, mass: Any) -> list[str]:
    """Return the kernels of the constraints; mass : the constant matrix, None if L is not separable."""
    import sympy

    if mass is None:
        raise InputError(
            f"'{formula.name}' has constraints, but L = {formula.L} is not separable. Expected L = T(v) - U(q) with a "
            "constant mass matrix: Cartesian coordinates, in which constraints need no others."
        )
    q, v, t = kernels.q, kernels.v, kernels.t
    g = [_in_plain_symbols(formula, each, q, v, t) for each in formula.constraints]
    for each, shown in zip(g, formula.constraints, strict=True):
        moving = sorted(_shown(x) for x in each.free_symbols & {*v, t})
        if moving or not each.free_symbols & {*q}:
            what = f"depends on {', '.join(moving)}" if moving else "depends on no coordinate"
            raise InputError(
                f"'{formula.name}': the constraint {shown} {what}. Expected a function of the coordinates and the "
                "parameters, 0 along motions, such as x**2 + y**2 - l**2."
            )
    _check_functions(formula.name, g)
    G = sympy.Matrix([[each.diff(x) for x in q] for each in g])
    W = (mass.inv() * G.T).T
    second = [each.diff(a, b) for each in g for a in q for b in q]
    _check_functions(formula.name, [*G, *second])
    return [
        f"CONSTRAINTS = {len(g)}",
        kernels.filling("constraints", "parameters, q, out", {"out": [*g, *G, *W]}),
        kernels.filling("constraint_hessians", "parameters, q, out", {"out": second}),
    ]


class _Kernels:
    """The kernels of one Lagrangian, as text."""

    def __init__(self, formula: Formula, q: list[Any], v: list[Any], t: Any) -> None:
        self.formula, self.q, self.v, self.t = formula, q, v, t
        self.names: dict[Any, str] = {x: f"q{k}" for k, x in enumerate(q)}
        self.names |= {x: f"v{k}" for k, x in enumerate(v)}
        self.names |= {x: f"a{k}" for k, x in enumerate(formula.parameters)}
        self.names[t] = "t"

    def value(self, L: Any) -> str:
        """The kernel that returns L."""
        printer = Printer(self.names)
        (result,) = printer.define([L])
        return self._kernel("value", "parameters, t, q, v", printer, [L], [f"return {result} + zero"])

    def filling(self, name: str, arguments: str, outputs: Mapping[str, Sequence[Any]]) -> str:
        """A kernel that writes expressions into its output arrays."""
        printer = Printer(self.names)
        flat = [x for values in outputs.values() for x in values]
        texts = iter(printer.define(flat))
        lines = []
        for out, values in outputs.items():
            for k, value in enumerate(values):
                wide = "" if value.free_symbols & {*self.q, *self.v, self.t} else " + zero"
                lines.append(f"put({out}, {k}, {next(texts)}{wide})")
        return self._kernel(name, arguments, printer, flat, lines)

    def _kernel(self, name: str, arguments: str, printer: Printer, used: Sequence[Any], lines: list[str]) -> str:
        needed = set().union(*(x.free_symbols for x in used))
        body = ["zero = get(q, 0) * 0.0"]
        body += [f"{self.names[x]} = get(q, {k})" for k, x in enumerate(self.q) if x in needed]
        body += [f"{self.names[x]} = get(v, {k})" for k, x in enumerate(self.v) if x in needed]
        body += [f"{self.names[x]} = parameters[{k}]" for k, x in enumerate(self.formula.parameters) if x in needed]
        body += [*printer.lines, *lines]
        return f"@kernel\ndef {name}({arguments}):\n" + "\n".join(f"    {line}" for line in body) + "\n"


def _flat(table: list[list[Any]]) -> list[Any]:
    return [x for row in table for x in row]


def name_of(coordinate: Any) -> str:
    """Return the name of a coordinate: theta also for theta(t)."""
    return str(coordinate.func) if coordinate.is_Function else str(coordinate)


def _shown(part: Any) -> str:
    """Return an expression as its author wrote it: our own symbols have an underscore in SymPy."""
    import sympy

    return str(part.xreplace({x: sympy.Symbol(x.name) for x in part.atoms(sympy.Dummy)}))


def _plain_symbols(formula: Formula) -> tuple[list[Any], list[Any], Any]:
    """Return new symbols for coordinates, velocities and time, so that q may be given as functions of t."""
    import sympy

    q = [sympy.Dummy(name_of(x)) for x in formula.q]
    return q, [sympy.Dummy(str(x)) for x in formula.v], sympy.Dummy("t")


def _in_plain_symbols(formula: Formula, expression: Any, q: list[Any], v: list[Any], t: Any) -> Any:
    """Return L, or a constraint, in these symbols."""
    import sympy

    L = expression.xreplace(dict(zip(formula.v, v, strict=True))).xreplace(dict(zip(formula.q, q, strict=True)))
    if formula.t is not None:
        L = L.xreplace({formula.t: t})
    what = "L" if expression is formula.L else f"the constraint {expression}"
    known = {*q, *v, t, *formula.parameters}
    unknown = sorted(str(x) for x in L.free_symbols - known)
    if unknown:
        raise InputError(
            f"'{formula.name}': {what} mentions {', '.join(unknown)}, which {'is' if len(unknown) == 1 else 'are'} "
            "neither coordinate, velocity, time nor parameter. Name it in q=, v= or t=, or give it a value in "
            f"parameters={{{unknown[0]}: 1.0}}."
        )
    if L.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo, -sympy.oo):
        raise InputError(
            f"'{formula.name}': {what} contains complex or infinite values: {expression}; a Lagrangian is real"
        )
    return L


def _check_functions(name: str, expressions: Sequence[Any]) -> None:
    import sympy

    allowed = {"Symbol", "Dummy", "Add", "Mul", "Pow", GUARD, *FUNCTIONS}
    for expression in expressions:
        for part in sympy.preorder_traversal(expression):
            kind = type(part).__name__
            if part.is_number or kind in allowed:
                continue
            if kind in ("Abs", "sign", "DiracDelta", "Heaviside", "Piecewise", "Min", "Max"):
                raise InputError(
                    f"'{name}': {_shown(part)} in L or its derivatives is not smooth; a Lagrangian must be twice "
                    "differentiable. Replace it by a smooth function."
                )
            raise InputError(
                f"'{name}': {_shown(part)} cannot be compiled ({kind}). L may contain + - * / **, sqrt and "
                f"{', '.join(FUNCTIONS)}; write it out with these, or supply kernels by hand: "
                "Lagrangian.from_kernels."
            )


def _check_regular(formula: Formula, mass: Any) -> None:
    """Refuse a mass matrix that is singular at several random points, and therefore everywhere.

    This is much faster than simplifying the determinant: 57 s for four coupled pendulums.
    """
    import mpmath
    import sympy

    symbols = sorted(mass.free_symbols, key=str)
    entries = sympy.lambdify(symbols, list(mass), "mpmath")
    rng = random.Random(1)
    d = mass.rows
    for _ in range(POINTS):
        # With fifty digits, a determinant of zero stays below 1e-40 of the product of the rows' lengths.
        with many_digits(50), contextlib.suppress(ZeroDivisionError, ValueError, OverflowError):
            rows = mpmath.matrix(d, d)
            for k, x in enumerate(entries(*(mpmath.mpf(rng.uniform(0.2, 0.9)) for _ in symbols))):
                rows[k // d, k % d] = x
            lengths = [mpmath.norm(rows[k, :]) for k in range(d)]
            if all(lengths) and abs(mpmath.det(rows)) > mpmath.mpf("1e-30") * mpmath.fprod(lengths):
                return
    silent = [str(formula.v[k]) for k in range(d) if all(x == 0 for x in mass.row(k))]
    which = f"it has no kinetic energy in {', '.join(silent)}" if silent else "its kinetic energy is degenerate"
    raise InputError(
        f"'{formula.name}' is not regular: det(d2L/dv dv) = 0, {which}, so momenta do not determine velocities. "
        "Expected a Lagrangian whose kinetic energy depends on every velocity; leave such coordinates out, or choose "
        "others."
    )
