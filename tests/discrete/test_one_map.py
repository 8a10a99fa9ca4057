"""Two discrete Lagrangians that share their equations on Q x Q may be two maps of phase space: momenta tell."""

from itertools import pairwise

import numpy as np
import pytest

import orbits
from orbits import discrete
from orbits.certificate.measuring import Problem
from orbits.errors import InputError
from orbits.lagrangians.newtonian import n_body

from .mechanics import Central, Magnetic, Pendulum

H = 0.1


@pytest.mark.parametrize("L", [Pendulum(), Central(dimension=3)], ids=lambda L: L.name)
def test_trapezoidal_and_both_symplectic_eulers_share_their_equations_and_are_three_maps(L):
    """They differ by f(q1) - f(q0), f = -+ h V/2: the same paths of positions, momenta apart by grad f."""
    trapezoidal = discrete.trapezoidal(L)
    path = discrete.march_pairs(trapezoidal, L.q, L.q + H * L.v, H, 20)
    p = np.array([discrete.legendre_minus(trapezoidal, *pair, H)[1] for pair in pairwise(path)])
    p = np.vstack([p, discrete.legendre_plus(trapezoidal, *path[-2:], H)[1]])
    rest = np.zeros(L.dimension)
    kick = np.array([0.5 * H * L.gradients(q, rest)[0] for q in path])
    for L_d, moved in (
        (trapezoidal, 0.0),
        (discrete.symplectic_euler_a(L), kick),
        (discrete.symplectic_euler_b(L), -kick),
    ):
        # Positions of order 1 are rounded and divided by h, 2^-53/h: 1.1e-15 was reached.
        assert np.abs(discrete.euler_lagrange_residual(L_d, path, H)).max() < 6e-15
        assert np.abs(discrete.momentum_residual(L_d, path, p + moved, H)).max() < 6e-15
        if L_d is not trapezoidal:
            assert np.abs(discrete.momentum_residual(L_d, path, p, H)).max() > 1e-2  # h |grad V|/2


@pytest.mark.nightly
def test_the_certificate_finds_the_momenta_of_an_equivalent_discrete_lagrangian():
    """A path of Störmer–Verlet with momenta of symplectic Euler: its DEL residual is round-off, it is another map."""
    L = orbits.lagrangians.pendulum
    problem = Problem(L, orbits.StormerVerlet(), H, np.array([1.0]), np.array([0.5]), 0.0)
    kicked = np.array([[0.5 * H * np.sin(1.0)]])
    other = orbits.march(L, orbits.methods.SymplecticEuler(), q=[1.0], p=[0.5 + kicked[0, 0]], dt=H, steps=40)
    own = problem.path
    assert problem.euler_lagrange().holds
    assert problem.legendre_transforms().holds
    assert np.abs(own.q[:41] - other.q).max() < 1e-14  # the same positions
    problem.__dict__["path"] = other
    assert problem.euler_lagrange().holds
    assert not problem.legendre_transforms().holds
    found = orbits.certify(L, orbits.methods.SymplecticEuler(), H)["momenta of L_d"]
    assert found.holds
    assert found.measured < found.bound


@pytest.mark.parametrize(
    ("method", "rule"),
    [
        (orbits.StormerVerlet(), discrete.trapezoidal),
        (orbits.methods.LobattoIIIAB(stages=2), discrete.trapezoidal),
        (orbits.Gauss(stages=1), discrete.midpoint),
        (orbits.methods.SymplecticEuler("kick-drift"), discrete.symplectic_euler_b),
        (orbits.methods.SymplecticEuler("drift-kick"), discrete.symplectic_euler_a),
    ],
    ids=lambda x: getattr(x, "label", ""),
)
def test_a_method_is_the_map_of_its_discrete_lagrangian_momenta_included(method, rule):
    L = n_body([1.0, 0.1])
    q = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.2]])
    path = orbits.march(L, method, q=q, v=[[0.0, -0.1, 0.0], [0.1, 1.0, 0.0]], dt=H, steps=20)
    shape = (-1, 2, 3)
    residual = discrete.momentum_residual(rule(L), path.q.reshape(shape), path.p.reshape(shape), H)
    assert residual.shape == (20, 2, 2, 3)
    assert np.abs(residual).max() < 2e-15  # 2^-53 |q|/h, and GM = 0.1 of the body that moves: 1.8e-16 was reached
    for other in (discrete.trapezoidal, discrete.midpoint, discrete.symplectic_euler_a, discrete.symplectic_euler_b):
        if other is not rule:
            missed = discrete.momentum_residual(other(L), path.q, path.p, H)
            assert np.abs(missed).max() > 1e-6


def test_both_symplectic_eulers_of_a_lagrangian_that_is_not_separable_have_different_equations():
    L = Magnetic()
    a, b = discrete.symplectic_euler_a(L), discrete.symplectic_euler_b(L)
    path = discrete.march_pairs(a, L.q, L.q + H * L.v, H, 10)
    assert np.abs(discrete.euler_lagrange_residual(a, path, H)).max() < 1e-14
    assert np.abs(discrete.euler_lagrange_residual(b, path, H)).max() > 1e-3


def test_momenta_of_another_shape_are_refused():
    path = np.zeros((4, 2))
    with pytest.raises(InputError, match="path and momenta must have one shape"):
        discrete.momentum_residual(discrete.midpoint(Magnetic()), path, path[:-1], H)
