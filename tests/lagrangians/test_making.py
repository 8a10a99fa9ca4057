"""Lagrangians of users: from SymPy, from handwritten kernels, and the errors for invalid ones."""

import copy
import os
import pickle
import subprocess
import sys

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import orbits
from orbits.errors import InputError, IntegrationError, SingularityError
from orbits.kernels.binding import kernel_of
from orbits.kernels.lanes import get, put
from orbits.kernels.lanes.functions import cos, sin
from orbits.lagrangians.base import SEPARABLE
from orbits.lagrangians.symbolic.printing import FUNCTIONS, Printer
from orbits.marching.flow import Flow
from orbits.methods import LobattoIIIAB, RungeKutta4, SymplecticEuler

from ..coverings import each, first

q, v, w, k, t = sympy.symbols("q v w k t")
x, y, vx, vy = sympy.symbols("x y vx vy")
positive = sympy.Symbol("k", positive=True)
whole = sympy.Symbol("n", integer=True)
fast = sympy.Symbol("u", positive=True)


def made(L, **changes):
    arguments = {"q": [q], "v": [v], "parameters": {}, "name": "test", **changes}
    return orbits.Lagrangian.from_sympy(L, **arguments)


def in_positive():
    """L with |k|, from which SymPy has left out that k may be negative."""
    return made(v**2 / 2 - sympy.sqrt(positive**2), q=[positive])


def printed(expression, symbols):
    """The value of an expression by the printed statements, in plain Python floats."""
    printer = Printer({symbol: str(symbol) for symbol in symbols})
    (result,) = printer.define([expression])
    names = {name: getattr(mpmath, name) for name in FUNCTIONS}
    names |= {"sqrt": mpmath.sqrt, "power": mpmath.power, "rsqrt_cubed": lambda a: a ** mpmath.mpf("-1.5")}

    def value(**values):
        scope = {**names, **{key: mpmath.mpf(number) for key, number in values.items()}}
        for line in printer.lines:
            exec(line, scope)
        return eval(result, scope)

    return value


@each("exponent", [sympy.Rational(n, 2) for n in range(-9, 10) if n] + [sympy.Rational(1, 3), -4, 7])
def test_powers_are_printed_right_alone_and_in_a_quotient(exponent):
    base = x**2 + y**2
    for expression in (base**exponent, 3 * x / (y * base**exponent), x * base ** (exponent - 1) - base**exponent / x):
        value = printed(expression, [x, y])(x="1.3", y="0.7")
        exact = sympy.lambdify([x, y], expression, "mpmath")(mpmath.mpf("1.3"), mpmath.mpf("0.7"))
        assert abs(value - exact) < 1e-13 * abs(exact)  # rational constants are rounded to float64


TERMS = [
    x,
    y,
    x * y,
    x**2 / 3,
    sympy.sin(x),
    sympy.exp(-y),
    1 / (1 + x**2),
    sympy.sqrt(2 + y**2),
    (1 + y**2) ** -1.5,
    -x,
]


@given(st.lists(st.tuples(st.sampled_from(TERMS), st.sampled_from("+-*/")), min_size=1, max_size=6))
def test_whatever_is_combined_is_printed_right(parts):
    expression = sympy.Integer(1)
    for term, operation in parts:
        expression = {
            "+": expression + term,
            "-": expression - term,
            "*": expression * term,
            "/": expression / (3 + term**2),
        }[operation]
    value = printed(expression, [x, y])(x="0.8", y="-0.6")
    exact = sympy.lambdify([x, y], expression, "mpmath")(mpmath.mpf("0.8"), mpmath.mpf("-0.6"))
    assert abs(value - exact) < 1e-12 * max(1, abs(exact))


def test_coordinates_may_be_functions_of_time_and_velocities_their_derivatives():
    angle = sympy.Function("angle")(t)
    rate = angle.diff(t)
    L = made(rate**2 / 2 + sympy.cos(angle), q=[angle], v=[rate], t=t, name="swing")
    plain = orbits.lagrangians.pendulum
    assert L.value([0.7], [0.3]) == plain.value([0.7], [0.3])
    assert orbits.StormerVerlet().serves(L)


