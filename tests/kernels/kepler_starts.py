"""Starts on Kepler orbits of all kinds, and their increments by the general kernel; for tests of Kepler flows."""

import mpmath as mp
import numpy as np
import pytest

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.flow import kepler_increments
from orbits.kernels.lanes import load, store


@kernel
def increments(state, gm, dt, out):
    for p in range(0, state.shape[1], 8):
        x, y, z = load(state[0], p), load(state[1], p), load(state[2], p)
        u, v, w = load(state[3], p), load(state[4], p), load(state[5], p)
        dx, dy, dz, du, dv, dw = kepler_increments(x, y, z, u, v, w, load(gm, p), load(dt, p))
        store(out[0], p, dx)
        store(out[1], p, dy)
        store(out[2], p, dz)
        store(out[3], p, du)
        store(out[4], p, dv)
        store(out[5], p, dw)


def start(e, rng, anywhere=True):
    """A state (6,) on a conic with GM 1 and pericentre distance 1, anywhere on it, turned at random."""
    with mp.workdps(40):
        e = mp.mpf(float(e))
        if e < 1 and rng.integers(2):
            E = mp.mpf(rng.uniform(-np.pi, np.pi))
            f = 2 * mp.atan(mp.sqrt((1 + e) / (1 - e)) * mp.tan(E / 2))
        elif e <= 1:
            f = mp.mpf(rng.uniform(-3.1, 3.1))
        else:
            f = mp.acos(-1 / e) * mp.mpf(rng.uniform(-1, 1) * rng.choice([0.5, 0.9, 0.99999]))
        r, root = (1 + e) / (1 + e * mp.cos(f)), mp.sqrt(1 + e)
        q = np.array([float(r * mp.cos(f)), float(r * mp.sin(f)), 0.0])
        v = np.array([float(-mp.sin(f) / root), float((e + mp.cos(f)) / root), 0.0])
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.concatenate([turn @ q, turn @ v])


def all_sorts(count, seed):
    """States of all conics with steps of all lengths, easy and hard ones side by side."""
    rng = np.random.default_rng(seed)
    e = rng.choice([0.0, 0.05, 0.3, 0.9, 0.9999, 1.0, 1.2, 30.0], count)
    state = np.array([start(x, rng) for x in e]).T.copy()
    dt = rng.choice([-1, 1], count) * 10.0 ** rng.uniform(-9, 3, count)
    gm = np.where(rng.random(count) < 0.05, 0.0, rng.uniform(0.5, 2.0, count))
    return state, gm, dt


def energies(state):
    return np.sum(state[3:] ** 2, axis=0) / 2 - 1 / np.sqrt(np.sum(state[:3] ** 2, axis=0))


def ellipses(e, count, seed):
    """Ellipses with GM 1 and a of 0.5 to 2, uniform in mean anomaly, turned at random, and their periods."""
    rng = np.random.default_rng(seed)
    M, a = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.5, 2.0, count)
    E = M
    for _ in range(60):
        E = M + e * np.sin(E)
    b, r = np.sqrt(1 - e * e), 1 - e * np.cos(E)
    q, v = np.array([np.cos(E) - e, b * np.sin(E), 0 * E]), np.array([-np.sin(E) / r, b * np.cos(E) / r, 0 * E])
    for i, j in ((0, 1), (1, 2)):
        angle = rng.uniform(0, 2 * np.pi, count)
        for x in (q, v):
            x[i], x[j] = np.cos(angle) * x[i] - np.sin(angle) * x[j], np.sin(angle) * x[i] + np.cos(angle) * x[j]
    return np.concatenate([q * a, v / np.sqrt(a)]), 2 * np.pi * a**1.5


needs_extended = pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="energies need extended precision")
