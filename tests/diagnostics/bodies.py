"""Bodies for the diagnostics of steps: no symmetry, no plane, and two massless particles among them."""

import numpy as np


def three_bodies(particles=True):
    """A star, an inner planet on an eccentric orbit, an outer one, and two particles: gm, q, v about the barycentre."""
    gm = np.array([1.0, 1e-2, 3e-3, 0.0, 0.0])
    q = np.array([[0.0, 0.0, 0.0], [0.7, 0.1, 0.05], [-1.5, 0.4, -0.2], [2.0, 0.3, 0.1], [-0.2, 2.5, 0.1]])
    v = np.array([[0.0, 0.0, 0.0], [-0.1, 1.3, 0.1], [-0.2, -0.7, 0.15], [-0.1, 0.7, 0.1], [-0.6, 0.0, 0.1]])
    q -= (gm @ q) / gm.sum()
    v -= (gm @ v) / gm.sum()
    n = 5 if particles else 3
    return gm[:n], q[:n], v[:n]


def random_kepler(rng, e=0.2):
    """Two bodies on an orbit with a = GM = 1, anywhere on it and anyhow oriented: gm, q, v."""
    gm = np.array([0.999, 0.001])
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    E = rng.uniform(0.0, 2.0 * np.pi)
    root = np.sqrt(1.0 - e * e)
    r = axes @ [np.cos(E) - e, root * np.sin(E), 0.0]
    w = axes @ [-np.sin(E), root * np.cos(E), 0.0] / (1.0 - e * np.cos(E))
    return gm, np.array([-gm[1] * r, gm[0] * r]), np.array([-gm[1] * w, gm[0] * w])
