"""Relativity to first post-Newtonian order by the fields of several bodies or of all: the Lagrangian of Einstein,
Infeld and Hoffmann.

    L = (1/c^2) { sum_i m_i v_i^4/8 + sum_{i<j} G m_i m_j/(2 r) [3 (v_i^2 + v_j^2) - 7 v_i . v_j - (v_i . n)(v_j . n)]
                  - 1/2 sum_i m_i Phi_i^2 },     r = |q_i - q_j|,  n = (q_i - q_j)/r,  Phi_i = sum_j G m_j/r

in harmonic coordinates. Its part with three bodies is the square of Phi, so that the sums take two loops over pairs:

    (1/m_i) dL/dv_i = (1/c^2) { (v_i^2/2 + 3 Phi_i) v_i - sum_j G m_j/(2 r) [7 v_j + n (v_j . n)] }
    (1/m_i) dL/dq_i = (1/c^2) sum_j G m_j/r^2 { n [Phi_i + Phi_j - 3/2 (v_i^2 + v_j^2) + 7/2 v_i . v_j
                      + 3/2 (v_i . n)(v_j . n)] - 1/2 [(v_j . n) v_i + (v_i . n) v_j] }

If only some bodies are sources, relativity among the others is left out: the sums are over pairs with a source, and of
Phi_s^2 of a source s the part that is quadratic in the masses of the others. A massless particle at x has

    L = (1/c^2) { v^4/8 + sum_s G m_s/r [3/2 (v^2 + v_s^2) - 7/2 v . v_s - 1/2 (v . n)(v_s . n) - Phi_s] - Phi^2/2 }

per unit mass, with Phi of the sources alone: the limit of a body of vanishing mass that is no source.

Momentum and angular momentum are conserved exactly. The centre of mass, with masses m [1 + (v^2 - Phi)/(2 c^2)], moves
uniformly to first post-Newtonian order, as L is invariant under Lorentz's boosts to that order. With a softening eps,
r^2 = |q_i - q_j|^2 + eps^2, and n = (q_i - q_j)/r.
Parameters: 1/c^2, the number of sources, the rows of all massive bodies, sources first, each group in ascending order.
Source: Einstein, Infeld & Hoffmann (1938), Ann. Math. 39, 65; Landau & Lifshitz (1975), sec. 106.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put, room, rsqrt_cubed
from orbits.lagrangians.base import GRADIENTS, MASSLESS_PARTICLES
from orbits.lagrangians.terms.base import Summand
from orbits.lagrangians.terms.einstein_infeld_hoffmann_hessians import hessians, row
from orbits.lagrangians.terms.pairs import difference

KEPT = 4096
"""The most pairs whose 1/r is kept from the first loop for the second, 256 KiB for eight stages."""


@kernel(inline=True)
def kept_pairs(n, sources):
    """Return the number of pairs with a source, or 0 if they are too many to keep."""
    pairs = sources * (2 * n - 1 - sources) // 2
    return pairs if pairs <= KEPT else 0


@kernel(inline=True)
def write_depths(strength, own, q, bodies, kept, depth):
    """Write Phi of the first `bodies` in the order of the parameters, then Phi of the sources by sources alone, and if
    `kept`, then 1/r of all pairs.
    """
    n, sources = strength.shape[0] - 1, int(own[1])
    at = bodies + sources
    for k in range(at):
        put(depth, k, get(q, 0) * 0.0)
    for a in range(sources):
        i = row(own, a, n)
        x, y, z, gm = get(q, i), get(q, n + i), get(q, 2 * n + i), strength[1 + i]
        whole = get(depth, a)
        for b in range(a + 1, bodies):
            if b == sources:
                put(depth, bodies + a, whole)
            j = row(own, b, n)
            near = _inverse_distance(strength, q, j, x, y, z)
            whole = whole + strength[1 + j] * near
            put(depth, b, get(depth, b) + gm * near)
            if kept > 0:
                put(depth, at, near)
                at += 1
        put(depth, a, whole)
        if sources == bodies:
            put(depth, bodies + a, whole)


@kernel(inline=True)
def _inverse_distance(strength, q, j, x, y, z):
    """Return 1/r of body j and a point."""
    n = strength.shape[0] - 1
    dx, dy, dz = x - get(q, j), y - get(q, n + j), z - get(q, 2 * n + j)
    r2 = strength[0] + dx * dx + dy * dy + dz * dz
    return rsqrt_cubed(r2) * r2


@kernel
def value(strength, own, t, q, v):
    """Return the sum over bodies, and over pairs with a source."""
    n, sources = strength.shape[0] - 1, int(own[1])
    depth = room(n + sources, q)
    write_depths(strength, own, q, n, 0, depth)
    total = get(q, 0) * 0.0
    for a in range(n):
        i = row(own, a, n)
        vx, vy, vz = get(v, i), get(v, n + i), get(v, 2 * n + i)
        v2, whole = vx * vx + vy * vy + vz * vz, get(depth, a)
        square = whole * whole
        if a < sources:
            among = get(depth, n + a)
            square = among * (2.0 * whole - among)
        total = total + strength[1 + i] * (0.125 * (v2 * v2) - 0.5 * square)
        for b in range(a + 1, n if a < sources else a):
            j = row(own, b, n)
            d, w = difference(q, i, j, n), (get(v, j), get(v, n + j), get(v, 2 * n + j))
            r2 = strength[0] + d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            near3 = rsqrt_cubed(r2)
            squares = v2 + (w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
            product = vx * w[0] + vy * w[1] + vz * w[2]
            along = (vx * d[0] + vy * d[1] + vz * d[2]) * (w[0] * d[0] + w[1] * d[1] + w[2] * d[2])
            pair = strength[1 + i] * strength[1 + j] * near3
            total = total + pair * (r2 * (1.5 * squares - 3.5 * product) - 0.5 * along)
    return own[0] * total


@kernel
def gradients(strength, own, t, q, v, f, p):
    """Add the forces to f and the momenta to p."""
    n, sources = strength.shape[0] - 1, int(own[1])
    kept = kept_pairs(n, sources)
    depth = room(n + sources + kept, q)
    write_depths(strength, own, q, n, kept, depth)
    for a in range(n):
        v2 = _add_own_momentum(strength, own, v, get(depth, a), row(own, a, n), p)
        put(depth, a, get(depth, a) - 1.5 * v2)
        if a < sources:
            put(depth, n + a, get(depth, n + a) - 1.5 * v2)
    at = n + sources
    for a in range(sources):
        i = row(own, a, n)
        x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
        vx, vy, vz = get(v, i), get(v, n + i), get(v, 2 * n + i)
        fx, fy, fz = get(f, i), get(f, n + i), get(f, 2 * n + i)
        px, py, pz = get(p, i), get(p, n + i), get(p, 2 * n + i)
        scale, depth_i = own[0] * strength[1 + i], get(depth, a)
        for b in range(a + 1, n):
            if b == sources:
                depth_i = get(depth, n + a)
            j = row(own, b, n)
            near = get(depth, at) if kept > 0 else _inverse_distance(strength, q, j, x, y, z)
            at += 1
            dx, dy, dz = x - get(q, j), y - get(q, n + j), z - get(q, 2 * n + j)
            wx, wy, wz = get(v, j), get(v, n + j), get(v, 2 * n + j)
            near2, size = near * near, (scale * strength[1 + j]) * near
            along_i, along_j = vx * dx + vy * dy + vz * dz, wx * dx + wy * dy + wz * dz
            bracket = (depth_i + get(depth, b)) + 3.5 * (vx * wx + vy * wy + vz * wz)
            size3 = size * near2
            radial = size3 * (bracket + 1.5 * (along_i * along_j) * near2)
            half, swap = 0.5 * size3, 3.5 * size
            half_i, half_j = half * along_i, half * along_j
            gx = radial * dx - half_j * vx - half_i * wx
            gy = radial * dy - half_j * vy - half_i * wy
            gz = radial * dz - half_j * vz - half_i * wz
            fx, fy, fz = fx + gx, fy + gy, fz + gz
            put(f, j, get(f, j) - gx)
            put(f, n + j, get(f, n + j) - gy)
            put(f, 2 * n + j, get(f, 2 * n + j) - gz)
            px = px - swap * wx - half_j * dx
            py = py - swap * wy - half_j * dy
            pz = pz - swap * wz - half_j * dz
            put(p, j, get(p, j) - swap * vx - half_i * dx)
            put(p, n + j, get(p, n + j) - swap * vy - half_i * dy)
            put(p, 2 * n + j, get(p, 2 * n + j) - swap * vz - half_i * dz)
        put(f, i, fx)
        put(f, n + i, fy)
        put(f, 2 * n + i, fz)
        put(p, i, px)
        put(p, n + i, py)
        put(p, 2 * n + i, pz)


@kernel(inline=True)
def _add_own_momentum(strength, own, v, depth, i, p):
    """Add (v^2/2 + 3 Phi) v of one body to p, and return v^2."""
    n = strength.shape[0] - 1
    x, y, z = get(v, i), get(v, n + i), get(v, 2 * n + i)
    v2 = x * x + y * y + z * z
    weight = (own[0] * strength[1 + i]) * (0.5 * v2 + 3.0 * depth)
    put(p, i, get(p, i) + weight * x)
    put(p, n + i, get(p, n + i) + weight * y)
    put(p, 2 * n + i, get(p, 2 * n + i) + weight * z)
    return v2


@kernel
def momenta(strength, own, t, q, v, f, p):
    """Add the momenta to p: `gradients` without forces, in one loop over pairs."""
    n, sources = strength.shape[0] - 1, int(own[1])
    for a in range(sources):
        i = row(own, a, n)
        x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
        vx, vy, vz = get(v, i), get(v, n + i), get(v, 2 * n + i)
        px, py, pz = get(p, i), get(p, n + i), get(p, 2 * n + i)
        scale = own[0] * strength[1 + i]
        for b in range(a + 1, n):
            j = row(own, b, n)
            dx, dy, dz = x - get(q, j), y - get(q, n + j), z - get(q, 2 * n + j)
            wx, wy, wz = get(v, j), get(v, n + j), get(v, 2 * n + j)
            r2 = strength[0] + dx * dx + dy * dy + dz * dz
            size3 = (scale * strength[1 + j]) * rsqrt_cubed(r2)
            half, three, swap = 0.5 * size3, 3.0 * (size3 * r2), 3.5 * (size3 * r2)
            half_i, half_j = half * (vx * dx + vy * dy + vz * dz), half * (wx * dx + wy * dy + wz * dz)
            px = px + (three * vx - swap * wx - half_j * dx)
            py = py + (three * vy - swap * wy - half_j * dy)
            pz = pz + (three * vz - swap * wz - half_j * dz)
            put(p, j, get(p, j) + (three * wx - swap * vx - half_i * dx))
            put(p, n + j, get(p, n + j) + (three * wy - swap * vy - half_i * dy))
            put(p, 2 * n + j, get(p, 2 * n + j) + (three * wz - swap * vz - half_i * dz))
        put(p, i, px)
        put(p, n + i, py)
        put(p, 2 * n + i, pz)
    for i in range(n):
        _add_own_momentum(strength, own, v, 0.0, i, p)


@kernel
def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return the force and the momentum per unit mass."""
    n, count = strength.shape[0] - 1, int(own[1])
    depth = room(2 * count, sources)
    write_depths(strength, own, sources, count, 0, depth)
    (x, y, z), (vx, vy, vz) = place, velocity
    v2 = vx * vx + vy * vy + vz * vz
    zero = v2 * 0.0
    whole, lx, ly, lz, fx, fy, fz, px, py, pz = zero, zero, zero, zero, zero, zero, zero, zero, zero, zero
    for a in range(count):
        j = row(own, a, n)
        dx, dy, dz = x - get(sources, j), y - get(sources, n + j), z - get(sources, 2 * n + j)
        wx, wy, wz = get(speeds, j), get(speeds, n + j), get(speeds, 2 * n + j)
        r2 = strength[0] + dx * dx + dy * dy + dz * dz
        near3 = strength[1 + j] * rsqrt_cubed(r2)
        near = near3 * r2
        along, along_j = vx * dx + vy * dy + vz * dz, wx * dx + wy * dy + wz * dz
        own_part = get(depth, a) - 1.5 * (wx * wx + wy * wy + wz * wz)
        bracket = own_part + (3.5 * (vx * wx + vy * wy + vz * wz) - 1.5 * v2)
        radial = near3 * (bracket + 1.5 * along * along_j / r2)
        half, half_j, swap = 0.5 * (near3 * along), 0.5 * (near3 * along_j), 3.5 * near
        whole = whole + near
        lx, ly, lz = lx + near3 * dx, ly + near3 * dy, lz + near3 * dz
        fx = fx + (radial * dx - (half_j * vx + half * wx))
        fy = fy + (radial * dy - (half_j * vy + half * wy))
        fz = fz + (radial * dz - (half_j * vz + half * wz))
        px, py, pz = px + (swap * wx + half_j * dx), py + (swap * wy + half_j * dy), pz + (swap * wz + half_j * dz)
    weight, size = 0.5 * v2 + 3.0 * whole, own[0]
    return (
        size * (fx + whole * lx),
        size * (fy + whole * ly),
        size * (fz + whole * lz),
        size * (weight * vx - px),
        size * (weight * vy - py),
        size * (weight * vz - pz),
    )


