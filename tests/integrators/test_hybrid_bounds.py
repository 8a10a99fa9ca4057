"""Encounters that are followed, on the problems of REBOUND's tests of MERCURIUS and TRACE: in Jacobi coordinates within
the bounds that these assert, in democratic heliocentric ones within the largest errors of both.

REBOUND compares the energy at the end with that at the start; here it is the largest error of 200 samples. In the
coordinates of MERCURIUS and TRACE, democratic heliocentric ones, the map has errors like theirs, which oscillate:
within their bounds at one time, above them at another. There it is held to the largest errors of both among 200
samples, in REBOUND 5.2.2. Runs with many encounters are chaotic: with other roundings their errors are others.
"""

import json
import math

import numpy as np
import pytest
import rebound

import orbits
from orbits.regression import peers
from orbits.resources import data_path

from ..coverings import first
from ..maps import newtonian_energy
from ..problems import rebounds_outer_solar_system

DATA = json.loads(data_path("rebound_test_bounds.json").read_text())
MERCURIUS = {row["name"]: row["asserts"] for row in DATA["tests"]}["test_mercurius.test_outer_solar / many_encounters"]

JACOBI = orbits.WisdomHolman(encounters="follow planets")
SEVERAL_KICKS = orbits.methods.SABA(encounters="follow planets")
HELIOCENTRIC = orbits.WisdomHolman(coordinates="democratic-heliocentric", encounters="follow planets")
YEAR = 2 * math.pi

# A planet of a giant's mass each, x, y, vx, vy about a star: get_sim of test_many_encounters, in rebound/tests/
# test_mercurius.py and test_trace.py of REBOUND 5.2.2.
MANY = np.array([
    [0.90000, 0.00000, 0.00000, 1.10360], [-1.17676, -0.05212, 0.22535, -0.90102],
    [-1.66025, -0.69852, 0.18932, -0.60030], [0.57904, 1.03836, -0.69267, 0.75995],
    [-0.41683, 0.83128, -1.03478, -0.72482], [1.83969, 0.32938, -0.55114, 0.51646],
])  # fmt: skip


def bodies(gm, places, velocities):
    """A star with bodies beside it, in units in which G = 1."""
    names = ["star", *(f"body {k}" for k in range(1, len(gm)))]
    return orbits.System(names, gm=gm, q=places, v=velocities, units=orbits.DIMENSIONLESS)


def many_encounters():
    flat = np.zeros((6, 1))
    q, v = np.hstack([MANY[:, :2], flat]), np.hstack([MANY[:, 2:], flat])
    at_rest = np.zeros((1, 3))
    return bodies([1.0] + [1e-4] * 6, np.vstack([at_rest, q]), np.vstack([at_rest, v])).barycentric()


def outer_solar_system(times_heavier=1.0):
    """The system with heavier planets, and Jupiter's period."""
    sim = rebounds_outer_solar_system()
    for planet in sim.particles[1:]:
        planet.m *= times_heavier
    return orbits.rebound.from_rebound(sim), sim.particles[1].P


def plunging():
    """A second planet whose pericentre is at 0.096, on an orbit across that of the first."""
    sim = rebound.Simulation()
    sun = rebound.Particle(m=1.0)
    sim.add(sun)
    sim.add(primary=sun, m=9.55e-4, a=5.2)
    sim.add(primary=sun, m=2.857e-4, a=9.58, e=0.99, inc=math.pi / 2)
    sim.move_to_com()
    return orbits.rebound.from_rebound(sim)


def propagated(system, method, dt, duration):
    return orbits.propagate(system, method, dt=dt, duration=duration, samples=201, progress=False)


def energy_errors(run, q=None, v=None):
    """The relative change of the energy at the samples, or in the states of a peer."""
    gm = run.system.values.gm
    q, v = (run.q.value, run.v.value) if q is None else (q, v)
    found = np.array([newtonian_energy(gm, *state) for state in zip(q, v, strict=True)])
    return np.abs(found / newtonian_energy(gm, run.q.value[0], run.v.value[0]) - 1.0)


def bounds(*most):
    """Of the energy error by each of the maps, of which one runs by default."""
    cases = zip((JACOBI, SEVERAL_KICKS, HELIOCENTRIC), most, strict=True)
    return pytest.mark.parametrize(("method", "most"), first(1, cases), ids=str)


# 4.4e-16 and 3.3e-16 were reached; in heliocentric coordinates 1.2e-9, and 1.2e-10 at the end. The largest error of
# MERCURIUS and TRACE is 2.4e-9.
@bounds(2e-15, 2e-15, 2e-9)
def test_the_outer_solar_system_keeps_its_energy(method, most):
    assert MERCURIUS.startswith("dE<3e-10;")
    system, period = outer_solar_system()
    run = propagated(system, method, 1e-3 * period, 1000.0)
    assert run.excursions.total == 0
    errors = energy_errors(run)
    assert errors.max() < most
    assert errors[-1] < 3e-10


