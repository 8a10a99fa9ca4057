"""Symmetries up to a total derivative: L changes by dK/dt, and p . xi - K is conserved, by which methods, how well."""

import dataclasses

import numpy as np
import pytest

import orbits
from orbits import discrete
from orbits.errors import InputError
from orbits.lagrangians import boost, charged_particle, rotation, translation
from orbits.lagrangians.newtonian import n_body
from orbits.tableaux.elementary import drift_kick, kick_drift
from orbits.tableaux.gauss import gauss
from orbits.tableaux.lobatto import lobatto_iiia_iiib, lobatto_iiib_iiia

from ..coverings import first
from .mechanics import Oscillator, Plain, pair

FAMILY = [*map(gauss, (1, 2, 3)), *map(lobatto_iiia_iiib, (2, 3)), *map(lobatto_iiib_iiia, (2, 3))]
EULER = [kick_drift(), drift_kick()]
SPECIAL = [orbits.Gauss(stages=3), orbits.methods.LobattoIIIAB(stages=2), orbits.methods.SymplecticEuler()]


class Uniform(Plain):
    """m |v|^2/2 + e A(q) . v + m g . q in the plane; A = B (-y, x)/2, or Landau's B (-y, 0)."""

    name = "uniform fields"
    q, v, h = np.array([0.7, -0.2]), np.array([0.3, 0.9]), 0.2
    m, eB, g = 1.7, 0.9, np.array([0.4, -1.1])

    def __init__(self, *, magnetic="", force=False):
        row, column = {"": (0.0, 0.0), "symmetric": (-0.5, 0.5), "landau": (-1.0, 0.0)}[magnetic]
        self.A, self.force = self.eB * np.array([[0.0, row], [column, 0.0]]), self.m * self.g * force

    def value(self, q, v, t=0.0):
        return 0.5 * self.m * (v @ v) + v @ self.A @ q + self.force @ q

    def gradients(self, q, v, t=0.0):
        return self.A.T @ v + self.force, self.m * v + self.A @ q

    def hessians(self, q, v, t=0.0):
        return np.zeros((2, 2)), self.A.T.copy(), self.m * np.eye(2)


def broken(L_d, symmetry, L, t=0.3):
    """By how much L_d fails to change by K1 - K0, at two points that need not lie on a motion."""
    q0, q1 = pair(L)
    return abs(discrete.drift(L_d, symmetry, [q0, q1], None, L.h, t).broken[-1])


X = translation([1.0, 0.0], gauge=lambda q: Uniform.eB * q[1] / 2)
FALL = translation([1.0, 0.0], gauge=lambda q, t: Uniform.m * Uniform.g[0] * t, timed=True)
FALLING_BOOST = orbits.Symmetry(
    "boost in a uniform force",
    lambda s, q, t: q + s * t * np.array([1.0, 0.0]),
    lambda q, t: t * np.array([1.0, 0.0]),
    lambda q, t: Uniform.m * (q[0] + Uniform.g[0] * t * t / 2),
    timed=True,
)
PLAIN = rotation()
TURN = orbits.Symmetry("turn", PLAIN.flow, PLAIN.generator, lambda q: Uniform.eB * (q[1] ** 2 - q[0] ** 2) / 2)


@pytest.mark.parametrize("tableau", [*FAMILY, *EULER], ids=lambda t: t.name)
def test_a_gauge_term_linear_in_q_and_t_is_inherited_by_every_method_of_the_family(tableau):
    """Translation in a uniform magnetic field, K = e B y/2; in a uniform force, m g t; boost of a free body, m x."""
    for L, symmetry in (
        (Uniform(magnetic="symmetric"), X),
        (Uniform(force=True), FALL),
        (Uniform(), boost([1.0, 0.0], Uniform.m)),
    ):
        # Roundings of a handful of terms below 1: 4e-17 was reached.
        assert broken(discrete.vprk(L, tableau), symmetry, L) < 5e-16


@pytest.mark.parametrize("tableau", [*FAMILY, *EULER], ids=lambda t: t.name)
def test_a_gauge_term_with_the_square_of_time_is_inherited_from_order_two_on(tableau):
    """A boost in a uniform force: what order 1 misses is m g h^2/2 a step."""
    L = Uniform(force=True)
    found = broken(discrete.vprk(L, tableau), FALLING_BOOST, L)
    if tableau in EULER:
        assert abs(found - L.m * abs(L.g[0]) * L.h**2 / 2) < 5e-16
    else:
        assert found < 5e-16  # 3e-17 was reached