def test_names_that_are_no_identifiers_work():
    odd = sympy.Symbol("2 lambda!")
    L = made(odd * v**2 / 2 - q**4, parameters={odd: 2.0})
    assert L.momentum([0.1], [0.5])[0] == 1.0
    assert L.with_parameters(**{"2 lambda!": 3.0}).momentum([0.1], [0.5])[0] == 1.5


def test_what_depends_on_time_or_couples_to_velocities_is_not_separable():
    assert SEPARABLE in made(v**2 / 2 - q**2).traits
    assert SEPARABLE not in made(v**2 / 2 - q**2 + sympy.cos(t), t=t).traits
    assert SEPARABLE not in made(v**2 / 2 - q**2 + q * v, name="gauged").traits
    assert SEPARABLE not in made(-sympy.sqrt(1 - v**2) - q**2, name="relativistic").traits


def test_two_lagrangians_of_one_name_do_not_share_kernels():
    one, two = made(v**2 / 2 - q**2, name="same"), made(v**2 / 2 - q**4, name="same")
    assert one.gradients([2.0], [0.0])[0][0] == -4.0
    assert two.gradients([2.0], [0.0])[0][0] == -32.0


REFUSED = {
    "not regular": (v + q**2, {}, r"not regular.*no kinetic energy"),
    "a silent velocity": (vx**2 / 2 - x * y, {"q": [x, y], "v": [vx, vy]}, "no kinetic energy in vy"),
    "degenerate": ((vx + vy) ** 2 / 2, {"q": [x, y], "v": [vx, vy]}, "kinetic energy is degenerate"),
    "unknown symbol": (v**2 / 2 - k * q**2, {}, r"mentions k, which is neither.*parameters=\{k: 1.0\}"),
    "gamma": (v**2 / 2 - sympy.gamma(q), {}, "gamma.* cannot be compiled"),
    "undefined function": (v**2 / 2 - sympy.Function("f")(q), {}, "cannot be compiled"),
    "an integral": (v**2 / 2 - sympy.Integral(sympy.exp(q**2), q), {}, "cannot be compiled"),
    "not smooth": (v**2 / 2 - sympy.Max(q, 0) ** 3, {}, "not smooth"),
    "absolute value": (v**2 / 2 - sympy.Abs(q) ** 3, {}, r"Abs\(q\) in L .*not smooth"),
    "a derivative": (v**2 / 2 - sympy.Function("f")(q).diff(q), {}, r"Derivative\(f\(q\), q\) cannot be compiled"),
    "piecewise": (v**2 / 2 - sympy.Piecewise((q**2, q > 0), (0, True)), {}, "not smooth"),
    "infinite": (v**2 / 2 - sympy.oo * q, {}, "infinite values"),
    "beyond float64": (v**2 / 2 - sympy.Integer(10) ** 400 * q, {}, "beyond float64"),
    "a complex number": (v**2 / 2 - sympy.asin(2) * q, {}, "complex"),
    "complex": (v**2 / 2 - sympy.I * q, {}, "complex"),
    "text": ("v**2/2", {}, "is the text.*SymPy expression"),
    "not an expression": (3.5j, {}, "complex|SymPy expression|not regular"),
    "counts": (v**2 / 2, {"v": [v, w]}, "as many coordinates as velocities"),
    "no list": (v**2 / 2, {"q": q}, "must be lists"),
    "given twice": (v**2 / 2, {"v": [q]}, "q is given twice"),
    "one name twice": (
        (vx**2 + vy**2) / 2,
        {"q": [x, sympy.Symbol("x", real=True)], "v": [vx, vy]},
        "coordinates must be different names",
    ),
    "no coordinates": (v**2 / 2, {"q": None}, "must be lists"),
    "listed parameters": (v**2 / 2 - k * q, {"parameters": [k]}, "mapping from symbols to values"),
    "example": (v**2 / 2, {"example": orbits.Motion(q=(1.0, 2.0), v=(1.0, 2.0), dt=0.1)}, "the example's q of shape"),
    "symmetry": (v**2 / 2, {"symmetries": ["rotation"]}, "must be `orbits.Symmetry` objects"),
    "text parameter": (v**2 / 2 - k * q, {"parameters": {k: "1"}}, "parameter k must be a real number"),
    "whole coordinate": (
        v**2 / 2 - sympy.cos(2 * sympy.pi * whole),
        {"q": [whole]},
        "n was declared to SymPy as a whole number",
    ),
    "positive velocity": (fast**2 / 2 - q**2, {"v": [fast]}, "u was declared to SymPy with a sign"),
    "complex parameter": (v**2 / 2 - k * q, {"parameters": {k: 1j}}, "parameter k must be a real number"),
    "infinite parameter": (v**2 / 2 - k * q, {"parameters": {k: float("inf")}}, "parameter k must be finite"),
    "text as symbol": (v**2 / 2, {"q": ["q"]}, "must be SymPy symbols"),
    "no name": (v**2 / 2, {"name": ""}, "name must be a word"),
}


