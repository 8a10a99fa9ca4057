"""Rigid bodies in homogeneous quaternions: closed forms, what is conserved, which groups are found, refusals."""

import numpy as np
import pytest
import sympy

import orbits
from orbits import rotations
from orbits.errors import InputError
from orbits.lagrangians import euler_top, heavy_top, spin_orbit

from ..coverings import at

EPS = 2.0**-53
SPIN = (0.4, 0.0, 0.9)
"""Euler's top of the moments 1, 2, 3 from this spin, at t = 10, by Jacobi's elliptic functions in 30 digits."""

RATES_AT_10 = np.array([-0.3337316157383565, 0.2205067088699706, 0.8909502027504743])
MOMENTUM_AT_10 = np.array([-0.1222698036241977, 0.1615748147306903, 0.9792566948285027])
"""Direction of the angular momentum in the axes of the body."""


def test_eulers_top_follows_the_elliptic_functions_to_the_last_bits():
    q, v = rotations.start(SPIN)
    path = orbits.march(euler_top, orbits.Gauss(stages=8), q=q, v=v, dt=0.1, steps=100)
    assert np.abs(rotations.body_rates(path.q[-1], path.v[-1]) - RATES_AT_10).max() < 8 * EPS
    direction = np.array([1.0, 2.0, 3.0]) * SPIN
    seen = (direction / np.linalg.norm(direction)) @ rotations.matrices(path.q[-1])
    assert np.abs(seen - MOMENTUM_AT_10).max() < 8 * EPS


@pytest.mark.parametrize("stages", at((1, 3), [1, 2, 3, 4]))
def test_attitudes_converge_with_the_order_of_the_method(stages):
    q, v = rotations.start(SPIN)
    errors = []
    for count in ((200, 400), (100, 200), (50, 100), (25, 50))[stages - 1]:
        path = orbits.march(euler_top, orbits.Gauss(stages=stages), q=q, v=v, dt=10 / count, steps=count)
        errors.append(np.abs(rotations.body_rates(path.q[-1], path.v[-1]) - RATES_AT_10).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * stages, abs=0.25)


def test_a_heavy_top_keeps_both_angular_momenta_over_thousands_of_turns():
    q, v = rotations.start((0.1, 0.0, 5.0), attitude=(1.0, 0.2, 0.0, 0.0))
    path = orbits.march(heavy_top, orbits.Gauss(stages=4), q=q, v=v, dt=0.02, steps=20_000, every=100)
    for group in heavy_top.symmetries[:2]:
        charge = path.momentum_map(group)
        # One rounding in each step, that do not line up: 3e-15 was seen.
        assert np.abs(charge / charge[0] - 1).max() < 2e-14, group.name
    # Round-off leaves |q| a small velocity, which nothing brings back: 4e-12 was seen.
    assert np.abs(np.linalg.norm(path.q, axis=1) - 1).max() < 1e-11
    energy = path.energy()
    assert np.ptp(energy) < 1e-8 * abs(energy[0])


def test_the_map_of_a_top_is_that_of_the_same_formula_shipped():
    made = orbits.lagrangians.rigid_body((1.0, 1.0, 0.4), potential=lambda R: 1.5 * R[2, 2])
    q, v = np.array(heavy_top.example.q), np.array(heavy_top.example.v)
    shipped = heavy_top.with_parameters(I0=0.8)
    assert made.value(q, v) == pytest.approx(shipped.value(q, v), rel=8 * EPS)


def test_the_groups_of_a_body_are_those_that_leave_it_as_it_is():
    def names(L):
        return [group.name for group in L.symmetries]

    space = [f"rotation about {x}" for x in "xyz"]
    assert names(orbits.lagrangians.rigid_body((1, 2, 3))) == [*space, "length of q"]
    assert names(orbits.lagrangians.rigid_body((2, 1, 1))) == [*space, "rotation about axis 1", "length of q"]
    tilted = orbits.lagrangians.rigid_body((1, 1, 1), potential=lambda R: R[0, 1])
    assert names(tilted) == ["rotation about x", "rotation about axis 2", "length of q"]
    assert len(names(orbits.lagrangians.rigid_body((1, 1, 1)))) == 7
    assert names(orbits.lagrangians.rigid_body((1, 1, 2)).with_parameters(I1=1.5)) == [*space, "length of q"]


