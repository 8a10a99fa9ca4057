"""Lagrangians from SymPy: those of users, and those of this package."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from orbits.errors import InputError, shown
from orbits.kernels.binding import Tag
from orbits.lagrangians.base import (
    CONSTRAINED,
    SEPARABLE,
    Compiled,
    Lagrangian,
    Motion,
    Rotor,
    Symmetries,
    require_name,
)
from orbits.lagrangians.symbolic.generation import Formula, module_text, name_of
from orbits.lagrangians.symbolic.modules import digest, module

DECLARED = ("real", "integer", "positive", "negative", "nonnegative", "nonpositive", "zero", "nonzero", "even", "odd")
"""What symbols of parameters may be declared to be, in the words of SymPy, and numbers are or are not."""


def from_sympy(
    L: Any,
    *,
    q: Sequence[Any],
    v: Sequence[Any],
    t: Any = None,
    parameters: Mapping[Any, float] | None = None,
    name: str = "lagrangian",
    example: Motion | None = None,
    symmetries: Symmetries = (),
    source: str = "",
    constraints: Sequence[Any] = (),
) -> Lagrangian:
    """Return a Lagrangian from an expression in SymPy; its kernels are stored on disk for other processes.

    L : SymPy expression of q, v, t and the parameters, twice differentiable
    q, v : d coordinates and their velocities: symbols, or functions of t and their derivatives
    t : the time, if L depends on it; parameters : values by symbol
    symmetries : a list of them, or a function of the parameters' values by name that returns one
    constraints : expressions of q and the parameters that are 0 along motions, or equations: x**2 + y**2 - l**2; L is
        then separable, in coordinates that need no others, and marched by `orbits.methods.Rattle()` and compositions

    Raises InputError, with the reason, for invalid Lagrangians: symbols without a value, functions that cannot be
    compiled, complex or non-smooth expressions, a mass matrix d2L/dv dv without inverse, constraints that depend on
    velocities or time.

        q, v, g = sympy.symbols("q v g")
        pendulum = orbits.Lagrangian.from_sympy(v**2 / 2 + g * sympy.cos(q), q=[q], v=[v], parameters={g: 9.81})
    """
    formula = _checked(L, q, v, t, {} if parameters is None else parameters, name)
    formula = replace(formula, constraints=_checked_constraints(constraints, name, len(formula.q)))
    parts = ([formula.L], formula.q, formula.v, formula.parameters, [] if t is None else [t], formula.constraints)
    compiled = _compiled(name, digest(name, _told(parts)), lambda: module_text(formula))
    names = [name_of(x) for x in formula.q]
    return Lagrangian(
        name=name,
        formula=str(L),
        coordinates=tuple(names),
        parameters={str(key): value for key, value in (parameters or {}).items()},
        compile=lambda: compiled,
        example=example,
        groups=symmetries,
        source=source,
        symbolic=lambda: formula,
        constraints=tuple(str(g) for g in formula.constraints),
        check_parameters=lambda values: _check_values(name, formula.parameters, values),
        signs=tuple(bool(x.is_nonnegative) - bool(x.is_nonpositive) for x in formula.q),
    )


def _told(parts: Sequence[Iterable[Any]]) -> str:
    """Return what tells formulas apart, the same in all processes: SymPy counts the symbols of `sympy.Dummy` anew in
    each, and with each use.
    """
    import sympy

    made = {x for part in parts for one in part for x in one.atoms(sympy.Dummy)}
    in_order = enumerate(sorted(made, key=lambda x: x.dummy_index))
    plain = {x: sympy.Symbol(f"\0{k} {x.name}", **x.assumptions0) for k, x in in_order}
    return repr([[sympy.srepr(one.xreplace(plain)) for one in part] for part in parts])


def shipped(
    *,
    name: str,
    formula: str,
    coordinates: Sequence[str],
    parameters: Mapping[str, float],
    expression: Callable[[Sequence[Any], Sequence[Any], Any, Any], Any],
    example: Motion,
    symmetries: Symmetries = (),
    rotors: tuple[Rotor, ...] = (),
    source_: str,
    constraints: Sequence[str] = (),
    constraint_expressions: Callable[[Sequence[Any], Any], Sequence[Any]] | None = None,
) -> Lagrangian:
    """Return a Lagrangian of this package; SymPy is loaded only if its kernels have never been made on this machine.

    expression : function (q, v, t, p) that returns L in SymPy; p has the parameters as attributes
    constraints : the functions that are 0 along motions, for users; constraint_expressions : function (q, p) that
        returns them in SymPy
    """

    def compile_() -> Compiled:
        text = Path(inspect.getfile(expression)).read_text(encoding="utf-8")
        return _compiled(name, digest(name, text), lambda: module_text(in_sympy()))

    def in_sympy() -> Formula:
        import types

        import sympy

        q = sympy.symbols([f"q_{k}" for k in range(len(coordinates))])
        v = sympy.symbols([f"v_{k}" for k in range(len(coordinates))])
        t = sympy.Symbol("t")
        p = {key: sympy.Symbol(f"p_{key}") for key in parameters}
        named = types.SimpleNamespace(**p)
        L = sympy.sympify(expression(q, v, t, named))
        g = () if constraint_expressions is None else tuple(constraint_expressions(q, named))
        return Formula(name, L, tuple(q), tuple(v), t, tuple(p.values()), g)

    return Lagrangian(
        name=name,
        formula=formula,
        coordinates=tuple(coordinates),
        parameters=dict(parameters),
        compile=compile_,
        example=example,
        groups=symmetries,
        source=source_,
        symbolic=in_sympy,
        rotors=rotors,
        constraints=tuple(constraints),
    )


def _compiled(name: str, key: str, write: Callable[[], str]) -> Compiled:
    made = module(key, write)
    kernels = {"dimension": made.DIMENSION}
    kernels |= {what: getattr(made, what) for what in ("value", "gradients", "hessians")}
    if SEPARABLE in made.TRAITS:
        kernels["accelerate"] = kernels["accelerate_stages"] = made.accelerate
    if CONSTRAINED in made.TRAITS:
        kernels["constraint_count"] = made.CONSTRAINTS
        kernels |= {what: getattr(made, what) for what in ("constraints", "constraint_hessians")}
    return Compiled(Tag(f"{name}-{key}", kernels), frozenset(made.TRAITS))


def _checked(L: Any, q: Any, v: Any, t: Any, parameters: Mapping[Any, float], name: str) -> Formula:
    import sympy

    require_name(name)
    if isinstance(L, str):
        raise InputError(
            f"'{name}': L is the text {L!r}; expected a SymPy expression, because reading a text as a formula would "
            "execute it. Write it with sympy.symbols."
        )
    try:
        expression = sympy.sympify(L, strict=True)
    except sympy.SympifyError:
        expression = None
    if not isinstance(expression, sympy.Expr):
        raise InputError(f"'{name}': L must be a SymPy expression, got {type(L).__name__}")
    if not isinstance(parameters, Mapping):
        raise InputError(f"'{name}': parameters must be a mapping from symbols to values, got {shown(parameters)}")
    if not all(isinstance(x, list | tuple) for x in (q, v)) or len(q) != len(v) or not len(q):
        raise InputError(
            f"'{name}': q and v must be lists of as many coordinates as velocities, such as q=[x, y], v=[vx, vy]; got "
            f"{q!r} and {v!r}"
        )
    for x in (*q, *v, *([] if t is None else [t]), *parameters):
        if not isinstance(x, sympy.Symbol | sympy.Derivative | sympy.core.function.AppliedUndef):
            raise InputError(f"'{name}': q, v, t and the keys of parameters must be SymPy symbols; got {shown(x)}")
    for x in (*q, *v, *([] if t is None else [t])):
        if x.is_integer or x.is_imaginary:
            kind = "a whole" if x.is_integer else "an imaginary"
            raise InputError(
                f"'{name}': {x} was declared to SymPy as {kind} number, by which L is simplified; coordinates, "
                "velocities and time are real. Declare it with real=True."
            )
    for x in (*v, *([] if t is None else [t])):
        if x.is_nonnegative or x.is_nonpositive:
            raise InputError(
                f"'{name}': {x} was declared to SymPy with a sign, by which L is simplified; velocities and time have "
                "both. Declare it with real=True."
            )
    everything = [*q, *v, *([] if t is None else [t]), *parameters]
    if len(set(everything)) < len(everything):
        twice = sorted({str(x) for x in everything if everything.count(x) > 1})
        raise InputError(f"'{name}': {', '.join(twice)} is given twice among q, v, t and parameters")
    names = [str(x) for x in parameters]
    if len(set(names)) < len(names):
        raise InputError(f"'{name}': two parameters have the same name: {', '.join(sorted(names))}")
    return Formula(name, expression, tuple(q), tuple(v), t, tuple(parameters))


def _check_values(name: str, symbols: Iterable[Any], values: Mapping[str, float]) -> None:
    """Raise InputError for a value that its symbol was declared not to have: SymPy has simplified L accordingly."""
    import sympy

    for symbol in symbols:
        declared = [(fact, symbol.assumptions0[fact]) for fact in DECLARED if fact in symbol.assumptions0]
        if not declared:
            continue
        value = values[str(symbol)]
        number = sympy.Integer(value) if value.is_integer() else sympy.Rational(value)
        for fact, assumed in sorted(declared, key=lambda each: not each[1]):  # what is, before what is not
            if getattr(number, f"is_{fact}") is not assumed:
                raise InputError(
                    f"'{name}': parameter {symbol} was declared to SymPy with {fact}={assumed}, and L is simplified "
                    f"accordingly; got {value!r}. Declare the symbol without it, or give another value."
                )


def _checked_constraints(constraints: Any, name: str, d: int) -> tuple[Any, ...]:
    """Return the functions that are 0 along motions; what they depend on is checked when kernels are made."""
    import sympy

    if isinstance(constraints, str) or not isinstance(constraints, Sequence):
        raise InputError(
            f"'{name}': constraints must be a list of SymPy expressions that are 0 along motions, such as "
            f"[x**2 + y**2 - l**2]; got {shown(constraints)}"
        )
    found = []
    for each in constraints:
        g = each.lhs - each.rhs if isinstance(each, sympy.Equality) else each
        if not isinstance(g, sympy.Expr):
            raise InputError(
                f"'{name}': the constraint {shown(each)} is no SymPy expression; expected one that is 0 along motions, "
                "such as x**2 + y**2 - l**2"
            )
        found.append(g)
    if len(found) >= d:
        raise InputError(
            f"'{name}': {len(found)} constraints on {d} coordinate{'s' * (d > 1)} leave nothing free to move; expected "
            "fewer constraints than coordinates"
        )
    return tuple(found)
