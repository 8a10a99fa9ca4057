"""The fastest passage ahead of a system, which determines how long a step may be.

Each body is paired with the massive body that dominates its motion at the start, that of the largest GM/r^3, and their
two-body orbit is followed to its pericentre, if that lies within the time span.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.search.apsides import apsides

TWO_PI = 2.0 * math.pi


@kernel
def fastest_passage(gm, softening, q, v, massive, given, span):
    """Return the fastest passage within the time `span`, whose sign is the direction: (row, partner, distance, speed,
    eccentricity, shortest period of any body); row -1 if there is no pair.

    gm : (n,); q, v : (n, 3); massive : indices of the bodies with GM > 0; given : (n,) bool, those that are not marched
    """
    fastest, row, partner, distance, speed, eccentricity, period = -1.0, -1, -1, 0.0, 0.0, 0.0, math.inf
    forwards = 1.0 if span >= 0.0 else -1.0
    for i in range(q.shape[0]):
        if given[i]:
            continue
        centre, strongest = -1, -1.0
        x = y = z = 0.0
        xi, yi, zi = q[i, 0], q[i, 1], q[i, 2]
        for k in range(massive.shape[0]):
            j = massive[k]
            if j == i:
                continue
            dx, dy, dz = xi - q[j, 0], yi - q[j, 1], zi - q[j, 2]
            r2 = dx * dx + dy * dy + dz * dz
            mu = gm[i] + gm[j]
            pull = mu * mu / (r2 * r2 * r2)
            if pull > strongest:
                centre, strongest = j, pull
                x, y, z = dx, dy, dz
        if centre < 0:
            continue
        u, v_y, w = v[i, 0] - v[centre, 0], v[i, 1] - v[centre, 1], v[i, 2] - v[centre, 2]
        mu = gm[i] + gm[centre]
        r2, speed2, rv = x * x + y * y + z * z, u * u + v_y * v_y + w * w, (x * u + y * v_y + z * w) * forwards
        r = math.sqrt(r2)
        e, nearest, _, _, inverse_a = apsides(mu, x, y, z, u, v_y, w)
        if inverse_a > 0.0:
            motion = math.sqrt(mu * inverse_a) * inverse_a
            period = min(period, TWO_PI / motion)
            anomaly = math.atan2(rv * math.sqrt(inverse_a / mu), 1.0 - r * inverse_a)
            mean = anomaly - rv * math.sqrt(inverse_a / mu)
            wait = (-mean if mean <= 0.0 else TWO_PI - mean) / motion
        else:
            wait = math.inf if rv >= 0.0 else -r2 / rv
        if not (wait <= abs(span) and nearest < r):
            nearest, reached2 = r, speed2
        else:
            reached2 = mu * (1.0 + e) / nearest
        rate2 = reached2 / (nearest * nearest + softening * softening)
        if not rate2 <= fastest:
            fastest, row, partner = rate2, i, centre
            distance, speed, eccentricity = nearest, math.sqrt(reached2), e
    return row, partner, distance, speed, eccentricity, period