@each("case", REFUSED)
def test_what_cannot_be_a_lagrangian_is_refused_with_the_reason(case):
    L, changes, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        made(L, **changes)


PENDULUM, KEPLER = orbits.lagrangians.pendulum, orbits.lagrangians.kepler
WRONG_USES = {
    "shape": (lambda: PENDULUM.value([1.0, 2.0], [0.0]), r"has 1 coordinate \(q\); got q of shape \(2,\)"),
    "nan": (lambda: PENDULUM.value([float("nan")], [0.0]), "q must be finite"),
    "text as time": (lambda: PENDULUM.value([1.0], [0.0], t="x"), "t must be a real number, got 'x'"),
    "no time": (lambda: PENDULUM.velocity([1.0], [0.0], t=None), "t must be a real number, got None"),
    "coordinate of another sign": (
        lambda: in_positive().value([-1.0], [0.0]),
        "k was declared to SymPy >= 0, and L is simplified accordingly; it is -1",
    ),
    "start of another sign": (
        lambda: orbits.march(in_positive(), orbits.Gauss(), q=[-1.0], v=[0.0], dt=0.1, steps=5),
        "k was declared to SymPy >= 0.*it is -1",
    ),
    "motion to another sign": (
        lambda: orbits.march(in_positive(), orbits.StormerVerlet(), q=[1.0], v=[0.0], dt=0.1, steps=20),
        "k was declared to SymPy >= 0.*it is -",
    ),
    "complex state": (lambda: PENDULUM.value([1j], [0.0]), "must be 1 real numbers"),
    "text": (lambda: PENDULUM.value("a", [0.0]), "must be 1 real numbers"),
    "ragged": (lambda: KEPLER.value([[1.0], [1.0, 2.0]], [0.0, 0.0]), "must be 2 real numbers"),
    "parameter": (lambda: PENDULUM.with_parameters(length=2.0), "no parameter length; it has: m, l, g"),
    "parameter of another sign": (
        lambda: made(v**2 / 2 - positive * q**2, parameters={positive: 2.0}).with_parameters(k=-2.0),
        "parameter k was declared to SymPy with positive=True.*got -2.0",
    ),
    "parameter value": (lambda: PENDULUM.with_parameters(g="x"), "parameter g must be a real number"),
    "dt": (lambda: orbits.march(PENDULUM, orbits.Gauss(), dt=0.0, steps=3), "dt must be finite and not zero"),
    "dt nan": (lambda: orbits.march(PENDULUM, orbits.Gauss(), dt=float("nan"), steps=3), "dt must be finite"),
    "steps": (lambda: orbits.march(PENDULUM, orbits.Gauss(), dt=0.1, steps=0), "steps must be a whole number >= 1"),
    "many steps": (lambda: orbits.march(PENDULUM, orbits.Gauss(), dt=0.1, steps=10**400), "steps = 1000.* at most 9e"),
    "every": (lambda: orbits.march(PENDULUM, orbits.Gauss(), dt=0.1, steps=5, every=2), "multiple of every"),
    "method": (lambda: orbits.march(PENDULUM, 8, dt=0.1, steps=5), "must be a method"),
    "lagrangian": (lambda: orbits.march("pendulum", orbits.Gauss(), dt=0.1, steps=5), "expected a Lagrangian"),
    "start": (lambda: orbits.march(PENDULUM, orbits.Gauss(), dt=0.1, steps=5, q=[1.0]), "needs q and either v or p"),
    "canonical": (lambda: Flow(PENDULUM, orbits.StormerVerlet(), 0.1, canonical=True), "has no canonical form"),
    "kernel names": (
        lambda: orbits.Lagrangian.from_kernels({"force": restoring}, coordinates=["q"], name="x"),
        "no kernel is called force",
    ),
    "not compiled": (
        lambda: orbits.Lagrangian.from_kernels({"accelerate": len}, coordinates=["q"], name="x"),
        "not compiled; put @orbits.kernel",
    ),
    "kernel arguments": (
        lambda: orbits.Lagrangian.from_kernels({"value": restoring}, coordinates=["q"], name="x"),
        r"value takes \(parameters, q, out\); expected value\(parameters, t, q, v\)",
    ),
    "incomplete": (
        lambda: orbits.Lagrangian.from_kernels({"value": lagrangian_of_none}, coordinates=["q"], name="x"),
        "value need gradients, hessians",
    ),
    "accelerations only": (
        lambda: orbits.Lagrangian.from_kernels({"accelerate": restoring}, coordinates=["q"], name="x").energy([1], [0]),
        "has accelerations only.*value, gradients and hessians",
    ),
    "parameters by hand": (
        lambda: orbits.Lagrangian.from_kernels(
            {"accelerate": restoring}, coordinates=["q"], name="x", parameters={"k": np.complex128(1j)}
        ),
        "parameter k must be a real number",
    ),
    "kernels in a list": (
        lambda: orbits.Lagrangian.from_kernels([1], coordinates=["q"], name="x"),
        "kernels must be functions by name",
    ),
    "coordinates": (
        lambda: orbits.Lagrangian.from_kernels({"accelerate": restoring}, coordinates="q", name="x"),
        "coordinates must be a list of names",
    ),
    "no kernels": (lambda: orbits.Lagrangian.from_kernels({}, coordinates=["q"], name="x"), "no kernels were given"),
    "copies": (lambda: orbits.lagrangians.rotation(copies=1.5), "copies must be a whole number >= 1, got 1.5"),
    "no copies": (lambda: orbits.lagrangians.translation([1.0], copies=0), "copies must be a whole number >= 1, got 0"),
    "masses": (lambda: orbits.lagrangians.boost([1.0], masses="a"), "masses is 'a'; expected an array of real numbers"),
    "stages": (lambda: LobattoIIIAB(stages=1), "stages between 2 and 8"),
    "variant": (lambda: SymplecticEuler(variant="both"), "kick-drift and drift-kick"),
}


