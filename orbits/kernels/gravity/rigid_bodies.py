"""Rigid bodies among others to the second degree of their gravity: attractions, torques, and what they are made of.

With x from a rigid body to another one of GM = o, r = |x|, j the moments of inertia per unit of its mass, R its
attitude (from its axes to those of space) and J = R j R^T,

    V / m = -(o / 2 r^3) (tr j - 3 x.J x / r^2),     g = (3 / 2 r^5) [(tr j - 5 x.J x / r^2) x + 2 J x]

What j has in common with a sphere adds nothing to g, and is left out: then nothing of it is left by rounding either.
Per unit of its GM the other is accelerated by -g, itself by o g, and its spin l, an angular momentum per unit of mass
in the axes of space, changes by o x cross g: the torque of the attraction, so that the angular momentum of orbits and
spins is conserved to round-off. With softening r^2 is x^2 + eps^2, in V too.

The state of a rigid body is a unit quaternion (a, b, c, d) and l, and their low parts: two rows of eight,

    a  b  c  d  l1  l2  l3  0      and      a_lo  b_lo  c_lo  d_lo  l1_lo  l2_lo  l3_lo  0

In free rotation l stays as it is, and only the attitude moves: by the exact flow of
`orbits.kernels.rotation.free_rotation`, with the energy kept in doubled precision by
`orbits.kernels.rotation.in_doubled_precision`.

`own`, the parameters: the number of rigid bodies with mass; the index, in a row of stages, from which their
quaternions stand, four of each; the length of a block of moments of massless bodies; then of each rigid body with mass
its row among the bodies and its three moments; then three blocks, the moments of all massless bodies.

Source: Maciejewski (1995), Celest. Mech. 63, 1, to the second degree; MacCullagh's formula.
"""

from __future__ import annotations

from numba.extending import intrinsic

from orbits.kernels.binding import SumType, Tag, accelerate, field, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full, lane, load, rsqrt_cubed, unit
from orbits.kernels.rotation.in_doubled_precision import turned_freely
from orbits.kernels.sums.summation import accumulate

COUNT, PLACE, BLOCK, FIRST = range(4)
"""Indices of the parameters."""

OF_EACH = 4
"""The parameters of a rigid body with mass."""

STATE_ROWS = 2
"""The rows of eight of the state of a rigid body."""

TAG = Tag("rigid-bodies", {})


@intrinsic
def _terms_of(typingctx, tags):
    """Return the tags of the terms of a sum, without its forces."""
    return SumType(tags.terms)(tags), lambda context, builder, signature, arguments: context.get_dummy_value()


@verb
def accelerate_by_terms(tags, parameters, q, out):
    """Write the accelerations of all bodies by the terms of a sum, of positions alone."""
    count = len(tags.terms)
    if count == 1:
        return lambda tags, parameters, q, out: accelerate(first_term(tags), parameters[0], q, out)
    return lambda tags, parameters, q, out: accelerate(_terms_of(tags), parameters[:count], q, out)


@verb
def field_of_terms(tags, parameters, sources, x, y, z):
    """Return the acceleration of massless particles by the terms of a sum."""
    count = len(tags.terms)
    if count == 1:
        return lambda tags, parameters, sources, x, y, z: field(first_term(tags), parameters[0], sources, x, y, z)
    return lambda tags, parameters, sources, x, y, z: field(_terms_of(tags), parameters[:count], sources, x, y, z)


@kernel(inline=True)
def rows_of(attitude):
    """Return the rows of the matrix of a unit quaternion, nine numbers or lanes."""
    a, b, c, d = attitude
    return (
        (1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)),
        (2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)),
        (2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)),
    )


@kernel(inline=True)
def in_body(R, x):
    """Return a vector of space in the axes of the body."""
    return (
        R[0][0] * x[0] + R[1][0] * x[1] + R[2][0] * x[2],
        R[0][1] * x[0] + R[1][1] * x[1] + R[2][1] * x[2],
        R[0][2] * x[0] + R[1][2] * x[1] + R[2][2] * x[2],
    )


@kernel(inline=True)
def in_space(R, x):
    """Return a vector of the body in the axes of space."""
    return (
        R[0][0] * x[0] + R[0][1] * x[1] + R[0][2] * x[2],
        R[1][0] * x[0] + R[1][1] * x[1] + R[1][2] * x[2],
        R[2][0] * x[0] + R[2][1] * x[1] + R[2][2] * x[2],
    )