@pytest.mark.parametrize("tableau", [*FAMILY, *EULER], ids=lambda t: t.name)
def test_a_gauge_term_quadratic_in_q_is_inherited_by_gauss_and_not_by_lobatto(tableau):
    """Rotation in Landau's gauge A = (-B y, 0), K = e B (y^2 - x^2)/2: it asks b_i a_ij + b_j a_ji = b_i b_j of a."""
    L = Uniform(magnetic="landau")
    own = tableau.b[:, None] * tableau.a
    quadratic = np.abs(own + own.T - np.outer(tableau.b, tableau.b)).max() < 1e-15
    assert quadratic == tableau.name.lower().startswith("gauss")
    found = broken(discrete.vprk(L, tableau), TURN, L)
    assert found < 2e-15 if quadratic else found > 1e-8  # h^5 times a small number for three stages: 6e-8


def test_the_straight_lines_of_midpoint_and_trapezoidal_inherit_quadratic_gauge_terms_too():
    L = Uniform(magnetic="landau")
    assert broken(discrete.midpoint(L), TURN, L) < 2e-15
    assert broken(discrete.trapezoidal(L), TURN, L) < 2e-15  # Lobatto's own L_d is another one, and does not
    assert broken(discrete.symplectic_euler_a(L), TURN, L) > 1e-3


def swing(L):
    """q -> q + s n cos(omega t) along a normal mode n of the oscillators: K = -omega sin(omega t) n.M q."""
    square, modes = np.linalg.eig(np.linalg.solve(L.mass, L.stiffness))
    omega, n = np.sqrt(square[0]), modes[:, 0]
    return orbits.Symmetry(
        "swing",
        lambda s, q, t: q + s * np.cos(omega * t) * n,
        lambda q, t: np.cos(omega * t) * n,
        lambda q, t: -omega * np.sin(omega * t) * (n @ L.mass @ q),
        timed=True,
    )


def test_other_dependence_on_time_is_inherited_by_the_exact_discrete_lagrangian_and_by_others_to_their_order():
    L = Oscillator()
    assert broken(discrete.exact(L), swing(L), L) < 2e-15
    assert 1e-6 < broken(discrete.vprk(L, gauss(2)), swing(L), L) < 1e-4  # h^5/720 = 3e-6 times a few


@pytest.mark.parametrize("symmetry", [X, TURN, FALL, FALLING_BOOST], ids=lambda s: s.name)
def test_whole_moves_change_the_discrete_action_by_the_gauge_terms_integral_along_the_flow(symmetry):
    fields = {X: {"magnetic": "symmetric"}, TURN: {"magnetic": "landau"}}.get(symmetry, {"force": True})
    L = Uniform(**fields)
    q0, q1 = pair(L)
    L_d = discrete.midpoint(L)
    assert symmetry.defect(q0, 0.4) < 1e-13
    for s in (0.7, -2.3):
        assert abs(discrete.invariance(L_d, symmetry, q0, q1, L.h, s, 0.3)) < 1e-15  # 1.1e-16 was reached
    plain = orbits.Symmetry(symmetry.name, symmetry.flow, symmetry.generator, timed=symmetry.timed)
    assert abs(discrete.invariance(L_d, plain, q0, q1, L.h, 0.7, 0.3)) > 1e-3


@pytest.mark.nightly
@pytest.mark.parametrize("method", first(1, SPECIAL), ids=lambda m: m.label)
def test_the_charges_of_a_uniform_magnetic_field_are_conserved_and_certified(method):
    """p_x - e B y/2 and p_y + e B x/2, the centre of the gyration, and the uniform motion along the field."""
    L = charged_particle.with_parameters(m=1.3, e=0.8, B0=1.1, B2=0.0, E2=0.0)
    path = orbits.march(L, method, dt=0.2, steps=300)
    x, y, z = path.q.T
    p_x, p_y, p_z = path.p.T
    half = 0.8 * 1.1 / 2
    along = {s.name: s for s in L.symmetries}
    assert np.array_equal(path.momentum_map(along["translation along x"]), p_x - half * y)
    assert np.array_equal(path.momentum_map(along["translation along y"]), p_y + half * x)
    for charge in (p_x - half * y, p_y + half * x, p_z * path.t - 1.3 * z):
        # 300 steps of roundings of numbers of order 1; the last is a difference of terms up to 8: 3.6e-15 was reached.
        assert np.ptp(charge) < 2e-14
    assert np.ptp(p_x) > 0.5  # what the plain momentum map takes for the charge
    L_d = discrete.vprk(L, method.tableau)
    found = discrete.drift(L_d, along["translation along x"], path.q[:40], path.p[:40], 0.2)
    assert np.abs(found.broken).max() < 1e-15  # 1.6e-16 was reached
    assert not found.solver.any()
    certificate = orbits.certify(L, method, 0.2, q=[0.8, 0.1, 0.3], v=[0.2, 0.5, 0.1])
    names = [f.name for f in certificate.findings if f.name.startswith("momentum map")]
    assert sorted(names) == sorted(f"momentum map: {s.name}" for s in L.symmetries)
    assert len(names) == 5
    assert all(certificate[name].holds for name in names), certificate.table()


