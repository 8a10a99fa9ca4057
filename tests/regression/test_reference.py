"""The exact reference solution is exact: every digit of it, on every conic, against formulas it does not use.

The converged one is as good as it says.
"""

from __future__ import annotations

import json
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import orbits
from orbits.point_masses import PointMasses
from orbits.regression import reference
from orbits.resources import data_path
from orbits.time_grid import TimeGrid

TIMES = np.concatenate([np.linspace(-400.0, 400.0, 21), [1e-9, 1e6, -1e9]])


def start_at_pericentre(e, r=1.0):
    """One massive body and a massless one at pericentre distance r; returns also the exact e and a of the floats."""
    gm, q, v = np.array([1.0, 0.0]), np.zeros((2, 3)), np.zeros((2, 3))
    q[1, 0], v[1, 1] = r, np.sqrt((1 + e) / r)
    speed, distance = mpf(float(v[1, 1])), mpf(r)
    energy = speed**2 / 2 - 1 / distance
    return gm, q, v, distance * speed**2 - 1, -1 / (2 * energy) if energy else mpmath.inf


@pytest.mark.parametrize("e", [0.001, 0.3, 0.9, 0.999])
def test_elliptic_orbits_agree_with_keplers_equation_in_every_bit(e):
    with mpmath.workdps(70):
        gm, q, v, e, a = start_at_pericentre(e)
        expected = []
        for t in TIMES.tolist():
            M = mpmath.fmod(mpf(t) / a**1.5, 2 * mpmath.pi)
            E = mpmath.findroot(lambda E, M=M: E - e * mpmath.sin(E) - M, (-7, 7), solver="anderson", tol=1e-120)
            expected.append([a * (mpmath.cos(E) - e), a * mpmath.sqrt(1 - e * e) * mpmath.sin(E)])
        expected = np.array(expected, dtype=float)
    measured = reference.exact(PointMasses(gm, q, v), TIMES)
    np.testing.assert_array_equal(measured.q[:, 1, :2], expected)
    np.testing.assert_array_equal(measured.q[:, 0], 0.0)


@pytest.mark.parametrize("e", [1.001, 2.5, 30.0])
def test_hyperbolic_orbits_agree_with_keplers_equation_in_every_bit(e):
    with mpmath.workdps(70):
        gm, q, v, e, a = start_at_pericentre(e)
        expected = []
        for t in TIMES.tolist():
            M = mpf(t) / (-a) ** 1.5
            H = mpmath.asinh(M / (e - 1))  # beyond the root of a convex function: Newton's steps only come closer
            for _ in range(100):
                H -= (e * mpmath.sinh(H) - H - M) / (e * mpmath.cosh(H) - 1)
            expected.append([a * (mpmath.cosh(H) - e), -a * mpmath.sqrt(e * e - 1) * mpmath.sinh(H)])
        expected = np.array(expected, dtype=float)
    np.testing.assert_array_equal(reference.exact(PointMasses(gm, q, v), TIMES).q[:, 1, :2], expected)


def test_the_parabola_agrees_with_barkers_equation_in_every_bit():
    gm, q, v = np.array([2.0, 0.0]), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 0, 0], [0, 2, 0]])
    with mpmath.workdps(70):
        expected = []
        for t in TIMES.tolist():
            W = 3 * mpf(t) / 2  # 3/2 sqrt(gm / (2 r^3)) t, with D + D^3/3 = W 2/3
            y = mpmath.cbrt(abs(W) + mpmath.sqrt(W * W + 1))
            D = mpmath.sign(W) * (y - 1 / y)
            expected.append([1 - D * D, 2 * D])
        expected = np.array(expected, dtype=float)
    measured = reference.exact(PointMasses(gm, q, v), TIMES)
    # y - 1/y cancels where t is small: the closed form, not what is tested, is then wrong in the 60th digit only.
    np.testing.assert_array_equal(measured.q[:, 1, :2], expected)


