"""The Lagrangians of the package against the formulas of their sources, written out here once more."""

from math import cos, hypot, sin
from types import SimpleNamespace

import numpy as np
import pytest

from orbits.lagrangians import registry

FORMULAS = {
    "charged-particle": lambda q, v, t, p: (
        p.m * (v @ v) / 2
        + p.e * (p.B0 / 2 + p.B2 * (q[0] ** 2 + q[1] ** 2) / 4) * (q[0] * v[1] - q[1] * v[0])
        - p.e * p.E2 * (q[2] ** 2 - (q[0] ** 2 + q[1] ** 2) / 2)
    ),
    "double-pendulum": lambda q, v, t, p: (
        p.m1 * (p.l1 * v[0]) ** 2 / 2
        + p.m2 * ((p.l1 * v[0]) ** 2 + (p.l2 * v[1]) ** 2 + 2 * p.l1 * p.l2 * v[0] * v[1] * cos(q[0] - q[1])) / 2
        + p.g * (p.m1 * p.l1 * cos(q[0]) + p.m2 * (p.l1 * cos(q[0]) + p.l2 * cos(q[1])))
    ),
    "driven-pendulum": lambda q, v, t, p: v[0] ** 2 / 2 + (p.g + p.a * p.w**2 * cos(p.w * t)) * cos(q[0]),
    "free-particle": lambda q, v, t, p: p.m * (v @ v) / 2,
    "harmonic-oscillator": lambda q, v, t, p: (p.m * v[0] ** 2 - p.k * q[0] ** 2) / 2,
    "henon-heiles": lambda q, v, t, p: (
        v @ v / 2 - q @ q / 2 - p.k * q[0] ** 2 * q[1] + p.k * q[1] ** 3 / 3
    ),
    "kepler": lambda q, v, t, p: v @ v / 2 + p.GM / hypot(*q),
    "oblate": lambda q, v, t, p: (
        v @ v / 2 + p.GM / hypot(*q) * (1 - p.J2 * (p.R / hypot(*q)) ** 2 * (3 * (q[2] / hypot(*q)) ** 2 - 1) / 2)
    ),
    "pendulum": lambda q, v, t, p: p.m * (p.l * v[0]) ** 2 / 2 + p.m * p.g * p.l * cos(q[0]),
    "restricted-three-body": lambda q, v, t, p: (
        ((v[0] - q[1]) ** 2 + (v[1] + q[0]) ** 2) / 2  # the velocity in the frame at rest
        + (1 - p.mu) / hypot(q[0] + p.mu, q[1])
        + p.mu / hypot(q[0] - (1 - p.mu), q[1])
    ),
    "spherical-pendulum": lambda q, v, t, p: (
        p.m * p.l**2 * (v[0] ** 2 + (sin(q[0]) * v[1]) ** 2) / 2 + p.m * p.g * p.l * cos(q[0])
    ),
    "spin-orbit": lambda q, v, t, p: (
        (v[0] ** 2 + v[1] ** 2) / 2
        + p.GM / hypot(q[0], q[1])
        + p.eps * v[2] ** 2 / 2
        + p.eps * p.GM * p.alpha**2 * cos(2 * (q[2] - np.arctan2(q[1], q[0]))) / (4 * hypot(q[0], q[1]) ** 3)
    ),
    "transformed-kepler": lambda q, v, t, p: (
        (v[0] ** 2 + v[1] ** 2) / (2 * hypot(q[0], q[1]) ** 1.5)
        + hypot(q[0], q[1]) ** 1.5 * (p.GM / hypot(q[0], q[1]) + p.E0)
        + (v[2] - hypot(q[0], q[1]) ** 1.5) ** 2 / 2
    ),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_the_value_is_that_of_the_formula_of_the_source(name):
    L = registry()[name]
    changed = {key: value * (1.1 + 0.13 * k) for k, (key, value) in enumerate(L.parameters.items())}
    if name == "spin-orbit":
        changed["eps"] = 0.7  # so that the terms with it are seen
    L = L.with_parameters(**changed)
    rng = np.random.default_rng(7)
    for _ in range(3):
        q = np.array(L.example.q) + 0.05 * rng.normal(size=L.dimension)
        v = np.array(L.example.v) + 0.05 * rng.normal(size=L.dimension)
        expected = FORMULAS[name](q, v, 0.3, SimpleNamespace(**L.parameters))
        # Some roundings of terms of order one.
        assert abs(L.value(q, v, 0.3) - expected) < 4e-15 * max(1.0, abs(expected))
