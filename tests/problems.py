"""Problems that many tests share, each built here and nowhere else: plain arrays (gm, q, v), or systems.

gm : (n,), q, v : (n, 3), with G = 1 unless it says otherwise; 0 in gm for massless particles, which come last.
"""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

import orbits

STATES = "2022-08-09"
"""The epoch of the bundled elements of asteroids."""

FIGURE_EIGHT = orbits.System(
    ["a", "b", "c"],
    gm=[1, 1, 1],
    q=[[0.97000436, -0.24308753, 0], [-0.97000436, 0.24308753, 0], [0, 0, 0]],
    v=[[0.466203685, 0.43236573, 0], [0.466203685, 0.43236573, 0], [-0.93240737, -0.86473146, 0]],
    units=orbits.DIMENSIONLESS,
)
"""Three equal bodies on one curve, with a period of 6.3259; Chenciner & Montgomery (2000)."""


def about_the_barycentre(gm, q, v):
    """Return the state with the centre of mass at rest at the origin."""
    return gm, q - (gm[:, None] * q).sum(axis=0) / gm.sum(), v - (gm[:, None] * v).sum(axis=0) / gm.sum()


def three_bodies(particles=0):
    """A star, an inner planet on an eccentric orbit and an outer one: nonlinear, not integrable, in no plane.

    particles : massless particles around them
    """
    gm = np.array([1.0, 1e-2, 3e-3])
    q = np.array([[0.0, 0.0, 0.0], [0.7, 0.1, 0.05], [-1.5, 0.4, -0.2]])
    v = np.array([[0.0, 0.0, 0.0], [-0.1, 1.3, 0.1], [-0.2, -0.7, 0.15]])
    gm, q, v = about_the_barycentre(gm, q, v)
    x, w = particles_around(particles)
    return np.append(gm, np.zeros(particles)), np.vstack([q, x]), np.vstack([v, w])


def particles_around(count=5):
    """Massless particles among the three bodies: q, v."""
    angle = np.linspace(0.3, 5.0, count)
    radius = np.linspace(2.0, 3.0, count)
    q = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle), 0.1 * np.cos(3 * angle)])
    v = np.column_stack([-np.sin(angle), np.cos(angle), 0.05 * np.sin(angle)]) / np.sqrt(radius)[:, None]
    return q, v


def kepler(e):
    """Two bodies of comparable mass, relative orbit with a = 1 and eccentricity e at pericentre, GM = 1 in all."""
    gm = np.array([0.7, 0.3])
    r, s = np.array([1 - e, 0.0, 0.0]), np.array([0.0, np.sqrt((1 + e) / (1 - e)), 0.0])
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    q, v = np.array([-0.3 * r, 0.7 * r]) @ tilt.T, np.array([-0.3 * s, 0.7 * s]) @ tilt.T
    return gm, q, v


def random_kepler(rng, e=0.2):
    """Two bodies on an orbit with a = GM = 1, anywhere on it and anyhow oriented."""
    gm = np.array([0.999, 0.001])
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    E = rng.uniform(0.0, 2.0 * np.pi)
    root = np.sqrt(1.0 - e * e)
    r = axes @ [np.cos(E) - e, root * np.sin(E), 0.0]
    w = axes @ [-np.sin(E), root * np.cos(E), 0.0] / (1.0 - e * np.cos(E))
    return gm, np.array([-gm[1] * r, gm[0] * r]), np.array([-gm[1] * w, gm[0] * w])


def kepler_orbit(e, t):
    """Exact position and velocity on a plane orbit with a = GM = 1, a time t after its pericentre: mpmath numbers."""
    E = mpmath.findroot(lambda x: x - e * mpmath.sin(x) - t, t + e * mpmath.sin(t))
    root = mpmath.sqrt(1 - e * e)
    rate = 1 / (1 - e * mpmath.cos(E))
    position = [mpmath.cos(E) - e, root * mpmath.sin(E)]
    return position, [-mpmath.sin(E) * rate, root * mpmath.cos(E) * rate]


def belt(asteroids: int) -> orbits.System:
    """Return Sun, planets and Moon with the brightest asteroids as massless particles."""
    return orbits.System.solar_system(STATES).add_particles(orbits.asteroids(asteroids))


def rebounds_outer_solar_system() -> Any:
    """Return Sun and giants as REBOUND makes them for its own tests, a Simulation in years / 2 pi and au with G = 1."""
    import rebound

    sim = rebound.Simulation()
    sim.add("outer solar system")
    sim.move_to_com()
    return sim