@kernel
def particle_momenta(strength, own, t, sources, speeds, place, velocity):
    """Return the momentum per unit mass alone, for which no depths of the sources are needed."""
    n, count = strength.shape[0] - 1, int(own[1])
    (x, y, z), (vx, vy, vz) = place, velocity
    v2 = vx * vx + vy * vy + vz * vz
    whole = px = py = pz = v2 * 0.0
    for a in range(count):
        j = row(own, a, n)
        dx, dy, dz = x - get(sources, j), y - get(sources, n + j), z - get(sources, 2 * n + j)
        wx, wy, wz = get(speeds, j), get(speeds, n + j), get(speeds, 2 * n + j)
        r2 = strength[0] + dx * dx + dy * dy + dz * dz
        near3 = strength[1 + j] * rsqrt_cubed(r2)
        near, half = near3 * r2, 0.5 * near3 * (wx * dx + wy * dy + wz * dz)
        whole, swap = whole + near, 3.5 * near
        px, py, pz = px + (swap * wx + half * dx), py + (swap * wy + half * dy), pz + (swap * wz + half * dz)
    weight, size = 0.5 * v2 + 3.0 * whole, own[0]
    return size * (weight * vx - px), size * (weight * vy - py), size * (weight * vz - pz)


@kernel
def inertia(strength, own, t, q, v, out):
    """Add G m (v^2 - Phi)/(2 c^2) of each body to out, (n,)."""
    n, sources = strength.shape[0] - 1, int(own[1])
    depth = room(n + sources, q)
    write_depths(strength, own, q, n, 0, depth)
    for a in range(n):
        i = row(own, a, n)
        v2 = v[i] * v[i] + v[n + i] * v[n + i] + v[2 * n + i] * v[2 * n + i]
        out[i] += 0.5 * own[0] * strength[1 + i] * (v2 - depth[a])


TAG = Tag(
    "einstein-infeld-hoffmann",
    {
        "value": value,
        "gradients": gradients,
        "momenta": momenta,
        "hessians": hessians,
        "particle_gradients": particle_gradients,
        "particle_momenta": particle_momenta,
        "inertia": inertia,
    },
)


def einstein_infeld_hoffmann(rows: Sequence[int], bodies: int, c: float) -> Summand:
    """Return the term.

    rows : those of the sources, counted from 0; bodies : the number of massive bodies; c : a speed
    """
    rows = sorted(rows)
    others = sorted(set(range(bodies)) - set(rows))
    return Summand(
        name="Einstein-Infeld-Hoffmann",
        formula="1PN of several bodies / c^2",
        tag=TAG,
        parameters=np.array([1.0 / (c * c), len(rows), *rows, *others], dtype=np.float64),
        traits=frozenset({MASSLESS_PARTICLES, GRADIENTS}),
        axis=None,
        galilean=False,
    )