@orbits.kernel
def restoring(parameters, q, out):
    put(out, 0, -parameters[0] * get(q, 0) * get(q, 0) * get(q, 0))


@orbits.kernel
def lagrangian_of_none(parameters, t, q, v):
    return 0.0


@each("case", WRONG_USES)
def test_a_wrong_use_is_an_input_error_that_says_what_is_right(case):
    use, message = WRONG_USES[case]
    with pytest.raises(InputError, match=message):
        use()


@pytest.mark.nightly
def test_kernels_by_hand_march_like_the_same_formula_in_sympy():
    by_hand = orbits.Lagrangian.from_kernels(
        {"accelerate": restoring}, coordinates=["q"], name="quartic", parameters={"k": 2.0}
    )
    symbolic = made(v**2 / 2 - 2 * q**4 / 4, name="quartic")
    for method in (orbits.StormerVerlet(), orbits.Gauss(stages=4)):  # kernels on vectors, and on rows
        a = orbits.march(by_hand, method, q=[1.0], v=[0.2], dt=0.1, steps=50)
        b = orbits.march(symbolic, method, q=[1.0], v=[0.2], dt=0.1, steps=50)
        assert np.abs(a.q - b.q).max() < 1e-14  # 50 steps of roundings; 1.2e-15 was reached


