"""Nothing is lost on the way to REBOUND and back: not a bit, not a name, not the softening."""

from __future__ import annotations

import numpy as np
import pytest
import rebound
from astropy import units as u

import orbits
from orbits.errors import InputError

NAMES = ["probe", "Sun", "Jupiter", "a grain"]
GM = [0.0, 2.9591220828411956e-4, 2.8253458252257923e-7, 0.0]
Q = [[1.1, 0.2, 0.3], [-0.007, -0.003, -0.001], [4.0, 2.9, 1.2], [0.1, 2.5, -0.3]]
V = [[0.001, 0.015, 0.0], [5.4e-6, -6.8e-6, -3e-6], [-0.0046, 0.0058, 0.0026], [-0.01, 0.001, 0.0]]


def states(sim):
    return [(p.name, p.m, p.x, p.y, p.z, p.vx, p.vy, p.vz) for p in sim.particles]


def test_there_and_back_is_the_identity_when_massive_bodies_come_first():
    order = [1, 2, 0, 3]
    system = orbits.System(
        [NAMES[i] for i in order], *([x[i] for i in order] for x in (GM, Q, V)), epoch="J2000", radii=[1e-2, 1e-3, 0, 0]
    )
    sim = orbits.to_rebound(system)
    assert orbits.from_rebound(sim, units=orbits.SOLAR, epoch="J2000") == system


def test_massive_bodies_go_first_and_massless_ones_become_test_particles():
    sim = orbits.to_rebound(orbits.System(NAMES, GM, Q, V, softening=0.125))
    assert states(sim) == [(NAMES[i], GM[i], *Q[i], *V[i]) for i in (1, 2, 0, 3)]
    assert (sim.G, sim.N_active, sim.testparticle_type, sim.softening, sim.t) == (1.0, 2, 0, 0.125, 0.0)


def test_a_simulation_with_units_keeps_them_and_its_G():
    sim = rebound.Simulation()
    sim.units = ("AU", "yr", "Msun")
    sim.add(m=1.0, name="star")
    sim.add(m=1e-3, a=1.0)
    system = orbits.from_rebound(sim)
    assert system.names == ("star", "particle 1")
    assert system.units.G == sim.G
    assert system.units.length.to(u.au) == pytest.approx(1.0, rel=1e-15)
    assert system.units.time.to(u.yr) == 1.0
    assert system.gm[0].to_value(u.au**3 / u.yr**2) == pytest.approx(4 * np.pi**2, rel=1e-4)  # Kepler's third law
    np.testing.assert_array_equal(system.values.gm, sim.G * np.array([1.0, 1e-3]))


def test_a_simulation_without_units_is_pure_numbers_with_its_G():
    sim = rebound.Simulation()
    sim.add(m=2.0)
    sim.add(m=0.5, x=1.0, vy=1.0)
    assert orbits.from_rebound(sim).units == orbits.DIMENSIONLESS
    sim.G = 3.0
    system = orbits.from_rebound(sim)
    assert system.units.G == 3.0
    assert system.values.gm.tolist() == [6.0, 1.5]
    assert system.energy().value == pytest.approx(sim.energy(), rel=1e-15)


def test_an_unsynchronized_simulation_is_read_synchronized_and_left_alone():
    def made(safe):
        sim = rebound.Simulation()
        sim.add(m=1.0)
        sim.add(m=1e-3, a=1.0, e=0.1)
        sim.integrator, sim.dt = "whfast", 0.05
        sim.integrator.safe_mode = safe
        sim.integrator.keep_unsynchronized = 1 - safe
        sim.steps(10)
        return sim

    sim = made(safe=0)
    assert not sim.is_synchronized
    before = states(sim)
    system = orbits.from_rebound(sim)
    # The same ten steps, synchronized after each: the same up to the round-off of nine more half-steps.
    np.testing.assert_allclose(system.values.q, orbits.from_rebound(made(safe=1)).values.q, rtol=0, atol=1e-14)
    assert states(sim) == before
    assert not sim.is_synchronized


def plain():
    sim = rebound.Simulation()
    sim.add(m=1.0, name="star")
    sim.add(m=1e-3, x=1.0, vy=1.0, name="planet")
    return sim


def with_heavy_test_particle():
    sim = plain()
    sim.N_active = 1
    return sim


def with_forces():
    sim = plain()
    sim.additional_forces = lambda _: None
    return sim


def with_boundary():
    sim = plain()
    sim.boundary = "periodic"
    return sim


def without_gravity():
    sim = plain()
    sim.gravity = "none"
    return sim


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (with_heavy_test_particle, "'planet' is a test particle .* with mass 0.001"),
        (with_forces, "additional forces"),
        (with_boundary, "periodic"),
        (without_gravity, "none"),
        (rebound.Simulation, "without bodies"),
    ],
)
def test_what_a_system_cannot_be_is_refused_in_words(make, message):
    with pytest.raises(InputError, match=message):
        orbits.from_rebound(make())
