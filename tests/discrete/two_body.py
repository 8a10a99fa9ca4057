"""The Kepler flow in many digits, by universal variables and bisection; independent of the library."""

import mpmath
import numpy as np

DIGITS = 40


def _stumpff(z):
    if abs(z) < mpmath.mpf(10) ** -18:
        return 1 - z / 2, 1 - z / 6, mpmath.mpf(1) / 2 - z / 24, mpmath.mpf(1) / 6 - z / 120
    x = mpmath.sqrt(abs(z))
    if z > 0:
        return mpmath.cos(x), mpmath.sin(x) / x, (1 - mpmath.cos(x)) / z, (x - mpmath.sin(x)) / (z * x)
    return mpmath.cosh(x), mpmath.sinh(x) / x, (1 - mpmath.cosh(x)) / z, (x - mpmath.sinh(x)) / (z * x)


def flow(q, v, gm, h):
    """Return position and velocity after h as floats, and the action per unit mass, int |v|^2/2 + gm/r dt."""
    with mpmath.workdps(DIGITS):
        q, v = [mpmath.mpf(float(x)) for x in q], [mpmath.mpf(float(x)) for x in v]
        gm, h = mpmath.mpf(float(gm)), mpmath.mpf(float(h))
        r0 = mpmath.sqrt(sum(x * x for x in q))
        qv, beta = sum(a * b for a, b in zip(q, v, strict=True)), 2 * gm / r0 - sum(x * x for x in v)

        def G(s):
            c0, c1, c2, c3 = _stumpff(beta * s * s)
            return c0, s * c1, s * s * c2, s**3 * c3

        def time(s):
            _, g1, g2, g3 = G(s)
            return r0 * g1 + qv * g2 + gm * g3

        low, high = mpmath.mpf(-1), mpmath.mpf(1)
        while time(low) > h:
            low *= 2
        while time(high) < h:
            high *= 2
        s = (low + high) / 2
        for _ in range(300):
            g0, g1, g2, g3 = G(s)
            miss = r0 * g1 + qv * g2 + gm * g3 - h
            low, high = (low, s) if miss > 0 else (s, high)
            last, s = s, s - miss / (r0 * g0 + qv * g1 + gm * g2)
            if not low < s < high:
                s = (low + high) / 2
            if abs(s - last) <= mpmath.mpf(10) ** (5 - DIGITS) * abs(s):
                break
        g0, g1, g2, g3 = G(s)
        r = r0 * g0 + qv * g1 + gm * g2
        f, g, fd, gd = 1 - gm / r0 * g2, r0 * g1 + qv * g2, -gm / r0 / r * g1, 1 - gm / r * g2
        q1 = np.array([float(f * a + g * b) for a, b in zip(q, v, strict=True)])
        v1 = np.array([float(fd * a + gd * b) for a, b in zip(q, v, strict=True)])
        # |v|^2/2 + gm/r = 2 gm/r - beta/2, and dt = r ds.
        return q1, v1, float(2 * gm * s - beta * h / 2)


def swept(q, v, q1, h):
    """The angle from q to q1 along the motion, in degrees, below one revolution."""
    normal = np.cross([*q, 0][:3], [*v, 0][:3]) * np.sign(h)
    across = np.cross([*q, 0][:3], [*q1, 0][:3]) @ normal / np.sqrt(normal @ normal)
    return np.degrees(np.arctan2(across, q @ q1)) % 360
