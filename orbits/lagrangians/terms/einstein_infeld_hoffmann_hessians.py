"""Second derivatives of `orbits.lagrangians.terms.einstein_infeld_hoffmann`.

With w = 1/r, d = q_i - q_j, a = v_i . d, a' = v_j . d and B = 3/2 (v_i^2 + v_j^2) - 7/2 v_i . v_j, a pair has

    T = G m_i m_j (w B - w^3 a a'/2)

and the squares of Phi_i = sum_k G m_k w_ik have products of the gradients of two w, of all pairs (k, l) of partners of
i with a source among them.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put, room, rsqrt_cubed
from orbits.lagrangians.terms.pairs import add_differences, difference

ORDER = 2
"""The index of the first row in the parameters."""


@kernel(inline=True)
def row(own, place, n):
    """Return the row of the body at a place in the order of the parameters: that place, if all n are sources."""
    return place if own[1] == n else int(own[ORDER + place])


@kernel
def hessians(strength, own, t, q, v, out):
    """Add the second derivatives, as `orbits.kernels.binding.hessians` writes them."""
    n, sources = strength.shape[0] - 1, int(own[1])
    pulls = room(3 * n, q)
    for a in range(n):
        _add_body(own[0], strength, v, row(own, a, n), out)
        _add_square(strength, own, q, a, pulls, out)
        for b in range(a + 1, n if a < sources else a):
            _add_pair(own[0], strength, q, v, (row(own, a, n), row(own, b, n)), out)


@kernel
def _add_body(size, strength, v, i, out):
    """Add those of m v^4/8."""
    n = strength.shape[0] - 1
    d, gm = 3 * n, size * strength[1 + i]
    v2 = get(v, i) * get(v, i) + get(v, n + i) * get(v, n + i) + get(v, 2 * n + i) * get(v, 2 * n + i)
    for a in range(3):
        for b in range(3):
            more = gm * get(v, a * n + i) * get(v, b * n + i) + (0.5 * gm if a == b else 0.0) * v2
            at = 2 * d * d + (a * n + i) * d + b * n + i
            put(out, at, get(out, at) + more)


@kernel
def _add_pair(size, strength, q, v, pair, out):
    """Add those of T."""
    n = strength.shape[0] - 1
    i, j = pair
    d, mixed, inert = 3 * n, 9 * n * n, 18 * n * n
    x = difference(q, i, j, n)
    one, two = (get(v, i), get(v, n + i), get(v, 2 * n + i)), (get(v, j), get(v, n + j), get(v, 2 * n + j))
    r2 = strength[0] + x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    w3 = (size * strength[1 + i] * strength[1 + j]) * rsqrt_cubed(r2)
    w, w5 = w3 * r2, w3 / r2
    a1, a2 = one[0] * x[0] + one[1] * x[1] + one[2] * x[2], two[0] * x[0] + two[1] * x[1] + two[2] * x[2]
    B = 1.5 * (one[0] * one[0] + one[1] * one[1] + one[2] * one[2])
    B = B + 1.5 * (two[0] * two[0] + two[1] * two[1] + two[2] * two[2])
    B = B - 3.5 * (one[0] * two[0] + one[1] * two[1] + one[2] * two[2])
    round_, bent = 1.5 * w5 * a1 * a2 - w3 * B, 3.0 * w5 * B - 7.5 * (w5 / r2) * a1 * a2
    for a in range(3):
        ua = a2 * one[a] + a1 * two[a]
        for b in range(3):
            ub, same = a2 * one[b] + a1 * two[b], 1.0 if a == b else 0.0
            dd = round_ * same + bent * x[a] * x[b] + 1.5 * w5 * (x[a] * ub + ua * x[b])
            add_differences(out, 0, dd - 0.5 * w3 * (one[a] * two[b] + two[a] * one[b]), a, b, i, j, n)
            first = 1.5 * w5 * a2 * x[a] * x[b] - w3 * (
                x[a] * (3.0 * one[b] - 3.5 * two[b]) + 0.5 * (two[a] * x[b] + same * a2)
            )
            second = 1.5 * w5 * a1 * x[a] * x[b] - w3 * (
                x[a] * (3.0 * two[b] - 3.5 * one[b]) + 0.5 * (one[a] * x[b] + same * a1)
            )
            cross = -3.5 * same * w - 0.5 * w3 * x[a] * x[b]
            ai, aj, bi, bj = (a * n + i) * d, (a * n + j) * d, b * n + i, b * n + j
            put(out, mixed + ai + bi, get(out, mixed + ai + bi) + first)
            put(out, mixed + aj + bi, get(out, mixed + aj + bi) - first)
            put(out, mixed + ai + bj, get(out, mixed + ai + bj) + second)
            put(out, mixed + aj + bj, get(out, mixed + aj + bj) - second)
            put(out, inert + ai + bi, get(out, inert + ai + bi) + 3.0 * same * w)
            put(out, inert + aj + bj, get(out, inert + aj + bj) + 3.0 * same * w)
            put(out, inert + ai + bj, get(out, inert + ai + bj) + cross)
            put(out, inert + aj + bi, get(out, inert + aj + bi) + cross)


@kernel
def _add_square(strength, own, q, place, pulls, out):
    """Add those of -m Phi^2/2 of one body, the number `place` in the order of the parameters; pulls is workspace."""
    n, sources = strength.shape[0] - 1, int(own[1])
    i, d = row(own, place, n), 3 * n
    size = own[0] * strength[1 + i]
    partners = n if place < sources else sources
    zero = get(q, 0) * 0.0
    whole = among = zero
    ax, ay, az, sx, sy, sz = zero, zero, zero, zero, zero, zero
    for c in range(partners):
        if c == place:
            continue
        k = row(own, c, n)
        x, y, z = difference(q, i, k, n)
        r2 = strength[0] + x * x + y * y + z * z
        near3 = strength[1 + k] * rsqrt_cubed(r2)
        whole = whole + near3 * r2
        gx, gy, gz = near3 * x, near3 * y, near3 * z
        ax, ay, az = ax + gx, ay + gy, az + gz
        put(pulls, 3 * c, gx)
        put(pulls, 3 * c + 1, gy)
        put(pulls, 3 * c + 2, gz)
        if c < sources:
            among, sx, sy, sz = among + near3 * r2, sx + gx, sy + gy, sz + gz
    for c in range(partners):
        if c == place:
            continue
        k = row(own, c, n)
        x = difference(q, i, k, n)
        r2 = strength[0] + x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        g = size * get(pulls, 3 * c), size * get(pulls, 3 * c + 1), size * get(pulls, 3 * c + 2)
        # All gradients that go with that of k; without a source among the two there are none.
        s, deep = (ax, ay, az), whole
        if c >= sources:
            s, deep = (sx, sy, sz), among
        near3 = (size * strength[1 + k] * deep) * rsqrt_cubed(r2)
        for a in range(3):
            for b in range(3):
                tide = (near3 if a == b else zero) - 3.0 * near3 / r2 * x[a] * x[b]
                add_differences(out, 0, tide, a, b, i, k, n)
                ii, ik, ki = (a * n + i) * d + b * n + i, (a * n + i) * d + b * n + k, (a * n + k) * d + b * n + i
                put(out, ii, get(out, ii) - g[a] * s[b])
                put(out, ki, get(out, ki) + g[a] * s[b])
                put(out, ik, get(out, ik) + s[a] * g[b])
        for e in range(partners):
            if e == place or (c >= sources and e >= sources):
                continue
            m = row(own, e, n)
            for a in range(3):
                for b in range(3):
                    km = (a * n + k) * d + b * n + m
                    put(out, km, get(out, km) - g[a] * get(pulls, 3 * e + b))
