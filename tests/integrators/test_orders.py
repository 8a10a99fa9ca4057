"""Orders that double precision cannot show, published bounds, and maps computed in two ways."""

import json

import mpmath
import numpy as np
import pytest

import orbits
from orbits import discrete
from orbits.marching.flow import Flow
from orbits.methods import LobattoIIIAB, LobattoIIIBA
from orbits.tableaux import gauss, lobatto_iiia_iiib

from ..coverings import at, first
from ..problems import kepler_orbit
from .plain_steps import one_step

KEPLER = orbits.lagrangians.kepler


@pytest.mark.parametrize(
    ("tableau", "order"),
    [*((gauss(s), 2 * s) for s in range(1, 9)), *((lobatto_iiia_iiib(s), 2 * s - 2) for s in (2, 3, 4, 5))],
    ids=lambda x: x.name if hasattr(x, "name") else "",
)
def test_the_error_of_one_step_falls_with_the_power_order_plus_one_in_fifty_digits(tableau, order):
    """One step from an unsymmetric point of an orbit with e = 0.3, against Kepler's equation."""
    with mpmath.workdps(50):
        e, t = mpmath.mpf("0.3"), mpmath.mpf("0.8")
        q, p = kepler_orbit(e, t)
        errors = []
        for h in (mpmath.mpf(1) / 32, mpmath.mpf(1) / 64):
            got, exact = one_step(tableau, q, p, h), kepler_orbit(e, t + h)[0]
            errors.append(max(abs(a - b) for a, b in zip(got, exact, strict=True)))
        measured = float(mpmath.log(errors[0] / errors[1], 2)) - 1
    # The next terms of the expansion: 0.2 at most was reached, with eight stages.
    assert abs(measured - order) < 0.4, measured


BOUNDS = json.loads("""{
    "Gauss": {"1": [4e-4, 8e-4], "2": [4e-8, 4e-8], "3": [1e-12, 2e-12], "4": [4e-16, 8e-16]},
    "IIIA": {"2": [2e-4, 8e-4], "3": [8e-9, 8e-8], "4": [2e-13, 2e-12]},
    "IIIB": {"2": [4e-4, 8e-4], "3": [4e-8, 4e-8], "4": [1e-12, 2e-12]}}""")
"""What JuliaGNI/GeometricIntegrators.jl asserts of its VPRK methods in variational_integrators_tests.jl: relative
errors of q and p of a harmonic oscillator, m = 1, k = 0.5, q = 0.5, p = 0, after ten steps of 0.1.
"""


@pytest.mark.parametrize(
    ("family", "stages"), at((1, 5), [(family, int(s)) for family, bounds in BOUNDS.items() for s in bounds])
)
@pytest.mark.parametrize("canonical", first(1, [False, True]), ids=["second-order form", "canonical form"])
def test_the_bounds_of_geometric_integrators_are_met(family, stages, canonical):
    method = {"Gauss": orbits.Gauss, "IIIA": LobattoIIIAB, "IIIB": LobattoIIIBA}[family](stages=stages)
    flow = Flow(orbits.lagrangians.harmonic_oscillator, method, 0.1, canonical=canonical)
    q, p = flow.step([0.5], [0.0], 10)
    w = np.sqrt(0.5)
    exact = 0.5 * np.cos(w), -0.5 * w * np.sin(w)
    bounds = BOUNDS[family][str(stages)]
    assert abs(q[0] - exact[0]) / abs(exact[0]) <= bounds[0]
    assert abs(p[0] - exact[1]) / abs(exact[1]) <= bounds[1]


def ulps(a, b):
    return np.abs(a - b).max() / np.spacing(np.abs(a).max())


def one_step_ulps(L, method, L_d):
    """The largest difference, in ulps, of the compiled step from the position-momentum form of L_d, along a path."""
    path = orbits.march(L, method, dt=0.1, steps=20)
    steps = [discrete.step(L_d, q, p, 0.1) for q, p in zip(path.q[:-1], path.p[:-1], strict=True)]
    return max(ulps(path.q[1:], np.array([q for q, _ in steps])), ulps(path.p[1:], np.array([p for _, p in steps])))


@pytest.mark.parametrize(
    "L",
    first(1, [KEPLER, orbits.lagrangians.double_pendulum, orbits.lagrangians.charged_particle]),
    ids=lambda L: L.name,
)
def test_midpoint_equations_are_gauss_with_one_stage_to_a_few_ulps(L):
    """Newton's method on Q x Q against the compiled step; for a magnetic Lagrangian, and one of variable mass, too."""
    # Rounding of q1 - q0 over h: 10 ulps at most were reached, by the charged particle.
    assert one_step_ulps(L, orbits.Gauss(stages=1), discrete.midpoint(L)) < 30


@pytest.mark.parametrize("L", first(1, [KEPLER, orbits.lagrangians.henon_heiles]), ids=lambda L: L.name)
def test_trapezoidal_equations_are_lobatto_with_two_stages_and_stormer_verlet(L):
    for method in (orbits.StormerVerlet(), LobattoIIIAB(stages=2)):
        assert one_step_ulps(L, method, discrete.trapezoidal(L)) < 15  # 4.75 at most was reached
    verlet = orbits.march(L, orbits.StormerVerlet(), dt=0.1, steps=20)
    lobatto = orbits.march(L, LobattoIIIAB(stages=2), dt=0.1, steps=20)
    assert ulps(verlet.q, lobatto.q) < 8


def test_with_a_magnetic_term_the_trapezoidal_rule_is_another_method_than_lobatto():
    L = orbits.lagrangians.charged_particle
    path = orbits.march(L, LobattoIIIAB(stages=2), dt=0.1, steps=1)
    q, _ = discrete.step(discrete.trapezoidal(L), path.q[0], path.p[0], 0.1)
    assert 1e-6 < np.abs(q - path.q[1]).max() < 1e-2


def test_the_exact_discrete_lagrangian_of_kepler_marches_on_the_orbit_at_any_step():
    """Forty steps of a tenth of a period; the marching rule depends on time only through h."""
    path = orbits.march(KEPLER, orbits.Gauss(stages=8), dt=0.02, steps=1200, every=30)
    L_d = discrete.exact(KEPLER)
    q, p = path.q[0], path.p[0]
    for k in range(40):
        q, p = discrete.step(L_d, q, p, 0.6)
        assert np.abs(q - path.q[k + 1]).max() < 1e-11
