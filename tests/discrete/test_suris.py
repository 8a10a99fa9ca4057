"""Suris' map of the pendulum as a discrete Lagrangian: its potential, its formula, its integral, where it ends."""

import numpy as np
import pytest
import sympy

import orbits
from orbits import discrete
from orbits.errors import InputError
from orbits.lagrangians import pendulum

from .mechanics import compare

HEAVY = pendulum.with_parameters(m=1.3, l=0.7, g=2.1)


@pytest.mark.parametrize("L", [pendulum, HEAVY], ids=["unit", "heavy"])
@pytest.mark.parametrize("h", [0.3, 1.1, -0.9])
def test_the_derivatives_of_suris_discrete_lagrangian_are_those_of_its_value(L, h):
    """Of the value by the dilogarithm; away from q = pi, near which the force is steep at long steps."""
    compare(discrete.suris(L), np.array([0.7]), np.array([1.2]), h, 0.0, 1e-13, 0.02)


def test_its_equations_are_suris_formula():
    h, L_d = 1.2, discrete.suris(pendulum)
    q = discrete.march_pairs(L_d, [0.4], [1.1], h, 12)[:, 0]
    formula = -4 * np.angle(1 + h * h / 4 * np.exp(1j * q[1:-1]))
    assert np.abs(q[2:] - 2 * q[1:-1] + q[:-2] - formula).max() < 1.5e-15  # roundings of q: 2.8e-16 was reached


@pytest.mark.parametrize("L", [pendulum, HEAVY], ids=["unit", "heavy"])
def test_the_march_in_closed_form_is_the_map_of_the_discrete_lagrangian(L):
    L_d, h = discrete.suris(L), 0.9
    q, p = L_d.march([0.7, 2.9], [0.3, 0.0], h, 15)
    for k in range(2):
        residual = discrete.momentum_residual(L_d, q[:, k, None], p[:, k, None], h)
        assert np.abs(residual).max() < 3e-15  # 6.7e-16 was reached
        x, y = discrete.step(L_d, q[0, k : k + 1], p[0, k : k + 1], h)
        assert max(abs(x[0] - q[1, k]), abs(y[0] - p[1, k])) < 1e-15


@pytest.mark.parametrize("h", [0.5, 1.2, 1.9])
def test_suris_map_has_an_integral_where_the_standard_map_has_chaos(h):
    L_d = discrete.suris(pendulum)
    q, _ = L_d.march(np.linspace(0.1, 3.1, 12), np.zeros(12), h, 500)
    # 500 roundings of positions up to pi: 6.9e-15 was reached, at h = 1.9.
    assert np.ptp(L_d.integral(q[:-1], q[1:], h), axis=0).max() < 4e-14
    standard = orbits.march(pendulum, orbits.StormerVerlet(), q=[3.0], v=[0.0], dt=h, steps=500).q[:, 0]
    assert np.ptp(L_d.integral(standard[:-1], standard[1:], h)) > 1e-3


def test_it_stands_for_the_pendulum_to_order_two():
    """|L_d - exact| falls as h^3 along a true motion, and its limit is the trapezoidal rule's."""
    errors, exact, L_d = [], discrete.exact(pendulum), discrete.suris(pendulum)
    for h in (0.1, 0.05, 0.025):
        q = orbits.march(pendulum, orbits.Gauss(stages=8), q=[1.0], v=[0.5], dt=h, steps=1).q
        errors.append(abs(L_d.value(q[0], q[1], h) - exact.value(q[0], q[1], h)))
    assert np.allclose(np.log2(np.divide(errors[:-1], errors[1:])), 3.0, atol=0.1)  # 3.04 at the shorter steps
    q0, q1 = np.array([0.7]), np.array([0.8])
    assert abs(L_d.value(q0, q1, 1e-3) - discrete.trapezoidal(pendulum).value(q0, q1, 1e-3)) < 1e-9
    assert abs(L_d.value(q0, q1, 0.3) + L_d.value(q1, q0, -0.3)) < 1e-15  # symmetric


def test_the_steps_at_which_its_potential_ends_are_refused():
    L_d = discrete.suris(pendulum)
    q = np.array([0.5])
    L_d.value(q, q, 1.999)
    for h in (2.0, -2.0, 3.0):
        with pytest.raises(InputError, match=r"is too long.*here \|h\| < 2; .*force jumps at q = pi"):
            L_d.value(q, q, h)
    with pytest.raises(InputError, match=r"here \|h\| < 1\.1547"):
        discrete.suris(HEAVY).march([0.5], [0.0], 1.2, 3)
    with pytest.raises(InputError, match=r"got 'kepler'\. Pass orbits\.lagrangians\.pendulum"):
        discrete.suris(orbits.lagrangians.kepler)
    with pytest.raises(InputError, match="m, l, g > 0"):
        discrete.suris(pendulum.with_parameters(g=-1.0))
    with pytest.raises(InputError, match="one shape"):
        L_d.march([0.5], [0.0, 1.0], 0.3, 3)


def test_another_lagrangian_of_that_name_has_no_such_map():
    x, v, m, length, g = sympy.symbols("x v m l g")
    spring = orbits.Lagrangian.from_sympy(
        m * v**2 / 2 - g * length * x**2 / 2, q=[x], v=[v], parameters={m: 1.0, length: 1.0, g: 1.0}, name="pendulum"
    )
    with pytest.raises(InputError, match=r"'pendulum' is not m l\^2 v\^2/2 \+ m g l cos q, for which alone"):
        discrete.suris(spring)


@pytest.mark.parametrize(
    ("q", "steps", "words"),
    [([0.5], -1, "steps must be a whole number >= 0, got -1"), (["far"], 3, "expected an array of real numbers")],
)
def test_marches_of_suris_map_that_are_none_are_refused(q, steps, words):
    with pytest.raises(InputError, match=words):
        discrete.suris(pendulum).march(q, [0.0], 0.1, steps)
