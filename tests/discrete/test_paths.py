"""The action of a path, its gradient, and the residual of trajectories from anywhere, one that REBOUND made too."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import discrete
from orbits.errors import InputError
from orbits.lagrangians.newtonian import n_body

from ..coverings import first
from .mechanics import Driven, Magnetic, Pendulum, difference, rules


@pytest.mark.parametrize("L", [Pendulum(), Driven(), Magnetic()], ids=lambda L: L.name)
@pytest.mark.parametrize("rule", ["symplectic_euler_a", "trapezoidal", "midpoint", "vprk Gauss(2)"])
def test_the_residual_is_the_gradient_of_the_action(rule, L):
    L_d, h, t0 = rules()[rule](L), L.h, 0.4
    path = L.q + h * np.arange(5)[:, None] * L.v + 0.05 * np.cos(np.arange(5))[:, None]

    def action(inner):
        return discrete.action(L_d, np.vstack([path[:1], inner.reshape(3, -1), path[-1:]]), h, t0)

    residual = discrete.euler_lagrange_residual(L_d, path, h, t0)
    assert residual.shape == (3, len(L.q))
    slope = difference(action, path[1:-1].ravel(), 0.01)
    assert np.abs(slope - residual.ravel()).max() < 2e-13  # 2.8e-14 was reached
    times = t0 + h * np.arange(5)
    assert np.abs(discrete.euler_lagrange_residual(L_d, path, times) - residual).max() < 4e-15


@pytest.mark.parametrize("rule", first(4, ["symplectic_euler_b", "trapezoidal", "midpoint", "vprk Gauss(3)", "exact"]))
def test_a_marched_path_solves_its_own_equations_to_round_off_and_no_others(rule):
    L = Magnetic()
    L_d, h = rules()[rule](L), 0.1
    path = discrete.march_pairs(L_d, *discrete.start(L_d, L.q, L.v, h), h, 8)
    ulps = np.abs(discrete.euler_lagrange_residual(L_d, path, h, in_ulps=True)).max()
    # Each point is known to half an ulp, and |q|/h is some five times |p|: 4.5 was reached.
    assert ulps < 30
    other = discrete.midpoint(L) if rule != "midpoint" else discrete.trapezoidal(L)
    assert np.abs(discrete.euler_lagrange_residual(other, path, h, in_ulps=True)).max() > 1e9


def rebound_path(integrator, h, steps):
    rebound = pytest.importorskip("rebound")
    sim = rebound.Simulation()
    for m, x in (
        (1.0, (0, 0, 0, 0, 0, 0)),
        (1e-2, (0.7, 0.1, 0.05, -0.1, 1.3, 0.1)),
        (3e-3, (-1.5, 0.4, -0.2, -0.2, -0.7, 0.15)),
    ):
        sim.add(m=m, **dict(zip(("x", "y", "z", "vx", "vy", "vz"), x, strict=True)))
    sim.move_to_com()
    sim.integrator, sim.dt = integrator, h
    path, speeds = [], []
    for k in range(steps):
        if integrator == "ias15":
            sim.integrate(k * h)
        elif k:
            sim.steps(1)
        path.append([p.xyz for p in sim.particles])
        speeds.append([p.vxyz for p in sim.particles])
    return np.array([1.0, 1e-2, 3e-3]), np.array(path), np.array(speeds)


def test_the_leapfrog_of_rebound_solves_discrete_equations_and_ias15_does_not():
    """REBOUND's leapfrog is drift-kick-drift: the points *between* the drifts, q + h v/2, solve the trapezoidal ones.

    The stored points are drifted by half a step each way, and themselves solve the equations of no quadrature here.
    """
    h = 0.0625
    gm, path, speeds = rebound_path("leapfrog", h, 60)
    L_d = discrete.trapezoidal(n_body(gm))
    amid = path + h / 2 * speeds
    ulps = np.abs(discrete.euler_lagrange_residual(L_d, amid, h, in_ulps=True))
    assert ulps.shape == (58, 3, 3)
    # Stored positions of 1.5 lose 2^-53, twice, and differences of neighbours are 0.08: 40 was reached.
    assert ulps.max() < 120
    # There the momenta are those of half a kick, and the drifts and kicks are the map of the trapezoidal L_d.
    momenta = gm[:, None] * (speeds[:-1] + speeds[1:]) / 2
    residual = discrete.momentum_residual(L_d, amid[:-1], momenta, h)
    assert np.abs(residual).max() < 120 * np.spacing(np.abs(momenta).max())
    euler = discrete.symplectic_euler_a(n_body(gm))
    assert np.abs(discrete.momentum_residual(euler, amid[:-1], momenta, h)).max() > 1e-5
    gm, path, speeds = rebound_path("ias15", h, 60)
    assert np.abs(discrete.euler_lagrange_residual(L_d, path, h, in_ulps=True)).max() > 1e9
    # What IAS15 follows is the true motion: the exact L_d sees no residual but its rounding and that of the positions.
    exact = discrete.exact(n_body(gm))
    assert np.abs(discrete.euler_lagrange_residual(exact, path[:4], h, in_ulps=True)).max() < 60  # 9 was reached


def test_times_must_be_uniform_and_the_offender_is_named():
    L_d = discrete.trapezoidal(Pendulum())
    path, times = np.linspace(0, 1, 6)[:, None], 0.1 * np.arange(6)
    discrete.euler_lagrange_residual(L_d, path, times)
    discrete.euler_lagrange_residual(L_d, path, 1e4 + times)  # rounded to 2e-12, as times are
    times[3] += 1e-6
    with pytest.raises(InputError, match=r"usual spacing is 0\.1.*points 2 and 3\) it is 0\.100001"):
        discrete.euler_lagrange_residual(L_d, path, times)
    with pytest.raises(InputError, match="array of shape"):
        discrete.euler_lagrange_residual(L_d, path, times[:-1])
    with pytest.raises(InputError, match="leave out t0"):
        discrete.action(L_d, path, 0.1 * np.arange(6), 0.5)
    with pytest.raises(InputError, match="finite"):
        discrete.action(L_d, path, [0, 0.1, 0.2, np.nan, 0.4, 0.5])


@pytest.mark.parametrize(
    "path", [np.zeros((2, 1)), np.zeros(5), np.zeros((5, 2)), np.zeros((5, 1, 2)), [[0.0], [np.nan], [0.1]]]
)
def test_what_is_no_path_is_refused(path):
    with pytest.raises(InputError):
        discrete.euler_lagrange_residual(discrete.trapezoidal(Pendulum()), path, 0.1)


@pytest.mark.parametrize(
    ("path", "h", "words"),
    [
        (np.zeros((5, 1)) * u.km, 0.1, "the path is .*; expected an array of real numbers. Take the floats"),
        (np.zeros((5, 1)), np.arange(5) * u.yr, "h is .*; expected an array of real numbers. Take the floats"),
        ([[1.0], [1.0, 2.0]], 0.1, "the path is .*; expected an array of real numbers"),
        (np.zeros((5, 1)), "soon", "h is 'soon'; expected an array of real numbers"),
    ],
)
def test_units_and_what_are_no_numbers_are_refused_not_dropped(path, h, words):
    with pytest.raises(InputError, match=words):
        discrete.action(discrete.trapezoidal(Pendulum()), path, h)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: discrete.vprk(orbits.lagrangians.kepler, orbits.Gauss(stages=2)), "expected a tableau, such as"),
        (lambda: discrete.vprk("kepler", orbits.Gauss(stages=2).tableau), "expected a Lagrangian such as .*'kepler'"),
        (lambda: discrete.midpoint("kepler"), "expected a Lagrangian such as .*'kepler'"),
        (lambda: discrete.exact("kepler"), "expected a Lagrangian such as .*'kepler'"),
        (lambda: discrete.exact_linear("heavy", [[1.0]]), "mass is 'heavy'; expected an array of real numbers"),
        (lambda: discrete.exact_free_particle(dimension=0), "dimension must be a whole number >= 1, got 0"),
    ],
)
def test_what_no_discrete_lagrangian_is_of_is_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_the_times_of_a_clock_that_adds_dt_again_and_again_are_uniform():
    path = orbits.march(orbits.lagrangians.pendulum, orbits.Gauss(stages=1), dt=0.1, steps=300)
    times = np.cumsum(np.full(301, 0.1)) - 0.1
    L_d = discrete.midpoint(orbits.lagrangians.pendulum)
    assert np.abs(discrete.euler_lagrange_residual(L_d, path.q, times)).max() < 1e-12
