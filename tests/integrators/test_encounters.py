"""Closest approaches and stop conditions, compared with exact orbits and with a search in every step."""

import numpy as np
import pytest

import orbits
from orbits.kernels.search.record import DISTANCE2, DOMINANT, OTHER, PARTNER, SPEED2, TIME
from orbits.kernels.search.stopping import ANY, CLOSER, FARTHER
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.problem import Ends
from orbits.marching.watching.leg_observers import ENERGY, SUSPECT

from ..coverings import cover
from ..problems import belt

GAUSS = orbits.Gauss(stages=8)


def marcher(gm, q, v, h, method=GAUSS, **options):
    gm = np.asarray(gm, dtype=float)
    massive = gm > 0
    return Leg.of(newtonian, method, parameters(gm[massive], 0.0), massive, np.array(q), np.array(v), h, **options)


def approaches(run):
    """(4, 2, rows): distance, time, speed and partner, with rows in the kernels' order."""
    out = run.checkpoint()["approaches"][:, :, : len(run.problem.massive)].copy()
    out[DISTANCE2], out[SPEED2] = np.sqrt(out[DISTANCE2]), np.sqrt(out[SPEED2])
    out[TIME] *= run.clock.h
    return out


def ellipse(e, h, gm=(1.0, 0.0), **options):
    """A body about another, GM = 1 and a = 1, from the apocentre at t = 0: pericentre at pi, distance 1 - e."""
    total = sum(gm)
    q, v = np.zeros((2, 3)), np.zeros((2, 3))
    q[1, 0], v[1, 1] = 1 + e, np.sqrt(total * (1 - e) / (1 + e))
    return marcher(gm, q, v, h, **options)


@cover(("gm", "e", "h"), [(1.0, 0.0), (0.999, 0.001), (0.5, 0.5)], [0.1, 0.6, 0.9], [0.01, -0.01], strength=1)
def test_a_pericentre_is_found_with_its_time_and_speed(gm, e, h):
    run = ellipse(e, h, gm)
    run.advance(400)
    distance, time, speed, partner = approaches(run)[:, :, 1]
    column = OTHER if gm == (0.5, 0.5) else DOMINANT
    # A cubic polynomial over a step, which is less than half of the time distance / speed: (1/2)^4 / 384 at worst.
    assert distance[column] == pytest.approx(1 - e, rel=1e-4)
    assert time[column] == pytest.approx(np.copysign(np.pi, h), abs=1e-4)
    assert speed[column] == pytest.approx(np.sqrt(sum(gm) * (1 + e) / (1 - e)), rel=5e-3)
    assert partner[column] == 0


def test_a_passage_within_a_single_step_is_seen():
    """A particle on a straight line passes a light body at 0.01 between two steps that are 3 apart."""
    run = marcher([1e-12, 0.0], [[0, 0, 0], [-10.0, 0.01, 0]], [[0, 0, 0], [1.0, 0, 0]], 3.0)
    run.advance(8)
    distance, time, _, partner = approaches(run)[:, DOMINANT, 1]
    assert distance == pytest.approx(0.01, rel=1e-7)
    assert time == pytest.approx(10.0, rel=1e-7)
    assert partner == 0


def solar_system(particles=20, **options):
    system = belt(particles).values
    return marcher(system.gm, system.q, system.v, 6.0, **options)


def test_approaches_of_planets_and_asteroids_are_those_of_a_look_at_every_fraction_of_a_step():
    run = solar_system()
    states = [run.state_after(0.0)[0]]
    steps, parts = 150, 6
    for _ in range(steps):
        states += [run.state_after(6.0 * k / parts)[0] for k in range(1, parts)]
        run.advance(1)
        states.append(run.state_after(0.0)[0])
    found = approaches(run)
    q = np.array(states)
    for row in range(1, 30):
        others = [j for j in range(1, 10) if j != row]
        sun = np.linalg.norm(q[:, row] - q[:, 0], axis=1)
        # The looks are a day apart, which misses up to (0.5 d / (distance / speed))^2 / 2 of a distance.
        tolerance = 2e-3 if row < 3 else 1e-4
        # The end of a run is not in the record, nor is what is farther away there than later.
        if 0 < sun.argmin() < len(q) - 1:
            assert found[0, DOMINANT, row] == pytest.approx(sun.min(), rel=tolerance)
        if row < 10:
            near = np.array([np.linalg.norm(q[:, row] - q[:, j], axis=1) for j in others])
            j, k = np.unravel_index(near.argmin(), near.shape)
            if k < len(q) - 1:
                assert found[0, OTHER, row] == pytest.approx(near.min(), rel=2e-3)
                assert found[PARTNER, OTHER, row] == others[j]


@pytest.mark.parametrize("threads", [1, 3])
def test_the_record_does_not_depend_on_how_the_march_is_cut_nor_on_threads(threads):
    whole = solar_system(60)
    whole.advance(700)
    parts = solar_system(60, threads=threads)
    for count in (1, 2, 3, 5, 100, 89, 7, 400, 93):
        parts.advance(count)
    for name, array in whole.checkpoint().items():
        assert np.array_equal(array, parts.checkpoint()[name]), name


def test_a_march_stops_after_the_step_in_which_a_pair_comes_to_its_bound():
    stops = np.array([[CLOSER, 0, 1, 0.5**2]])
    for gm in ((0.999, 0.001), (1.0, 0.0)):
        run, plain = ellipse(0.6, 0.04, gm, ends=Ends(stops)), ellipse(0.6, 0.04, gm)
        run.advance(1000)
        assert run.bounds.met == SUSPECT
        for _ in range(run.step - 1):
            plain.advance(1)
        assert np.linalg.norm(np.diff(plain.state()[0], axis=0)) >= 0.5
        plain.advance(1)
        assert np.linalg.norm(np.diff(plain.state()[0], axis=0)) < 0.5
        for name, array in run.checkpoint().items():
            assert np.array_equal(array, plain.checkpoint()[name]), name


def test_a_march_stops_where_a_pair_was_closer_within_a_step():
    stops = np.array([[CLOSER, ANY, ANY, 0.02**2]])
    run = marcher([1e-12, 0.0], [[0, 0, 0], [-10.0, 0.01, 0]], [[0, 0, 0], [1.0, 0, 0]], 3.0, ends=Ends(stops))
    run.advance(8)
    assert run.step == 4
    assert run.bounds.met == SUSPECT


def test_a_march_stops_where_a_particle_is_farther():
    stops = np.array([[FARTHER, 1, 0, 1.5**2]])
    inside = marcher([1.0, 0.0], [[0, 0, 0], [1.0, 0, 0]], [[0, 0, 0], [0, 1.5, 0]], 0.1, ends=Ends(stops))
    inside.advance(1000)
    assert np.linalg.norm(inside.state()[0][1]) > 1.5
    assert np.linalg.norm(inside.state_after(-0.1)[0][1]) < 1.5


def test_a_run_ends_where_the_energy_error_exceeds_a_bound():
    bound = 1e-3
    run = ellipse(0.6, 0.04, (0.5, 0.5), method=orbits.methods.RungeKutta4(), ends=Ends(energy_bound=bound))
    plain = ellipse(0.6, 0.04, (0.5, 0.5), method=orbits.methods.RungeKutta4())

    def energy():
        q, v = plain.state()
        return 0.25 * np.sum(v**2) - 0.25 / np.linalg.norm(q[1] - q[0])

    start, count = energy(), 0
    while abs(energy() - start) <= bound * abs(start):
        plain.advance(1)
        count += 1
    run.advance(10**6)
    assert run.step == count
    assert run.bounds.met == ENERGY
