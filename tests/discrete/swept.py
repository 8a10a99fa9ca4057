"""Kepler's problem as the tests of exact discrete Lagrangians want it: ends, action, angle."""

import mpmath
import numpy as np

from ..kepler_truth import flow

DIGITS = 40


def motion(q, v, gm, h):
    """Return position and velocity after h as floats, and the action per unit mass, int |v|^2/2 + gm/r dt."""
    with mpmath.workdps(DIGITS):
        q1, v1, s = flow([float(x) for x in q], [float(x) for x in v], float(gm), float(h))
        q, v, gm, h = mpmath.matrix(q), mpmath.matrix(v), mpmath.mpf(float(gm)), mpmath.mpf(float(h))
        beta = 2 * gm / mpmath.norm(q) - sum(x * x for x in v)
        # |v|^2/2 + gm/r = 2 gm/r - beta/2, and dt = r ds.
        action = 2 * gm * (s or 0) - beta * h / 2
        return np.array([float(x) for x in q1]), np.array([float(x) for x in v1]), float(action)


def swept(q, v, q1, h):
    """The angle from q to q1 along the motion, in degrees, below one revolution."""
    normal = np.cross([*q, 0][:3], [*v, 0][:3]) * np.sign(h)
    across = np.cross([*q, 0][:3], [*q1, 0][:3]) @ normal / np.sqrt(normal @ normal)
    return np.degrees(np.arctan2(across, q @ q1)) % 360
