"""Any Lagrangian in transformed time, dt = g dtau, with a monitor g(q) > 0 in SymPy.

    L~(q, t, q', t') = g(q) (L(q, q' / g(q)) + E0) + (t' - g(q))^2 / 2

E0 is the energy of the motion, a parameter. The first part has the same orbits and the same momenta as L at that
energy. The second makes the time t a coordinate: its momentum p_t = t' - g is conserved, and is 0 at the start; so
t' = g, in every stage of every variational method, and t has no effect on q.

For L = q'.M q' / 2 - V the first part is q'.M q' / (2 g) - g (V - E0).
Source: Hairer, Lubich & Wanner (2006), sec. VIII.2.1; Leimkuhler & Reich (2004), sec. 9.2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number
from orbits.errors import InputError, shown
from orbits.lagrangians.base import Array, Lagrangian, Motion, show
from orbits.lagrangians.symbolic import from_sympy
from orbits.lagrangians.symbolic.generation import Formula
from orbits.lagrangians.symbolic.printing import GUARD
from orbits.lagrangians.symmetry import Symmetry, translation

TIME, ENERGY = "t", "E0"

DIGITS = 50

UNCHANGED = 1e-9
"""The relative change of g along a generator below which a symmetry of L is one of L~ too."""


def time_transformed(
    lagrangian: Lagrangian,
    *,
    monitor: Any,
    energy: float | None = None,
    q: ArrayLike | None = None,
    v: ArrayLike | None = None,
    dt: float = 0.3,
) -> Lagrangian:
    """Return a Lagrangian in transformed time tau, dt = g dtau: symplectic methods may then vary their steps in t.

    lagrangian : of this package or from `Lagrangian.from_sympy`, independent of time
    monitor : g(q) > 0, a SymPy expression of its coordinates and parameters, as symbols of their names
    energy : E0, the energy of the motion; by default that of q, v
    q, v : (d,) where the motion begins, with v = dq/dt; by default the Lagrangian's example
    dt : a suitable step of tau, for the new Lagrangian's own example

    The result has the coordinates of `lagrangian` and t, the time, as the last one. Its own example begins at q, v and
    t = 0 with the velocities dq/dtau = g v and t' = g. Its momenta are those of `lagrangian`, and 0 for t.
    Raises InputError for a Lagrangian without formula or that depends on time, and a monitor that is not a positive,
    finite function of the coordinates.

        x, y = sympy.symbols("x y")
        kepler = orbits.lagrangians.kepler
        eccentric = orbits.lagrangians.time_transformed(kepler, monitor=(x**2 + y**2) ** sympy.Rational(3, 4))
        path = orbits.march(eccentric, orbits.Gauss(stages=8), dt=0.3, steps=1000)
        path.q[:, :2], path.q[:, 2]  # places, times
    """
    if not isinstance(lagrangian, Lagrangian):
        raise InputError(f"expected a Lagrangian such as orbits.lagrangians.kepler, got {shown(lagrangian)}")
    name = lagrangian.name
    if lagrangian.symbolic is None:
        raise InputError(
            f"'{name}' has no formula in SymPy, so the derivatives of its transformed Lagrangian are unknown. Write it "
            "with orbits.Lagrangian.from_sympy; for bodies, use orbits.propagate(..., dt=orbits.TimeTransformed())."
        )
    if lagrangian.constraints:
        raise InputError(
            f"'{name}' has constraints, which are not kept in transformed time. Expected a Lagrangian without any, "
            "such as one in angles."
        )
    if not lagrangian.autonomous:
        raise InputError(
            f"'{name}' depends on time: in transformed time its energy would be a momentum p_t that enters linearly, "
            "which no regular Lagrangian has. Expected one that does not depend on time."
        )
    taken = {TIME, ENERGY} & {*lagrangian.coordinates, *lagrangian.parameters}
    if taken:
        raise InputError(f"'{name}' has a coordinate or parameter named {sorted(taken)[0]}, which the result needs.")
    start, speed = _start(lagrangian, q, v)
    formula = lagrangian.symbolic()
    g = _in_symbols_of(formula, lagrangian, monitor)
    return _made(lagrangian, formula, g, monitor, (start, speed), energy, dt)


def is_transformed(lagrangian: Lagrangian) -> bool:
    """Return whether a Lagrangian is one of transformed time, as `time_transformed` makes it."""
    return lagrangian.coordinates[-1:] == (TIME,) and ENERGY in lagrangian.parameters


def _made(
    lagrangian: Lagrangian,
    formula: Formula,
    g: Any,
    monitor: Any,
    motion: tuple[Array, Array],
    energy: float | None,
    dt: float,
) -> Lagrangian:
    """Return the Lagrangian; g is the monitor in the symbols of the formula."""
    import sympy

    start, speed = motion

    parameters = dict(zip(formula.parameters, lagrangian.parameters.values(), strict=True))
    here = _value(g, {**dict(zip(formula.q, start, strict=True)), **parameters})
    if not 0.0 < here < math.inf:
        raise InputError(
            f"the monitor {monitor} of '{lagrangian.name}' is {here:g} at q = {show(start)}; expected a positive, "
            "finite number: time would stand still or run backwards."
        )
    E = _energy(formula, parameters, start, speed) if energy is None else finite_number(energy, "energy")
    clock, hour, level = sympy.Symbol(TIME), sympy.Dummy("t'"), sympy.Symbol(ENERGY)
    names = lagrangian.coordinates
    plain = dict(zip(formula.q, [sympy.Symbol(x) for x in names], strict=True))
    speeds = {old: sympy.Dummy(f"{name}'") for old, name in zip(formula.v, names, strict=True)}
    called = dict(zip(formula.parameters, [sympy.Symbol(x) for x in lagrangian.parameters], strict=True))
    clock_rate = _guarded(g)
    slow = {old: new / clock_rate for old, new in speeds.items()}
    L = clock_rate * (formula.L.xreplace(slow) + level) + (hour - clock_rate) ** 2 / 2
    g = g.xreplace(plain).xreplace(called)

    def checked(values: Mapping[str, float]) -> None:
        _of_these(lagrangian, values)

    made = from_sympy(
        L.xreplace(plain).xreplace(called),
        q=[*plain.values(), clock],
        v=[*speeds.values(), hour],
        parameters={**{called[key]: value for key, value in parameters.items()}, level: E},
        name=f"{lagrangian.name} in transformed time",
        example=Motion((*start.tolist(), 0.0), (*(here * speed).tolist(), here), dt),
        symmetries=lambda values: _symmetries(_of_these(lagrangian, values), g, names, start),
        source="Hairer, Lubich & Wanner (2006), sec. VIII.2.1",
    )
    return replace(
        made,
        formula=f"g (L(q, q' / g) + E0) + (t' - g)^2 / 2, L = {lagrangian.formula}, g = {g}",
        check_parameters=checked,
        signs=(*lagrangian.signs, 0) if lagrangian.signs else (),
    )


def _of_these(lagrangian: Lagrangian, values: Mapping[str, float]) -> Lagrangian:
    """Return the Lagrangian that was transformed, with these parameters. Raises InputError as that does."""
    return lagrangian.with_parameters(**{name: values[name] for name in lagrangian.parameters})


def _guarded(g: Any) -> Any:
    """Return g, marked for the kernels: NaN where it is not positive, and time would stand still or run backwards."""
    import sympy

    parts = {
        "nargs": 1,
        "fdiff": lambda self, argindex=1: sympy.Integer(1),  # its value makes everything NaN already
        "_imp_": staticmethod(lambda x: x),
    }
    return type(GUARD, (sympy.Function,), parts)(g)


def _start(lagrangian: Lagrangian, q: ArrayLike | None, v: ArrayLike | None) -> tuple[Array, Array]:
    """Return q and v of the start of the motion."""
    if (q is None) != (v is None):
        raise InputError(f"'{lagrangian.name}': a start needs both q and v.")
    if q is None or v is None:
        if lagrangian.example is None:
            raise InputError(f"'{lagrangian.name}' has no example of a motion: give its start, q and v.")
        q, v = lagrangian.example.q, lagrangian.example.v
    return lagrangian.vector(q, "q"), lagrangian.vector(v, "v")


def _in_symbols_of(formula: Formula, lagrangian: Lagrangian, monitor: Any) -> Any:
    """Return the monitor in the symbols of a formula, which are those of its coordinates and parameters by name."""
    import sympy

    try:
        g = None if isinstance(monitor, str) else sympy.sympify(monitor, strict=True)
    except sympy.SympifyError:
        g = None
    if not isinstance(g, sympy.Expr):
        raise InputError(
            f"monitor is {shown(monitor)}; expected a SymPy expression of {', '.join(lagrangian.coordinates)}."
        )
    own = dict(zip(lagrangian.coordinates, formula.q, strict=True))
    own |= dict(zip(lagrangian.parameters, formula.parameters, strict=True))
    known = {*formula.q, *formula.parameters}
    g = g.xreplace({x: own[x.name] for x in g.free_symbols - known if x.name in own})
    strangers = sorted(str(x) for x in g.free_symbols - {s for x in known for s in x.free_symbols})
    if strangers or g.has(*formula.v):
        what = ", ".join(strangers) or "velocities"
        raise InputError(
            f"the monitor depends on {what}; expected a function of the coordinates "
            f"{', '.join(lagrangian.coordinates)} and of parameters of the Lagrangian: else the momenta would change."
        )
    return g


def _value(g: Any, known: Mapping[Any, float]) -> float:
    """Return g for the values of its symbols; NaN if it is not a real number."""
    import sympy

    number = sympy.N(g.xreplace({key: sympy.Float(float(value)) for key, value in known.items()}))
    return float(number) if number.is_real and number.is_finite else math.nan


def _energy(formula: Formula, parameters: Mapping[Any, float], q: Array, v: Array) -> float:
    """Return p . v - L, rounded once: in float64, terms that cancel would leave an orbit of another energy."""
    import sympy

    known = {**dict(zip(formula.q, q, strict=True)), **dict(zip(formula.v, v, strict=True)), **parameters}
    exact = {key: sympy.Float(float(value), DIGITS) for key, value in known.items()}
    # Velocities first: those that are derivatives of functions of t contain the coordinates.
    moving = {x: exact[x] for x in formula.v}
    E = sum(x * formula.L.diff(x) for x in formula.v) - formula.L
    return float(sympy.N(E.xreplace(moving).xreplace(exact), DIGITS))


def _symmetries(lagrangian: Lagrangian, g: Any, names: Sequence[str], start: Array) -> tuple[Symmetry, ...]:
    """Return the symmetries of L that leave g unchanged, as those of L~, and the translation of time."""
    import sympy

    symbols = [sympy.Symbol(x) for x in names]
    values = {sympy.Symbol(name): value for name, value in lagrangian.parameters.items()}
    log_slope = sympy.lambdify(symbols, [sympy.diff(sympy.log(g), x).xreplace(values) for x in symbols], "math")
    rng, found = np.random.default_rng(1), []
    places = [start * (1.0 + 0.1 * rng.normal(size=len(start))) for _ in range(4)]
    for symmetry in lagrangian.symmetries:
        if symmetry.timed or symmetry.gauge is not None:
            continue
        terms = [np.asarray(log_slope(*x), dtype=np.float64) * symmetry.xi(x) for x in places]
        if all(abs(np.sum(x)) <= UNCHANGED * np.sum(np.abs(x)) + 1e-300 for x in terms):
            found.append(_with_time(symmetry))
    along = np.zeros(len(start) + 1)
    along[-1] = 1.0
    return (*found, translation(along, name="translation of time"))


def _with_time(symmetry: Symmetry) -> Symmetry:
    """Return a symmetry that leaves the last coordinate, the time, unchanged."""
    return Symmetry(
        symmetry.name,
        lambda s, q: np.append(symmetry.flow(s, q[:-1]), q[-1]),
        lambda q: np.append(symmetry.generator(q[:-1]), 0.0),
    )
