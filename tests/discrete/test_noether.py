"""The discrete Noether theorem: what of a drift is round-off, what the solver's, what a broken symmetry."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import discrete
from orbits.errors import InputError
from orbits.lagrangians.newtonian import n_body
from orbits.lagrangians.symmetry import Symmetry, rotation, translation

from ..coverings import cover
from .mechanics import Central, rules

QUICK = [name for name in rules() if name != "exact_by_collocation"]


def marched(L_d, q, p, h, steps):
    Q, P = [np.array(q)], [np.array(p)]
    for _ in range(steps):
        q, p = discrete.step(L_d, q, p, h)
        Q.append(q)
        P.append(p)
    return np.array(Q), np.array(P)


@cover(("rule", "dimension"), QUICK, [3, 2], strength=1)
def test_the_angular_momentum_of_a_planet_drifts_by_round_off_alone(rule, dimension):
    L = Central(name="kepler", dimension=dimension)
    turn = rotation() if dimension == 2 else rotation([0.3, -0.2, 1.0])
    L_d, h = rules()[rule](L), 0.2
    assert abs(discrete.invariance(L_d, turn, L.q, L.q + h * L.v, h, 0.7)) < 2e-15
    Q, P = marched(L_d, L.q, L.v, h, 12)
    found = discrete.drift(L_d, turn, Q, P, h)
    assert np.array_equal(found.momentum, discrete.momentum_map(turn, Q, P))
    assert np.abs(found.total).max() < 1e-14  # 12 steps that each lose 2^-53 |q|/h
    assert np.abs(found.broken).max() < 1e-14  # 1.3e-15 was reached
    assert not found.solver.any()
    assert np.abs(found.round_off).max() < found.floor[-1]


def test_a_broken_symmetry_is_told_apart():
    L, h = Central(squash=1e-3), 0.1
    L_d = discrete.trapezoidal(L)
    assert abs(discrete.invariance(L_d, rotation(), L.q, L.q + h * L.v, h, 0.7)) > 1e-5
    Q, P = marched(L_d, L.q, L.v, h, 40)
    found = discrete.drift(L_d, rotation(), Q, P, h)
    assert np.abs(found.total).max() > 1e-4
    assert np.abs(found.total - found.broken).max() < 1e-14  # 2e-15 was reached
    assert not found.solver.any()


def test_a_spoiled_point_shows_in_the_solvers_part_and_only_from_there_on():
    L, h = Central(), 0.1
    L_d = discrete.trapezoidal(L)
    Q, P = marched(L_d, L.q, L.v, h, 40)
    spoiled = P.copy()
    spoiled[20:] += 1e-9
    found = discrete.drift(L_d, rotation(), Q, spoiled, h)
    assert not found.solver[:20].any()
    assert np.abs(found.solver[20:]).max() > 1e-10
    assert np.abs(found.broken).max() < 1e-14
    moved = Q.copy()
    moved[20] += 1e-9
    from_positions = discrete.drift(L_d, rotation(), moved, None, h)
    assert not from_positions.solver[:19].any()
    assert np.abs(from_positions.solver).max() > 1e-9
    assert np.abs(from_positions.broken).max() < 1e-14  # the identity holds at any points
    total = found.broken + found.solver + found.round_off
    assert np.array_equal(total, found.total) or np.abs(total - found.total).max() < 1e-16


def test_positions_alone_give_the_same_answer_with_fewer_digits():
    L, h = Central(), 0.02
    L_d = discrete.trapezoidal(L)
    Q, P = marched(L_d, L.q, L.v, h, 60)
    own, recomputed = (discrete.drift(L_d, rotation(), Q, x, h) for x in (P, None))
    assert not own.solver.any()
    assert not recomputed.solver.any()
    assert np.abs(recomputed.total).max() < 0.02 * recomputed.floor.max()  # 0.0012


def test_translations_of_a_free_particle_and_of_bodies():
    free = discrete.exact_free_particle(2.0, 3)
    along = translation([1.0, -2.0, 0.5])
    Q, P = marched(free, [0.1, 0.2, 0.3], [1.0, 0.4, -0.2], 0.3, 20)
    found = discrete.drift(free, along, Q, P, 0.3)
    assert np.abs(found.total).max() < 5e-14  # 7e-15 was reached
    assert not found.solver.any()
    assert not found.broken.any()
    L = n_body([1.0, 0.1, 0.02])
    q = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [-2.0, 0.3, 0.1]])
    v = np.array([[0.01, 0.0, 0.0], [0.0, 1.0, 0.1], [0.1, -0.6, 0.0]])
    h = 0.1
    for L_d in (discrete.trapezoidal(L), discrete.midpoint(L)):
        Q, P = marched(L_d, q.ravel(), L.momentum(q, v), h, 10)
        for symmetry in L.symmetries:
            found = discrete.drift(L_d, symmetry, Q.reshape(-1, 3, 3), P.reshape(-1, 3, 3), h)
            assert np.abs(found.total).max() < 4e-15, found  # 5.3e-16 was reached
            assert np.abs(found.broken).max() < 1e-15, found
            assert not found.solver.any(), found


def test_the_users_own_symmetry_and_one_that_is_none():
    L, h = Central(gm=1.0), 0.1
    L_d = discrete.midpoint(L)
    Q, P = marched(L_d, L.q, L.v, h, 20)
    turn = Symmetry("mine", lambda s, q: rotation().flow(2 * s, q), lambda q: 2 * rotation().generator(q))
    assert np.abs(discrete.drift(L_d, turn, Q, P, h).total).max() < 1e-14
    shift = discrete.drift(L_d, translation([1.0, 0.0]), Q, P, h)
    assert np.abs(shift.broken).max() > 0.1
    assert np.abs(shift.total - shift.broken).max() < 4e-15  # 5.6e-16 was reached
    assert "translation" in str(shift)


def test_bad_input_is_refused():
    L_d, turn = discrete.midpoint(Central()), rotation()
    Q = np.array([[1.0, 0.0], [1.0, 0.1], [0.98, 0.2]])
    with pytest.raises(InputError, match="one shape"):
        discrete.drift(L_d, turn, Q, Q[:-1], 0.1)
    with pytest.raises(InputError, match="one step h for a whole path"):
        discrete.drift(L_d, turn, Q, Q, [0.0, 0.1, 0.3])
    with pytest.raises(InputError, match="finite"):
        discrete.momentum_map(turn, Q, Q * np.nan)
    with pytest.raises(InputError, match="one shape"):
        discrete.momentum_map(turn, Q, Q[0])
    with pytest.raises(InputError, match=r"q is .*; expected an array of real numbers\. Take the floats"):
        discrete.momentum_map(turn, Q * u.km, Q)
    for ask in (
        lambda: discrete.momentum_map("rotation", Q, Q),
        lambda: discrete.drift(L_d, "rotation", Q, Q, 0.1),
        lambda: discrete.invariance(L_d, "rotation", Q[0], Q[1], 0.1, 0.5),
    ):
        with pytest.raises(InputError, match=r"expected an orbits\.Symmetry, such as one of .*; got 'rotation'"):
            ask()
    for other, text in (
        (translation([1.0, 0.0, 0.0]), r"translation: the generator returns shape \(3,\) for a point of shape \(2,\)"),
        (rotation([0.0, 0.0, 1.0]), r"rotation: the generator takes no point of shape \(2,\): cannot reshape"),
        (Symmetry("mine", lambda s, q: q, lambda q: q * np.nan), r"mine: the generator is .*nan.*finite numbers"),
        (Symmetry("mine", lambda s, q: q, lambda q: q * 1j), r"mine: the generator is .*j.*finite numbers"),
        (Symmetry("mine", lambda s, q: q, lambda q: q, lambda q: q), r"the gauge returns shape \(2,\) for .* a number"),
    ):
        with pytest.raises(InputError, match=text):
            discrete.momentum_map(other, Q, Q)
        with pytest.raises(InputError, match=text):
            orbits.march(orbits.lagrangians.kepler, orbits.Gauss(stages=4), dt=0.05, steps=1).momentum_map(other)
