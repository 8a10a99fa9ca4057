"""Marching on Q x Q and in phase space, starting from velocities, and the discrete boundary-value problem."""

import numpy as np
import pytest

from orbits import discrete
from orbits.errors import ConvergenceError, InputError
from orbits.lagrangians.newtonian import n_body
from orbits.tableaux.gauss import gauss

from ..coverings import cover
from .mechanics import Bratu, Central, Degenerate, Driven, Magnetic, Oscillator, Pendulum, rules, systems


@cover(("rule", "system"), [name for name in rules() if name != "exact_by_collocation"], systems(), strength=1)
def test_pairs_and_positions_with_momenta_march_alike(rule, system):
    L = systems()[system]
    L_d, h, t = rules()[rule](L), L.h, 0.3
    q0, q1 = discrete.start(L_d, L.q, L.v, h, t)
    p0 = L.momentum(L.q, L.v, t)
    assert np.abs(discrete.legendre_minus(L_d, q0, q1, h, t)[1] - p0).max() < 4e-15  # 2^-53 |q|/h; 4.4e-16 was reached
    x, p = discrete.step(L_d, L.q, p0, h, t)
    again, q2 = discrete.advance(L_d, q0, q1, h, t)
    y, _ = discrete.step(L_d, x, p, h, t + h)
    assert np.array_equal(again, q1)
    assert np.abs(x - q1).max() < 1e-15
    assert np.abs(y - q2).max() < 1e-15  # 2.2e-16 was reached
    path = discrete.march_pairs(L_d, q0, q1, h, 1, t)
    assert np.abs(path - [q0, q1, q2]).max() < 1e-15


def test_störmer_verlet_is_the_trapezoidal_rule_in_phase_space():
    L, h = Central(), 0.1
    q, p = L.q, L.v
    for _ in range(20):
        x, y = discrete.step(discrete.trapezoidal(L), q, p, h)
        p = p + h / 2 * L.gradients(q, p)[0]
        q = q + h * p
        p = p + h / 2 * L.gradients(q, p)[0]
        # Momenta come from q1 - q0 over h: 2^-53 |q|/h.
        assert np.abs(x - q).max() < 5e-16
        assert np.abs(y - p).max() < 4e-15  # 5.6e-16 was reached
        q, p = x, y


def test_bodies_in_space_march_in_their_own_shape():
    L_d = discrete.trapezoidal(n_body([1.0, 0.1]))
    q0 = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1]])
    path = discrete.march_pairs(L_d, q0, q0 + 0.01, 0.1, 3)
    assert path.shape == (5, 2, 3)
    assert np.abs(discrete.euler_lagrange_residual(L_d, path, 0.1)).max() < 1e-15
    found = discrete.boundary_value(L_d, path[0], path[-1], 0.1, 4)
    assert np.abs(found - path).max() < 2e-15


BOUNDED = {L.name: L for L in (Pendulum(), Driven(), Magnetic(), Oscillator())}


@cover(("rule", "name"), ["symplectic_euler_a", "trapezoidal", "midpoint", "vprk Gauss(2)"], BOUNDED, strength=1)
def test_the_boundary_value_problem_gives_back_a_marched_path(rule, name):
    L = BOUNDED[name]
    L_d, h, t = rules()[rule](L), L.h / 2, 0.3
    path = discrete.march_pairs(L_d, *discrete.start(L_d, L.q, L.v, h, t), h, 8, t)
    found = discrete.boundary_value(L_d, path[0], path[-1], h, len(path) - 1, guess=path + 0.05, t0=t)
    assert np.array_equal(found[[0, -1]], path[[0, -1]])
    assert np.abs(found - path).max() < 1e-14  # 1.1e-15 was reached
    # From the straight line: in the magnetic field another solution, which is as stationary.
    straight = discrete.boundary_value(L_d, path[0], path[-1], h, len(path) - 1, t0=t)
    residual = discrete.euler_lagrange_residual(L_d, straight, h, t)
    assert np.abs(residual).max() < 8 * 2.0**-53 / h  # 4.7 of these were reached
    assert (np.abs(straight - path).max() < 1e-14) == (L.name != "a particle in a magnetic field")


def test_for_kepler_it_is_lamberts_problem():
    L, h, steps = Central(name="kepler"), 0.25, 8
    exact = discrete.exact(L)
    path = discrete.march_pairs(exact, *discrete.start(exact, L.q, L.v, h), h, steps - 1)
    near = path + 0.01 * np.sin(np.arange(steps + 1))[:, None]
    found = discrete.boundary_value(exact, path[0], path[-1], h, steps, guess=near)
    assert np.abs(found - path).max() < 2e-15
    # One arc in 8 steps and in one: the same momenta at both ends.
    one = exact.first(path[0], path[-1], steps * h)
    assert np.abs(exact.d1(found[0], found[1], h) - one[1]).max() < 4e-15
    assert np.abs(exact.d2(found[-2], found[-1], h) - one[2]).max() < 4e-15
    assert abs(discrete.action(exact, found, h) - one[0]) < 4e-15  # 4.7e-16 was reached in these
    # Eight stages are at round-off too; two converge to it with their order.
    by_gauss = discrete.boundary_value(discrete.vprk(L, gauss(8)), path[0], path[-1], h, steps, guess=near)
    assert np.abs(by_gauss - path).max() < 2e-15
    errors = []
    for n in (8, 16):
        fine = discrete.march_pairs(exact, *discrete.start(exact, L.q, L.v, 2 / n), 2 / n, n - 1)
        found = discrete.boundary_value(discrete.trapezoidal(L), fine[0], fine[-1], 2 / n, n, guess=fine)
        errors.append(np.abs(found - fine).max())
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_long_paths_are_solved_block_by_block_to_the_same_floor(monkeypatch):
    L = Magnetic()
    L_d, h = discrete.midpoint(L), 0.02
    path = discrete.march_pairs(L_d, *discrete.start(L_d, L.q, L.v, h), h, 38)
    whole = discrete.boundary_value(L_d, path[0], path[-1], h, 39)
    monkeypatch.setattr("orbits.discrete.boundary.DENSE_UP_TO", 0)
    blocks = discrete.boundary_value(L_d, path[0], path[-1], h, 39)
    assert np.abs(whole - path).max() < 3e-14  # 2^-53 times the conditioning of forty steps: 4.7e-15 was reached
    assert np.abs(blocks - path).max() < 3e-14