@kernel(inline=True)
def attraction(R, moments, x, softening2):
    """Return g at x; numbers or lanes."""
    A, B, C = moments
    A, B, C = ((A - B) + (A - C)) * (1.0 / 3.0), ((B - C) + (B - A)) * (1.0 / 3.0), ((C - A) + (C - B)) * (1.0 / 3.0)
    r2 = softening2 + (x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    near, inverse = rsqrt_cubed(r2), 1.0 / r2
    n = in_body(R, x)
    jn = A * n[0], B * n[1], C * n[2]
    along = (n[0] * jn[0] + n[1] * jn[1] + n[2] * jn[2]) * inverse
    J = in_space(R, jn)
    size = 1.5 * near * inverse
    across, straight = 2.0 * size, -5.0 * size * along
    return straight * x[0] + across * J[0], straight * x[1] + across * J[1], straight * x[2] + across * J[2]


@kernel(inline=True)
def cross(x, y):
    """Return x cross y."""
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@kernel(inline=True)
def turned(moments, h, attitude, low, spin, spin_lo):
    """Return the attitude, a unit quaternion, and its low parts after free rotation for h."""
    pairs = (spin[0], spin_lo[0]), (spin[1], spin_lo[1]), (spin[2], spin_lo[2])
    return turned_freely(moments, h, attitude, low, pairs)


@kernel(inline=True)
def moments_of(own, i):
    """Return the moments of rigid body i of those with mass, per unit of mass."""
    k = FIRST + OF_EACH * i
    return own[k + 1], own[k + 2], own[k + 3]


@kernel
def pull(strength, own, q, carry, g, torques):
    """Add the accelerations of all bodies by the second degree of the rigid ones, and write the rates of their spins.

    carry : their states, two rows for each; torques : three numbers for each
    """
    n = strength.shape[0] - 1
    for i in range(int(own[COUNT])):
        row, b, moments = carry[STATE_ROWS * i], int(own[FIRST + OF_EACH * i]), moments_of(own, i)
        R = rows_of((row[0], row[1], row[2], row[3]))
        tx, ty, tz = 0.0, 0.0, 0.0
        for k in range(n):
            if k != b:
                x = q[k] - q[b], q[n + k] - q[n + b], q[2 * n + k] - q[2 * n + b]
                f, mine, other = attraction(R, moments, x, strength[0]), strength[1 + b], strength[1 + k]
                turning = cross(x, f)
                tx, ty, tz = tx + other * turning[0], ty + other * turning[1], tz + other * turning[2]
                g[k], g[n + k], g[2 * n + k] = g[k] - mine * f[0], g[n + k] - mine * f[1], g[2 * n + k] - mine * f[2]
                g[b], g[n + b] = g[b] + other * f[0], g[n + b] + other * f[1]
                g[2 * n + b] = g[2 * n + b] + other * f[2]
        torques[3 * i], torques[3 * i + 1], torques[3 * i + 2] = tx, ty, tz


@kernel
def kick_spins(own, carry, h, torques):
    """Advance the spins of rigid bodies by h times their rates."""
    for i in range(int(own[COUNT])):
        high, low = carry[STATE_ROWS * i], carry[STATE_ROWS * i + 1]
        for k in range(3):
            high[4 + k], low[4 + k] = accumulate(high[4 + k], low[4 + k], h * torques[3 * i + k])


@kernel
def turn(own, carry, h):
    """Advance the attitudes of rigid bodies by their free rotation for h."""
    for i in range(int(own[COUNT])):
        row, rest = carry[STATE_ROWS * i], carry[STATE_ROWS * i + 1]
        attitude, low = (row[0], row[1], row[2], row[3]), (rest[0], rest[1], rest[2], rest[3])
        spin, spin_lo = (row[4], row[5], row[6]), (rest[4], rest[5], rest[6])
        attitude, low = turned(moments_of(own, i), h, attitude, low, spin, spin_lo)
        row[0], row[1], row[2], row[3] = attitude
        rest[0], rest[1], rest[2], rest[3] = low


@kernel(inline=True)
def note_attitudes(own, carry, stage):
    """Write the attitudes of rigid bodies into a row of stages, for massless particles."""
    for i in range(int(own[COUNT])):
        for k in range(4):
            stage[int(own[PLACE]) + 4 * i + k] = carry[STATE_ROWS * i, k]


@kernel(inline=True)
def field_of_bodies(strength, own, stage, place):
    """Return the acceleration of massless particles by the second degree of rigid bodies, at their attitudes of a
    stage.
    """
    n, softening2 = strength.shape[0] - 1, full(strength[0])
    zero = place[0] * 0.0
    gx, gy, gz = zero, zero, zero
    for i in range(int(own[COUNT])):
        b, at = int(own[FIRST + OF_EACH * i]), int(own[PLACE]) + 4 * i
        R = rows_of((full(stage[at]), full(stage[at + 1]), full(stage[at + 2]), full(stage[at + 3])))
        A, B, C = moments_of(own, i)
        x = place[0] - stage[b], place[1] - stage[n + b], place[2] - stage[2 * n + b]
        f, mine = attraction(R, (full(A), full(B), full(C)), x, softening2), strength[1 + b]
        gx, gy, gz = gx - mine * f[0], gy - mine * f[1], gz - mine * f[2]
    return gx, gy, gz


@kernel(inline=True)
def field_on_tops(strength, own, stage, place, particle, attitude):
    """Return the accelerations of massless rigid bodies by the second degree of their own shape, and the rates of their
    spins; particle : the number of the first of eight.
    """
    n, softening2 = strength.shape[0] - 1, full(strength[0])
    R, moments, zero = rows_of(attitude), moments_of_tops(own, particle), place[0] * 0.0
    gx, gy, gz, tx, ty, tz = zero, zero, zero, zero, zero, zero
    for k in range(n):
        x = stage[k] - place[0], stage[n + k] - place[1], stage[2 * n + k] - place[2]
        f, other = attraction(R, moments, x, softening2), strength[1 + k]
        turning = cross(x, f)
        gx, gy, gz = gx + other * f[0], gy + other * f[1], gz + other * f[2]
        tx, ty, tz = tx + other * turning[0], ty + other * turning[1], tz + other * turning[2]
    return (gx, gy, gz), (tx, ty, tz)


@kernel(inline=True)
def moments_of_tops(own, particle):
    """Return the moments of eight massless particles, from number `particle` on."""
    first, block = FIRST + OF_EACH * int(own[COUNT]) + particle, int(own[BLOCK])
    return load(own, first), load(own, first + block), load(own, first + 2 * block)


@kernel(inline=True)
def state_of_tops(carry, start):
    """Return the attitudes of eight massless particles from their rows, then their low parts, the spins, and the low
    parts of these; lanes past the last one have the attitude of space.
    """
    zero = full(0.0)
    a, b, c, d, l1, l2, l3 = zero, zero, zero, zero, zero, zero, zero
    a_lo, b_lo, c_lo, d_lo, e1, e2, e3 = zero, zero, zero, zero, zero, zero, zero
    for k in range(WIDTH):
        one = unit(k)
        if start + k < carry.shape[0]:
            high, low = carry[start + k, 0], carry[start + k, 1]
            a, b, c, d = a + high[0] * one, b + high[1] * one, c + high[2] * one, d + high[3] * one
            a_lo, b_lo, c_lo, d_lo = a_lo + low[0] * one, b_lo + low[1] * one, c_lo + low[2] * one, d_lo + low[3] * one
            l1, l2, l3 = l1 + high[4] * one, l2 + high[5] * one, l3 + high[6] * one
            e1, e2, e3 = e1 + low[4] * one, e2 + low[5] * one, e3 + low[6] * one
        else:
            a = a + one
    return (a, b, c, d), (a_lo, b_lo, c_lo, d_lo), (l1, l2, l3), (e1, e2, e3)


@kernel
def keep_tops(carry, start, attitude, attitude_lo, spin, spin_lo):
    """Write what `state_of_tops` reads."""
    for k in range(WIDTH):
        if start + k < carry.shape[0]:
            high, low = carry[start + k, 0], carry[start + k, 1]
            high[0], high[1] = lane(attitude[0], k), lane(attitude[1], k)
            high[2], high[3] = lane(attitude[2], k), lane(attitude[3], k)
            low[0], low[1] = lane(attitude_lo[0], k), lane(attitude_lo[1], k)
            low[2], low[3] = lane(attitude_lo[2], k), lane(attitude_lo[3], k)
            high[4], high[5], high[6] = lane(spin[0], k), lane(spin[1], k), lane(spin[2], k)
            low[4], low[5], low[6] = lane(spin_lo[0], k), lane(spin_lo[1], k), lane(spin_lo[2], k)
