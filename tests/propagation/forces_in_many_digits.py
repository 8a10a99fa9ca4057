"""Bodies with terms and forces in many digits, written from the formulas: for derivatives by differences.

Newton's attraction, J2 of the first body, tides in it with its spin, Marsden's force with g = (r0/r)^2, and radiation
pressure, both on the last body. Steps are those of the extrapolated midpoint rule (Hairer, Nørsett & Wanner 1993, sec.
II.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

COLUMNS = 9


@dataclass
class Numbers:
    """What acts: gm of each body; J2 and pole, with the radius R of the first; its tides; A1 ... A3 and beta of the
    last body, 1/c.
    """

    gm: Any
    J2: Any
    pole: Any
    R: Any
    k2: Any
    lag: Any
    inertia: Any
    A: Any
    beta: Any
    slow: Any


def rates(x: Numbers, y: Any, n: int) -> Any:
    """Return the rates of q, v (n, 3 each, in one vector) and of the spin of the first body."""
    q, v, s = y[: 3 * n].reshape(n, 3), y[3 * n : 6 * n].reshape(n, 3), y[6 * n :]
    a, torque = np.zeros((n, 3), dtype=object) * mpmath.mpf(0), np.zeros(3, dtype=object)
    for i in range(n):
        for j in range(n):
            if i != j:
                d = q[j] - q[i]
                a[i] = a[i] + x.gm[j] / mpmath.sqrt(d @ d) ** 3 * d
    for i in range(1, n):
        r, w = q[i] - q[0], v[i] - v[0]
        r2 = r @ r
        size = mpmath.sqrt(r2)
        up = (r @ x.pole) / size
        flat = x.gm[0] * x.J2 * x.R**2 * mpmath.mpf(1.5) / r2**2 * ((5 * up**2 - 1) * r / size - 2 * up * x.pole)
        bent = r + x.lag * (2 * (r @ w) / r2 * r + w + np.cross(r, s))
        pull = -3 * x.k2 * x.gm[i] * x.R**5 / r2**4 * bent
        a[i] = a[i] + flat + pull
        a[0] = a[0] - x.gm[i] / x.gm[0] * (flat + pull)
        torque = torque - x.gm[i] * np.cross(r, pull)
    r, w = q[-1] - q[0], v[-1] - v[0]
    size = mpmath.sqrt(r @ r)
    out, h = r / size, np.cross(r, w)
    h = h / mpmath.sqrt(h @ h)
    a[-1] = a[-1] + (x.A[0] * out + x.A[1] * np.cross(h, out) + x.A[2] * h) / size**2
    a[-1] = a[-1] + x.beta * x.gm[0] / size**2 * ((1 - (out @ w) * x.slow) * out - w * x.slow)
    return np.concatenate([v.ravel(), a.ravel(), torque / (x.inertia * x.gm[0] * x.R**2)])


def flow(x: Numbers, y: Any, end: Any, steps: int) -> Any:
    """Return the state after a time, by so many steps."""
    n = (len(y) - 3) // 6
    H = mpmath.mpf(end) / steps
    for _ in range(steps):
        begun, rows = rates(x, y, n), []
        for k in range(1, COLUMNS + 1):
            h = H / (2 * k)
            before, now = y, y + h * begun
            for _ in range(2 * k - 1):
                before, now = now, before + 2 * h * rates(x, now, n)
            row = [(before + now + h * rates(x, now, n)) / 2]
            for j in range(1, k):
                row.append(row[j - 1] + (row[j - 1] - rows[j - 1]) / ((mpmath.mpf(k) / (k - j)) ** 2 - 1))
            rows = row
        y = rows[-1]
    return y
