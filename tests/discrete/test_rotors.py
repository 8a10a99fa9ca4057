"""Discrete mechanics on SO(3): the L_d of the Lie group variational integrator, of kicks and exact rotations, and of a
free body; in four numbers, and in the axes of the body.
"""

import numpy as np
import pytest

import orbits
from orbits import discrete, rotations
from orbits.errors import InputError
from orbits.lagrangians import euler_top, full_two_body, heavy_top, kepler

from ..coverings import first, only
from .mechanics import compare

Q0, Q1 = np.array([1.0, 0.3, 0.1, 0.2]), np.array([0.9, 0.35, 0.2, 0.25])
H = 0.1
MAKERS = {
    "moser-veselov": discrete.moser_veselov,
    "kick-rotate-kick": discrete.kick_rotate_kick,
    "unequal kicks": lambda L: discrete.kick_rotate_kick(L, before=0.3, after=0.9),
}
LGVI, VERLET = orbits.methods.LieGroupVariational(), orbits.StormerVerlet()


@pytest.fixture(scope="module")
def pair():
    return full_two_body((1.0, 0.3), None, (0.02, 0.03, 0.04))


def marched(method=LGVI, steps=12):
    q, v = rotations.start(rates=(0.4, 0.3, 2.0), attitude=(1.0, 0.3, 0.1, 0.2))
    return orbits.march(heavy_top, method, q=q, v=v, dt=H, steps=steps)


@pytest.mark.parametrize("name", only(["moser-veselov", "unequal kicks"], MAKERS))
def test_derivatives_are_those_of_the_value(name):
    compare(MAKERS[name](heavy_top), Q0, Q1, H, 0.0, 1e-9, 0.01)


@pytest.mark.nightly
@pytest.mark.parametrize("name", MAKERS)
def test_derivatives_are_those_of_the_value_for_two_bodies_and_their_places(name, pair):
    q0 = np.array(pair.example.q)
    q1 = q0 + 0.05 * np.array(pair.example.v) + 0.01 * np.arange(7) / 7
    compare(MAKERS[name](pair), q0, q1, H, 0.0, 1e-8, 0.005)


def test_it_is_the_trace_of_moser_and_veselov():
    """tr[(1 - F) J_d]/h - h/2 (U + U+), and the action of the lengths."""
    R0, R1 = rotations.matrices(Q0), rotations.matrices(Q1)
    J = np.array([1.0, 1.0, 0.4])
    J_d, mgl, spare = np.diag(J.sum() / 2 - J), heavy_top.parameters["mgl"], heavy_top.parameters["I0"]
    want = np.trace((np.eye(3) - R0.T @ R1) @ J_d) / H - H / 2 * mgl * (R0[2, 2] + R1[2, 2])
    want += 2 * spare / H * np.log(np.linalg.norm(Q1) / np.linalg.norm(Q0)) ** 2
    assert discrete.moser_veselov(heavy_top).value(Q0, Q1, H) == pytest.approx(want, abs=1e-14)


@pytest.mark.parametrize(("method", "maker"), first(1, [(LGVI, "moser-veselov"), (VERLET, "kick-rotate-kick")]))
def test_both_legendre_transforms_in_the_body_are_the_angular_momenta_of_the_march(method, maker):
    path, L_d = marched(method), MAKERS[maker](heavy_top)
    momenta = 0.5 * rotations.product(path.q * [1, -1, -1, -1], path.p)[:, 1:]
    for k in range(12):
        D1, D2 = discrete.body_covectors(L_d, path.q[k], path.q[k + 1], H)
        # Stored quaternions are rounded, which L_d divides by h: 1e-15/0.1.
        assert np.abs(D1 + momenta[k]).max() < 4e-15
        assert np.abs(D2 - momenta[k + 1]).max() < 4e-15
    assert np.abs(discrete.euler_lagrange_residual(L_d, path.q, H)).max() < 4e-14
    # The momentum of a start at rates w is J w.
    np.testing.assert_allclose(momenta[0], [0.4, 0.3, 0.8], rtol=1e-15)


METHODS = [LGVI, VERLET, orbits.methods.Composition(LGVI, order=4), orbits.methods.Composition(order=4)]


@pytest.mark.parametrize("method", first(2, METHODS), ids=lambda method: method.label)
def test_a_step_is_the_map_of_the_methods_own_discrete_lagrangian(method):
    L_d, path = method.discrete_lagrangian(heavy_top), marched(method, 3)
    q, p = discrete.step(L_d, path.q[1], path.p[1], H)
    assert np.abs(q - path.q[2]).max() < 2e-15
    assert np.abs(p - path.p[2]).max() < 4e-14
    step = discrete.phase_step(L_d, path.q[1], path.p[1], H)
    assert np.abs(step.p - p).max() < 4e-14
    whole = discrete.phase_derivative(L_d, path.q[1], q, H)
    # Second derivatives of short parts are large: 3e-12 was seen for the composition.
    assert np.abs(step.derivative - whole).max() < 2e-11 * np.abs(whole).max()


