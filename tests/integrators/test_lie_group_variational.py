"""The Lie group variational integrator: orders, its equation and where that ends, what it keeps and for how long."""

import numpy as np
import pytest
import sympy

import orbits
from orbits import rotations
from orbits.errors import ConvergenceError, InputError, SingularityError
from orbits.lagrangians import euler_top, full_two_body, heavy_top, rigid_body

from ..coverings import first

LGVI = orbits.methods.LieGroupVariational()


def composed(order):
    return LGVI if order == 2 else orbits.methods.Composition(LGVI, order=order)


def spinning_top():
    return rotations.start(rates=(0.4, 0.3, 2.0), attitude=(1.0, 0.3, 0.1, 0.2))


def end_of(lagrangian, method, q, v, time, steps):
    path = orbits.march(lagrangian, method, q=q, v=v, dt=time / steps, steps=steps, every=steps)
    return path.q[-1], path.p[-1]


def skew(x):
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def body_momentum(q, p):
    return 0.5 * rotations.product(q * [1, -1, -1, -1], p)[..., 1:]


@pytest.mark.parametrize(("order", "counts"), first(1, [(2, (160, 320)), (4, (80, 160)), (6, (40, 80)), (8, (40, 60))]))
def test_a_top_in_gravity_converges_with_the_order_of_the_composition(order, counts):
    q, v = spinning_top()
    truth, _ = end_of(heavy_top, orbits.Gauss(stages=8), q, v, 4.0, 800)
    errors = [np.abs(end_of(heavy_top, composed(order), q, v, 4.0, n)[0] - truth).max() for n in counts]
    measured = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    assert measured == pytest.approx(order, abs=0.1)


@pytest.mark.nightly
def test_two_bodies_converge_and_keep_their_whole_angular_momentum():
    pair = full_two_body((1.0, 0.3), None, (0.02, 0.03, 0.04))
    q = np.array([1.5, 0.1, 0.2, *rotations.start((0, 0, 0), (1, 0.3, 0.1, 0.2))[0]])
    v = np.array([0.0, 0.9, 0.1, *rotations.start((0.2, 0.3, 1.0), (1, 0.3, 0.1, 0.2))[1]])
    truth, _ = end_of(pair, orbits.Gauss(stages=8), q, v, 4.0, 200)
    for order, counts in ((2, (200, 400)), (4, (50, 100))):
        errors = [np.abs(end_of(pair, composed(order), q, v, 4.0, n)[0] - truth).max() for n in counts]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)
    path = orbits.march(pair, LGVI, q=q, v=v, dt=0.02, steps=10_000, every=100)
    charges = np.array([path.momentum_map(group) for group in pair.symmetries[:3]])
    # 10,000 kicks of orbit and spin, each rounded: the reach is 5e-15.
    assert np.abs(charges - charges[:, :1]).max() < 5e-15 * np.linalg.norm(charges[:, 0])


def test_each_step_solves_the_equation_of_moser_and_veselov():
    """F J_d - J_d F^T = S(h Pi_half), F = R^T R+, with the torque that the potential has."""
    q, v = spinning_top()
    h, J, mgl = 0.1, np.array([1.0, 1.0, 0.4]), heavy_top.parameters["mgl"]
    J_d = np.diag(J.sum() / 2 - J)
    path = orbits.march(heavy_top, LGVI, q=q, v=v, dt=h, steps=50)
    R, momenta = rotations.matrices(path.q), body_momentum(path.q, path.p)
    for k in range(50):
        F, torque = R[k].T @ R[k + 1], [-mgl * np.cross([0, 0, 1.0], row[2]) for row in R[k : k + 2]]
        half = momenta[k] + h / 2 * torque[0]
        # Rotations in float64, of numbers of order one: 4e-16 was seen.
        assert np.abs(F @ J_d - J_d @ F.T - skew(h * half)).max() < 2e-15
        assert np.abs(F.T @ half + h / 2 * torque[1] - momenta[k + 1]).max() < 4e-15


def test_about_a_principal_axis_the_sine_of_the_angle_is_h_omega():
    for rate in (1e-6, 0.3, 9.99):
        q, v = rotations.start(rates=(0.0, 0.0, rate))
        path = orbits.march(euler_top, LGVI, q=q, v=v, dt=0.1, steps=1)
        assert 2 * np.arctan2(path.q[1, 3], path.q[1, 0]) == pytest.approx(np.arcsin(0.1 * rate), rel=1e-13)


def test_every_step_below_a_radian_is_taken_whatever_the_moments_and_the_axis():
    """On the branch that leads back to no turn at all: longer steps turn the body further."""
    rng = np.random.default_rng(11)
    for _ in range(60):
        J_d = rng.random(3) ** 3 + 1e-6
        J = J_d.sum() - J_d
        axis = rng.normal(size=3) * rng.choice([0.01, 1.0, 100.0], 3)
        q, v = rotations.start(rates=axis / np.linalg.norm(axis))
        body = euler_top.with_parameters(I1=J[0], I2=J[1], I3=J[2])
        last = 0.0
        for h in (0.1, 0.4, 0.7, 0.9, 0.999):
            turned = orbits.march(body, LGVI, q=q, v=v, dt=h, steps=1).q[1]
            angle = 2 * np.arctan2(np.linalg.norm(turned[1:]), turned[0])
            assert last < angle < 2.4
            last = angle