TYPED = """
@kernel
def accelerate(parameters, q, out):
    put(out, 0, -strength * {}(get(q, 0)))
"""


def typed(function, strength):
    scope = {"kernel": orbits.kernel, "get": get, "put": put, "sin": sin, "cos": cos, "__name__": "__main__"}
    scope["strength"] = strength
    exec(compile(TYPED.format(function), "<stdin>", "exec"), scope)
    return orbits.Lagrangian.from_kernels({"accelerate": scope["accelerate"]}, coordinates=["q"], name="alike")


def test_kernels_typed_into_a_session_that_look_alike_are_not_confused():
    """Their names, bytecode and constants are the same; the functions and values that they use are not."""
    assert typed("sin", 1.0).tag.name == typed("sin", 1.0).tag.name
    one, other, stronger = typed("sin", 1.0), typed("cos", 1.0), typed("sin", 3.0)
    ends = [orbits.march(L, orbits.StormerVerlet(), q=[1.0], v=[0.0], dt=0.1, steps=1).q[-1, 0] for L in (one, other)]
    assert ends == pytest.approx([1 - 0.005 * np.sin(1.0), 1 - 0.005 * np.cos(1.0)], abs=1e-15)
    assert stronger.tag.name not in (one.tag.name, other.tag.name)
    kernel_of(one.tag.type, "accelerate").py_func.__globals__["strength"] = 2.0  # compiled code keeps 1.0
    with pytest.raises(InputError, match=r"kernel accelerate reads a variable .* has changed since it was first used"):
        orbits.march(one, orbits.StormerVerlet(), q=[1.0], v=[0.0], dt=0.1, steps=1)


@pytest.mark.parametrize(
    "method",
    first(2, [orbits.Gauss(stages=8), LobattoIIIAB(stages=3), orbits.StormerVerlet(), RungeKutta4()]),
    ids=lambda m: m.label,
)
@pytest.mark.parametrize("canonical", first(2, [False, True]))
def test_a_singular_configuration_on_the_way_is_an_error_with_step_and_state(method, canonical):
    """A fall into the centre with a step of 0.3: no method returns NaN."""
    if canonical and method.canonical is None:
        pytest.skip("it has no canonical form")
    flow = Flow(KEPLER, method, 0.3, canonical=canonical)
    failure = None
    try:
        path = flow.march([1.0, 0.0], [0.0, 0.0], 400)
    except IntegrationError as error:
        failure, path = error, error.trajectory
    assert np.isfinite(path.q).all()
    assert np.isfinite(path.p).all()
    if method.name == "gauss":
        assert failure is not None
    if failure is not None:
        assert "'kepler', step" in str(failure)
        assert "Use a smaller dt" in str(failure)
        assert len(path) == failure.step + 1


def test_a_start_at_a_singularity_is_an_error():
    with pytest.raises(SingularityError, match=r"'kepler' is singular at q = \[0"):
        KEPLER.value([0.0, 0.0], [1.0, 0.0])
    with pytest.raises(InputError, match=r"not regular at q = \[0"):
        orbits.march(orbits.lagrangians.spherical_pendulum, orbits.Gauss(), dt=0.1, steps=1, q=[0.0, 0.0], v=[0.1, 1.0])


