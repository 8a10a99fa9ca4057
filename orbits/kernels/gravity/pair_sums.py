"""Pair sums of Newtonian gravity, plain or with Plummer softening.

Positions of n bodies are a vector of 3n coordinates, all x, then all y, then all z; in an (3n, 8) array each row holds
one coordinate in eight lanes (the stages of an implicit step). `strength` is a vector of 1 + n numbers: the softening
length squared, then GM of each body. Two bodies at the same position give values that are not finite; callers check.
"""

from __future__ import annotations

import math

from numba import types

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    full,
    get,
    load,
    load_some,
    put,
    rsqrt_cubed,
    select,
    sqrt,
    store_some,
    total,
    unit,
)

TILE = 128
"""Number of partners that are summed separately before their sum is added to a body's."""


NOBODY = -1


@kernel
def pair_accelerations(strength, q, out):
    """Write the accelerations of n mutually attracting bodies into `out`, each pair evaluated once.

    q, out : (3n,) float64 or (3n, 8) lanes; strength : (1 + n,)
    """
    _clear(strength, q, out)
    _add_pairs(strength, q, None, NOBODY, out)


@kernel
def close_pair_accelerations(strength, q, q_lo, out):
    """As `pair_accelerations`, for positions in doubled precision: separations of close bodies keep their digits.

    q_lo : the low parts, with the shape of q
    """
    _clear(strength, q, out)
    _add_pairs(strength, q, q_lo, NOBODY, out)


@kernel
def add_other_pair_accelerations(strength, q, q_lo, without, out):
    """Add to `out` what `close_pair_accelerations` writes, but for the pairs of one body, the number `without`.

    q_lo : the low parts, or None
    """
    _add_pairs(strength, q, q_lo, without, out)


@kernel(inline=True)
def _clear(strength, q, out):
    """Write zeros."""
    zero = get(q, 0) * 0.0
    for k in range(3 * (strength.shape[0] - 1)):
        put(out, k, zero)


@kernel(inline=True)
def _add_pairs(strength, q, q_lo, without, out):
    """Add the accelerations to `out`; q_lo is None for positions without low parts."""
    n = strength.shape[0] - 1
    softening2 = strength[0]
    for i in range(n):
        if i == without:
            continue
        x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
        x_lo, y_lo, z_lo = _low(q_lo, i), _low(q_lo, n + i), _low(q_lo, 2 * n + i)
        ax, ay, az = get(out, i), get(out, n + i), get(out, 2 * n + i)
        gm_i = strength[1 + i]
        for j in range(i + 1, n):
            if j == without:
                continue
            dx = _apart(q, q_lo, j, x, x_lo)
            dy = _apart(q, q_lo, n + j, y, y_lo)
            dz = _apart(q, q_lo, 2 * n + j, z, z_lo)
            w = rsqrt_cubed(softening2 + dx * dx + dy * dy + dz * dz)
            w_i, w_j = w * strength[1 + j], w * gm_i
            ax, ay, az = ax + w_i * dx, ay + w_i * dy, az + w_i * dz
            put(out, j, get(out, j) - w_j * dx)
            put(out, n + j, get(out, n + j) - w_j * dy)
            put(out, 2 * n + j, get(out, 2 * n + j) - w_j * dz)
        put(out, i, ax)
        put(out, n + i, ay)
        put(out, 2 * n + i, az)


@verb
def _low(q_lo, k):
    """Return low part k, or None without low parts."""
    return (lambda q_lo, k: None) if isinstance(q_lo, types.NoneType) else (lambda q_lo, k: get(q_lo, k))


@verb
def _apart(q, q_lo, k, x, x_lo):
    """Return coordinate k minus (x, x_lo)."""
    if isinstance(q_lo, types.NoneType):
        return lambda q, q_lo, k, x, x_lo: get(q, k) - x
    return lambda q, q_lo, k, x, x_lo: (get(q, k) - x) + (get(q_lo, k) - x_lo)


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
        w = rsqrt_cubed(softening2 + dx * dx + dy * dy + dz * dz) * strength[1 + j]
        ax, ay, az = ax + w * dx, ay + w * dy, az + w * dz
    return ax, ay, az


