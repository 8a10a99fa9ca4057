"""Pair sums of Newtonian gravity, plain or with Plummer softening.

Positions of n bodies are a vector of 3n coordinates, all x, then all y, then all z; in an (3n, 8) array each row holds
one coordinate in eight lanes (the stages of an implicit step). `strength` is a vector of 1 + n numbers: the softening
length squared, then GM of each body. Two bodies at one place give values that are not finite; callers look for them.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, get, load, put, rsqrt_cubed, sqrt, store, unit


@kernel
def pair_accelerations(strength, q, out):
    """Write the accelerations of n mutually attracting bodies into `out`, each pair evaluated once.

    q, out : (3n,) float64 or (3n, 8) lanes; strength : (1 + n,)
    """
    n = strength.shape[0] - 1
    softening2 = strength[0]
    zero = get(q, 0) * 0.0
    for k in range(3 * n):
        put(out, k, zero)
    for i in range(n):
        x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
        ax, ay, az = get(out, i), get(out, n + i), get(out, 2 * n + i)
        gm_i = strength[1 + i]
        for j in range(i + 1, n):
            dx, dy, dz = get(q, j) - x, get(q, n + j) - y, get(q, 2 * n + j) - z
            w = rsqrt_cubed(dx * dx + dy * dy + dz * dz + softening2)
            w_i, w_j = w * strength[1 + j], w * gm_i
            ax, ay, az = ax + w_i * dx, ay + w_i * dy, az + w_i * dz
            put(out, j, get(out, j) - w_j * dx)
            put(out, n + j, get(out, n + j) - w_j * dy)
            put(out, 2 * n + j, get(out, 2 * n + j) - w_j * dz)
        put(out, i, ax)
        put(out, n + i, ay)
        put(out, 2 * n + i, az)


@kernel
def attraction(strength, sources, x, y, z):
    """Return the acceleration (ax, ay, az) at the point (x, y, z) in the field of n bodies.

    sources : (3n,) float64, with a point in float64 or eight points in lanes; or (3n, 8) lanes, with a point in lanes
    """
    n = strength.shape[0] - 1
    softening2 = strength[0]
    ax, ay, az = x * 0.0, x * 0.0, x * 0.0
    for j in range(n):
        dx, dy, dz = get(sources, j) - x, get(sources, n + j) - y, get(sources, 2 * n + j) - z
        w = rsqrt_cubed(dx * dx + dy * dy + dz * dz + softening2) * strength[1 + j]
        ax, ay, az = ax + w * dx, ay + w * dy, az + w * dz
    return ax, ay, az


@kernel
def body_accelerations(strength, q, out):
    """Write the accelerations of n mutually attracting bodies into `out`, eight bodies in lanes.

    q, out : (3n + 8,) float64; the last eight elements of `out` are overwritten. Both directions of a pair are
        evaluated, by the same arithmetic up to the sign.
    """
    n = strength.shape[0] - 1
    softening2 = strength[0]
    # Downwards: the lanes past body n spill into the next coordinate, which a lower block then writes.
    for block in range((n + WIDTH - 1) // WIDTH - 1, -1, -1):
        start = WIDTH * block
        stop = min(start + WIDTH, n)
        x, y, z = load(q, start), load(q, n + start), load(q, 2 * n + start)
        ax, ay, az = full(0.0), full(0.0), full(0.0)
        for j in range(n):
            dx, dy, dz = q[j] - x, q[n + j] - y, q[2 * n + j] - z
            r2 = dx * dx + dy * dy + dz * dz + softening2
            if start <= j < stop:
                # At distance 1 from itself, in the direction 0, a body feels nothing of itself.
                r2 = r2 + unit(j - start)
            w = rsqrt_cubed(r2) * strength[1 + j]
            ax, ay, az = ax + w * dx, ay + w * dy, az + w * dz
        store(out, start, ax)
        store(out, n + start, ay)
        store(out, 2 * n + start, az)


@kernel
def pair_potential(strength, q):
    """Return sum over pairs of -GM_i GM_j / sqrt(r_ij^2 + softening^2); float64, or lanes for q of shape (3n, 8)."""
    n = strength.shape[0] - 1
    value = get(q, 0) * 0.0
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy, dz = get(q, j) - get(q, i), get(q, n + j) - get(q, n + i), get(q, 2 * n + j) - get(q, 2 * n + i)
            r2 = dx * dx + dy * dy + dz * dz + strength[0]
            value = value - strength[1 + i] * strength[1 + j] / sqrt(r2)
    return value
