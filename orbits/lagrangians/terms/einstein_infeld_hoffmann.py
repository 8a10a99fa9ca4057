"""Relativity to first post-Newtonian order, by the fields of several bodies or of all: the Lagrangian of Einstein, Infeld
and Hoffmann.

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
r^2 = |q_i - q_j|^2 + eps^2, and n = (q_i - q_j)/r. Parameters: 1/c^2, number of sources, the rows of all massive bodies,
sources first.
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
from orbits.lagrangians.terms.einstein_infeld_hoffmann_hessians import ORDER, hessians
from orbits.lagrangians.terms.pairs import difference


@kernel
def write_depths(strength, own, q, depth):
    """Write Phi of all bodies in the order of the parameters, and after these Phi of the sources by sources alone."""
    n, sources = strength.shape[0] - 1, int(own[1])
    for k in range(n + sources):
        put(depth, k, get(q, 0) * 0.0)
    for a in range(sources):
        i = int(own[ORDER + a])
        whole = get(depth, a)
        for b in range(a + 1, n):
            if b == sources:
                put(depth, n + a, whole)
            j = int(own[ORDER + b])
            x, y, z = difference(q, i, j, n)
            r2 = strength[0] + x * x + y * y + z * z
            near = rsqrt_cubed(r2) * r2
            whole = whole + strength[1 + j] * near
            put(depth, b, get(depth, b) + strength[1 + i] * near)
        put(depth, a, whole)
        if sources == n:
            put(depth, n + a, whole)


@kernel
def value(strength, own, t, q, v):
    """Return the sum over bodies, and over pairs with a source."""
    n, sources = strength.shape[0] - 1, int(own[1])
    depth = room(n + sources, q)
    write_depths(strength, own, q, depth)
    total = get(q, 0) * 0.0
    for a in range(n):
        i = int(own[ORDER + a])
        vx, vy, vz = get(v, i), get(v, n + i), get(v, 2 * n + i)
        v2, whole = vx * vx + vy * vy + vz * vz, get(depth, a)
        square = whole * whole
        if a < sources:
            among = get(depth, n + a)
            square = among * (2.0 * whole - among)
        total = total + strength[1 + i] * (0.125 * (v2 * v2) - 0.5 * square)
        for b in range(a + 1, n if a < sources else a):
            j = int(own[ORDER + b])
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
    depth = room(n + sources, q)
    write_depths(strength, own, q, depth)
    for a in range(n):
        i = int(own[ORDER + a])
        x, y, z = get(v, i), get(v, n + i), get(v, 2 * n + i)
        v2, whole = x * x + y * y + z * z, get(depth, a)
        weight = (own[0] * strength[1 + i]) * (0.5 * v2 + 3.0 * whole)
        put(p, i, get(p, i) + weight * x)
        put(p, n + i, get(p, n + i) + weight * y)
        put(p, 2 * n + i, get(p, 2 * n + i) + weight * z)
        put(depth, a, whole - 1.5 * v2)
        if a < sources:
            put(depth, n + a, get(depth, n + a) - 1.5 * v2)
    for a in range(sources):
        i = int(own[ORDER + a])
        x, y, z = get(q, i), get(q, n + i), get(q, 2 * n + i)
        vx, vy, vz = get(v, i), get(v, n + i), get(v, 2 * n + i)
        fx, fy, fz = get(f, i), get(f, n + i), get(f, 2 * n + i)
        px, py, pz = get(p, i), get(p, n + i), get(p, 2 * n + i)
        scale, depth_i = own[0] * strength[1 + i], get(depth, a)
        for b in range(a + 1, n):
            if b == sources:
                depth_i = get(depth, n + a)
            j = int(own[ORDER + b])
            dx, dy, dz = x - get(q, j), y - get(q, n + j), z - get(q, 2 * n + j)
            wx, wy, wz = get(v, j), get(v, n + j), get(v, 2 * n + j)
            r2 = strength[0] + dx * dx + dy * dy + dz * dz
            near3 = (scale * strength[1 + j]) * rsqrt_cubed(r2)
            near = near3 * r2
            along_i, along_j = vx * dx + vy * dy + vz * dz, wx * dx + wy * dy + wz * dz
            bracket = depth_i + get(depth, b) + 3.5 * (vx * wx + vy * wy + vz * wz)
            radial = near3 * (bracket + 1.5 * along_i * along_j / r2)
            half_i, half_j, swap = 0.5 * (near3 * along_i), 0.5 * (near3 * along_j), 3.5 * near
            gx = radial * dx - (half_j * vx + half_i * wx)
            gy = radial * dy - (half_j * vy + half_i * wy)
            gz = radial * dz - (half_j * vz + half_i * wz)
            fx, fy, fz = fx + gx, fy + gy, fz + gz
            put(f, j, get(f, j) - gx)
            put(f, n + j, get(f, n + j) - gy)
            put(f, 2 * n + j, get(f, 2 * n + j) - gz)
            px, py, pz = px - (swap * wx + half_j * dx), py - (swap * wy + half_j * dy), pz - (swap * wz + half_j * dz)
            put(p, j, get(p, j) - (swap * vx + half_i * dx))
            put(p, n + j, get(p, n + j) - (swap * vy + half_i * dy))
            put(p, 2 * n + j, get(p, 2 * n + j) - (swap * vz + half_i * dz))
        put(f, i, fx)
        put(f, n + i, fy)
        put(f, 2 * n + i, fz)
        put(p, i, px)
        put(p, n + i, py)
        put(p, 2 * n + i, pz)


@kernel
def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return the force and the momentum per unit mass."""
    n, count = strength.shape[0] - 1, int(own[1])
    depth = room(count, sources)
    for a in range(count):
        put(depth, a, get(sources, 0) * 0.0)
    for a in range(count):
        i = int(own[ORDER + a])
        whole = get(depth, a)
        for b in range(a + 1, count):
            j = int(own[ORDER + b])
            x, y, z = difference(sources, i, j, n)
            r2 = strength[0] + x * x + y * y + z * z
            near = rsqrt_cubed(r2) * r2
            whole = whole + strength[1 + j] * near
            put(depth, b, get(depth, b) + strength[1 + i] * near)
        put(depth, a, whole)
    (x, y, z), (vx, vy, vz) = place, velocity
    v2 = vx * vx + vy * vy + vz * vz
    zero = v2 * 0.0
    # The force is Phi times `pull`, and the rest.
    whole, lx, ly, lz, fx, fy, fz, px, py, pz = zero, zero, zero, zero, zero, zero, zero, zero, zero, zero
    for a in range(count):
        j = int(own[ORDER + a])
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
def inertia(strength, own, t, q, v, out):
    """Add G m (v^2 - Phi)/(2 c^2) of each body to out, (n,)."""
    n, sources = strength.shape[0] - 1, int(own[1])
    depth = room(n + sources, q)
    write_depths(strength, own, q, depth)
    for a in range(n):
        i = int(own[ORDER + a])
        v2 = v[i] * v[i] + v[n + i] * v[n + i] + v[2 * n + i] * v[2 * n + i]
        out[i] += 0.5 * own[0] * strength[1 + i] * (v2 - depth[a])


TAG = Tag(
    "einstein-infeld-hoffmann",
    {
        "value": value,
        "gradients": gradients,
        "hessians": hessians,
        "particle_gradients": particle_gradients,
        "inertia": inertia,
    },
)


def einstein_infeld_hoffmann(rows: Sequence[int], bodies: int, c: float) -> Summand:
    """Return the term.

    rows : those of the sources, counted from 0; bodies : the number of massive bodies; c : a speed
    """
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