@kernel
def close_attraction(strength, sources, sources_lo, place, place_lo):
    """As `attraction`, for positions in doubled precision, with the rate: (ax, ay, az, S), S = sum_j GM_j / r_j^3.

    sources_lo : the low parts, with the shape of sources, or None; place, place_lo : (x, y, z) and their low parts
    """
    n = strength.shape[0] - 1
    softening2 = strength[0]
    (x, y, z), (x_lo, y_lo, z_lo) = place, place_lo
    ax, ay, az, rate = x * 0.0, x * 0.0, x * 0.0, x * 0.0
    for j in range(n):
        dx = _apart(sources, sources_lo, j, x, x_lo)
        dy = _apart(sources, sources_lo, n + j, y, y_lo)
        dz = _apart(sources, sources_lo, 2 * n + j, z, z_lo)
        w = rsqrt_cubed(softening2 + dx * dx + dy * dy + dz * dz) * strength[1 + j]
        ax, ay, az, rate = ax + w * dx, ay + w * dy, az + w * dz, rate + w
    return ax, ay, az, rate


@kernel
def gross_field(strength, sources, x, y, z):
    """Return the sum of the magnitudes of the attractions at a point, whose vectors may cancel; as for `attraction`."""
    n = strength.shape[0] - 1
    gross = x * 0.0
    for j in range(n):
        dx, dy, dz = get(sources, j) - x, get(sources, n + j) - y, get(sources, 2 * n + j) - z
        gross = gross + strength[1 + j] / (dx * dx + dy * dy + dz * dz + strength[0])
    return gross


@kernel
def body_accelerations(strength, q, out):
    """Write the accelerations of n mutually attracting bodies into `out`, bodies in lanes.

    q : (3n + 8,) float64; elements from 3n on are read but do not matter; out : (3n,) or longer
    Both directions of a pair are evaluated, by the same arithmetic up to the sign.
    """
    share_of_accelerations(strength, q, out, 0, strength.shape[0] - 1)


@kernel(inline=True)
def share_of_accelerations(strength, q, out, start, stop):
    """Write the accelerations of bodies start ... stop - 1 into `out`, and nothing else.

    start : a multiple of 8. The bits do not depend on start and stop, so that threads can divide the bodies.
    """
    for first in range(start, stop, 2 * WIDTH):
        if first + WIDTH < stop:
            _accelerate_sixteen(strength, q, out, first, stop)
        else:
            _accelerate_eight(strength, q, out, first, stop)


@kernel(inline=True)
def _accelerate_eight(strength, q, out, first, stop):
    """Write the accelerations of bodies first ... first + 7, if below `stop`."""
    n = strength.shape[0] - 1
    softening2 = strength[0]
    x, y, z = load(q, first), load(q, n + first), load(q, 2 * n + first)
    ax, ay, az = full(0.0), full(0.0), full(0.0)
    for tile in range(0, n, TILE):
        # Sums of sums: the rounding error of a body's sum grows with the number of tiles, not of bodies.
        bx, by, bz = full(0.0), full(0.0), full(0.0)
        for j in range(tile, min(tile + TILE, n)):
            dx, dy, dz = get(q, j) - x, get(q, n + j) - y, get(q, 2 * n + j) - z
            r2 = softening2 + dx * dx + dy * dy + dz * dz
            if first <= j < first + WIDTH:
                # At distance 1 from itself, in the direction 0, a body feels nothing of itself.
                r2 = r2 + unit(j - first)
            w = rsqrt_cubed(r2) * strength[1 + j]
            bx, by, bz = bx + w * dx, by + w * dy, bz + w * dz
        ax, ay, az = ax + bx, ay + by, az + bz
    _store_bodies(out, n, first, stop - first, ax, ay, az)


@kernel(inline=True)
def _accelerate_sixteen(strength, q, out, first, stop):
    """As `_accelerate_eight` for two registers: their instructions overlap, and each partner is read once for both."""
    n = strength.shape[0] - 1
    softening2 = strength[0]
    second = first + WIDTH
    x, y, z = load(q, first), load(q, n + first), load(q, 2 * n + first)
    X, Y, Z = load(q, second), load(q, n + second), load(q, 2 * n + second)
    ax, ay, az, AX, AY, AZ = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for tile in range(0, n, TILE):
        bx, by, bz, BX, BY, BZ = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
        for j in range(tile, min(tile + TILE, n)):
            xj, yj, zj, gm = get(q, j), get(q, n + j), get(q, 2 * n + j), get(strength, 1 + j)
            dx, dy, dz = xj - x, yj - y, zj - z
            DX, DY, DZ = xj - X, yj - Y, zj - Z
            r2 = softening2 + dx * dx + dy * dy + dz * dz
            R2 = softening2 + DX * DX + DY * DY + DZ * DZ
            if first <= j < second:
                r2 = r2 + unit(j - first)
            elif second <= j < second + WIDTH:
                R2 = R2 + unit(j - second)
            w, W = rsqrt_cubed(r2) * gm, rsqrt_cubed(R2) * gm
            bx, by, bz = bx + w * dx, by + w * dy, bz + w * dz
            BX, BY, BZ = BX + W * DX, BY + W * DY, BZ + W * DZ
        ax, ay, az, AX, AY, AZ = ax + bx, ay + by, az + bz, AX + BX, AY + BY, AZ + BZ
    _store_bodies(out, n, first, WIDTH, ax, ay, az)
    _store_bodies(out, n, second, stop - second, AX, AY, AZ)


