"""Massless particles that a Wisdom–Holman map cannot follow take steps of their own, each alone, and return."""


import numpy as np
import pytest

import orbits
from orbits.elements import ecliptic_to_icrf, state_from_elements
from orbits.kernels.jacobi_particles import ELSEWHERE, NUMBER
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.adaptive import Adaptive
from orbits.marching.clocks import Place
from orbits.marching.marcher import Marcher

FOLLOW, WARN = orbits.WisdomHolman(encounters="follow"), orbits.WisdomHolman(encounters="warn")
GAUSS = orbits.Gauss(stages=8)
DT = 100.0
KM = 149597870.7


def giants():
    """Sun, Jupiter and Saturn, in au and days."""
    start = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
    return start.values.gm, start.values.q, start.values.v


def with_particles(elements):
    """The same, with massless particles of these (a, e, M)."""
    gm, q, v = giants()
    places, speeds = zip(*(state_from_elements(gm[0], a=a, e=e, M=M) for a, e, M in elements), strict=True)
    return (
        np.append(gm, np.zeros(len(places))),
        np.vstack([q, q[0] + ecliptic_to_icrf(np.array(places))]),
        np.vstack([v, v[0] + ecliptic_to_icrf(np.array(speeds))]),
    )


CROSSERS = [(a, 0.3, M) for a, M in zip(np.linspace(4.5, 6.0, 50), np.linspace(0.0, 6.0, 50), strict=True)]
QUIET = [(2.9, 0.02, 1.0), (3.1, 0.05, 2.0), (15.0, 0.1, 3.0)]
PLUNGER = (2.5, 0.96, 2.0)


def marcher(method, gm, q, v, h, **options):
    massive = gm > 0
    return Marcher(newtonian, method, parameters(gm[massive]), massive, q, v, h, retire=True, **options)


def marched(method, gm, q, v, h, steps, **options):
    run = marcher(method, gm, q, v, h, **options)
    run.advance(steps)
    return run.state()


def exactly(gm, q, v, time):
    """Where steps chosen one by one lead."""
    clock = Adaptive().towards(np.sign(time))
    run = Marcher(newtonian, GAUSS, parameters(gm[gm > 0]), gm > 0, q, v, clock, retire=True)
    place = Place(0, time)
    run.advance_to(place)
    return run.state_at(place)[0]


@pytest.mark.parametrize("h", [DT, -DT])
def test_bits_depend_neither_on_neighbours_nor_threads_nor_blocks_nor_the_order_of_particles(h):
    """Nor on what is sampled, nor on a checkpoint on the way, in which some particles are away."""
    gm, q, v = with_particles([*CROSSERS[::2], *QUIET, PLUNGER])
    run, steps = marcher(FOLLOW, gm, q, v, h, threads=3), 250
    run.advance(steps)
    x, w = run.state()
    assert np.array_equal(marched(WARN, gm[:3], q[:3], v[:3], h, steps)[0], x[:3])
    plain = marched(WARN, gm, q, v, h, steps)
    quiet = slice(28, 31)
    assert np.array_equal(plain[0][quiet], x[quiet])
    met = ~(plain[0][3:28] == x[3:28]).all(axis=1)
    assert met.sum() > 8
    order = np.append(np.arange(3), 3 + np.random.default_rng(1).permutation(len(gm) - 3))
    other = marcher(FOLLOW, gm[order], q[order], v[order], h)
    other.block, away = 7, set()
    for count in (20, 37, 93, 100):
        other.advance(count)
        other.state_after(0.3 * h)
        away |= set(np.flatnonzero(other._state["particle_memory"][:, 0, NUMBER] == ELSEWHERE))
        saved = other.checkpoint()
        other = marcher(FOLLOW, gm[order], q[order], v[order], h)
        other.restore(saved)
    assert len(away) > 3
    assert np.array_equal(other.state()[0], x[order])
    assert np.array_equal(other.state()[1], w[order])
    for k in (5, 17, 27, 30, 31):
        alone = np.append(np.arange(3), k)
        assert np.array_equal(marched(FOLLOW, gm[alone], q[alone], v[alone], h, steps)[0][-1], x[k])


def test_crossers_come_out_of_their_encounters_as_by_steps_chosen_one_by_one():
    """40 years back, three quarters of them are off by less than 136 km in steps of 100 days and 0.7 km in those of 25,
    which is what the map leaves, magnified by encounters. Warned of only, a quarter is off by more than 1e5 km.
    """
    gm, q, v = with_particles([*CROSSERS, *QUIET])
    exact = exactly(gm, q, v, -14600.0)
    off = {}
    for method, h in ((FOLLOW, -DT), (FOLLOW, -DT / 4), (WARN, -DT)):
        x = marched(method, gm, q, v, h, round(-14600.0 / h))[0]
        off[method, h] = np.quantile(np.linalg.norm(x - exact, axis=1)[3:53] * KM, 0.75)

    assert off[FOLLOW, -DT] < 200.0
    assert off[FOLLOW, -DT / 4] < 1.0
    assert off[WARN, -DT] > 1e5