@pytest.mark.nightly
def test_two_massive_bodies_agree_with_a_taylor_integration_of_their_equations():
    gm = np.array([1.0, 0.25])
    q, v = np.array([[0.1, 0.2, 0.3], [1.3, 0.0, -0.2]]), np.array([[0.05, -0.2, 0.01], [0.1, 0.9, 0.3]])
    times = np.array([-1.5, 0.0, 0.7, 2.0])

    def slope(_, y):
        d = [y[3 + k] - y[k] for k in range(3)]
        cube = mpmath.sqrt(sum(x * x for x in d)) ** 3
        return [*y[6:], *(mpf(gm[1]) * x / cube for x in d), *(-mpf(gm[0]) * x / cube for x in d)]

    with mpmath.workdps(22):
        y0 = [mpf(x) for x in (*q.ravel().tolist(), *v.ravel().tolist())]
        forwards = mpmath.odefun(slope, 0, y0)
        backwards = mpmath.odefun(lambda t, y: [-x for x in slope(t, y)], 0, y0)
        expected = np.array(
            [[float(x) for x in (forwards(t) if t >= 0 else backwards(-t))[:6]] for t in times.tolist()]
        )
    np.testing.assert_array_equal(reference.exact(PointMasses(gm, q, v), times).q.reshape(-1, 6), expected)


@pytest.mark.parametrize("e", [0.0, 0.5, 1 - 1e-9, 1.0, 1 + 1e-9, 4.0])
def test_more_digits_change_no_bit(e, monkeypatch):
    gm, q, v, _, _ = start_at_pericentre(e, r=0.7)
    q += [0.3, -5.0, 2.0]
    v += [1e-3, 2e-3, 0.1]
    ours = reference.exact(PointMasses(gm, q, v), TIMES)
    monkeypatch.setattr(reference, "PRECISION", 500)
    monkeypatch.setattr(reference, "_CONVERGED", 2.0**-240)
    monkeypatch.setattr(reference, "_SERIES_BELOW", 1e-30)
    np.testing.assert_array_equal(ours.q, reference.exact(PointMasses(gm, q, v), TIMES).q)


def test_the_exact_reference_solution_states_its_rounding_as_its_error():
    gm, q, v, _, _ = start_at_pericentre(0.3)
    measured = reference.exact(PointMasses(gm, q, v), TIMES)
    assert measured.kind == "exact"
    assert measured.error.tolist() == [np.spacing(0.0) / 2, 2.0**-53]


@pytest.mark.parametrize(
    ("gm", "v_last", "softening", "known"),
    [
        ([1.0, 0.0, 0.0], 1.0, 0.0, True),
        ([0.0, 0.0, 3.0], 1.0, 0.0, True),
        ([1.0, 0.0, 0.0], 1.0, 0.1, False),  # softened: not Kepler's problem
        ([1.0, 0.1, 0.0], 1.0, 0.0, False),  # a restricted three-body problem
        ([1.0, 0.0, 0.0], 0.0, 0.0, False),  # falls straight into the attractor
    ],
)
def test_the_exact_solution_is_claimed_only_where_there_is_one(gm, v_last, softening, known):
    q = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]])
    v = np.array([[0.0, 0, 0], [0, 1, 0], [v_last, 0, 0]])
    assert reference.exact_applies(PointMasses(np.array(gm), q, v, softening)) is known


@pytest.fixture(scope="module")
def ten_bodies():
    """The ten bodies of the data file, the days of its references, and these as sums of high and low parts."""
    data = json.loads(data_path("solar_system_10body.json").read_text(encoding="utf-8"))
    system = orbits.System(data["names"], data["gm_au3_d2"], data["q"], data["v"], units=orbits.SOLAR)
    days = np.array([365.25 * float(year) for year in data["reference_years"]])
    exact = [[[Fraction(x) for x in row[:3]] for row in rows] for rows in data["reference_years"].values()]
    high = np.array(exact, dtype=np.float64)
    low = np.array([[[float(x - Fraction(float(x))) for x in row] for row in rows] for rows in exact])
    return system, days, high, low


@pytest.mark.nightly
def test_the_converged_reference_solution_is_as_good_as_it_says_against_quadruple_precision(ten_bodies):
    system, days, high, low = ten_bodies
    times = np.append(0.0, days)
    made = reference.converged(system, TimeGrid(2.0, times))
    error = np.linalg.norm((made.q[1:] - high) - low, axis=-1).max(axis=0)
    # Random walks: the stated error is the larger of two distances between them, at most half of what one has done.
    assert np.all(error < 2 * made.error), error / made.error
    assert np.all(made.error[5:] < 1e-12)  # au; Jupiter to Pluto: 68 m in a thousand years, so it is not blind safety


@pytest.mark.parametrize(("step", "expected"), [(3.0, 2.0), (4.0, 4.0), (0.99, 0.5), (1e-300, 2.0**-997)])
def test_the_step_of_the_converged_reference_solution_is_a_power_of_two(step, expected):
    assert reference.power_of_two(step) == expected