@kernel(inline=True)
def _store_bodies(out, n, first, count, ax, ay, az):
    """Write the accelerations of the first `count` of bodies first ... first + 7."""
    store_some(out, first, ax, count)
    store_some(out, n + first, ay, count)
    store_some(out, 2 * n + first, az, count)


@kernel
def dynamical_rate(strength, q, v):
    """Return S = sum over pairs of G (m_i + m_j) / (r_ij^2 + softening^2)^(3/2), and dS/dt.

    q, v : (3n + 8,) float64. S^(-1/2) is the shortest dynamical time in the system.
    """
    n = strength.shape[0] - 1
    numbers = full(0.0)
    for k in range(WIDTH):
        numbers = numbers + (1.0 * k) * unit(k)
    rate, change = full(0.0), full(0.0)
    for i in range(n - 1):
        for first in range(i + 1, n, WIDTH):
            valid = numbers < 1.0 * (n - first)
            x, y, z = load(q, first) - q[i], load(q, n + first) - q[n + i], load(q, 2 * n + first) - q[2 * n + i]
            u, w, s = load(v, first) - v[i], load(v, n + first) - v[n + i], load(v, 2 * n + first) - v[2 * n + i]
            r2 = select(valid > 0.0, x * x + y * y + z * z + strength[0], full(1.0))
            gm = load_some(strength, 1 + first, n - first) + strength[1 + i]
            own = select(valid > 0.0, gm * rsqrt_cubed(r2), full(0.0))
            turning = select(valid > 0.0, (x * u + y * w + z * s) / r2, full(0.0))
            rate, change = rate + own, change - 3.0 * own * turning
    return total(rate), total(change)


@kernel
def gross_attraction(strength, q, i):
    """Return the sum of the magnitudes of the attractions on body i, whose vectors may cancel; q : (3n,) float64."""
    n = strength.shape[0] - 1
    gross = 0.0
    for j in range(n):
        if j != i:
            x, y, z = q[j] - q[i], q[n + j] - q[n + i], q[2 * n + j] - q[2 * n + i]
            gross += strength[1 + j] / (x * x + y * y + z * z + strength[0])
    return gross


@kernel
def pair_tides(strength, q, some, out):
    """Write the derivatives of the accelerations of some bodies by their positions.

    q : (3n,) float64; some : (m,) int64, their numbers in ascending order; out : (3m, 3m), x of all first
    """
    n, m = strength.shape[0] - 1, some.shape[0]
    for a in range(3 * m):
        for b in range(3 * m):
            out[a, b] = 0.0
    for row in range(m):
        i, column = some[row], 0
        for j in range(n):
            while column < m and some[column] < j:
                column += 1
            both = column < m and some[column] == j
            if j == i or (both and j < i):  # which came with the row of j
                continue
            x, y, z = q[j] - q[i], q[n + j] - q[n + i], q[2 * n + j] - q[2 * n + i]
            r2 = strength[0] + x * x + y * y + z * z
            w = 1.0 / (r2 * math.sqrt(r2))
            bent = 3.0 * w / r2
            for a in range(3):
                da = x if a == 0 else (y if a == 1 else z)
                for b in range(a, 3):
                    db = x if b == 0 else (y if b == 1 else z)
                    tide = bent * (da * db) - (w if a == b else 0.0)
                    _add_tide(out, a * m + row, b * m + row, strength[1 + j] * tide)
                    if both:
                        _add_tide(out, a * m + column, b * m + column, strength[1 + i] * tide)
                        out[a * m + row, b * m + column] = out[b * m + row, a * m + column] = -strength[1 + j] * tide
                        out[a * m + column, b * m + row] = out[b * m + column, a * m + row] = -strength[1 + i] * tide


@kernel(inline=True)
def _add_tide(out, k, other, tide):
    """Add an element of a symmetric matrix."""
    out[k, other] += tide
    if k != other:
        out[other, k] += tide


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
