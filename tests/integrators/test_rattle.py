"""RATTLE and its compositions: against the same motions in angles, and what they keep."""

import numpy as np
import pytest
import sympy

import orbits
from orbits.diagnostics.constrained_motion import motion
from orbits.errors import ConvergenceError, InputError
from orbits.lagrangians.constraints import constraint_values
from orbits.methods import Composition, Rattle

from ..coverings import first

SPHERE = orbits.lagrangians.pendulum_on_a_sphere
RODS = orbits.lagrangians.double_pendulum_on_rods
DUMBBELL = orbits.lagrangians.dumbbell
CONSTRAINED = [SPHERE, RODS, DUMBBELL]
RATTLE = Rattle()


def named(L):
    return L.name


def in_angles(theta, phi):
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)])


@pytest.fixture(scope="module")
def end_of_the_pendulum():
    """The example on the sphere after a time of 4, by Gauss in spherical angles."""
    (x, y, z), v = np.array(SPHERE.example.q), np.array(SPHERE.example.v)
    start = [np.arccos(-z), np.arctan2(y, x)], [v[2] / np.hypot(x, y), (x * v[1] - y * v[0]) / (x * x + y * y)]
    angles = orbits.lagrangians.spherical_pendulum
    return in_angles(*orbits.march(angles, orbits.Gauss(8), q=start[0], v=start[1], dt=0.05, steps=80).q[-1])


@pytest.mark.nightly
@pytest.mark.parametrize(("order", "steps"), first(1, [(2, (40, 160)), (4, (20, 80)), (6, (10, 40)), (8, (10, 20))]))
def test_the_pendulum_on_the_sphere_converges_to_the_motion_in_angles_at_the_declared_order(
    order, steps, end_of_the_pendulum
):
    method = RATTLE if order == 2 else Composition(RATTLE, order=order)
    errors = [
        np.abs(orbits.march(SPHERE, method, dt=4.0 / n, steps=n, every=n).q[-1] - end_of_the_pendulum).max()
        for n in steps
    ]
    measured = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    assert abs(measured - order) < 0.1  # 2.001, 4.004, 6.002, 7.974
    assert errors[1] > 1e-13  # above round-off


@pytest.mark.nightly
def test_the_double_pendulum_on_rods_is_that_in_angles():
    (x, y, x2, y2), (u, w, u2, w2) = RODS.example.q, RODS.example.v
    start = [np.arctan2(x, -y), np.arctan2(x2 - x, y - y2)]
    speeds = [
        (u * np.cos(start[0]) + w * np.sin(start[0])),
        ((u2 - u) * np.cos(start[1]) + (w2 - w) * np.sin(start[1])) / 0.75,
    ]
    angles = orbits.lagrangians.double_pendulum.with_parameters(l2=0.75)
    one, other = orbits.march(angles, orbits.Gauss(8), q=start, v=speeds, dt=0.05, steps=60).q[-1]
    end = orbits.march(RODS, Composition(RATTLE, order=8), dt=0.05, steps=60).q[-1]
    expected = [np.sin(one), -np.cos(one), np.sin(one) + 0.75 * np.sin(other), -np.cos(one) - 0.75 * np.cos(other)]
    assert np.abs(end - expected).max() < 1e-13  # 2e-15 was reached


@pytest.mark.nightly
def test_a_free_rod_turns_uniformly_about_its_centre_of_mass():
    free = DUMBBELL.with_parameters(GM=0.0, l=0.5, m1=3.0, m2=1.0)
    q, v = [1.0, 0.0, 0.0, 1.5, 0.0, 0.0], [0.1, 0.0, 0.0, 0.1, 0.4, 0.0]
    path = orbits.march(free, Composition(RATTLE, order=8), q=q, v=v, dt=0.1, steps=100)
    rod = path.q[:, 3:] - path.q[:, :3]
    angle = 0.8 * path.t  # the relative velocity 0.4 over the length 0.5
    expected = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    # The error of order 8 grows uniformly; rounding of the angle, a hundred times: 6e-15 was reached.
    assert np.abs(rod - expected).max() < 3e-14
    centre = (3.0 * path.q[:, :3] + path.q[:, 3:]) / 4.0
    assert np.abs(centre - (centre[0] + np.outer(path.t, [0.1, 0.1, 0.0]))).max() < 1e-14


