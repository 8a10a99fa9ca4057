"""The free rotation of a rigid body, in closed form: any moments of inertia, any time step; float64 or `Lanes`.

Euler's equations are Pi_i' = a_i Pi_j Pi_k with a_1 = 1/C - 1/B and so on, (i, j, k) cyclic. The squares of the momenta
are all linear in one function of Weierstrass, with roots for which e_i - e_j = a_k (a_i Pi_j^2 - a_j Pi_i^2). With
S_i(t) = sqrt(P(t) - e_i), which is 1/t for short t, the theorem of addition is

    Pi_i(t) = (S_j S_k Pi_i + S_i a_i Pi_j Pi_k) / D,     D = S_i^2 - a_j a_k Pi_i^2, the same for all i

There is no case to distinguish, no phase to find at the start, and equal moments are as good as others. From the middle
of a step, where the momentum is Pi, its ends are X + Y and X - Y, of the two parts of the sum. The body turns by a
quaternion that takes the one end to the other,

    ( |X|/M cos c,   sin c X/|X| - cos c X x Y/(M |X|) ),     M = |Pi|,
    c = M int (X J^-1 X)/(X X) dt from the middle to the end,     X_i^2 ~ Pi_i^2 (P - e_j)(P - e_k)

an integral of a smooth even function: four nodes of Gauss, with a series for P, have all digits of a step that is short
beside the period. A longer one is some short ones. Of a very long one whole periods are left out: these return the
momentum and turn the body about it, by a complete integral of the third kind.

Sources: Whittaker (1937), Analytical Dynamics, sec. 69-71; DLMF, sec. 23.9, 23.10; for the complete integral Bulirsch
(1965), Numer. Math. 7, 353.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, fma, full, load, maximum, minimum, rint, select, sqrt, store
from orbits.kernels.lanes.functions import cos, sin

SHORT = 0.6
"""Longest step, in units of 1/sqrt(e_max - e_min): the series of P then ends at 2e-18, the quadrature at 1e-17."""

FEW = 12.0
"""Up to this number of short steps, no period is computed."""

MOST = 512
"""Limit of the number of short steps. The longest periods, at the separatrix to the last bit, take some 200."""

NODES2 = (0.033648268067506856, 0.27618431387246445, 0.6346774762346367, 0.9221566084920587)
WEIGHTS = (0.362683783378362, 0.31370664587788727, 0.22238103445337448, 0.10122853629037626)
"""Squares of the nodes in (0, 1), and weights, of the even rule with eight nodes in (-1, 1)."""

SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(8, 0, -1))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(9, 1, -1))
"""Coefficients of the sine and cosine in x^2, the highest first, without 1 and x^2/2."""

LEAST_KC2 = 1e-33
"""Motions nearer to the separatrix than this differ from it by less than rounding."""

ROUNDS = 20
"""Limit of a quadratic convergence."""

HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
"""A quarter turn in three parts."""

LARGE = 2.0**20
"""Angles beyond it are left to the C library."""


@kernel(inline=True)
def sine_and_cosine_less_one(x):
    """Return sin x and cos x - 1; of small angles, both to the last digits; float64 or `Lanes`."""
    n = rint(x * (1.0 / HALF_PI[0]))
    r = fma(-n, HALF_PI[2], fma(-n, HALF_PI[1], fma(-n, HALF_PI[0], x)))
    z = r * r
    s, c = z * 0.0, z * 0.0
    for k in range(len(SINE)):
        s, c = fma(z, s, SINE[k]), fma(z, c, COSINE[k])
    s, c = fma(r * z, s, r), fma(z * z, c, -0.5 * z)
    quarter = n - 4.0 * rint(0.25 * n)
    half = abs(quarter) == 2.0
    cosine = 1.0 + c
    sine = select(quarter == 1.0, cosine, select(quarter == -1.0, -cosine, select(half, -s, s)))
    less = select(quarter == 1.0, -1.0 - s, select(quarter == -1.0, s - 1.0, select(half, -1.0 - cosine, c)))
    large = abs(x) > LARGE
    if any_lane(large):
        sine, less = select(large, sin(x), sine), select(large, cos(x) - 1.0, less)
    return sine, less


@kernel(inline=True)
def product(p, q):
    """Return the product of two quaternions."""
    a, b, c, d = p
    e, f, g, h = q
    return (
        fma(a, e, -fma(b, f, fma(c, g, d * h))),
        fma(a, f, fma(b, e, fma(c, h, -d * g))),
        fma(a, g, fma(c, e, fma(d, f, -b * h))),
        fma(a, h, fma(d, e, fma(b, g, -c * f))),
    )


@kernel(inline=True)
def turned(q, more):
    """Return the unit quaternion q (1 + more), of unit length to the last bit."""
    a, b, c, d = q
    da, db, dc, dd = product(q, more)
    w, x, y, z = a + da, b + db, c + dc, d + dd
    half = -0.5 * (fma(w, w, -1.0) + fma(x, x, fma(y, y, z * z)))
    return fma(half, w, w), fma(half, x, x), fma(half, y, y), fma(half, z, z)


@kernel(inline=True)
def _root_of_one_and(x):
    """Return sqrt(1 + x) - 1."""
    return x / (1.0 + sqrt(1.0 + x))


@kernel(inline=True)
def _half_step(momentum, evens, odds, constants):
    """Return the two parts of the change of the momentum, even and odd in time."""
    x, y, z = momentum
    bc, ca, ab, series = constants
    more = series - fma(bc, x * x, fma(ca, y * y, ab * (z * z))) * (1.0 / 3.0)
    over = 1.0 / (1.0 + more)
    even = over * (evens[0] - more) * x, over * (evens[1] - more) * y, over * (evens[2] - more) * z
    return even, (over * odds[0] * (y * z), over * odds[1] * (z * x), over * odds[2] * (x * y))


@kernel(inline=True)
def _short_step(rates, inverse, tau, momentum):
    """Return what a short step adds to 1 in the quaternion of its rotation, and to the momentum.

    rates : the a_i of the momentum's scale; inverse : 1/A, 1/B, 1/C; tau : half of the step; the momentum is not 0
    """
    x, y, z = momentum
    a, b, c = tau * rates[0], tau * rates[1], tau * rates[2]
    x2, y2, z2 = x * x, y * y, z * z
    # Differences of the roots, times tau^2, then the roots, whose sum is 0.
    da, db, dc = a * fma(b, z2, -c * y2), b * fma(c, x2, -a * z2), c * fma(a, y2, -b * x2)
    ea, eb, ec = (dc - db) * (1.0 / 3.0), (da - dc) * (1.0 / 3.0), (db - da) * (1.0 / 3.0)

    # Coefficients of s^2 P(s) - 1 in s^4, s^6 ...: DLMF 23.9.4.
    c2 = 0.1 * fma(ea, ea, fma(eb, eb, ec * ec))
    c3 = (1.0 / 7.0) * (ea * eb * ec)
    c22 = c2 * c2
    c4, c5 = (1.0 / 3.0) * c22, (3.0 / 11.0) * (c2 * c3)
    c6 = (1.0 / 39.0) * fma(2.0 * c22, c2, 3.0 * c3 * c3)
    c7 = (2.0 / 33.0) * (c22 * c3)
    c8 = (3.0 / 85.0) * fma(c4, c4, 2.0 * fma(c2, c6, c3 * c5))
    c9 = (1.0 / 19.0) * fma(c2, c7, fma(c3, c6, c4 * c5))
    series = c2 + (c3 + (c4 + (c5 + (c6 + (c7 + (c8 + c9))))))

    pa1, pb1, pc1 = _root_of_one_and(series - ea), _root_of_one_and(series - eb), _root_of_one_and(series - ec)
    parts = a + a * pa1, b + b * pb1, c + c * pc1
    bc1, ca1, ab1 = fma(pb1, pc1, pb1 + pc1), fma(pc1, pa1, pc1 + pa1), fma(pa1, pb1, pa1 + pb1)
    constants = b * c, c * a, a * b, series
    evens, odds = _half_step((x, y, z), (bc1, ca1, ab1), parts, constants)
    du, dv, dw = evens[0] + odds[0], evens[1] + odds[1], evens[2] + odds[2]
    x, y, z = x + du, y + dv, z + dw
    evens, odds = _half_step((x, y, z), (bc1, ca1, ab1), parts, constants)
    X, Y, Z = x + evens[0], y + evens[1], z + evens[2]
    U, V, W = odds
    du, dv, dw = du + (evens[0] + U), dv + (evens[1] + V), dw + (evens[2] + W)

    x2, y2, z2 = x * x, y * y, z * z
    angle = x * 0.0
    for k in range(len(NODES2)):
        s = NODES2[k]
        p = fma(s, fma(s, fma(s, fma(s, fma(s, fma(s, fma(s, c9, c8), c7), c6), c5), c4), c3), c2) * (s * s)
        na, nb, nc = 1.0 + fma(-s, ea, p), 1.0 + fma(-s, eb, p), 1.0 + fma(-s, ec, p)
        wa, wb, wc = x2 * (nb * nc), y2 * (nc * na), z2 * (na * nb)
        mean = fma(wa, inverse[0], fma(wb, inverse[1], wc * inverse[2])) / (wa + (wb + wc))
        angle = fma(WEIGHTS[k], mean, angle)
    M = sqrt(x2 + (y2 + z2))
    sine, less = sine_and_cosine_less_one(angle * (tau * M))
    size = sqrt(fma(X, X, fma(Y, Y, Z * Z)))
    shrunk = -fma(U, U, fma(V, V, W * W)) / (M * (M + size))
    along, across = sine / size, -(1.0 + less) / (M * size)
    turn = (
        fma(less, size / M, shrunk),
        fma(along, X, across * fma(Y, W, -Z * V)),
        fma(along, Y, across * fma(Z, U, -X * W)),
        fma(along, Z, across * fma(X, V, -Y * U)),
    )
    return turn, (du, dv, dw)


@kernel(inline=True)
def _ordered(one, other):
    """Return two pairs (moment, momentum) in ascending order of the moments."""
    swap = one[0] > other[0]
    less = select(swap, other[0], one[0]), select(swap, other[1], one[1])
    return less, (select(swap, one[0], other[0]), select(swap, one[1], other[1]))


@kernel(inline=True)
def _half_turns(moments, momentum):
    """Return the period of the momentum, half of the angle by which the body turns about it in that time, and whether
    its quaternion then has the other sign, 1 or 0.
    """
    one, two, three = (moments[0], momentum[0]), (moments[1], momentum[1]), (moments[2], momentum[2])
    one, two = _ordered(one, two)
    two, three = _ordered(two, three)
    one, two = _ordered(one, two)
    A, B, C = one[0], two[0], three[0]
    x2, y2, z2 = one[1] * one[1], two[1] * two[1], three[1] * three[1]
    # M^2 - 2 E A, 2 E C - M^2 and M^2 - 2 E B, without differences of large numbers.
    low = fma(y2, (B - A) / B, z2 * ((C - A) / C))
    high = fma(x2, (C - A) / A, y2 * ((C - B) / B))
    mid = fma(z2, (C - B) / C, -x2 * ((B - A) / A))
    around = mid > 0.0  # about the axis of the largest moment; otherwise about that of the least
    large = select(around, (C - B) * low, (B - A) * high)
    rate = sqrt(large / (A * B * C))
    kc = sqrt(maximum(minimum((C - A) * abs(mid) / large, 1.0), LEAST_KC2))
    p = sqrt(1.0 + select(around, C * (B - A) / (A * (C - B)), C * low / (A * high)))
    # Bulirsch's cel with a = b = 1, and the arithmetic-geometric mean on the way: em is 2^n times that.
    a, b, em, e, size = p * 0.0 + 1.0, 1.0 / p, p * 0.0 + 1.0, kc, p * 0.0 + 1.0
    going = size
    for _ in range(ROUNDS):
        f, g = a, e / p
        a = select(going, a + b / p, a)
        b = select(going, 2.0 * fma(f, g, b), b)
        p = select(going, p + g, p)
        g = em
        em = select(going, em + kc, em)
        size = select(going, 0.5 * size, size)
        going = going * (abs(g - kc) > g * 1e-8)
        if not any_lane(going):
            break
        kc = select(going, 2.0 * sqrt(e), kc)
        e = select(going, kc * em, e)
    third = 0.5 * math.pi * fma(a, em, b) / (em * (em + p))
    first = 0.5 * math.pi / (em * size)
    M = sqrt(x2 + (y2 + z2))
    half = 2.0 * M / rate * fma((C - A) / (A * C), third, first / C)
    return 4.0 * first / rate, half, around


@kernel(inline=True)
def both(more, other):
    """Return (1 + more)(1 + other) - 1, of quaternions."""
    a, b, c, d = product(more, other)
    return (
        a + (more[0] + other[0]),
        b + (more[1] + other[1]),
        c + (more[2] + other[2]),
        d + (more[3] + other[3]),
    )


@kernel
def _without_periods(many, moments, h, momentum):
    """Return the rest of h after whole periods, and the rotation by these less 1; h and 0 in lanes without `many`."""
    period, half, around = _half_turns(moments, momentum)
    periods = rint(h / period)
    x, y, z = momentum
    sine, less = sine_and_cosine_less_one(periods * half)
    odd = around * (abs(periods - 2.0 * rint(0.5 * periods)) == 1.0)
    along = select(odd, -sine, sine) / sqrt(fma(x, x, fma(y, y, z * z)))
    rest = select(many, fma(-periods, period, h), h)
    less = select(odd, -2.0 - less, less)
    less, along = select(many, less, 0.0), select(many, along, 0.0)
    return rest, less, along * x, along * y, along * z


@kernel
def _long_step(moments, rates, inverse, rate, h, momentum):
    """Return what a step of any length adds to 1 in the quaternion of its rotation, and to the momentum."""
    x, y, z = momentum
    a, b, c, d = x * 0.0, x * 0.0, x * 0.0, x * 0.0
    many = rate * abs(h) > FEW
    if any_lane(many):
        h, a, b, c, d = _without_periods(many, moments, h, momentum)
    count = maximum(rint(0.499 + rate * abs(h)), 1.0)
    tau = 0.5 * h / count
    du, dv, dw = x * 0.0, x * 0.0, x * 0.0
    for k in range(MOST):
        going = count > k
        if not any_lane(going):
            break
        more, (u, v, w) = _short_step(rates, inverse, tau, (x + du, y + dv, z + dw))
        e, f, g, i = both((a, b, c, d), more)
        a, b, c, d = select(going, e, a), select(going, f, b), select(going, g, c), select(going, i, d)
        du, dv, dw = select(going, du + u, du), select(going, dv + v, dv), select(going, dw + w, dw)
    return (a, b, c, d), (du, dv, dw)


@kernel(inline=True)
def rotation(moments, h, momentum):
    """Return the free rotation of a body in the time h, a unit quaternion less 1 in its axes at the start, and the
    change of its momentum in its axes.

    Both have all digits of their own however short the step is. Arguments as for `rotate`.
    """
    A, B, C = moments
    x, y, z = momentum
    size = maximum(abs(x), maximum(abs(y), abs(z)))
    rest = size == 0.0
    scale = select(size < 1e-100, 2.0**500, select(size > 1e100, 2.0**-500, 1.0))
    x, y, z, h = select(rest, 1.0, x * scale), y * scale, z * scale, select(rest, 0.0, h / scale)
    a, b, c = (B - C) / (B * C), (C - A) / (C * A), (A - B) / (A * B)
    inverse = 1.0 / A, 1.0 / B, 1.0 / C
    x2, y2, z2 = x * x, y * y, z * z
    da, db, dc = a * fma(b, z2, -c * y2), b * fma(c, x2, -a * z2), c * fma(a, y2, -b * x2)
    rate = sqrt(maximum(abs(da), maximum(abs(db), abs(dc)))) * (1.0 / SHORT)
    if any_lane(rate * abs(h) > 1.0):
        more, (u, v, w) = _long_step(moments, (a, b, c), inverse, rate, h, (x, y, z))
    else:
        more, (u, v, w) = _short_step((a, b, c), inverse, 0.5 * h, (x, y, z))
    return more, (u / scale, v / scale, w / scale)


@kernel(inline=True)
def rotate(moments, h, attitude, momentum):
    """Return the attitude and the momentum of a free rigid body after the time h.

    moments : (A, B, C), in any order, > 0; equal ones too
    h : of either sign
    attitude : the unit quaternion (a, b, c, d) of the rotation from the axes of the body to those of space
    momentum : of rotation, in the axes of the body; may be 0
    Each entry is a float64, or `Lanes` with one body in each; the bits of a lane do not depend on its neighbours.
    """
    more, (u, v, w) = rotation(moments, h, momentum)
    return turned(attitude, more), (momentum[0] + u, momentum[1] + v, momentum[2] + w)


@kernel
def rotated_at(moments, attitude, momentum, times, attitudes, momenta):
    """Write the attitudes and momenta of a free body at many times, each from the start.

    times : (n,), n a multiple of 8; attitudes : (4, n); momenta : (3, n)
    """
    A, B, C = full(moments[0]), full(moments[1]), full(moments[2])
    q = full(attitude[0]), full(attitude[1]), full(attitude[2]), full(attitude[3])
    pi = full(momentum[0]), full(momentum[1]), full(momentum[2])
    for k in range(0, times.shape[0], WIDTH):
        (a, b, c, d), (x, y, z) = rotate((A, B, C), load(times, k), q, pi)
        store(attitudes[0], k, a)
        store(attitudes[1], k, b)
        store(attitudes[2], k, c)
        store(attitudes[3], k, d)
        store(momenta[0], k, x)
        store(momenta[1], k, y)
        store(momenta[2], k, z)


__all__ = ["both", "product", "rotate", "rotated_at", "rotation", "sine_and_cosine_less_one", "turned"]