@pytest.mark.parametrize(("method", "dt", "words"), [
    (LGVI, 0.8, r"1\.8 radians in this step.*Use dt = 0\.41 or less, or orbits\.StormerVerlet"),
    (LGVI, -0.8, r"1\.8 radians in this step.*Use dt = -0\.41 or less"),
    (composed(4), 0.9, r"longest step of the composition, 0\.658 dt.*Use dt = 0\.63 or less"),
])  # fmt: skip
def test_a_step_too_long_for_the_equation_is_refused_with_one_that_can_be_taken(method, dt, words):
    q, v = rotations.start(rates=(1.0, 0.2 * np.sign(dt), 2.0))
    with pytest.raises(ConvergenceError, match=words) as failure:
        orbits.march(heavy_top, method, q=q, v=v, dt=dt, steps=3)
    assert failure.value.step == 0
    assert len(failure.value.trajectory.q) == 1
    remedy = float(str(failure.value).split("Use dt = ")[1].split()[0])
    orbits.march(heavy_top, method, q=q, v=v, dt=remedy, steps=1)


@pytest.mark.parametrize("J", [(1.0, 1.0, 1.0), (1.0, 1.0, 2.0), (0.5, 0.5, 1e-6), (2.0, 1.0, 1.0)])
def test_equal_moments_flat_bodies_and_rods_are_bodies_like_others(J):
    q, v = rotations.start(rates=(0.3, -0.2, 0.5), attitude=(1.0, 0.2, 0.3, -0.1))
    body = euler_top.with_parameters(I1=J[0], I2=J[1], I3=J[2])
    want, _ = rotations.free_rotation(J, 2.0, rates=(0.3, -0.2, 0.5), attitude=q)
    errors = [np.abs(end_of(body, LGVI, q, v, 2.0, n)[0] - want).max() for n in (100, 200)]
    assert errors[1] < 2e-5
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.nightly
def test_a_million_steps_keep_the_angular_momentum_in_space():
    q, v = rotations.start(rates=(0.4, 0.1, 0.9), attitude=(1.0, 0.2, -0.1, 0.3))
    path = orbits.march(euler_top, LGVI, q=q, v=v, dt=0.05, steps=1_000_000, every=1000)
    charges = np.array([path.momentum_map(group) for group in euler_top.symmetries[:3]])
    # What is marched does not change at all: these are the roundings of reading it from (q, p).
    assert np.abs(charges - charges[:, :1]).max() < 2e-15 * np.linalg.norm(charges[:, 0])
    q, v = spinning_top()
    path = orbits.march(heavy_top, LGVI, q=q, v=v, dt=0.05, steps=1_000_000, every=1000)
    vertical = path.momentum_map(heavy_top.symmetries[0])
    # The reach is 1e-13: the vertical torque is 0 but for rounding.
    assert np.abs(vertical / vertical[0] - 1).max() < 1e-14
    assert np.ptp(path.energy()[:500]) == pytest.approx(np.ptp(path.energy()[500:]), rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_ten_million_steps_leave_rotations(order):
    q, v = spinning_top()
    steps = 10_000_000 if order == 2 else 2_000_000  # of five
    path = orbits.march(heavy_top, composed(order), q=q, v=v, dt=0.05, steps=steps, every=steps // 100)
    R = rotations.matrices(path.q)
    assert np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max() < 2e-15
    # Nor does the length of the quaternion walk: two units in the last place.
    assert np.abs(np.linalg.norm(path.q, axis=1) - 1).max() < 5e-16
    vertical = path.momentum_map(heavy_top.symmetries[0])
    assert np.abs(vertical / vertical[0] - 1).max() < 1e-13


@pytest.mark.nightly
def test_a_length_of_the_quaternion_that_moves_is_followed_as_gauss_does():
    q, v = np.array([1.0, 0.2, -0.1, 0.3]), np.array([0.3, 0.2, 0.1, 0.4])
    found, _ = end_of(euler_top, LGVI, q, v, 3.0, 50)
    truth, _ = end_of(euler_top, orbits.Gauss(stages=8), q, v, 3.0, 100)
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(truth), rel=1e-14)


def test_the_map_does_not_depend_on_where_a_march_is_cut():
    q, v = spinning_top()
    path = orbits.march(heavy_top, composed(6), q=q, v=v, dt=0.05, steps=40)
    again, momentum = orbits.Flow(heavy_top, composed(6), 0.05).step(path.q[20], path.p[20], 20)
    # The low parts are dropped at the cut.
    assert np.abs(again - path.q[-1]).max() < 4e-15
    assert np.abs(momentum - path.p[-1]).max() < 4e-14


@pytest.mark.nightly
def test_a_torque_that_is_not_finite_ends_the_march_with_the_states_before():
    top = rigid_body((1.0, 1.0, 0.5), potential=lambda R: sympy.sqrt(R[2, 2] - sympy.Rational(1, 2)))
    q, v = rotations.start(rates=(1.0, 0.0, 0.0))
    with pytest.raises(SingularityError, match="no longer finite") as failure:
        orbits.march(top, LGVI, q=q, v=v, dt=0.1, steps=100)
    assert np.isfinite(failure.value.trajectory.q).all()
    assert np.isfinite(failure.value.trajectory.p).all()


def test_other_lagrangians_are_refused_and_methods_named_that_can():
    with pytest.raises(InputError, match=r"one of rigid bodies; 'kepler' is not\. Use .*Gauss"):
        orbits.march(orbits.lagrangians.kepler, LGVI, dt=0.1, steps=1)
    assert orbits.methods.Composition(LGVI, order=4).serves(heavy_top)
    assert not orbits.methods.Composition(LGVI, order=4).serves(orbits.lagrangians.kepler)
