"""The derivative of Kepler's flow is that of the flow in fifty digits, on every conic and for any step."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from orbits.kernels.compile import kernel
from orbits.kernels.tangents.of_kepler_flow import flow_change, flow_of

from ..coverings import at

CASES = {
    "short": (0.9, 0.05),
    "backwards": (0.9, -0.1),
    "past the pericentre": (0.4, 2.0),
    "more than a period": (1.0, 9.0),
    "many periods back": (1.0, -40.0),
    "hyperbola": (1.9, 3.0),
    "hyperbola backwards": (1.9, -2.0),
    "parabola": (2.0**0.5, 0.5),
}


def stumpff(n, s, beta):
    """Return s^n c_n(beta s^2) by its series."""
    term, total, k = mpmath.mpf(1) / mpmath.factorial(n), mpmath.mpf(0), 0
    while abs(term) > mpmath.mpf(10) ** -60:
        total, k = total + term, k + 1
        term = -term * beta * s * s / ((2 * k + n) * (2 * k + n - 1))
    return s**n * total


def flow(start, dt):
    """Return the state after dt about GM = 1, by bisection and Newton's method."""
    x, v = start[:3], start[3:]
    r0, eta = mpmath.sqrt(mpmath.fdot(x, x)), mpmath.fdot(x, v)
    beta = 2 / r0 - mpmath.fdot(v, v)
    zeta = 1 - beta * r0

    def miss(s):
        return r0 * s + eta * stumpff(2, s, beta) + zeta * stumpff(3, s, beta) - dt

    low, high = sorted([mpmath.mpf(0), dt / r0])
    while miss(high) < 0:
        high *= 2
    while miss(low) > 0:
        low *= 2
    for _ in range(14):
        middle = (low + high) / 2
        low, high = (low, middle) if miss(middle) > 0 else (middle, high)
    s = (low + high) / 2
    for _ in range(7):
        s -= miss(s) / (r0 + eta * stumpff(1, s, beta) + zeta * stumpff(2, s, beta))
    G1, G2, G3 = (stumpff(k, s, beta) for k in (1, 2, 3))
    r = r0 + eta * G1 + zeta * G2
    f, g, df, dg = 1 - G2 / r0, dt - G3, -G1 / (r0 * r), 1 - G2 / r
    return [f * a + g * b for a, b in zip(x, v, strict=True)] + [df * a + dg * b for a, b in zip(x, v, strict=True)]


@kernel
def flow_matrix(x, v, gm, dt, increments, out):
    """Write the derivative of a step of Kepler's flow by its start, (6, 6).

    x, v : (3,); increments : (6,), of the step
    """
    d = increments
    flow = flow_of((x[0], x[1], x[2]), (v[0], v[1], v[2]), gm, dt, (d[0], d[1], d[2]), (d[3], d[4], d[5]))
    for k in range(6):
        for i in range(6):
            out[i, k] = 1.0 if i == k else 0.0
        way, change = flow_change(flow, (out[0, k], out[1, k], out[2, k]), (out[3, k], out[4, k], out[5, k]))
        for i in range(3):
            out[i, k] += way[i]
            out[3 + i, k] += change[i]


@pytest.mark.parametrize("name", at((1, 7), CASES))
def test_the_derivative_of_a_kepler_motion_is_that_of_fifty_digits(name):
    speed, dt = CASES[name]
    x, v = np.array([0.6, -0.64, 0.48]), np.array([0.48, 0.8, -0.36])
    v *= speed / np.linalg.norm(v)
    found, expected = np.zeros((6, 6)), np.zeros((6, 6))
    with mpmath.workdps(50):
        start, tiny = [mpmath.mpf(float(c)) for c in (*x, *v)], mpmath.mpf(10) ** -15
        end = flow(start, mpmath.mpf(dt))
        flow_matrix(x, v, 1.0, dt, np.array([float(b - a) for a, b in zip(start, end, strict=True)]), found)
        for k in range(6):
            there, back = ([c + sign * tiny * (i == k) for i, c in enumerate(start)] for sign in (1, -1))
            ends = zip(flow(there, mpmath.mpf(dt)), flow(back, mpmath.mpf(dt)), strict=True)
            expected[:, k] = [float((a - b) / (2 * tiny)) for a, b in ends]
    # Rounding, which grows with the angle swept: seen are 2e-16 for short steps and 8e-14 for forty units of time.
    bound = 5e-15 * max(1.0, abs(dt))
    assert np.abs(found - expected).max() < bound * np.abs(expected).max()
