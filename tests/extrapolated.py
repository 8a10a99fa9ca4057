"""A reference of another family in extended precision: the extrapolated midpoint rule for a massless particle about a
body at rest at the origin, with relativity, a flattening and light.

Steps are a fraction of r^(3/2). Source: Hairer, Nørsett & Wanner (1993), sec. II.9.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Vector = np.ndarray
COLUMNS = 12


def acceleration(gm: float, c: float, J2: float, radius: float, beta: float) -> Callable[[Vector, Vector], Vector]:
    """Return the acceleration at (q, v): `PostNewtonian` by its Lagrangian, J2 with its pole along z, light."""
    gm, small, J2, radius, beta = (np.longdouble(x) for x in (gm, 1 / np.longdouble(c) ** 2, J2, radius, beta))
    slow = np.sqrt(small)

    def of(q: Vector, v: Vector) -> Vector:
        r2, v2 = q @ q, v @ v
        r = np.sqrt(r2)
        pull = -gm * q / r2 / r
        s = q[2] / r
        flat = 1.5 * J2 * gm * radius**2 / r2**2
        pull = pull + flat * ((5 * s * s - 1) * q / r - np.array([0, 0, 2 * s], dtype=np.longdouble))
        pull = pull + beta * gm / r2 * ((1 - (q @ v) / r * slow) * q / r - v * slow)
        pull = pull + small * (gm**2 / r2**2 - 1.5 * gm * v2 / r2 / r) * q + 3 * small * gm * (q @ v) / r2 / r * v
        heavy = 1 + small * (0.5 * v2 + 3 * gm / r)
        return (pull - small * v * (v @ pull) / (heavy + small * v2)) / heavy

    return of


def motion(
    of: Callable[[Vector, Vector], Vector], gm: float, q: Vector, v: Vector, end: float, part: float = 0.4
) -> tuple[Vector, Vector]:
    """Return q and v after a time, in extended precision; each step takes `part` of sqrt(r^3 / GM)."""
    y, t = np.concatenate([q, v]).astype(np.longdouble), np.longdouble(0)

    def slope(y: Vector) -> Vector:
        return np.concatenate([y[3:], of(y[:3], y[3:])])

    while t < end:
        r2 = y[:3] @ y[:3]
        H = min(np.longdouble(part) * np.sqrt(r2 * np.sqrt(r2) / np.longdouble(gm)), np.longdouble(end) - t)
        rows: list[Vector] = []
        begun = slope(y)
        for k in range(1, COLUMNS + 1):
            h = H / (2 * k)
            before, now = y, y + h * begun
            for _ in range(2 * k - 1):
                before, now = now, before + 2 * h * slope(now)
            row = [(before + now + h * slope(now)) / 2]
            for j in range(1, k):
                ratio = (np.longdouble(k) / (k - j)) ** 2 - 1
                row.append(row[j - 1] + (row[j - 1] - rows[j - 1]) / ratio)
            rows = row
        y, t = rows[-1], t + H
    return y[:3], y[3:]