@pytest.mark.parametrize("name", ["moser-veselov", "kick-rotate-kick"])
def test_the_map_of_pairs_preserves_the_two_form_in_the_axes_of_the_body(name):
    L_d = MAKERS[name](heavy_top)
    q1 = discrete.advance(L_d, Q0, Q1, H)[1]
    T = discrete.body_pair_derivative(L_d, Q0, Q1, q1, H)
    before, after = discrete.body_two_form(L_d, Q0, Q1, H), discrete.body_two_form(L_d, Q1, q1, H)
    assert T.shape == before.shape == (6, 6)
    assert np.abs(T.T @ after @ T - before).max() < 1e-13 * np.abs(before).max()
    assert np.abs(T).max() > 1.0
    # It is that of the four numbers, restricted to turns.
    E0, E1 = discrete.body_frame(heavy_top, Q0), discrete.body_frame(heavy_top, Q1)
    E = np.block([[E0, np.zeros((4, 3))], [np.zeros((4, 3)), E1]])
    assert np.abs(E.T @ discrete.two_form(L_d, Q0, Q1, H) @ E - before).max() < 1e-14 * np.abs(before).max()


@pytest.mark.parametrize("name", ["moser-veselov", "kick-rotate-kick"])
def test_noether_rotations_of_space_and_of_the_body_are_kept_and_nothing_is_broken(name):
    L_d, path = MAKERS[name](heavy_top), marched(LGVI if name == "moser-veselov" else VERLET, 4)
    assert [s.name for s in heavy_top.symmetries] == ["rotation about z", "rotation about axis 3", "length of q"]
    for symmetry in heavy_top.symmetries:
        found = discrete.drift(L_d, symmetry, path.q, path.p, H)
        assert np.abs(found.total).max() < 2e-15
        assert np.abs(found.broken).max() < 2e-14
        assert not found.solver.any()
        assert abs(discrete.invariance(L_d, symmetry, Q0, Q1, H, 0.7)) < 1e-13
    tilted = orbits.lagrangians.rigid_body((1.0, 1.2, 0.4)).symmetries[0]
    assert np.abs(discrete.drift(L_d, tilted, path.q, path.p, H).broken).max() > 0.1


@pytest.mark.parametrize("name", ["moser-veselov", "kick-rotate-kick"])
def test_it_is_its_own_adjoint(name):
    L_d = MAKERS[name](heavy_top)
    assert L_d.value(Q1, Q0, -H) == pytest.approx(-L_d.value(Q0, Q1, H), rel=1e-14)


def test_that_of_a_free_body_is_the_exact_one():
    """Against collocation of the boundary-value problem; and its parts join to the whole."""
    L_d, plain = discrete.exact(euler_top), discrete.exact_by_collocation(euler_top)
    assert L_d.name == "exact-euler-top"
    assert discrete.exact(heavy_top).name == "exact-by-collocation"
    q1 = np.array([0.9, 0.35, 0.4, 0.25])
    for one, other in zip(L_d.jet(Q0, q1, 0.3), plain.jet(Q0, q1, 0.3), strict=True):
        # 7e-15 of second derivatives of 20 was seen.
        assert np.abs(np.asarray(one) - other).max() < 4e-14
    halves = discrete.composed(L_d, lambda h: np.array([0.3 * h, 0.7 * h]))
    for one, other in zip(L_d.jet(Q0, q1, 0.3), halves.jet(Q0, q1, 0.3), strict=True):
        assert np.abs(np.asarray(one) - other).max() < 1e-12


def test_the_free_body_turns_to_where_it_is_to_by_long_ways_too():
    L_d = discrete.kick_rotate_kick(euler_top)
    rates = np.array([0.4, 0.1, 0.9])
    q, _ = rotations.free_rotation((1, 2, 3), 2.5, rates=rates, attitude=Q0)
    D1, _ = discrete.body_covectors(L_d, Q0, q, 2.5)  # 2.4 radians
    np.testing.assert_allclose(-D1, rates * [1, 2, 3], rtol=1e-13)


def test_order_of_moser_veselov_is_two_and_its_error_is_that_of_the_cosine():
    """About a principal axis, L_d = J (1 - cos a)/h for J a^2/(2 h): 1/12 of a^2 less."""
    L_d, exact = discrete.moser_veselov(euler_top), discrete.kick_rotate_kick(euler_top)
    for a in (0.1, 0.2):
        q = rotations.start((0, 0, 0), (np.cos(a / 2), 0, 0, np.sin(a / 2)))[0]
        one = np.array([1.0, 0, 0, 0])
        assert L_d.value(one, q, 0.1) == pytest.approx(3 * (1 - np.cos(a)) / 0.1, rel=1e-14)
        assert exact.value(one, q, 0.1) == pytest.approx(3 * a * a / 0.2, rel=1e-14)


def test_what_is_no_rigid_body_and_steps_that_do_not_add_up_are_refused():
    with pytest.raises(InputError, match=r"'kepler' has no rigid body; expected orbits\.lagrangians\.rigid_body"):
        discrete.moser_veselov(kepler)
    with pytest.raises(InputError, match="no rigid body"):
        discrete.body_frame(kepler, kepler.example.q)
    with pytest.raises(InputError, match="no axes of bodies"):
        discrete.body_covectors(discrete.exact_free_particle(1.0), [0.0], [1.0], 0.1)
    L_d = discrete.moser_veselov(heavy_top)
    with pytest.raises(InputError, match=r"whose sum is h; for h = 1 it returns \[0.5, 0.4\]"):
        discrete.composed(L_d, lambda h: np.array([0.5, 0.4]) * h)
    with pytest.raises(InputError, match="parts are 3, but lengths returns 2"):
        discrete.composed([L_d] * 3, lambda h: np.array([0.5, 0.5]) * h)
