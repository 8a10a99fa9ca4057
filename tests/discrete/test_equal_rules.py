"""Discrete Lagrangians that are the same in two ways, that are symmetric, and the extremum of VPRK found otherwise."""

import numpy as np
import pytest

from orbits import discrete
from orbits.tableaux.elementary import drift_kick, kick_drift
from orbits.tableaux.gauss import gauss
from orbits.tableaux.lobatto import lobatto_iiia_iiib

from ..coverings import each, first
from .mechanics import Central, Magnetic, Oscillator, Pendulum, difference, pair, rules, systems

SEPARABLE = [Pendulum(), Central(), Central(dimension=3), Oscillator()]
ALL = [*systems().values()]


def apart(one, other, L):
    """The largest relative difference of values, derivatives and second derivatives."""
    q0, q1 = pair(L)
    a, b = one(L).jet(q0, q1, L.h, 0.3), other(L).jet(q0, q1, L.h, 0.3)
    scale = np.abs(a.d12).max()
    return max(np.abs(np.asarray(x) - np.asarray(y)).max() for x, y in zip(a, b, strict=True)) / scale


# 2.2e-16 of the second derivatives was reached in all of these.
@pytest.mark.parametrize("L", ALL, ids=lambda L: L.name)
def test_the_midpoint_rule_is_gauss_with_one_stage(L):
    assert apart(discrete.midpoint, lambda L: discrete.vprk(L, gauss(1)), L) < 2e-15


@pytest.mark.parametrize("L", SEPARABLE, ids=lambda L: L.name)
def test_for_separable_lagrangians_the_trapezoidal_rule_is_lobatto_with_two_stages(L):
    assert apart(discrete.trapezoidal, lambda L: discrete.vprk(L, lobatto_iiia_iiib(2)), L) < 2e-15


def test_with_a_magnetic_field_they_differ():
    assert apart(discrete.trapezoidal, lambda L: discrete.vprk(L, lobatto_iiia_iiib(2)), Magnetic()) > 1e-4


@pytest.mark.parametrize("L", ALL, ids=lambda L: L.name)
def test_both_symplectic_eulers_are_partitioned_methods_with_one_stage(L):
    euler = (discrete.symplectic_euler_a, discrete.symplectic_euler_b)
    pairs = [lambda L, t=t: discrete.vprk(L, t()) for t in (kick_drift, drift_kick)]
    defects = [[apart(e, p, L) for p in pairs] for e in euler]
    assert sorted(min(row) < 2e-15 < 1e-5 < max(row) for row in defects) == [True, True]
    assert np.argmin(defects[0]) != np.argmin(defects[1])


@pytest.mark.parametrize("L", first(1, [Pendulum(), Magnetic(), Central()]), ids=lambda L: L.name)
@pytest.mark.parametrize(
    "tableau", [gauss(2), gauss(3), lobatto_iiia_iiib(2), lobatto_iiia_iiib(3)], ids=lambda t: t.name
)
def test_the_extremum_under_the_constraint_is_found_by_a_method_that_knows_nothing_of_momenta(tableau, L):
    """Stationary h sum b_i L(Q_i, V_i) + lambda.(q1 - q0 - h sum b_i V_i), by Newton with differences of L alone."""
    q0, q1 = pair(L)
    h, t, (s, d) = L.h, 0.3, (len(tableau.b), len(q0))

    def action(V):
        Q = q0 + h * tableau.a @ V
        return h * sum(b * L.value(x, v, t + c * h) for b, c, x, v in zip(tableau.b, tableau.c, Q, V, strict=True))

    def equations(z):
        V, multiplier = z[: s * d].reshape(s, d), z[s * d :]
        slope = difference(lambda x: action(x.reshape(s, d)), V.ravel())
        return np.concatenate([slope - h * np.outer(tableau.b, multiplier).ravel(), h * tableau.b @ V - (q1 - q0)])

    z = np.concatenate([np.tile((q1 - q0) / h, s), np.zeros(d)])
    for _ in range(12):
        z = z - np.linalg.solve(difference(equations, z, 0.01), equations(z))
    V, multiplier = z[: s * d].reshape(s, d), z[s * d :]
    L_d = discrete.vprk(L, tableau)
    value, _, d2 = L_d.first(q0, q1, h, t)
    assert abs(action(V) - value) < 1e-15  # 1.1e-16 was reached
    assert np.abs(multiplier - d2).max() < 2e-13  # differences over differences: 3.6e-14 was reached
    # A point of the constraint beside the stationary one: the action is another, to second order.
    away = V + 0.1 * np.cos(np.arange(s))[:, None]
    away += (q1 - q0) / h - tableau.b @ away
    assert abs(action(away) - value) > 1e-6


SYMMETRIC = ("trapezoidal", "midpoint", "vprk Gauss", "vprk LobattoIIIAB", "exact")


@each("L", ALL)
@each("rule", rules())
def test_which_rules_are_symmetric(rule, L):
    """L_d(q0, q1; h) = -L_d(q1, q0; -h)."""
    L_d, (q0, q1), t = rules()[rule](L), pair(L), 0.3
    defect = abs(L_d.value(q0, q1, L.h, t) + L_d.value(q1, q0, -L.h, t + L.h))
    if rule.startswith(SYMMETRIC) or "Lobatto" in rule:
        assert defect < 2e-15  # 2.2e-16 was reached
    else:
        assert defect > 1e-4
