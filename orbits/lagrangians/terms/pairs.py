"""What terms share whose part of L is a sum of functions of q_i - q_b and v_i - v_b."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put, sqrt


@kernel(inline=True)
def difference(q, i, b, n):
    """Return q_i - q_b, three numbers."""
    return get(q, i) - get(q, b), get(q, n + i) - get(q, n + b), get(q, 2 * n + i) - get(q, 2 * n + b)


@kernel(inline=True)
def separation(place, sources, b, n):
    """Return a point minus q_b, three numbers; or a velocity minus v_b."""
    return place[0] - get(sources, b), place[1] - get(sources, n + b), place[2] - get(sources, 2 * n + b)


@kernel(inline=True)
def dot(a, b):
    """Return the scalar product of two vectors of three numbers."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(inline=True)
def add_with_reaction(out, change, i, b, n):
    """Add three numbers to those of body i, and take them from those of body b."""
    for a in range(3):
        put(out, a * n + i, get(out, a * n + i) + change[a])
        put(out, a * n + b, get(out, a * n + b) - change[a])


@kernel(inline=True)
def put_acceleration(out, a, i, n):
    """Add three numbers to the acceleration of body i."""
    for k in range(3):
        put(out, k * n + i, get(out, k * n + i) + a[k])


@kernel(inline=True)
def put_reaction(out, forces, inertia, b, n):
    """Take a sum of forces on others, times 1 / G m_b, from the acceleration of body b."""
    for k in range(3):
        put(out, k * n + b, get(out, k * n + b) - inertia * forces[k])


@kernel(inline=True)
def add_differences(out, at, value, a, c, i, b, n):
    """Add a derivative by differences, of axes a and c, to the block of derivatives that starts at `at`."""
    d = 3 * n
    ii, bb = at + (a * n + i) * d + c * n + i, at + (a * n + b) * d + c * n + b
    ib, bi = at + (a * n + i) * d + c * n + b, at + (a * n + b) * d + c * n + i
    put(out, ii, get(out, ii) + value)
    put(out, bb, get(out, bb) + value)
    put(out, ib, get(out, ib) - value)
    put(out, bi, get(out, bi) - value)


@kernel(inline=True)
def add_pair_tide(strength, sign, q, i, j, out):
    """Add the second derivatives of sign G m_i m_j / r to those by places."""
    n = strength.shape[0] - 1
    d = 3 * n
    dx, dy, dz = difference(q, j, i, n)
    r2 = dx * dx + dy * dy + dz * dz + strength[0]
    w = sign * strength[1 + i] * strength[1 + j] / (r2 * sqrt(r2))
    for a in range(3):
        da = dx if a == 0 else (dy if a == 1 else dz)
        for b in range(3):
            db = dx if b == 0 else (dy if b == 1 else dz)
            tide = w * (3.0 * da * db / r2 - (1.0 if a == b else 0.0))
            ii, jj = (a * n + i) * d + b * n + i, (a * n + j) * d + b * n + j
            ij, ji = (a * n + i) * d + b * n + j, (a * n + j) * d + b * n + i
            put(out, ii, get(out, ii) + tide)
            put(out, jj, get(out, jj) + tide)
            put(out, ij, get(out, ij) - tide)
            put(out, ji, get(out, ji) - tide)


@kernel(inline=True)
def add_between(out, value, a, c, i, b, other, n):
    """Add a derivative by q_i - q_b, axis a, and by q_other - q_b, axis c, and its mirror image to the block at 0."""
    d = 3 * n
    rows, columns = (a * n + i, a * n + b), (c * n + other, c * n + b)
    for x in range(2):
        for y in range(2):
            change = value if x == y else -value
            at, mirrored = rows[x] * d + columns[y], columns[y] * d + rows[x]
            put(out, at, get(out, at) + change)
            put(out, mirrored, get(out, mirrored) + change)