def test_with_parameters_makes_the_gauge_terms_anew():
    """Another mass, another K: m z of a boost."""
    q, p = np.array([0.3, -0.2, 0.5]), np.array([0.7, 0.4, -0.9])
    heavy = orbits.lagrangians.free_particle.with_parameters(m=3.0)
    along_z = next(s for s in heavy.symmetries if s.name == "boost along z")
    assert along_z.charge(q, p, 2.0) == -0.9 * 2.0 - 3.0 * 0.5
    assert [s.name for s in charged_particle.symmetries] == ["rotation about z"]


@pytest.mark.parametrize("method", [orbits.StormerVerlet(), *SPECIAL], ids=lambda m: m.label)
def test_the_centre_of_mass_of_n_bodies_moves_uniformly_to_round_off(method):
    L = n_body([1.0, 0.1, 0.02])
    q = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [-2.0, 0.3, 0.1]])
    v = np.array([[0.01, 0.0, 0.0], [0.0, 1.0, 0.1], [0.1, -0.6, 0.0]])
    path = orbits.march(L, method, q=q, v=v, dt=0.1, steps=300)
    boosts = [s for s in L.symmetries if s.name.startswith("boost")]
    assert len(boosts) == 3
    gm = np.array([1.0, 0.1, 0.02])
    for k, symmetry in enumerate(boosts):
        charge = path.momentum_map(symmetry)
        moved = path.p.reshape(-1, 3, 3)[:, :, k].sum(axis=1) * path.t - path.q.reshape(-1, 3, 3)[:, :, k] @ gm
        assert np.abs(charge - moved).max() < 1e-15
        assert np.ptp(charge) < 1e-14  # 300 steps of roundings of terms that grow to 3: 2.2e-15 was reached
        L_d = discrete.vprk(L, method.tableau)
        found = discrete.drift(L_d, symmetry, path.q[:8].reshape(-1, 3, 3), path.p[:8].reshape(-1, 3, 3), 0.1)
        assert np.abs(found.broken).max() < 5e-16  # 8e-17 was reached
        assert not found.solver.any()


def test_a_symmetry_that_depends_on_time_asks_for_the_time():
    q = np.array([[0.3, -0.2], [0.4, 0.1]])
    with pytest.raises(InputError, match=r"'boost' depends on time, but no time was given. Pass t="):
        discrete.momentum_map(boost([1.0, 0.0]), q, q)
    with pytest.raises(InputError, match="one for each point"):
        discrete.momentum_map(boost([1.0, 0.0]), q, q, [0.0, 1.0, 2.0])
    assert discrete.momentum_map(boost([1.0, 0.0], 2.0), q, q, [0.0, 1.0]).tolist() == [-0.6, 0.4 - 0.8]
    assert discrete.momentum_map(boost([1.0, 0.0], 2.0), q[1], q[1], 1.0) == 0.4 - 0.8


def test_functions_of_other_arguments_and_what_is_no_list_of_symmetries_are_refused():
    def untimed(q):
        return q

    def timed(q, t):
        return q

    with pytest.raises(InputError, match=r"generator takes other arguments, generator\(q, t\); with timed=False"):
        orbits.Symmetry("late", lambda s, q: q, timed)
    with pytest.raises(InputError, match=r"gauge takes other arguments.*needs timed=True"):
        orbits.Symmetry("late", lambda s, q: q, untimed, timed)
    with pytest.raises(InputError, match=r"flow takes other arguments.*timed=True it is called as flow\(s, q, t\)"):
        orbits.Symmetry("early", lambda s, q: q, timed, timed=True)
    with pytest.raises(InputError, match="generator must be a function, got 'no'"):
        orbits.Symmetry("none", lambda s, q: q, "no")
    for symmetries in (rotation(), [rotation(), "turn"], lambda parameters: rotation()):
        with pytest.raises(InputError, match=r"must be `orbits\.Symmetry` objects, in a list"):
            dataclasses.replace(orbits.lagrangians.kepler, groups=symmetries)


def test_bad_boosts_are_refused():
    with pytest.raises(InputError, match="masses of the bodies"):
        boost([1.0, 0.0], [1.0, 0.0])
    with pytest.raises(InputError, match="a boost needs a direction"):
        boost([0.0, 0.0])
