"""Contract tests of every Lagrangian of the package."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

import orbits
from orbits.integrators.forms import padded
from orbits.kernels import binding
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import load, put
from orbits.lagrangians import registry
from orbits.lagrangians.base import SEPARABLE, TIME_DEPENDENT

from ..coverings import each, only

NAMES = sorted(registry())
SOME = ("charged-particle", "double-pendulum-on-rods", "driven-pendulum", "kepler", "newtonian")
"""Those tested by default: a magnetic and a constrained one, one that depends on time, a plain one, and the one whose
kernels are written by hand; of all others SymPy writes them, in the same way.
"""
T = 0.3
WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}


def file_of(name):
    return sys.modules[f"orbits.lagrangians.{name.replace('-', '_')}"]


def problem(name):
    """The Lagrangian with different values of all parameters, so that a mix-up would be noticed."""
    L = registry()[name]
    return L.with_parameters(**{key: value * (1.1 + 0.13 * k) for k, (key, value) in enumerate(L.parameters.items())})


def points(L):
    """The example and three points near it, from a fixed seed."""
    rng = np.random.default_rng(5)
    q, v = np.array(L.example.q), np.array(L.example.v)
    yield q, v
    for _ in range(3):
        yield q + 0.05 * rng.normal(size=len(q)), v + 0.05 * rng.normal(size=len(v))


def slope(function, x, k, step=2e-3):
    """An eighth-order central difference along coordinate k."""
    unit = np.zeros(len(x))
    unit[k] = step
    return sum(w * (function(x + m * unit) - function(x - m * unit)) for m, w in WEIGHTS.items()) / step


@pytest.mark.parametrize("name", only(SOME, (name for name in NAMES if hasattr(file_of(name), "_expression"))))
def test_the_value_is_that_of_the_formula_in_plain_numbers(name):
    L = problem(name)
    for q, v in points(L):
        plain = float(file_of(name)._expression(q, v, T, SimpleNamespace(**L.parameters)))
        assert abs(L.value(q, v, T) - plain) <= 4e-16 * max(1.0, abs(plain)) * L.dimension


@pytest.mark.parametrize("name", only(SOME, NAMES))
def test_gradients_and_hessians_are_the_derivatives_of_the_value(name):
    L = problem(name)
    for q, v in points(L):
        f, p = L.gradients(q, v, T)
        qq, qv, vv = L.hessians(q, v, T)
        for k in range(L.dimension):
            # Round-off over the step and (step / distance to a singularity)^8: 3.8e-13 was reached for both orders.
            assert abs(slope(lambda x, v=v: L.value(x, v, T), q, k) - f[k]) < 2e-12
            assert abs(slope(lambda w, q=q: L.value(q, w, T), v, k) - p[k]) < 2e-12
            assert np.abs(slope(lambda x, v=v: L.gradients(x, v, T)[0], q, k) - qq[k]).max() < 2e-12
            assert np.abs(slope(lambda w, q=q: L.gradients(q, w, T)[0], v, k) - qv[:, k]).max() < 2e-12
            assert np.abs(slope(lambda w, q=q: L.gradients(q, w, T)[1], v, k) - vv[k]).max() < 2e-12


@kernel
def in_lanes(tag, parameters, t, q, v, out):
    d = binding.dimension(tag, parameters)
    at = load(t, 0)
    put(out, 0, binding.value(tag, parameters, at, q, v))
    binding.gradients(tag, parameters, at, q, v, out[1:], out[1 + d :])
    binding.hessians(tag, parameters, at, q, v, out[1 + 2 * d :])


@pytest.mark.parametrize("name", only(SOME[2:4], NAMES))
def test_kernels_on_rows_of_eight_give_the_values_of_kernels_on_vectors(name):
    L = problem(name)
    d = L.dimension
    some = list(points(L)) * 2
    times = T + 0.1 * np.arange(8.0)
    q, v = (np.ascontiguousarray(L.kernel_order(np.array(x)).T) for x in zip(*some, strict=True))
    out = np.empty((1 + 2 * d + 3 * d * d, 8))
    in_lanes(L.tag, L.parameter_vector, times, q, v, out)
    for k, (x, w) in enumerate(some):
        f, p = (L.kernel_order(y) for y in L.gradients(x, w, times[k]))
        blocks = [L.kernel_order(L.kernel_order(block).T).T.ravel() for block in L.hessians(x, w, times[k])]
        expected = np.concatenate([[L.value(x, w, times[k])], f, p, *blocks])
        # The same operations; which products are fused into sums may differ: one ulp was reached.
        assert np.abs(out[:, k] - expected).max() <= 4 * np.spacing(np.abs(expected).max())


@kernel
def accelerations(tag, parameters, q, out, rows, rows_out):
    binding.accelerate(tag, parameters, q, out)
    binding.accelerate(tag, parameters, rows, rows_out)


@pytest.mark.parametrize("name", only(SOME, (name for name in NAMES if SEPARABLE in registry()[name].traits)))
def test_accelerations_solve_the_euler_lagrange_equations(name):
    """M a = dL/dq where M is constant and nothing else depends on v; on vectors and on rows."""
    L = problem(name)
    rows_out = np.full((L.dimension, 8), np.nan)
    for x, w in points(L):
        q, out = np.zeros(padded(L.dimension)), np.full(padded(L.dimension), np.nan)
        q[: L.dimension] = L.kernel_order(x)
        accelerations(L.tag, L.parameter_vector, q, out, np.repeat(q[: L.dimension, None], 8, axis=1), rows_out)
        a = L.solve_mass(L.hessians(x, w)[2], L.gradients(x, w)[0], x)
        for found in (out[: L.dimension], *rows_out.T):
            # A handful of roundings: one ulp was reached.
            assert np.abs(L.caller_order(found) - a).max() <= 4 * np.spacing(np.abs(a).max())


@pytest.mark.parametrize("name", only(SOME, NAMES))
def test_the_legendre_transform_and_its_inverse_are_inverse(name):
    L = problem(name)
    for q, v in points(L):
        # Newton's method at the floor: 1.1e-16 was reached.
        assert np.abs(L.velocity(q, L.momentum(q, v, T), T) - v).max() < 1e-15 * max(1.0, np.abs(v).max())


def with_symmetries():
    """The Lagrangians with all their symmetries, and a charged particle in a uniform field, which has more of them."""
    for name in NAMES:
        yield pytest.param(problem(name), id=name)
    uniform = problem("charged-particle").with_parameters(B2=0.0, E2=0.0)
    yield pytest.param(uniform, id="charged-particle, uniform field")


@pytest.mark.parametrize("L", list(with_symmetries()))
def test_symmetries_change_the_lagrangian_by_a_total_derivative_and_generators_are_their_flows_derivatives(L):
    """Along q + tau v: L of the moved path is L + dK_s/dt, K_s the gauge term integrated along the flow, mostly 0."""
    for symmetry in L.symmetries:
        for q, v in points(L):
            assert symmetry.defect(q, T) < 4e-13  # round-off over the step: 6e-14 was reached, by a boost

            def along(what, q=q, v=v):
                return slope(lambda tau: what(0.7, q + tau[0] * v, T + tau[0]), np.zeros(1), 0)

            moved, pushed, gained = symmetry.moved(0.7, q, T), along(symmetry.moved), along(symmetry.gained)
            # As above: 6.4e-14 was reached, 6.7e-14 with a gauge term.
            assert abs(L.value(moved, pushed, T) - L.value(q, v, T) - gained) < 5e-13


@pytest.mark.parametrize("name", only(SOME, NAMES))
def test_traits_say_what_the_derivatives_show(name):
    L = problem(name)
    (q, v), (x, w) = list(points(L))[:2]
    constant_mass = np.array_equal(L.hessians(q, v)[2], L.hessians(x, w, 0.9)[2])
    no_mixed = not np.any(L.hessians(x, w)[1])
    autonomous = L.value(q, v, 0.1) == L.value(q, v, 0.9)
    assert (SEPARABLE in L.traits) == (constant_mass and no_mixed and autonomous)
    assert (TIME_DEPENDENT in L.traits) == (not autonomous)


@pytest.mark.parametrize("name", only(SOME[2:], (name for name in NAMES if SEPARABLE not in registry()[name].traits)))
def test_its_motion_solves_the_euler_lagrange_equations(name):
    """d/dt dL/dv = dL/dq along a march of Gauss with 8 stages, by differences of its momenta in time.

    Where accelerations are known, the test above says more for less.
    """
    L = problem(name)
    dt = L.example.dt / 4
    path = orbits.march(L, orbits.Gauss(stages=8), dt=dt, steps=8)
    rate = sum(w * (path.p[4 + m] - path.p[4 - m]) for m, w in WEIGHTS.items()) / dt
    force = L.gradients(path.q[4], path.v[4], path.t[4])[0]
    # The error of the difference of a charged particle, (dt / its gyration)^8: 1.8e-9 was reached; others 1e-11.
    assert np.abs(rate - force).max() < 1e-8 * max(1.0, np.abs(force).max())


@each("name", NAMES)
def test_it_says_what_it_is_and_where_it_comes_from(name):
    L = registry()[name]
    assert L.formula
    assert L.source
    assert len(L.coordinates) == len(L.example.q) == len(L.example.v)
    assert getattr(orbits.lagrangians, name.replace("-", "_")) is L
