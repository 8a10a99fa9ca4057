"""The flow of Kepler's problem for steps that are short beside the orbit, such as those of planets.

In units of the way that a body at rest at r0 would take, w = s r0 / dt for the universal anomaly s, Kepler's equation
of `orbits.kernels.kepler.flow` has three numbers in it, all small for short steps:

    1 = w + E g2 + Z g3,    r / r0 = 1 + E g1 + Z g2,    g_k(w) = w^k c_k(B w^2),   c_k Stumpff's functions
    E = q.v dt / r0^2,    Z = (v^2 - gm/r0) dt^2 / r0^2,    B = (2 gm/r0 - v^2) dt^2 / r0^2

    q+ = q + f q + g v,          f = -K g2,                    g = dt - dt K g3,     K = gm dt^2 / r0^3
    v+ = v + f' q + g' v,        f' = -(K / dt) g1 r0/r,       g' = f r0/r

A series in E, Z and B gives w; the g_k are computed once, in full; what w misses, d, is then found by a formula of the
fourth order and carried into them, so that it is also what tells a step that is not short. Lanes in which it is not are
computed by `kepler_increments`, which takes any step; the bits of a lane do not depend on its neighbours.

Sources: those of `orbits.kernels.kepler.flow`; Householder (1970), The Numerical Treatment of a Single Nonlinear
Equation.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.kepler.flow import SIXTH, SIXTH_REST, kepler_increments
from orbits.kernels.lanes import any_lane, fma, halves, joined, pair, select, sqrt

EVEN = tuple(1.0 / math.factorial(2 * k + 2) for k in range(7, 0, -1))
ODD = tuple(1.0 / math.factorial(2 * k + 3) for k in range(7, 0, -1))
"""Coefficients of c2 and c3, the highest first, without 1/2 and 1/6."""

REST_OF_24TH = 2.3129646346357427e-18
REST_OF_120TH = 1.1564823173178714e-19
"""What rounding takes from 1/24 and 1/120. As for 1/6, leaving it out would make orbits spiral: by 1e-19 of their
energy at each step.
"""

SMALL = 0.5
"""Bound of 2 |E| + 2 |Z| + |B|: 0.7 radians on a circle. The series of c2 and c3 are then complete to 2e-18, and the
distance changes by less than a third.
"""

NEAR = 2.0**-14
"""Bound of |d|: what its fourth power would change is then less than 1e-18."""


@kernel
def _any_increments(x, y, z, vx, vy, vz, gm, dt):
    """Return `kepler_increments`, not copied into the caller."""
    return kepler_increments(x, y, z, vx, vy, vz, gm, dt)


@kernel(inline=True)
def _in_lanes(short, found, x, y, z, vx, vy, vz, gm, dt):
    if not any_lane(1.0 - short):
        return found
    dx, dy, dz, du, dv, dw = found
    ex, ey, ez, eu, ev, ew = _any_increments(x, y, z, vx, vy, vz, gm, dt)
    dx, dy, dz = select(short, dx, ex), select(short, dy, ey), select(short, dz, ez)
    return dx, dy, dz, select(short, du, eu), select(short, dv, ev), select(short, dw, ew)


@kernel(inline=True)
def _in_a_pair(short, found, x, y, z, vx, vy, vz, gm, dt):
    if not any_lane(1.0 - short):
        return found
    (x0, x1), (y0, y1), (z0, z1), (gm0, gm1) = halves(x), halves(y), halves(z), halves(gm)
    (u0, u1), (v0, v1), (w0, w1), (short0, short1) = halves(vx), halves(vy), halves(vz), halves(short)
    dt0, dt1 = halves(dt)
    (dx0, dx1), (dy0, dy1), (dz0, dz1) = halves(found[0]), halves(found[1]), halves(found[2])
    (du0, du1), (dv0, dv1), (dw0, dw1) = halves(found[3]), halves(found[4]), halves(found[5])
    one = _in_lanes(short0, (dx0, dy0, dz0, du0, dv0, dw0), x0, y0, z0, u0, v0, w0, gm0, dt0)
    two = _in_lanes(short1, (dx1, dy1, dz1, du1, dv1, dw1), x1, y1, z1, u1, v1, w1, gm1, dt1)
    dx, dy, dz = joined(one[0], two[0]), joined(one[1], two[1]), joined(one[2], two[2])
    return dx, dy, dz, joined(one[3], two[3]), joined(one[4], two[4]), joined(one[5], two[5])


@verb
def _corrected(short, found, x, y, z, vx, vy, vz, gm, dt):
    """Return `found`, with `kepler_increments` in the lanes in which `short` is 0."""
    corrected = _in_a_pair if short == pair else _in_lanes
    return lambda short, found, x, y, z, vx, vy, vz, gm, dt: corrected(short, found, x, y, z, vx, vy, vz, gm, dt)


@kernel(inline=True)
def short_increments(x, y, z, vx, vy, vz, gm, dt):
    """Return (dx, dy, dz, dvx, dvy, dvz), the change of position and velocity in the time dt.

    The same as `kepler_increments`, for the same arguments and to the same accuracy; where the steps of all lanes are
    short, in two thirds of the time, and otherwise in 1.7 times that. Two registers at once, `joined`, take 1.4 times
    the time of one, to the same bits.
    """
    near = 1.0 / sqrt(fma(x, x, fma(y, y, z * z)))
    eta = fma(x, vx, fma(y, vy, z * vz))
    v2 = fma(vx, vx, fma(vy, vy, vz * vz))
    tau = dt * near
    tau2 = tau * tau
    kappa = gm * near
    K = kappa * tau2
    E, B, Z = (eta * near) * tau, fma(-v2, tau2, K + K), fma(v2, tau2, -K)

    # w - 1 = -a + (2 a^2 - b) + ..., the solution up to the fourth order in a; b and c count twice.
    a, b, c = 0.5 * E, SIXTH * Z, (1.0 / 12.0) * B
    third = fma(-5.0 * a, a, fma(5.0, b, c))
    fourth = fma(a * a, fma(14.0 * a, a, fma(-21.0, b, -6.0 * c)), b * fma(3.0, b, 0.6 * c))
    more = fma(a, third - 1.0, fma(a + a, a, -b)) + fourth

    # w^2 - 1 and w^3 - 1; then c2 and c3 without their leading 1/2 and 1/6, and g1, g2 and g3 without 1, 1/2 and 1/6.
    w = 1.0 + more
    square = more * (2.0 + more)
    cube = fma(square, w, more)
    w2 = 1.0 + square
    m = -B * w2
    m2 = m * m
    c2 = fma(m2, fma(m2, fma(m, EVEN[0], EVEN[1]), fma(m, EVEN[2], EVEN[3])), fma(m, EVEN[4], EVEN[5]))
    c3 = fma(m2, fma(m2, fma(m, ODD[0], ODD[1]), fma(m, ODD[2], ODD[3])), fma(m, ODD[4], ODD[5]))
    c2 = fma(m, EVEN[6], m * fma(m, c2, REST_OF_24TH))
    c3 = fma(m, ODD[6], fma(m, fma(m, c3, REST_OF_120TH), SIXTH_REST))
    h2, h3 = fma(0.5, square, w2 * c2), fma(SIXTH, cube, fma(cube, c3, c3))
    g2, g3 = 0.5 + h2, SIXTH + h3
    h1, g0 = fma(-B, g3, more), fma(-B, g2, 1.0)
    g1 = 1.0 + h1

    miss = fma(E, g2, fma(Z, g3, more))
    r = 1.0 + fma(E, g1, Z * g2)
    slope, Bg1 = fma(E, g0, Z * g1), B * g1
    bend = fma(Z, g0, -E * Bg1)
    half = 0.5 * miss * slope
    over = fma(r, r, -half)
    d = -miss * over / fma(r, over - half, SIXTH * miss * miss * bend)

    half, third = 0.5 * d, (1.0 / 3.0) * d
    h2 = fma(d, fma(half, fma(-third, Bg1, g0), g1), h2)
    h3 = fma(d, fma(half, fma(third, g0, g1), g2), h3)
    h1 = fma(-B, SIXTH + h3, more + d)
    # 1 - q/(1 + q), as the rounding errors of r / r0, which is near 1, are not symmetric.
    q = fma(E, h1, fma(Z, h2, fma(0.5, Z, E)))
    q = q / (1.0 + q)
    # On a circle the numbers are nearly the same at every step, and so would be their rounding errors: a slow spiral.
    # So those of the order of 1 are not rounded: the last roundings are of products with x ... vz, which turn. And of
    # two products, that with 1/6 is not rounded: its rounding errors are not random.
    f, df, lag = fma(-K, h2, -0.5 * K), -(kappa * (near * tau)), -(K * dt)
    df, dg, lag = fma(df, h1, df), fma(-f, q, f), fma(SIXTH, lag, lag * h3)
    df = fma(-df, q, df)
    dx, dy, dz = fma(f, x, fma(lag, vx, dt * vx)), fma(f, y, fma(lag, vy, dt * vy)), fma(f, z, fma(lag, vz, dt * vz))
    dvx, dvy, dvz = fma(df, x, dg * vx), fma(df, y, dg * vy), fma(df, z, dg * vz)
    short = (fma(2.0, abs(E) + abs(Z), abs(B)) <= SMALL) * (abs(d) <= NEAR)
    return _corrected(short, (dx, dy, dz, dvx, dvy, dvz), x, y, z, vx, vy, vz, gm, dt)


__all__ = ["short_increments"]
