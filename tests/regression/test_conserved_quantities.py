"""What is called |dE/E| and |dL/L| is that, by one set of functions, also where the textbook ratio is 0/0."""

from __future__ import annotations

import numpy as np
import pytest

from orbits.point_masses import PointMasses
from orbits.regression.conserved_quantities import Invariants

GM = np.array([1.0, 0.5, 0.0])
Q = np.array([[0.0, 0.1, 0.0], [1.0, 0.0, 0.2], [3.0, 0.0, 0.0]])
V = np.array([[0.0, -0.3, 0.1], [0.1, 0.8, 0.0], [0.0, 0.6, 0.0]])


def energy(gm, q, v):
    kinetic = 0.5 * sum(m * (u @ u) for m, u in zip(gm, v, strict=True))
    return kinetic - gm[0] * gm[1] / np.linalg.norm(q[1] - q[0])


def test_errors_of_massive_bodies_are_relative_to_the_initial_energy_and_angular_momentum():
    scaled = V * [[1.0], [1.001], [2.0]]  # the massless body does not count, whatever it does
    invariants = Invariants(PointMasses(GM, Q, V))
    measured_energy, measured_momentum = invariants.errors(np.array([Q, Q]), np.array([V, scaled]))
    e0, e1 = energy(GM, Q, V), energy(GM, Q, scaled)
    l0, l1 = (sum(m * np.cross(x, u) for m, x, u in zip(GM, Q, w, strict=True)) for w in (V, scaled))
    assert measured_energy[0] == measured_momentum[0] == 0.0
    # The plain formulas of this test round; the package's do not. 1e-12: their round-off over an error of 1e-3.
    assert measured_energy[1] == pytest.approx(abs((e1 - e0) / e0), rel=1e-12)
    assert measured_momentum[1] == pytest.approx(np.linalg.norm(l1 - l0) / np.linalg.norm(l0), rel=1e-12)


def test_about_one_massive_body_the_worst_particle_counts_with_its_own_energy():
    gm, q, v = np.array([0.0, 2.0, 0.0]), Q.copy(), V.copy()
    invariants = Invariants(PointMasses(gm, q, v))
    assert any("massless" in note for note in invariants.notes)
    changed = v.copy()
    changed[0] *= 1.01
    changed[2] *= 1.0001
    measured, _ = invariants.errors(q[None], changed[None])
    r, speed0, speed1 = (np.linalg.norm(x[0] - x[1]) for x in (q, v, changed))
    e0, e1 = 0.5 * speed0**2 - 2 / r, 0.5 * speed1**2 - 2 / r
    assert measured[0] == pytest.approx(abs((e1 - e0) / e0), rel=1e-12)


def test_a_vanishing_angular_momentum_is_compared_with_the_size_of_its_terms():
    gm, q = np.ones(2), np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    v = np.array([[0.0, 1, 0], [0.0, 1, 0]])  # q x v of the two cancel
    invariants = Invariants(PointMasses(gm, q, v))
    assert any("angular momentum vanishes" in note for note in invariants.notes)
    _, momentum = invariants.errors(q[None], (v * [[1.0], [1.25]])[None])
    assert momentum[0] == 0.125  # |dL| = 0.25 over terms that sum to 2


def test_one_body_alone_has_no_such_errors():
    measured = Invariants(PointMasses(np.ones(1), np.zeros((1, 3)), np.ones((1, 3)))).errors(
        np.zeros((4, 1, 3)), np.ones((4, 1, 3))
    )
    assert all(np.all(np.isnan(x)) and x.shape == (4,) for x in measured)
