"""Lagrangians in transformed time: the same orbits and momenta, with the time as a coordinate."""

import numpy as np
import pytest
import sympy

import orbits
from orbits import discrete
from orbits.diagnostics.tangent import plain_step
from orbits.errors import ConvergenceError, InputError, SingularityError
from orbits.lagrangians.bodies_in_transformed_time import bodies_in_transformed_time
from orbits.lagrangians.newtonian import n_body
from orbits.methods import LobattoIIIAB, SymplecticEuler

x, y = sympy.symbols("x y")
KEPLER = orbits.lagrangians.kepler
DYNAMICAL = (x**2 + y**2) ** sympy.Rational(3, 4)
time_transformed = orbits.lagrangians.time_transformed


def slope(function, at):
    """The derivative of a function along each axis, by eighth-order differences."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return np.array(
        [sum(w * (function(at + m * d) - function(at - m * d)) for m, w in weights.items()) / 1e-3
         for d in 1e-3 * np.eye(len(at))]
    )  # fmt: skip


@pytest.mark.parametrize("softening", [0.0, 0.3])
def test_the_derivatives_of_the_lagrangian_of_bodies_are_its_derivatives(softening):
    """Errors of the differences are 1e-11; momenta are those of Newton's Lagrangian at v = q' / g."""
    rng = np.random.default_rng(3)
    L, newton = bodies_in_transformed_time([1.0, 0.3, 0.2], -0.37, softening), n_body([1.0, 0.3, 0.2], softening)
    q, v = rng.normal(size=9), rng.normal(size=9)
    f, p = L.gradients(q, v)
    qq, qv, vv = L.hessians(q, v)
    for found, differences in (
        (f, slope(lambda z: L.value(z, v), q)),
        (p, slope(lambda z: L.value(q, z), v)),
        (qq, slope(lambda z: L.gradients(z, v)[0], q)),
        (qv, slope(lambda z: L.gradients(q, z)[0], v).T),
        (vv, slope(lambda z: L.gradients(q, z)[1], v)),
    ):
        np.testing.assert_allclose(found, differences, rtol=0, atol=1e-9 * np.abs(found).max())
    g = 1.0 / vv[0, 0]  # GM1 = 1
    np.testing.assert_allclose(p, newton.momentum(q, v / g), rtol=1e-14)
    assert L.energy(q, v) == pytest.approx(g * (newton.energy(q, v / g) + 0.37), rel=1e-13)
    assert [s.name.split()[0] for s in L.symmetries] == ["translation"] * 3 + ["rotation"] * 3


@pytest.fixture(scope="module")
def eccentric():
    """An orbit of e = 0.9 from its pericentre."""
    return time_transformed(KEPLER, monitor=DYNAMICAL, q=[1 - 0.9, 0.0], v=[0.0, (1.9 / 0.1) ** 0.5])


def test_orbits_and_times_are_those_of_the_lagrangian_that_was_transformed(eccentric):
    """Twenty orbits of e = 0.9 with 24 steps each, from the pericentre; 1e-12 is seen."""
    path = orbits.march(eccentric, orbits.Gauss(), dt=0.349, steps=480)
    q, v = np.array([1 - 0.9, 0.0, 0.0]), np.array([0.0, (1.9 / 0.1) ** 0.5, 0.0])
    for k in (1, 100, 480):
        exact, speed = orbits.kepler_flow(q, v, 1.0, path.q[k, 2])
        assert np.abs(path.q[k, :2] - exact[:2]).max() < 3e-11
        assert np.abs(path.p[k, :2] - speed[:2]).max() < 3e-10
    assert not path.p[:, 2].any()


def test_the_same_lagrangian_is_made_once_however_often_it_is_transformed():
    one, again = (time_transformed(KEPLER, monitor=DYNAMICAL).compile().tag.name for _ in range(2))
    assert one == again  # by which kernels on disk are found
    assert one != time_transformed(KEPLER, monitor=2 + x**2).compile().tag.name


def test_the_energy_of_the_start_is_rounded_once():
    """In float64, p.v - L at this pericentre is 1e-12 off, and so would be the energy of the orbit."""
    start = {"q": [2.0**-13, 0.0], "v": [0.0, float(np.sqrt(2.0**14 - 1))]}
    speed2 = sympy.Float(start["v"][1], 40) ** 2
    energy = time_transformed(KEPLER, monitor=DYNAMICAL, **start).parameters["E0"]
    assert energy == float(speed2 / 2 - 2**13)
    assert time_transformed(KEPLER, monitor=DYNAMICAL, energy=-0.25).parameters["E0"] == -0.25


def test_symmetries_are_kept_where_the_monitor_has_them(eccentric):
    assert [s.name for s in eccentric.symmetries] == ["rotation", "translation of time"]
    assert [s.name for s in time_transformed(KEPLER, monitor=2 + x**2).symmetries] == ["translation of time"]


def test_other_parameters_have_their_own_symmetries_and_are_checked_as_before():
    top = time_transformed(orbits.lagrangians.rigid_body((1, 1, 0.4)), monitor=sympy.Integer(1))
    assert "rotation about axis 3" in [s.name for s in top.symmetries]
    assert "rotation about axis 3" not in [s.name for s in top.with_parameters(I1=1.2).symmetries]

    k = sympy.Symbol("k", positive=True)  # SymPy writes k for sqrt(k**2)
    spring = orbits.Lagrangian.from_sympy(
        sympy.Symbol("vx") ** 2 / 2 - sympy.sqrt(k**2) * x**2,
        q=[x],
        v=[sympy.Symbol("vx")],
        parameters={k: 1.0},
        name="spring",
        example=orbits.Motion((1.0,), (0.0,), 0.1),
    )
    with pytest.raises(InputError, match="parameter k was declared to SymPy with positive=True"):
        time_transformed(spring, monitor=1 + x**2).with_parameters(k=-1.0)


@pytest.mark.nightly
@pytest.mark.parametrize("method", [orbits.Gauss(stages=2), LobattoIIIAB(stages=3), SymplecticEuler()])
def test_certificates_hold_for_a_lagrangian_of_ones_own(method):
    """A pendulum given as a function of t, with its angle in the monitor; its L_d is found as of any other."""
    t = sympy.Symbol("t")
    theta = sympy.Function("theta")(t)
    pendulum = orbits.Lagrangian.from_sympy(
        theta.diff(t) ** 2 / 2 + sympy.cos(theta), q=[theta], v=[theta.diff(t)], t=t, name="swing"
    )
    swing = time_transformed(pendulum, monitor=1 / (1 + sympy.Symbol("theta") ** 2), q=[1.0], v=[0.3], dt=0.1)
    assert swing.coordinates == ("theta", "t")
    certificate = orbits.certify(swing, method, dt=0.1)
    assert certificate.ok, certificate.table()
    path = orbits.march(swing, method, dt=0.1, steps=10)
    residual = discrete.euler_lagrange_residual(discrete.vprk(swing, method.tableau), path.q, 0.1)
    assert np.abs(residual).max() < 1e-13


def test_there_is_no_lagrangian_where_the_monitor_is_negative():
    falls = time_transformed(KEPLER, monitor=x, q=[0.5, 0.5], v=[-1.5, 0.3])
    assert np.isfinite(falls.value([0.01, 0.5, 0.0], [-0.5, 0.2, 0.5]))
    with pytest.raises(SingularityError, match=r"is singular at q = \[-0\.01"):
        falls.value([-0.01, 0.5, 0.0], [-0.5, 0.2, 0.5])


@pytest.mark.nightly
def test_a_monitor_that_becomes_negative_ends_the_march():
    """The motion cannot reach x = 0, where time stands still, but a long step can jump over; from there time would run
    backwards. Without the guard around the monitor, only luck ends the march: the iteration of a later step.
    """
    falls = time_transformed(KEPLER, monitor=x, q=[0.5, 0.5], v=[-1.5, 0.3])
    with pytest.raises(SingularityError) as caught:
        orbits.march(falls, orbits.Gauss(stages=1), dt=1.0, steps=60)
    path = caught.value.trajectory
    assert path.q[-1, 0] < 0.0
    assert np.all(np.diff(path.q[:, 2]) > 0.0)


def test_what_cannot_be_transformed_is_refused_with_the_reason():
    refused = (
        (r"'newtonian' has no formula.*from_sympy.*TimeTransformed", orbits.lagrangians.newtonian, x, {}),
        (r"'driven-pendulum' depends on time.*p_t that enters linearly", orbits.lagrangians.driven_pendulum, x, {}),
        (r"monitor is 'x'; expected a SymPy expression of x, y", KEPLER, "x", {}),
        (r"monitor depends on z; expected a function of the coordinates x, y", KEPLER, sympy.Symbol("z") * x, {}),
        (r"monitor x - 1 of 'kepler' is -0.3 at q = .*positive, finite", KEPLER, x - 1, {}),
        (r"is nan at q = .*positive, finite", KEPLER, 1 / (x - 0.5), {"q": [0.5, 0.0], "v": [0.0, 1.0]}),
        (r"needs both q and v", KEPLER, DYNAMICAL, {"q": [0.5, 0.0]}),
        (r"has a coordinate or parameter named E0", orbits.lagrangians.transformed_kepler, DYNAMICAL, {}),
        (r"expected a Lagrangian", "kepler", x, {}),
    )
    for message, lagrangian, monitor, options in refused:
        with pytest.raises(InputError, match=message):
            time_transformed(lagrangian, monitor=monitor, **options)


def test_a_plain_step_far_too_long_is_an_error_of_the_step(eccentric):
    """Newton's method meets a singular matrix far from any solution, which once went through as an error of NumPy."""
    q, v = eccentric.example.q, eccentric.example.v
    with pytest.raises(ConvergenceError, match="Newton's method fails"):
        plain_step(eccentric, orbits.Gauss(stages=8).tableau, q, eccentric.momentum(q, v), 4.2)


@pytest.mark.nightly
def test_a_monitor_that_vanishes_on_the_way_is_said_where_time_stands_still():
    vx, vy = sympy.symbols("vx vy")
    spring = orbits.Lagrangian.from_sympy((vx**2 + vy**2 - x**2 - 4 * y**2) / 2, q=[x, y], v=[vx, vy])
    start = {"q": [1.0, 0.0], "v": [0.0, 0.5]}
    stands = time_transformed(spring, monitor=x + 0.5, **start)
    with pytest.raises(ConvergenceError, match=r"dtau = 0\.1.*the monitor vanishes there, where time stands") as caught:
        orbits.march(stands, orbits.Gauss(stages=8), dt=0.1, steps=400)
    assert caught.value.trajectory.q[-1, 0] > -0.5
