"""Discrete Lagrangians with constraints: the trapezoidal one is that of RATTLE, in positions and momenta."""

import numpy as np
import pytest

import orbits
from orbits import discrete
from orbits.errors import InputError
from orbits.lagrangians import onto_constraints
from orbits.methods import Rattle

from ..coverings import at

LAGRANGIANS = [
    orbits.lagrangians.pendulum_on_a_sphere,
    orbits.lagrangians.double_pendulum_on_rods,
    orbits.lagrangians.dumbbell,
]


def largest(x):
    return float(np.max(np.abs(x)))


@pytest.fixture(params=at((0, 2), LAGRANGIANS), ids=lambda L: L.name)
def marched(request):
    L = request.param
    path = orbits.march(L, Rattle(), dt=L.example.dt, steps=30)
    return L, discrete.constrained(discrete.trapezoidal(L)), path, L.example.dt


@pytest.mark.nightly
def test_rattle_solves_the_equations_with_multipliers_and_has_the_momenta_of_its_discrete_lagrangian(marched):
    _, L_d, path, h = marched
    assert largest(discrete.euler_lagrange_residual(L_d, path.q, h)) < 1e-14  # 3.4e-15: |q| / h roundings
    assert largest(discrete.momentum_residual(L_d, path.q, path.p, h)) < 1e-14  # 2.3e-15
    assert largest(discrete.march_pairs(L_d, path.q[0], path.q[1], h, 20) - path.q[:22]) < 1e-14


def test_the_path_of_another_rule_is_told_from_it():
    L = orbits.lagrangians.dumbbell  # forces that are not linear: under uniform gravity both rules are one
    path = orbits.march(L, Rattle(), dt=0.05, steps=20)
    midpoint = discrete.constrained(discrete.midpoint(L))
    assert largest(discrete.euler_lagrange_residual(midpoint, path.q, 0.05)) > 1e-5


def test_both_legendre_transforms_lead_to_the_same_map(marched):
    _, L_d, path, h = marched
    q, p = path.q, path.p
    assert largest(discrete.legendre_minus(L_d, q[3], q[4], h)[1] - p[3]) < 1e-14
    assert largest(discrete.legendre_plus(L_d, q[2], q[3], h)[1] - p[3]) < 1e-14
    for sign in ("minus", "plus"):
        x, y = discrete.phase_map(L_d, q[3], p[3], h, sign=sign)
        assert max(largest(x - q[4]), largest(y - p[4])) < 1e-14


def test_the_two_form_is_preserved_for_vectors_tangent_to_the_constraints(marched):
    L, L_d, path, h = marched
    q, p, d = path.q, path.p, L.dimension
    J, M, B = discrete.canonical_form(d), discrete.phase_derivative(L_d, q[3], q[4], h), L_d.tangents(q[3], p[3])
    assert B.shape == (2 * d, 2 * (d - len(L.constraints)))
    assert abs(np.linalg.det(B.T @ J @ B)) > 0.1  # the form is not degenerate there
    assert largest((M @ B).T @ J @ (M @ B) - B.T @ J @ B) < 3e-15  # 5.6e-16
    after = L_d.tangents(q[4], p[4])
    assert largest(M @ B - after @ (after.T @ (M @ B))) < 1e-14  # tangent vectors stay tangent
    X = np.kron(np.diag([1.0, 0.0]), L_d.tangents(q[3])) + np.kron(np.diag([0.0, 1.0]), L_d.tangents(q[4]))
    omega, F = discrete.two_form(L_d, q[3], q[4], h), discrete.pair_derivative(L_d, q[3], q[4], q[5], h)
    later = discrete.two_form(L_d, q[4], q[5], h)
    assert largest((F @ X).T @ later @ (F @ X) - X.T @ omega @ X) < 5e-14 / h * h**0.5  # 9e-15, of 1/h
    for sign in ("minus", "plus"):
        assert largest(X.T @ (discrete.pull_back(L_d, q[3], q[4], h, sign=sign) - omega) @ X) < 1e-14


def test_the_exact_derivative_is_that_of_the_compiled_step(marched):
    """By differences along the constraints, with an error of delta^2."""
    L, L_d, path, h = marched
    q, p, d, delta = path.q[3], path.p[3], L.dimension, 1e-5
    flow, mass = orbits.Flow(L, Rattle(), h), L.hessians(path.q[3], path.v[3])[2]

    def moved(vector, size):
        x, w = onto_constraints(L, q + size * vector[:d], np.linalg.solve(mass, p + size * vector[d:]))
        return np.concatenate(flow.step(x, mass @ w))

    M = discrete.phase_derivative(L_d, q, path.q[4], h)
    for vector in L_d.tangents(q, p).T:
        slope = (moved(vector, delta) - moved(vector, -delta)) / (2 * delta)
        assert largest(slope - M @ vector) < 3e-9  # 3e-10


def test_the_momentum_maps_of_symmetries_of_the_constraints_are_conserved_by_noethers_theorem():
    L = orbits.lagrangians.dumbbell
    L_d, path = discrete.constrained(discrete.trapezoidal(L)), orbits.march(L, Rattle(), dt=0.05, steps=30)
    for symmetry in L.symmetries:
        assert abs(discrete.invariance(L_d, symmetry, path.q[0], path.q[1], 0.05, s=0.7)) < 1e-15
        drift = discrete.drift(L_d, symmetry, path.q, path.p, 0.05)
        assert largest(drift.broken) < 3e-15
        assert largest(drift.solver) == 0.0
    across = orbits.lagrangians.rotation([1.0, 0.0, 0.0])
    sphere = orbits.lagrangians.pendulum_on_a_sphere  # gravity is no symmetry of it
    L_d = discrete.constrained(discrete.trapezoidal(sphere))
    path = orbits.march(sphere, Rattle(), dt=0.1, steps=30)
    assert largest(discrete.drift(L_d, across, path.q, path.p, 0.1).broken) > 1e-2


def test_what_a_discrete_lagrangian_without_multipliers_cannot_know_is_refused():
    L = orbits.lagrangians.pendulum_on_a_sphere
    plain, path = discrete.trapezoidal(L), orbits.march(L, Rattle(), dt=0.1, steps=5)
    for function, arguments in (
        (discrete.euler_lagrange_residual, (path.q, 0.1)),
        (discrete.momentum_residual, (path.q, path.p, 0.1)),
        (discrete.step, (path.q[0], path.p[0], 0.1)),
        (discrete.inverse_legendre_plus, (path.q[1], path.p[1], 0.1)),
        (discrete.boundary_value, (path.q[0], path.q[5], 0.1, 5)),
    ):
        with pytest.raises(InputError, match=r"does not know the constraints.*Use discrete\.constrained\(L_d\)"):
            function(plain, *arguments)
    with pytest.raises(InputError, match="boundary values with constraints are not solved"):
        discrete.boundary_value(discrete.constrained(plain), path.q[0], path.q[5], 0.1, 5)
    with pytest.raises(InputError, match="'pendulum' has no constraints"):
        discrete.constrained(discrete.trapezoidal(orbits.lagrangians.pendulum))
    with pytest.raises(InputError, match="expected a discrete Lagrangian without constraints"):
        discrete.constrained(L)
