"""Nonlinear problems for the contract tests, and the one-step map of any method on them, as plain float arrays."""

import itertools

import numpy as np

from orbits.integrators import registry
from orbits.integrators.marcher import Marcher
from orbits.lagrangians.newtonian import newtonian, parameters


def methods():
    """The examples of every registered method."""
    for _, cls in sorted(registry().items()):
        yield from cls.examples()


def three_bodies():
    """A star, an inner planet on an eccentric orbit and an outer one: nonlinear, not integrable, in no plane."""
    gm = np.array([1.0, 1e-2, 3e-3])
    q = np.array([[0.0, 0.0, 0.0], [0.7, 0.1, 0.05], [-1.5, 0.4, -0.2]])
    v = np.array([[0.0, 0.0, 0.0], [-0.1, 1.3, 0.1], [-0.2, -0.7, 0.15]])
    v -= (gm[:, None] * v).sum(axis=0) / gm.sum()
    q -= (gm[:, None] * q).sum(axis=0) / gm.sum()
    return gm, q, v


def kepler(e):
    """Two bodies of comparable mass, relative orbit with a = 1 and eccentricity e at pericentre, GM = 1 in all."""
    gm = np.array([0.7, 0.3])
    r, s = np.array([1 - e, 0.0, 0.0]), np.array([0.0, np.sqrt((1 + e) / (1 - e)), 0.0])
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    q, v = np.array([-0.3 * r, 0.7 * r]) @ tilt.T, np.array([-0.3 * s, 0.7 * s]) @ tilt.T
    return gm, q, v


def particles_around(count=5):
    """Massless particles among the three bodies."""
    angle = np.linspace(0.3, 5.0, count)
    radius = np.linspace(2.0, 3.0, count)
    q = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle), 0.1 * np.cos(3 * angle)])
    v = np.column_stack([-np.sin(angle), np.cos(angle), 0.05 * np.sin(angle)]) / np.sqrt(radius)[:, None]
    return q, v


def marcher(method, gm, q, v, h, *, threads=1):
    massive = gm > 0
    return Marcher(newtonian, method, parameters(gm[massive]), massive, q, v, h, threads=threads)


def march(method, gm, q, v, h, steps):
    run = marcher(method, gm, q, v, h)
    run.advance(steps)
    return run.state()


def phase_map(method, gm, h):
    """The step as a map of the vector (q, p) of the massive bodies, p = GM v."""
    n = len(gm)
    m = np.repeat(gm, 3)

    def step(z):
        q, v = march(method, gm, z[: 3 * n].reshape(n, 3), (z[3 * n :] / m).reshape(n, 3), h, 1)
        return np.concatenate([q.ravel(), m * v.ravel()])

    return step


def jacobian(function, z, scales):
    """The derivative by eighth-order central differences; column by column with its own step."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    columns = []
    for k, scale in enumerate(scales):
        delta = 0.01 * scale
        unit = np.zeros(len(z))
        unit[k] = delta
        columns.append(sum(w * (function(z + m * unit) - function(z - m * unit)) for m, w in weights.items()) / delta)
    return np.array(columns).T


def pairs(*sequences):
    return list(itertools.product(*sequences))