def test_time_dependence_a_march_in_two_parts_is_the_march_in_one():
    L, method = orbits.lagrangians.driven_pendulum, orbits.Gauss(stages=4)
    whole = orbits.march(L, method, dt=0.1, steps=100)
    half = orbits.march(L, method, dt=0.1, steps=50)
    rest = orbits.march(L, method, dt=0.1, steps=50, q=half.q[-1], p=half.p[-1], t=half.t[-1])
    assert np.abs(rest.q[-1] - whole.q[-1]).max() < 1e-13  # the cut drops low parts; 6e-15 was reached
    fine = orbits.march(L, orbits.Gauss(stages=8), dt=0.05, steps=40)
    errors = []
    for steps in (5, 10):
        end = orbits.march(L, orbits.Gauss(stages=2), dt=2.0 / steps, steps=steps)
        errors.append(abs(end.q[-1, 0] - fine.q[-1, 0]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.4)


PROGRAM = """
import sys
import orbits
path = orbits.march(orbits.lagrangians.pendulum, orbits.StormerVerlet(), dt=0.1, steps=3)
from orbits.marching.stepping.driver import march
stats = march.entry.stats
print(path.q[-1, 0].hex(), sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), "sympy" in sys.modules)
"""


@pytest.mark.nightly
def test_kernels_are_found_again_by_another_process_which_needs_no_sympy(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def run():
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    cold, warm = run(), run()
    assert cold[0] == warm[0]
    assert cold[3] == "True"
    assert warm[3] == "False"
    assert int(warm[2]) == 0


@pytest.mark.nightly
def test_lagrangians_that_are_not_regular_or_not_defined_at_rest_or_beyond_march():
    relativistic = made(-sympy.sqrt(1 - v**2) - q**2 / 2, name="relativistic")
    path = orbits.march(relativistic, orbits.Gauss(stages=4), q=[0.0], v=[0.9], dt=0.05, steps=200)
    assert np.abs(path.energy() - path.energy()[0]).max() < 1e-9
    quartic = made(v**4 / 4 - q**2 / 2, name="quartic in v")
    path = orbits.march(quartic, orbits.Gauss(stages=2), q=[0.0], v=[1.0], dt=0.01, steps=20)
    assert np.abs(path.v[-1] - path.v[0]).max() < 0.05


def test_how_symbols_are_told_apart_is_part_of_what_makes_a_lagrangian():
    a, b, c, d = sympy.symbols("a b c d")
    L = b**2 / 2 + c**2 / 2 + d**2 / 2 - a**2 / 2 + a * c
    one = made(L, q=[a], v=[b], parameters={c: 1.0, d: 1.0})
    two = made(L, q=[a, b], v=[c, d])
    assert one.gradients([1.0], [3.0])[1].tolist() == [3.0]
    f, p = two.gradients([1.0, 2.0], [3.0, 4.0])
    assert f.tolist() == [2.0, 2.0]
    assert p.tolist() == [4.0, 4.0]


def test_a_name_is_never_executed(tmp_path):
    target = tmp_path / "injected"
    made(v**2 / 2 - q**6, name=f'n"""\nopen({str(target)!r}, "w").write("x")\n"""').value([1.0], [0.0])
    assert not target.exists()


def test_kernels_that_keep_a_variable_of_their_maker_are_refused():
    def maker(strength):
        @orbits.kernel
        def accelerate(parameters, q, out):
            put(out, 0, -strength * get(q, 0))

        return accelerate

    with pytest.raises(InputError, match="make it one of the parameters"):
        orbits.Lagrangian.from_kernels({"accelerate": maker(1.0)}, coordinates=["q"], name="kept")


def test_a_lagrangian_of_the_package_is_pickled_by_name_and_others_say_why_not():
    assert pickle.loads(pickle.dumps(KEPLER)) is KEPLER
    heavy = pickle.loads(pickle.dumps(PENDULUM.with_parameters(m=2.0)))
    assert heavy.parameters == {**PENDULUM.parameters, "m": 2.0}
    for own in (
        made(v**2 / 2 - q**2, name="kepler"),
        orbits.Lagrangian.from_kernels({"accelerate": restoring}, coordinates=["q"], name="x"),
    ):
        with pytest.raises(InputError, match="cannot be pickled: its kernels are code"):
            pickle.dumps(own)
        assert copy.deepcopy(own) is own


def test_parameters_cannot_be_changed_as_kernels_know_them():
    # They showed other values while the motion kept the old ones.
    L = PENDULUM.with_parameters(m=2.0)
    for change in (lambda x: x.update(m=3.0), lambda x: x.__setitem__("m", 3.0), lambda x: x.pop("m")):
        with pytest.raises(InputError, match="with_parameters"):
            change(L.parameters)
    assert pickle.loads(pickle.dumps(L)).parameters == L.parameters == {**PENDULUM.parameters, "m": 2.0}
