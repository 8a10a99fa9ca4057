"""Drag as kernels see it: massive bodies in vectors and in lanes, particles with rates of their own."""

import numpy as np
import pytest

import orbits
from orbits.forces.drag import Drag
from orbits.kernels.binding import SumTag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.terms_and_forces import add_forces, total_particle_force
from orbits.kernels.lanes import lane, load

GM = np.array([1.0, 0.3])
STRENGTH = np.array([0.0, *GM])
U = np.array([0.1, -0.2, 0.3])


def bound(massive, particles):
    force = Drag(rate=0.5, velocity=U).in_units(orbits.DIMENSIONLESS)
    made = force.bound(np.array(massive), np.array(particles), orbits.DIMENSIONLESS)
    return SumTag((made.tag,)), (made.parameters,)


@kernel
def forces(tags, strength, parameters, q, v, f):
    add_forces(tags, strength, parameters, 0.0, q, v, f, f, f)


@kernel
def on_eight(tags, strength, parameters, particle, sources, speeds, points, velocities, out):
    place = load(points, 0), load(points, 1), load(points, 2)
    velocity = load(velocities, 0), load(velocities, 1), load(velocities, 2)
    found = total_particle_force(tags, strength, parameters, 0.0, particle, sources, speeds, place, velocity)
    for a in range(3):
        for k in range(8):
            out[a, k] = lane(found[a], k)


def test_drag_is_against_the_velocity_relative_to_the_medium_on_the_bodies_named():
    tags, parameters = bound([True, False], [])
    rng = np.random.default_rng(4)
    q, v, f = rng.normal(size=6), rng.normal(size=6), np.ones(6)
    forces(tags, STRENGTH, parameters, q, v, f)
    expected = np.ones((3, 2))
    expected[:, 0] -= 0.5 * GM[0] * (v.reshape(3, 2)[:, 0] - U)
    assert np.allclose(f.reshape(3, 2), expected, rtol=4e-16, atol=4e-16)  # a product and a sum
    rows = np.ones((6, 8))
    forces(tags, STRENGTH, parameters, np.repeat(q[:, None], 8, axis=1), np.repeat(v[:, None], 8, axis=1), rows)
    assert np.allclose(rows, f[:, None], rtol=4e-16, atol=4e-16)


@pytest.mark.parametrize("stages", [False, True])
def test_each_particle_has_its_own_rate_with_particles_in_lanes_and_with_stages_in_lanes(stages):
    acted_on = np.arange(11) % 3 == 0
    tags, parameters = bound([False, False], acted_on)
    velocities = np.random.default_rng(4).normal(size=(3, 8))
    sources, out = np.zeros((6, 8) if stages else 6), np.empty((3, 8))
    on_eight(tags, STRENGTH, parameters, 3, sources, sources, velocities, velocities, out)
    rates = np.where(acted_on[3], 0.5, 0.0) * np.ones(8) if stages else 0.5 * acted_on[3:]
    expected = -np.resize(rates, 8) * (velocities - U[:, None])
    assert np.allclose(out, expected, rtol=4e-16, atol=4e-16)
