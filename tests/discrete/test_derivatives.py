"""D1, D2 and the second derivatives of every discrete Lagrangian against differences of its value and of D1, D2."""

import itertools

import numpy as np
import pytest

from orbits import discrete
from orbits.lagrangians import registry
from orbits.lagrangians.newtonian import n_body

from ..coverings import cover, keep
from .mechanics import compare, pair, rules, systems

TIME = 0.3


def test_every_maker_of_a_discrete_lagrangian_is_tested_here():
    makers = {name.split()[0] for name in rules()}
    from_numbers = {"exact_kepler", "exact_linear", "exact_free_particle", "exact_harmonic_oscillator"}  # test_exact.py
    of_one = {"suris"}  # test_suris.py
    returned = {name: getattr(discrete, name).__annotations__.get("return") for name in discrete.__all__}
    classes = ("DiscreteLagrangian", "Quadrature", "Vprk", "ExactByCollocation", "ExactKepler", "ExactLinear", "Suris")
    assert {name for name, kind in returned.items() if kind in classes} == makers | from_numbers | of_one


@cover(("rule", "system"), rules(), systems(), strength=1)
def test_the_derivatives_are_those_of_the_value(rule, system):
    L = systems()[system]
    # The truncation of the differences, delta^8 f^(9), which Kepler's pole makes large unless delta is small, and the
    # rounding, 2^-53/delta: up to 0.4 of these bounds was reached.
    delta, bound = (0.004, 1e-12) if "kepler" in system else (0.02, 1e-13)
    compare(rules()[rule](L), *pair(L), L.h, TIME, bound, delta)


SOME = [
    ("charged-particle", "vprk Gauss(2)"),
    ("double-pendulum-on-rods", "vprk LobattoIIIAB(3)"),
    ("driven-pendulum", "midpoint"),
    ("heavy-top", "midpoint"),
]
"""A magnetic one, one with constraints, one that depends on time and one with a mass that depends on the place."""


@pytest.mark.parametrize(
    ("name", "rule"),
    keep(
        lambda _, case: case in SOME,
        itertools.product(sorted(registry()), ["midpoint", "vprk Gauss(2)", "vprk LobattoIIIAB(3)"]),
    ),
)
def test_the_derivatives_for_every_lagrangian_of_the_library(name, rule):
    L = registry()[name]
    m = L.example
    q0, h = np.array(m.q), m.dt
    compare(rules()[rule](L), q0, q0 + h * np.array(m.v), h, m.t, 1e-11, 0.004)


def test_bodies_in_space_may_be_given_as_an_array_of_points():
    L_d = discrete.midpoint(n_body([1.0, 0.3]))
    q = np.array([[0.1, 0.2, 0.3], [1.0, -0.4, 0.2]])
    assert np.array_equal(L_d.d1(q, q + 0.01, 0.1), L_d.d1(q.ravel(), q.ravel() + 0.01, 0.1))
    assert L_d.d1(q, q + 0.01, 0.1).shape == (6,)