@pytest.mark.parametrize("L", first(1, CONSTRAINED), ids=named)
@pytest.mark.parametrize("steps", [20_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_constraints_and_tangency_stay_at_round_off_and_momentum_maps_and_energy_stay(L, steps):
    path = orbits.march(L, RATTLE, dt=L.example.dt, steps=steps, every=steps // 1000)
    hidden = [np.abs(constraint_values(L, q)[1] @ v).max() for q, v in zip(path.q, path.v, strict=True)]
    assert np.abs(path.constraint_values()).max() < 1e-15  # 4e-16 was reached, also after a million steps
    assert max(hidden) < 2e-15  # 5e-16
    for symmetry in L.symmetries:
        # A random walk of a rounding a step: 1.5e-13 was reached in a million.
        assert np.ptp(path.momentum_map(symmetry)) < 2e-15 + 3e-16 * steps**0.5
    energy = path.energy()
    early, late = energy[:250], energy[-250:]
    assert abs(late.mean() - early.mean()) < 0.05 * np.ptp(energy)  # 0.01: bounded, no drift


@pytest.mark.parametrize("L", first(1, CONSTRAINED), ids=named)
def test_steps_forth_and_back_lead_to_the_start(L):
    q, p = np.array(L.example.q), L.momentum(L.example.q, L.example.v)
    for method in (RATTLE, Composition(RATTLE, order=4)):
        there = orbits.Flow(L, method, 0.05).step(q, p, 50)
        x, y = orbits.Flow(L, method, -0.05).step(*there, 50)
        # Low parts are dropped at the turn, and the chaos of the rods amplifies that: 3e-15 was reached.
        assert max(np.abs(x - q).max(), np.abs(y - p).max()) < 3e-14


@pytest.mark.parametrize("L", CONSTRAINED, ids=named)
def test_the_reference_motion_keeps_constraints_and_energy_without_knowing_them(L):
    q, v = np.array(L.example.q), np.array(L.example.v)
    moved, faster, _ = motion(L, q, v, 1.0, 10)
    assert np.abs(constraint_values(L, q + moved)[0]).max() < 1e-14
    assert abs(L.energy(q + moved, v + faster) - L.energy(q, v)) < 1e-14


def test_without_constraints_it_is_stormer_verlet_to_the_last_bit():
    kepler = orbits.lagrangians.kepler
    one, other = (orbits.march(kepler, method, dt=0.1, steps=100) for method in (RATTLE, orbits.StormerVerlet()))
    assert np.array_equal(one.q, other.q)
    assert np.array_equal(one.p, other.p)


def test_a_start_off_the_constraints_is_refused_with_its_distance_and_moved_onto_them_on_request():
    q, v = [0.0, 0.0, -1.01], [0.1, 0.0, 0.0]
    with pytest.raises(InputError, match=r"off the constraint x\^2.*0\.0201.*about 0\.00995 away.*onto_constr"):
        orbits.march(SPHERE, RATTLE, q=q, v=v, dt=0.1, steps=1)
    with pytest.raises(InputError, match=r"leads off the constraint.*speed 0\.06, 0\.6 of its own.*onto_constr"):
        orbits.march(SPHERE, RATTLE, q=[0.6, 0.0, -0.8], v=v, dt=0.1, steps=1)
    moved = orbits.lagrangians.onto_constraints(SPHERE, q, [0.1, 0.0, 0.3])
    assert np.array_equal(moved, [[0.0, 0.0, -1.0], [0.1, 0.0, 0.0]])
    with pytest.raises(InputError, match="it is -3 at q"):  # the example is on a sphere of radius 1
        orbits.march(SPHERE.with_parameters(l=2.0), RATTLE, dt=0.1, steps=1)
    orbits.march(SPHERE, RATTLE, q=moved[0], v=moved[1], dt=0.1, steps=1)


def test_a_march_goes_on_from_every_state_of_another_also_where_the_pendulum_turns():
    """There velocities are of the size of rounding errors, and have no direction."""
    flow = orbits.Flow(SPHERE, RATTLE, 0.1)
    path = flow.march([0.6, 0.0, -0.8], [0.0, 0.0, 0.0], 200)
    there_and_back = flow.march(*orbits.Flow(SPHERE, RATTLE, -0.1).step(path.q[70], path.p[70], 70), 1)
    assert np.abs(there_and_back.p[0]).max() < 1e-14
    for q, p in zip(path.q, path.p, strict=True):
        flow.step(q, p)


def test_moving_onto_the_constraints_keeps_the_momenta_of_their_symmetries():
    q, v = [1.0, 0.1, 0.0, 1.2, 0.3, 0.1], [0.0, 1.0, 0.1, 0.2, 0.9, 0.3]
    x, w = orbits.lagrangians.onto_constraints(DUMBBELL, q, v)
    p = DUMBBELL.momentum(q, v)
    assert np.abs(constraint_values(DUMBBELL, x)[0]).max() < 1e-16
    change = DUMBBELL.momentum(x, w) - p
    assert np.abs(change[:3] + change[3:]).max() < 1e-15  # of the centre of mass


@pytest.mark.parametrize("dt", [1.5, 3.0, 50.0])
def test_a_step_with_no_way_back_to_the_constraints_is_refused_and_not_taken_to_the_far_side(dt):
    with pytest.raises(ConvergenceError, match=r"no multipliers bring it back.*Use a smaller dt") as caught:
        orbits.march(SPHERE, RATTLE, dt=dt, steps=10)
    path = caught.value.trajectory
    assert np.abs(path.constraint_values()).max() < 1e-15
    assert np.all(np.sum(path.q[1:] * path.q[:-1], axis=1) > 0.0)


def with_constraints(constraints, L=None):
    x, y, z, vx, vy, vz, k = sympy.symbols("x y z vx vy vz k")
    given = constraints(x, y, z, vx, k) if callable(constraints) else constraints
    kinetic = (vx**2 + vy**2 + vz**2) / 2 - z
    more = {"q": [x, y, z], "v": [vx, vy, vz], "parameters": {k: 1.0}, "name": "bead"}
    return orbits.Lagrangian.from_sympy(kinetic + (0 if L is None else L(x, vy)), constraints=given, **more)


def test_constraints_that_follow_from_others_are_refused_at_the_start():
    twice = with_constraints(lambda x, y, z, vx, k: [x**2 + z**2 - k, sympy.Eq(2 * (x**2 + z**2), 2 * k)])
    with pytest.raises(InputError, match=r"are dependent at q.*has no inverse.*Leave out those that follow"):
        orbits.march(twice, RATTLE, q=[0.6, 0.0, -0.8], v=[0.0, 1.0, 0.0], dt=0.1, steps=1)


@pytest.mark.nightly
def test_a_march_to_where_constraints_are_dependent_is_refused_there():
    cone = with_constraints(lambda x, y, z, vx, k: [x**2 + y**2 - z**2])
    with pytest.raises(ConvergenceError, match=r"to where they are dependent.*avoid this configuration"):
        orbits.march(cone, RATTLE, q=[0.05, 0.0, 0.05], v=[-0.5, 0.0, -0.5], dt=0.1, steps=1)


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        (lambda x, y, z, vx, k: [x * vx], "depends on vx"),
        (lambda x, y, z, vx, k: [k - 1], "depends on no coordinate"),
        (lambda x, y, z, vx, k: [x - sympy.Symbol("w")], r"the constraint .* mentions w"),
        (lambda x, y, z, vx, k: [x, y, z], "leave nothing free to move"),
        (lambda x, y, z, vx, k: [abs(x) - k], "must be twice differentiable"),
        (lambda x, y, z, vx, k: ["x - 1"], "is no SymPy expression"),
        ("x - 1", "must be a list of SymPy expressions"),
    ],
)
def test_what_is_no_holonomic_constraint_is_refused(constraints, message):
    with pytest.raises(InputError, match=message):
        _ = with_constraints(constraints).traits


def test_constraints_need_a_separable_lagrangian():
    with pytest.raises(InputError, match=r"is not separable.*Cartesian coordinates"):
        _ = with_constraints(lambda x, y, z, vx, k: [x**2 + y**2 - k], L=lambda x, vy: x * vy).traits


def test_other_methods_and_transformed_time_refuse_constraints_instead_of_forgetting_them():
    for method in (orbits.Gauss(stages=2), orbits.StormerVerlet(), Composition(order=4)):
        with pytest.raises(InputError, match=r"does not keep constraints.*Use orbits\.methods\.Rattle\(\)"):
            orbits.march(SPHERE, method, dt=0.1, steps=1)
    with pytest.raises(InputError, match="has constraints, which are not kept in transformed time"):
        orbits.lagrangians.time_transformed(SPHERE, monitor=sympy.Symbol("x") ** 2)