@pytest.mark.nightly
def test_two_bodies_keep_their_whole_angular_momentum_while_it_flows_from_orbit_to_spin():
    pair = orbits.lagrangians.full_two_body((1.0, 0.3), None, (0.02, 0.03, 0.04))
    q = np.array([1.5, 0.1, 0.2, *rotations.start((0, 0, 0), (1, 0.3, 0.1, 0.2))[0]])
    v = np.array([0.0, 0.9, 0.1, *rotations.start((0.2, 0.3, 1.0), (1, 0.3, 0.1, 0.2))[1]])
    path = orbits.march(pair, orbits.Gauss(stages=4), q=q, v=v, dt=0.02, steps=8000, every=80)
    charges = np.array([path.momentum_map(group) for group in pair.symmetries[:3]])
    size = np.linalg.norm(charges[:, 0])
    assert np.abs(charges - charges[:, :1]).max() < 5e-15 * size * 4  # 8,000 roundings; 7e-15 was seen
    spins = path.q[:, :3], path.v[:, :3]
    orbit = 0.3 / 1.3 * np.cross(*spins)
    assert np.linalg.norm(np.ptp(orbit, axis=0)) > 1e-3 * size


@pytest.mark.nightly
def test_a_figure_of_degree_two_turns_a_near_orbit_as_first_order_theory_says():
    """A flattened second body: its partner's node and pericentre move by J2; here the frequency of a circular orbit."""
    C, A, M, m = 2e-3, 1.9e-3, 1e-6, 1.0
    pair = orbits.lagrangians.full_two_body((M, m), None, (A, A, C))
    r = 1.0
    # n^2 = G (M + m) (1 + (3/2) J2 / r^2) / r^3, J2 = (C - A) / m, in the plane of the equator
    n = np.sqrt((M + m) * (1 + 1.5 * (C - A) / m))
    q, v = rotations.start((0.0, 0.0, 0.3))
    turn = 2 * np.pi / n
    path = orbits.march(
        pair, orbits.Gauss(stages=6), q=[r, 0, 0, *q], v=[0, r * n, 0, *v], dt=turn / 50, steps=50, every=50
    )
    assert np.abs(path.q[-1, :3] - [1, 0, 0]).max() < 1e-9


def test_the_spin_of_mercury_librates_as_its_orbit_forces_it_to():
    """38.4'' with the mean anomaly and -4.05'' with twice it: Margot (2009), for (B - A)/C = 2.18e-4."""
    e, a, count = 0.20563, 1.0, 400
    turns = 44  # three free periods and more, of 11.6 yr / 88 d each, are fitted with the forced terms
    L = spin_orbit.with_parameters(alpha=np.sqrt(3 * 2.18e-4))
    speed = np.sqrt((1 + e) / (1 - e))
    steps = turns * count
    path = orbits.march(
        L, orbits.Gauss(stages=4), q=[a * (1 - e), 0, 0], v=[0, speed, 1.5 + 2.36e-4], dt=2 * np.pi / count, steps=steps
    )
    t = path.t
    libration = (path.q[:, 2] - 1.5 * t) * 180 / np.pi * 3600
    free = 2 * np.pi / (11.62 * 365.25 / 87.969) / (2 * np.pi)
    columns = [np.sin(t), np.sin(2 * t), np.sin(3 * t), np.sin(free * t), np.cos(free * t), np.ones_like(t)]
    fit = np.linalg.lstsq(np.stack(columns, axis=1), libration, rcond=None)[0]
    assert fit[0] == pytest.approx(38.4, abs=0.5)
    assert fit[1] == pytest.approx(-4.05, abs=0.1)


@pytest.mark.parametrize(
    ("inertia", "words"),
    [
        ((1, 1, 3), "exceeds the sum of the others by 1"),
        ((1, 0, 1), "three principal moments of inertia > 0"),
        ((1, 1), "three principal moments"),
        ((1, np.nan, 1), "three principal moments"),
    ],
)
def test_moments_that_no_body_has_are_refused(inertia, words):
    with pytest.raises(InputError, match=words):
        orbits.lagrangians.rigid_body(inertia)
    with pytest.raises(InputError, match=words):
        orbits.lagrangians.full_two_body((1, 1), None, inertia)


@pytest.mark.parametrize(
    ("potential", "words"),
    [
        (lambda R: "a", "cannot be made into a formula"),  # which would be executed
        (lambda R: np.sin(R[2, 2]), "cannot be made into a formula .*with functions of SymPy"),
        (lambda R: R, "potential returns .*expected a function of the matrix R"),
        (3, "potential is 3; expected a function of the matrix R"),
        (lambda R: sympy.Symbol("a") * R[2, 2], "potential mentions a, by which the attitude .*other names than a, b"),
    ],
)
def test_what_is_no_potential_is_refused(potential, words):
    with pytest.raises(InputError, match=words):
        orbits.lagrangians.rigid_body((1, 1, 0.4), potential=potential)


def test_two_spheres_and_masses_that_are_none_are_refused():
    with pytest.raises(InputError, match="expected moments of inertia of one at least"):
        orbits.lagrangians.full_two_body((1, 1), None, None)
    with pytest.raises(InputError, match="masses is 1; expected two masses > 0"):
        orbits.lagrangians.full_two_body(1, None, (1, 1, 1))
    with pytest.raises(InputError, match="expected two masses > 0"):
        orbits.lagrangians.full_two_body((1, -1), None, (1, 1, 1))