def test_a_guess_from_which_newton_fails_is_an_error_with_the_state_and_the_remedy():
    L = Central()
    with pytest.raises(ConvergenceError, match=r"no path with stationary action.*better guess"):
        discrete.boundary_value(discrete.trapezoidal(L), [1.0, 0.0], [-1.0, 0.0], 0.5, 6)
    with pytest.raises(ConvergenceError, match=r"midpoint: step from q = .*h = 1:.*smaller h") as caught:
        discrete.step(discrete.midpoint(L), [1.0, 0.0], [0.0, 1.0], 1.0)  # r^3 - 1.118 r^2 + 0.25 has no root
    assert "residual" in str(caught.value)
    bratu = discrete.exact_by_collocation(Bratu())
    assert abs(bratu.value([0.0], [0.0], 1.87) + 2.3794898) < 1e-6  # there is a motion, though hardly
    with (
        np.errstate(over="ignore", invalid="ignore"),
        pytest.raises(ConvergenceError, match="does not converge from the straight line"),
    ):
        bratu.value([0.0], [0.0], 2.2)


def test_small_masses_are_not_degenerate_but_nearly_dependent_momenta_are():
    L_d, h = discrete.midpoint(n_body([1.0, 1e-16])), 0.1
    q, v = np.array([0.0, 0.0, 0.0, 1.0, 0.1, 0.2]), np.array([0.0, 0.0, 0.0, 0.1, 1.0, 0.0])
    p = np.array([1.0, 1.0, 1.0, 1e-16, 1e-16, 1e-16]) * v
    q1, _ = discrete.step(L_d, q, p, h, guess=q + h * v)
    assert np.abs((q1 - q)[3:] - h * v[3:]).max() < 0.01
    L = Oscillator()
    L.mass = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-15]])
    with pytest.raises(InputError, match=r"degenerate.*D1D2"):
        discrete.require_regular(discrete.trapezoidal(L), L.q, L.q + 0.1, 0.1)


def test_a_march_that_fails_says_at_which_step():
    L_d = discrete.exact(Central(name="kepler"))
    q0, q1 = np.array([1.0, 0.0]), np.array([0.9, 1e-4])  # a fall into the centre
    with pytest.raises((ConvergenceError, InputError)) as caught:
        discrete.march_pairs(L_d, q0, q1, 0.1, 40)
    assert "nan" not in str(caught.value)


def test_what_is_no_step_is_refused():
    L_d = discrete.midpoint(Pendulum())
    for h in (0.0, np.nan, np.inf, "0.1", [0.1]):
        with pytest.raises(InputError, match="h must"):
            L_d.value([0.1], [0.2], h)
        with pytest.raises(InputError, match="h must"):
            discrete.step(L_d, [0.1], [0.2], h)
    for q in ([0.1, 0.2], [np.nan], [1j], ["x"]):
        with pytest.raises(InputError):
            L_d.value([0.1], q, 0.1)
        with pytest.raises(InputError):
            discrete.advance(L_d, q, [0.1], 0.1)
    for steps in (0, -1, 1.5, True):
        with pytest.raises(InputError, match="steps"):
            discrete.boundary_value(L_d, [0.1], [0.2], 0.1, steps)
    with pytest.raises(InputError, match="guess must hold"):
        discrete.boundary_value(L_d, [0.1], [0.2], 0.1, 4, guess=np.zeros((3, 1)))
    with pytest.raises(InputError, match="numbers alone"):
        discrete.start(discrete.exact_kepler(1.0), [1.0, 0.0], [0.0, 1.0], 0.1)


@pytest.mark.parametrize("rule", ["symplectic_euler_a", "trapezoidal", "midpoint"])
def test_a_degenerate_lagrangian_is_refused_with_the_reason(rule):
    L = Degenerate()
    L_d = rules()[rule](L)
    if rule == "midpoint":  # -h/4 q^2 leaves D1D2 invertible: nothing is degenerate about this L_d
        discrete.require_regular(L_d, L.q, L.q + 0.1, L.h)
        return
    with pytest.raises(InputError, match=r"degenerate.*D1D2"):
        discrete.require_regular(L_d, L.q, L.q + 0.1, L.h)
    with pytest.raises(InputError, match=r"degenerate.*D1D2"):
        discrete.step(L_d, L.q, [0.1, 0.2], L.h, guess=L.q)