# 5.2e-15, 4.6e-15 and 1.0e-6 were reached. test_outer_solar_massive asserts 3e-7 at the end, where the map in
# heliocentric coordinates has 8.6e-7; the largest errors of MERCURIUS and TRACE are 1.3e-5 and 1.3e-6.
@bounds(3e-14, 3e-14, 1.2e-6)
def test_planets_fifty_times_as_heavy_are_followed_through_their_encounters(method, most):
    system, period = outer_solar_system(50.0)
    run = propagated(system, method, 1e-3 * period, 1000.0)
    assert run.excursions.total > 0
    assert energy_errors(run).max() < most


# Twelve starts that differ by 1e-14 had 8e-12 to 1.3e-8, 9e-15 to 1e-13, and, in heliocentric coordinates, 2e-6 to
# 1.2e-5: above the bound of MERCURIUS, and below that of TRACE. So the last is held to a thousandth of what WHFast
# loses, 0.024: 1e-4 to 5e-4 are reached.
@bounds(1e-7, 1e-12, 5e-5)
@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_six_planets_keep_their_energy_through_two_hundred_encounters(method, most):
    """MERCURIUS is held to 5e-6, TRACE to 5e-5, both to a ten-thousandth of what WHFast loses at the end."""
    assert MERCURIUS.endswith("6 bodies T=2000: dE<5e-6 and 1e4x better than whfast")
    run = propagated(many_encounters(), method, 0.034, 2000.0)
    worst = energy_errors(run).max()
    assert run.excursions.total > 50
    assert worst < most
    theirs = peers.run("whfast", run.system.values, times=run.times[1:], dt=0.034)
    share = 1e-3 if method is HELIOCENTRIC else 1e-4
    assert worst < share * energy_errors(run, theirs.q, theirs.v)[-1]


# 4.7e-9, 1.8e-11 and 1.0e-5 were reached; the largest error of TRACE is 1.3e-5, and MERCURIUS loses 3 % of the energy.
@bounds(1e-8, 4e-11, 1.2e-5)
@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_pericentres_of_a_planet_with_an_eccentricity_of_0_99_are_followed(method, most):
    run = propagated(plunging(), method, 0.15 * YEAR, 10 * 29.4 * YEAR)
    assert run.excursions.total >= 10  # one in each of ten revolutions
    assert energy_errors(run).max() < most  # 1e-4 is asserted by test_pericenter of TRACE


# 1.3e-12, 1e-14 and 7.7e-6 were reached. TRACE is held to 1e-6 at the end; its largest is 9.2e-6.
@pytest.mark.parametrize(
    ("method", "most"),
    first(2, [
        (orbits.WisdomHolman(encounters="follow"), 3e-12),
        (None, 3e-14),
        (orbits.WisdomHolman(coordinates="democratic-heliocentric", encounters="follow"), 9e-6),
    ]),
    ids=["jacobi", "chosen steps", "democratic-heliocentric"],
)
@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_a_particle_between_star_and_planet_keeps_its_jacobi_constant(method, most):
    """test_chaotic_exchange of TRACE: a planet of a hundredth of the mass at 5.2 au, 318 years, steps of 8 days."""
    mass, a = 0.01 / 0.99, 5.2
    at_star, at_planet = -mass / (1 + mass), 1 / (1 + mass)
    speed = math.sqrt((1 + mass) / a)
    q, v = np.zeros((3, 3)), np.zeros((3, 3))
    q[:, 0] = at_star * a, at_planet * a, 4.42 + at_star * a
    v[:, 1] = at_star * speed, at_planet * speed, 0.0072 * 365.25 / YEAR + at_star * speed
    system = bodies([1.0, mass, 0.0], q, v)

    def jacobi(run):
        (star, planet, r), w = np.moveaxis(run.q.value, 1, 0), run.v.value[:, 2]
        potential = -1.0 / np.linalg.norm(r - star, axis=1) - mass / np.linalg.norm(r - planet, axis=1)
        return 2 * (speed / a) * np.cross(r, w)[:, 2] - 2 * (0.5 * (w * w).sum(axis=1) + potential)

    run = propagated(system, method, None if method is None else 8 / 365 * YEAR, 2000.0)
    found = jacobi(run)
    assert len(run.retired) == 0
    assert np.abs(found / found[0] - 1.0).max() < most


@pytest.mark.parametrize("coordinates", first(1, ["jacobi", "democratic-heliocentric"]))
@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_a_particle_that_is_followed_by_the_planet_changes_no_bit_of_it(coordinates):
    """test_no_effect_tp; here it is bound to the planet."""
    method = orbits.WisdomHolman(coordinates=coordinates, encounters="follow particles")
    q, v = np.zeros((3, 3)), np.zeros((3, 3))
    q[1:, 0], v[1:, 1] = [1.0, 1.01], math.sqrt(1.001) + np.array([0.0, 0.3])
    both = propagated(bodies([1.0, 1e-3, 0.0], q, v), method, 0.1, 2.0)
    alone = propagated(bodies([1.0, 1e-3], q[:2], v[:2]), method, 0.1, 2.0)
    assert len(both.retired) == 0
    assert np.array_equal(both.q[:, :2], alone.q)
    assert np.array_equal(both.v[:, :2], alone.v)