def test_attitudes_and_matrices_are_the_same_rotations():
    rng = np.random.default_rng(2)
    q = rng.normal(size=(50, 4))
    R = rotations.matrices(q)
    assert np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max() < 16 * EPS  # sums of nine products
    assert np.allclose(rotations.matrices(rotations.product(q[0], q[1])), R[0] @ R[1], rtol=0, atol=8 * EPS)
    for one, matrix in zip(q, R, strict=True):
        again, _ = rotations.start((0, 0, 0), attitude=matrix)
        unit = one / np.linalg.norm(one)
        assert min(np.abs(again - unit).max(), np.abs(again + unit).max()) < 8 * EPS
    spin = rng.normal(size=3)
    assert np.allclose(rotations.body_rates(*rotations.start(spin, q[3])), spin, rtol=0, atol=8 * EPS)


@pytest.mark.parametrize(
    ("attitude", "words"),
    [
        (1.001 * np.eye(3), "differs from 1 by 0.002"),
        (-np.eye(3), "it is a reflection"),
        (np.zeros(4), "not 0"),
        (np.eye(2), "expected a quaternion"),
    ],
)
def test_what_is_no_rotation_is_refused_with_how_far_it_is_from_one(attitude, words):
    with pytest.raises(InputError, match=words):
        rotations.start((0, 0, 1), attitude)


@pytest.mark.parametrize("length", [1e-200, 1e200])
def test_quaternions_of_any_length_are_the_same_rotation(length):
    q, v = rotations.start((0.1, 0.2, 0.3), (1.0, 0.2, 0.3, 0.4))
    assert np.abs(rotations.matrices(length * q) - rotations.matrices(q)).max() < 4 * EPS
    assert np.abs(rotations.body_rates(length * q, length * v) - (0.1, 0.2, 0.3)).max() < 4 * EPS
    assert np.abs(rotations.start((0, 0, 0), length * q)[0] - q).max() < 4 * EPS


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: rotations.body_rates([0, 0, 0, 0], [0, 0, 0, 1]), "q has quaternions that are 0"),
        (lambda: rotations.matrices([np.inf, 0, 0, 0]), "or not finite"),
        (lambda: rotations.product(np.ones((2, 4)), np.ones((3, 4))), r"p has \(2,\) quaternions, and q \(3,\)"),
        (lambda: rotations.body_rates(np.ones((2, 4)), np.ones((3, 4))), r"q has \(2,\) quaternions, and v \(3,\)"),
        (lambda: rotations.matrices("none"), "q is 'none'; expected an array of real numbers"),
    ],
)
def test_what_are_no_quaternions_is_refused_in_words(ask, words):
    with pytest.raises(InputError, match=words):
        ask()


def test_the_formula_of_two_bodies_is_that_of_their_points_spins_and_figures(monkeypatch):
    """By numbers put into it: the equations, which SymPy derives in a minute, are nightly."""
    made = {}

    def noted(formula, *, q, v, parameters, **_):
        made.update(formula=formula, q=q, v=v, parameters=parameters)
        raise StopIteration

    monkeypatch.setattr("orbits.lagrangians.rigid_bodies.from_sympy", noted)
    masses, figures, G = (1.0, 0.3), ((0.5, 0.6, 0.7), (0.02, 0.03, 0.04)), 1.7
    with pytest.raises(StopIteration):
        orbits.lagrangians.full_two_body(masses, *figures, G=G)
    r, w = np.array([1.5, 0.4, -0.7]), np.array([0.2, 0.9, 0.1])
    rates, attitudes = ((0.3, 0.5, 1.7), (-0.4, 0.2, 1.1)), ((1, 0.2, -0.1, 0.3), (0.5, -0.2, 0.4, 0.1))
    starts = [rotations.start(*one) for one in zip(rates, attitudes, strict=True)]
    q, v = (np.concatenate([x, *(start[k] for start in starts)]) for k, x in enumerate((r, w)))
    numbers = {**made["parameters"], **dict(zip([*made["q"], *made["v"]], [*q, *v], strict=True))}
    distance, expected = np.linalg.norm(r), masses[0] * masses[1] / sum(masses) * (w @ w) / 2
    expected += G * masses[0] * masses[1] / distance
    for J, rate, (attitude, _), other in zip(figures, rates, starts, masses[::-1], strict=True):
        n = rotations.matrices(attitude).T @ r / distance
        expected += np.dot(J, np.square(rate)) / 2 + G * other / (2 * distance**3) * (sum(J) - 3 * np.dot(J, n * n))
    assert float(made["formula"].subs(numbers)) == pytest.approx(expected, rel=1e-14)
