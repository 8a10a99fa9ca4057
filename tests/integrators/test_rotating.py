"""Kick – exact rotation – kick: exact without a potential, its order with one, no limit to the angle of a step."""

import mpmath
import numpy as np
import pytest

import orbits
from orbits import rotations
from orbits.diagnostics.free_top import free_top
from orbits.errors import SingularityError
from orbits.lagrangians import euler_top, full_two_body, heavy_top, rigid_body
from orbits.methods import Composition

from ..coverings import first
from ..kernels.rotors import drawn

VERLET = orbits.StormerVerlet()
METHODS = [
    (VERLET, 2, (40, 80)),
    (Composition(order=4), 4, (20, 40)),
    (Composition(order=4, scheme="suzuki"), 4, (20, 40)),
    (Composition(order=6), 6, (10, 20)),
    (Composition(order=8), 8, (8, 12)),
]


def spinning_top():
    return rotations.start(rates=(0.1, 0.0, 5.0), attitude=(1.0, 0.2, 0.0, 0.0))


def end_of(lagrangian, method, q, v, time, steps):
    path = orbits.march(lagrangian, method, q=q, v=v, dt=time / steps, steps=steps, every=steps)
    return path.q[-1], path.p[-1]


@pytest.mark.parametrize(("method", "order", "counts"), first(1, METHODS), ids=lambda x: getattr(x, "label", None))
def test_a_top_in_gravity_converges_with_the_order_of_the_composition(method, order, counts):
    q, v = spinning_top()
    truth, _ = end_of(heavy_top, orbits.Gauss(stages=8), q, v, 2.0, 100)
    errors = [np.abs(end_of(heavy_top, method, q, v, 2.0, n)[0] - truth).max() for n in counts]
    measured = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    assert measured == pytest.approx(order, abs=0.2)


@pytest.mark.nightly
def test_two_bodies_converge_and_keep_their_whole_angular_momentum():
    pair = full_two_body((1.0, 0.3), None, (0.02, 0.03, 0.04))
    q = np.array([1.5, 0.1, 0.2, *rotations.start((0, 0, 0), (1, 0.3, 0.1, 0.2))[0]])
    v = np.array([0.0, 0.9, 0.1, *rotations.start((0.2, 0.3, 1.0), (1, 0.3, 0.1, 0.2))[1]])
    truth, _ = end_of(pair, orbits.Gauss(stages=8), q, v, 4.0, 200)
    errors = [np.abs(end_of(pair, Composition(order=4), q, v, 4.0, n)[0] - truth).max() for n in (50, 100)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
    path = orbits.march(pair, VERLET, q=q, v=v, dt=0.02, steps=10_000, every=100)
    charges = np.array([path.momentum_map(group) for group in pair.symmetries[:3]])
    # 10,000 kicks of orbit and spin, each rounded: the reach is 5e-15; 2.6e-15 was seen.
    assert np.abs(charges - charges[:, :1]).max() < 5e-15 * np.linalg.norm(charges[:, 0])


@pytest.mark.nightly
def test_steps_of_many_radians_follow_a_free_body_exactly():
    rates = (0.4, 0.1, 0.9)
    q, v = rotations.start(rates)
    for dt in (0.03, 7.0, -40.0):
        path = orbits.march(euler_top, VERLET, q=q, v=v, dt=dt, steps=10)
        want, turning = rotations.free_rotation((1, 2, 3), path.t, rates=rates)
        angle = max(10 * abs(dt), 1.0)
        assert np.abs(path.q - want).max() < 2e-16 * angle + 1e-15
        assert np.abs(rotations.body_rates(path.q, path.v) - turning).max() < 2e-16 * angle + 1e-15


@pytest.mark.nightly
def test_a_hundred_thousand_revolutions_in_steps_keep_ten_digits():
    """Rounding leaves no walk of the energy, which would be a phase of 1e-7 radians."""
    (inertia,), (q,), (momentum,) = drawn(1, seed=4)
    rates = momentum / inertia
    top = euler_top.with_parameters(I1=inertia[0], I2=inertia[1], I3=inertia[2])
    q, v = rotations.start(rates, q)
    # The momentum that is marched, to the last bit.
    momentum = 2.0 * np.array(rotations.product(q * [1, -1, -1, -1], top.momentum(q, v)))[1:] / 4.0
    steps = 600_000
    dt = 2e5 * np.pi / np.linalg.norm(rates) / steps
    path = orbits.march(top, VERLET, q=q, v=v, dt=dt, steps=steps, every=steps)
    attitude, _ = free_top(inertia, q, momentum, mpmath.mpf(dt) * steps)
    R = rotations.matrices(path.q[-1])
    # The angle of 6e5 radians is rounded by up to 7e-11, and so are the moments: 1.2e-10 was seen, 1e-7 with the walk.
    assert max(abs(float(attitude[i, j] - mpmath.mpf(R[i, j]))) for i in range(3) for j in range(3)) < 3e-10
    assert np.abs(R.T @ R - np.eye(3)).max() < 2e-15


def test_both_angular_momenta_of_a_top_in_gravity_keep_their_last_digits():
    q, v = spinning_top()
    path = orbits.march(heavy_top, Composition(order=4), q=q, v=v, dt=0.02, steps=20_000, every=100)
    for group in heavy_top.symmetries[:2]:
        charge = path.momentum_map(group)
        # Rounding of the torques: 5e-15 was seen.
        assert np.abs(charge / charge[0] - 1).max() < 2e-14, group.name
    assert np.abs(np.linalg.norm(path.q, axis=1) - 1).max() < 5e-16  # two units in the last place
    assert np.ptp(path.energy()) < 1e-8 * abs(path.energy()[0])


@pytest.mark.nightly
def test_a_length_of_the_quaternion_that_moves_is_followed_as_gauss_does():
    q, v = np.array([1.0, 0.2, -0.1, 0.3]), np.array([0.3, 0.2, 0.1, 0.4])
    exact, momentum = end_of(euler_top, VERLET, q, v, 3.0, 4)
    truth, wanted = end_of(euler_top, orbits.Gauss(stages=8), q, v, 3.0, 100)
    assert np.abs(exact - truth).max() < 1e-14 * np.abs(truth).max()
    assert np.abs(momentum - wanted).max() < 1e-14 * np.abs(wanted).max()


def test_the_map_does_not_depend_on_where_a_march_is_cut():
    q, v = spinning_top()
    method = Composition(order=6)
    path = orbits.march(heavy_top, method, q=q, v=v, dt=0.05, steps=40)
    flow = orbits.Flow(heavy_top, method, 0.05)
    again, momentum = flow.step(path.q[20], path.p[20], 20)
    # The low parts are dropped at the cut.
    assert np.abs(again - path.q[-1]).max() < 4e-15
    assert np.abs(momentum - path.p[-1]).max() < 4e-14


@pytest.mark.nightly
def test_a_torque_that_is_not_finite_ends_the_march_with_the_step_and_the_state():
    import sympy

    top = rigid_body((1.0, 1.0, 0.5), potential=lambda R: sympy.sqrt(R[2, 2] - sympy.Rational(1, 2)))
    q, v = rotations.start(rates=(1.0, 0.0, 0.0))
    with pytest.raises(SingularityError, match=r"step 10 .*no longer finite") as failure:
        orbits.march(top, VERLET, q=q, v=v, dt=0.1, steps=100)
    assert np.isfinite(failure.value.trajectory.q).all()
