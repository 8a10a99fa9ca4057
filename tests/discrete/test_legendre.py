"""Discrete Legendre transforms, the matching of momenta, and the two-form: one under both, and preserved."""

import numpy as np
import pytest

from orbits import discrete
from orbits.errors import InputError

from ..coverings import cover
from .mechanics import Driven, Magnetic, Oscillator, difference, pair, rules, systems

QUICK = [name for name in rules() if name != "exact_by_collocation"]
BOTH = ("minus", "plus")
of_rules_and_systems = cover(("rule", "system"), QUICK, systems(), strength=1)


@of_rules_and_systems
def test_the_transforms_have_inverses_and_momenta_match_along_a_trajectory(rule, system):
    L = systems()[system]
    L_d, (q0, q1), h, t = rules()[rule](L), pair(L), L.h, 0.3
    scale = np.abs(L_d.d12(q0, q1, h, t)).max()
    for forth, back in (
        (discrete.legendre_minus, discrete.inverse_legendre_minus),
        (discrete.legendre_plus, discrete.inverse_legendre_plus),
    ):
        x, y = back(L_d, *forth(L_d, q0, q1, h, t), h, t)
        assert max(np.abs(x - q0).max(), np.abs(y - q1).max()) < 1e-15  # 1.1e-16 was reached
    _, q2 = discrete.advance(L_d, q0, q1, h, t)
    # A point known to half an ulp: D1D2 times that, from three points.
    assert np.abs(discrete.momentum_mismatch(L_d, q0, q1, q2, h, t)).max() < 4 * 2.0**-53 * scale
    assert np.abs(discrete.momentum_mismatch(L_d, q0, q1, q2 + 1e-6, h, t)).max() > 1e-7


@of_rules_and_systems
def test_the_map_in_phase_space_is_the_same_by_both_transforms(rule, system):
    L = systems()[system]
    L_d, h, t = rules()[rule](L), L.h, 0.3
    q, p = L.q, L.momentum(L.q, L.v, t)
    expected = np.hstack(discrete.step(L_d, q, p, h, t))
    for sign in BOTH:
        got = np.hstack(discrete.phase_map(L_d, q, p, h, t, sign=sign))
        assert np.abs(got - expected).max() < 2e-15 * np.abs(L_d.d12(*pair(L), h, t)).max()  # 1.9e-16 was reached


@of_rules_and_systems
def test_the_two_form_is_both_pull_backs_and_is_preserved(rule, system):
    L = systems()[system]
    L_d, (q0, q1), h, t = rules()[rule](L), pair(L), L.h, 0.3
    omega = discrete.two_form(L_d, q0, q1, h, t)
    scale = np.abs(omega).max()
    assert np.array_equal(omega, -omega.T)
    for sign in BOTH:
        assert np.abs(discrete.pull_back(L_d, q0, q1, h, t, sign=sign) - omega).max() < 2e-15 * scale
    _, q2 = discrete.advance(L_d, q0, q1, h, t)
    F = discrete.pair_derivative(L_d, q0, q1, q2, h, t)
    after = discrete.two_form(L_d, q1, q2, h, t + h)
    assert np.abs(F.T @ after @ F - omega).max() < 4e-15 * scale  # 4.7e-16 was reached
    J, T = discrete.canonical_form(len(q0)), discrete.phase_derivative(L_d, q0, q1, h, t)
    assert np.abs(T.T @ J @ T - J).max() < 1e-14 * max(1.0, np.abs(T).max() ** 2)
    # A map that is none of this L_d's does not preserve it.
    assert np.abs((F + 1e-6).T @ after @ (F + 1e-6) - omega).max() > 1e-8 * scale


@cover(
    ("rule", "L"),
    ["vprk LobattoIIIAB(3)", "symplectic_euler_a", "trapezoidal"],
    [Driven(), Magnetic()],
    strength=1,
    ids=lambda x: getattr(x, "name", x),
)
def test_the_derivatives_of_the_maps_are_those_of_the_maps(rule, L):
    L_d, (q0, q1), h, t = rules()[rule](L), pair(L), L.h, 0.3
    d = len(q0)
    _, q2 = discrete.advance(L_d, q0, q1, h, t)

    def pairs(x):
        return np.hstack(discrete.advance(L_d, x[:d], x[d:], h, t))

    def phases(x):
        return np.hstack(discrete.step(L_d, x[:d], x[d:], h, t))

    F = discrete.pair_derivative(L_d, q0, q1, q2, h, t)
    assert np.abs(difference(pairs, np.hstack([q0, q1]), 0.005) - F).max() < 5e-13  # 3e-14 was reached
    p0 = discrete.legendre_minus(L_d, q0, q1, h, t)[1]
    T = discrete.phase_derivative(L_d, q0, q1, h, t)
    assert np.abs(difference(phases, np.hstack([q0, p0]), 0.005) - T).max() < 5e-13  # 1.0e-13
    for sign, transform in zip(BOTH, (discrete.legendre_minus, discrete.legendre_plus), strict=True):

        def moved(x, transform=transform):
            return np.hstack(transform(L_d, x[:d], x[d:], h, t))

        expected = discrete.legendre_derivative(L_d, q0, q1, h, t, sign=sign)
        assert np.abs(difference(moved, np.hstack([q0, q1])) - expected).max() < 5e-13  # 7e-14


def test_the_exact_lagrangian_of_the_oscillator_is_degenerate_near_conjugate_points_only():
    L_d = discrete.exact(Oscillator())
    discrete.require_regular(L_d, [0.1, 0.2], [0.3, -0.2], 0.4)
    with pytest.raises(InputError, match="sign"):
        discrete.phase_map(L_d, [0.1, 0.2], [0.3, -0.2], 0.4, sign="up")
