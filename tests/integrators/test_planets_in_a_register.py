"""Wisdom–Holman steps of up to eight planets, which stay in registers, and what is seen of them."""

import json

import numpy as np
import pytest

import orbits
from orbits.elements import state_from_elements
from orbits.kernels.maps.interaction import displace, interact, modify
from orbits.kernels.maps.jacobi import advance_planets, finish_velocities, step_lazy, step_modified, step_plain
from orbits.kernels.search.record import PARTNER
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.marcher import Marcher
from orbits.resources import data_path


def solar_system(count):
    """GM, q, v of the Sun and the first planets."""
    data = json.loads(data_path("solar_system_10body.json").read_text())
    return [np.array(data[name])[: count + 1] for name in ("gm_au3_d2", "q", "v")]


def crossing(seed):
    """A star and seven light planets on eccentric orbits that cross, one of them unbound."""
    rng = np.random.default_rng(seed)
    a, e, M = rng.uniform(0.8, 3.0, 7), rng.uniform(0.0, 0.4, 7), rng.uniform(0, 2 * np.pi, 7)
    E = M.copy()
    for _ in range(50):
        E = M + e * np.sin(E)
    b, r, turn = np.sqrt(1 - e * e), 1 - e * np.cos(E), rng.uniform(0, 2 * np.pi, 7)
    q = np.array([a * (np.cos(E) - e), a * b * np.sin(E), 0.02 * rng.normal(size=7)])
    v = np.array([-np.sin(E), b * np.cos(E), 0.02 * rng.normal(size=7)]) / (r * np.sqrt(a))
    for x in (q, v):
        x[0], x[1] = np.cos(turn) * x[0] - np.sin(turn) * x[1], np.sin(turn) * x[0] + np.cos(turn) * x[1]
    v[:, 6] *= 1.6
    gm = np.concatenate([[1.0], 1e-6 * rng.uniform(0.1, 10.0, 7)])
    return gm, np.vstack([np.zeros(3), q.T]), np.vstack([np.zeros(3), v.T])


def marcher(gm, q, v, h, **options):
    return Marcher(newtonian, orbits.WisdomHolman(**options), parameters(gm), gm > 0, q, v, h)


@pytest.mark.parametrize("count", [1, 2, 5, 8])
@pytest.mark.parametrize("kick", ["standard", "modified-kick", "lazy"])
def test_a_step_in_registers_has_the_bits_of_its_parts(kick, count):
    h = 3.0
    march = marcher(*solar_system(count), h, kernel=kick)
    march.advance(5)
    begun = march._state["memory"], march._loops._scratch
    planets, room = (x.copy() for x in begun)
    other, its_room = (x.copy() for x in begun)
    shift = h * h / 12
    for _ in range(20):
        advance_planets(other, its_room, h, h / 2)
        interact(other, its_room, count, False)
        if kick == "standard":
            step_plain(planets, room, h)
        elif kick == "lazy":
            step_lazy(planets, room, h, shift)
            displace(other, its_room, shift)
            interact(other, its_room, count, True)
        else:
            step_modified(planets, room, h, shift)
            modify(other, its_room, count, shift)
        finish_velocities(other, its_room, h / 2)
    assert np.isfinite(planets).all()
    assert np.array_equal(planets, other)


@pytest.mark.parametrize("kick", ["standard", "modified-kick", "lazy"])
def test_planets_move_alike_in_one_register_and_in_two(kick):
    gm, q, v = solar_system(9)
    gm[1] = 1e-40  # Mercury moves nothing, but moves the others by a place, Pluto into a second register
    others = [0, *range(2, 10)]
    one, two = marcher(gm[others], q[others], v[others], 3.0, kernel=kick), marcher(gm, q, v, 3.0, kernel=kick)
    for march in (one, two):
        march.advance(2000)
    for a, b in zip(one.state(), two.state(), strict=True):
        # The sums are rounded differently, but in what is 1e-3 of the motion, with low parts: no bit differed.
        assert np.max(np.abs(a - b[others])) < 1e-14


@pytest.mark.parametrize("seed", range(4))
def test_approaches_of_planets_are_those_of_the_general_search(seed):
    gm, q, v = crossing(seed)
    for h in (0.05, -0.02):
        found = []
        for special in (True, False):
            march = marcher(gm, q, v, h)
            assert march._watcher._planets
            march._watcher._planets = special
            march.advance(30_000)
            found.append((march.approaches(), *march.passages()))
        (one, listed, left_out), (other, its_list, also) = found
        assert len(listed) > 1
        assert left_out == also
        assert np.array_equal(listed, its_list)
        assert np.array_equal(one, other)
        assert len(set(one[PARTNER, 1, 1:8])) > 2


@pytest.mark.parametrize("seed", [0, 2, 21])
def test_the_innermost_and_the_outermost_of_eight_planets_are_no_neighbours(seed):
    """A heavy planet between them, so that the star is not where Jacobi coordinates begin. The outermost one comes in
    to the innermost one.
    """
    rng, gm, states = np.random.default_rng(seed), [1.0], [np.zeros((2, 3))]
    light = [(1e-9, a, 0.02, M) for a, M in ((1.5, 1.0), (1.9, 3.0), (2.4, 5.0), (2.9, 0.0), (3.3, 2.0))]
    first, seventh = (1e-9, 1.1, 0.1, rng.uniform(0, 6.28)), (0.05, 5.0, 0.02, rng.uniform(0, 6.28))
    for m, a, e, M in [first, *light, seventh, (1e-9, 8.0, 0.86, 5.28 + 0.2 * rng.random())]:
        omega = rng.uniform(0, 6.28) if m < 1e-8 and e > 0.05 else 0.0
        states.append(np.array(state_from_elements(1 + m, a=a, e=e, inc=0.02, Omega=1.0, omega=omega, M=M)))
        gm.append(m)
    q, v = np.array(states).transpose(1, 0, 2)
    whole, by_steps = (marcher(np.array(gm), q, v, 0.02) for _ in range(2))
    by_steps._watcher._planets = False
    whole.advance(2500)
    for _ in range(2500):
        by_steps.advance(1)
    assert np.allclose(whole.approaches()[0, 1, 1:9], by_steps.approaches()[0, 1, 1:9], rtol=1e-9, atol=0.0)


def test_more_than_nine_bodies_and_stars_that_are_not_first_are_searched_in_general():
    gm, q, v = solar_system(9)
    assert not marcher(gm, q, v, 3.0)._watcher._planets
    order = [1, 0, 2, 3]
    assert not marcher(gm[order], q[order], v[order], 3.0)._watcher._planets
    assert marcher(gm[:9], q[:9], v[:9], 3.0)._watcher._planets
