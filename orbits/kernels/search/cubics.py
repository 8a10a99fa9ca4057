"""The relative motion of a pair within a step, as the cubic Hermite polynomial through the states at its ends."""

from __future__ import annotations

from orbits.kernels.compile import kernel


@kernel(inline=True)
def hermite(s, h, x0, v0, x1, v1):
    """Return position, velocity and acceleration at the fraction s of a step of h between two states."""
    a, b = x1 - x0 - h * v0, h * (v1 - v0)
    c2, c3 = 3.0 * a - b, b - 2.0 * a
    velocity = v0 + s * (2.0 * c2 + 3.0 * s * c3) / h
    return x0 + s * (h * v0 + s * (c2 + s * c3)), velocity, (2.0 * c2 + 6.0 * s * c3) / (h * h)


@kernel(inline=True)
def distance2_at(s, h, first, second):
    """Return the squared distance at the fraction s of a step of h, half of its first two derivatives by s, and the
    squared speed; numbers or `Lanes`.

    first, second : relative positions and velocities, six numbers each
    """
    (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = first, second
    x, u, ax = hermite(s, h, x0, u0, x1, u1)
    y, v, ay = hermite(s, h, y0, v0, y1, v1)
    z, w, az = hermite(s, h, z0, w0, z1, w1)
    speed2 = u * u + v * v + w * w
    fall, slope = (x * u + y * v + z * w) * h, (speed2 + x * ax + y * ay + z * az) * h * h
    return x * x + y * y + z * z, fall, slope, speed2
