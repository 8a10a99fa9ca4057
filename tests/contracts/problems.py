"""What the contract tests do with a method: march, map a step, differentiate it, measure its error."""

import itertools

import numpy as np

from orbits.elements import two_body
from orbits.errors import ConvergenceError
from orbits.integrators import registry
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg

from ..problems import kepler


def methods():
    """The examples of every registered method of point masses."""
    for _, cls in sorted(registry().items()):
        yield from (method for method in cls.examples() if method.serves(newtonian))


def marcher(method, gm, q, v, h, *, threads=1):
    massive = gm > 0
    return Leg.of(newtonian, method, parameters(gm[massive]), massive, q, v, h, threads=threads)


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


def errors_against_the_exact_orbit(method, eccentricity, end, counts):
    """Numbers of steps that a method takes, and the distance from the exact two-body orbit after each."""
    gm, q, v = kepler(eccentricity)
    relative, _ = two_body(q[1] - q[0], v[1] - v[0], gm.sum(), end)
    kept = []
    for count in counts:
        try:
            q1, _ = march(method, gm, q, v, end / count, int(count))
        except ConvergenceError:
            continue  # a step that is far too long is refused
        kept.append((count, np.linalg.norm(q1[1] - q1[0] - relative)))
    return np.array(kept).T


def pairs(*sequences):
    return list(itertools.product(*sequences))
