"""The flow of Kepler's problem by universal variables: every conic, either sign of dt, float64 or `Lanes`.

With r0 = |q|, eta = q.v, beta = 2 gm/r0 - v^2 (gm/a), zeta = gm - beta r0 and the universal anomaly s, ds = dt/r,

    dt = r0 s + eta G2 + zeta G3,    r = r0 + eta G1 + zeta G2,    G_k(s) = s^k c_k(beta s^2),   c_k Stumpff's functions

    q+ = q + (f - 1) q + g v,        f - 1 = -gm G2/r0,        g = dt - gm G3
    v+ = v + f' q + (g' - 1) v,      f' = -gm G1/(r0 r),       g' - 1 = -gm G2/r

Only increments are computed, so that a short step loses no digits. A step below one radian takes a fixed sequence: a
series for s, one Householder iteration, then a correction that is applied to G1, G2 and G3 to second order, so that the
remaining error has no preferred sign. Lanes for which that is not enough are detected afterwards and solved in a
bracket; the bits of a lane do not depend on its neighbours.

Sources: Stumpff (1959), Himmelsmechanik I; Danby (1992), Fundamentals of Celestial Mechanics, 6.9; Conway (1986),
Celest. Mech. 39, 199 (Laguerre's iteration); Rein & Tamayo (2015), MNRAS 452, 376 (increments, round-off).
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import any_lane, fma, load, maximum, minimum, rint, select, sqrt, store
from orbits.kernels.lanes.functions import log, power
from orbits.kernels.sums.summation import quick_two_sum, two_product, two_sum

TWO_PI = 6.283185307179586
TWO_PI_REST = 2.4492935982947064e-16
"""2 pi = TWO_PI + TWO_PI_REST to 33 digits."""

EVEN = tuple(1.0 / math.factorial(2 * k + 4) for k in range(9, -1, -1))
ODD = tuple(1.0 / math.factorial(2 * k + 5) for k in range(9, -1, -1))
"""Coefficients of c2 and c3, the highest first, without 1/2 and 1/6; the truncation error is below 1e-19 for |z| <=
2.5."""

NEAR = 2.0**-18
"""A correction of s below this fraction is applied to the G_k by its first two powers: the third is lost in
rounding."""

SIXTH = 1.0 / 6.0
SIXTH_REST = 9.25185853854297e-18
"""1/6 = SIXTH + SIXTH_REST to 33 digits."""

ROUNDS = 80
"""Limit of the bracketed iteration; bisection alone takes 60 rounds to the last bit."""

DOUBLINGS = 12
"""Limit of doublings of the argument of the G_k: beyond 2^12 radians e^x overflows."""


@kernel(inline=True)
def _short_series(z):
    """Return c2 and c3 of |z| <= 1 to nine digits."""
    m = -z
    c2 = fma(m, 1.0 / 3628800.0, 1.0 / 40320.0)
    c3 = fma(m, 1.0 / 39916800.0, 1.0 / 362880.0)
    c2 = fma(m, c2, 1.0 / 720.0)
    c3 = fma(m, c3, 1.0 / 5040.0)
    c2 = fma(m, c2, 1.0 / 24.0)
    c3 = fma(m, c3, 1.0 / 120.0)
    return fma(m, c2, 0.5), fma(m, c3, 1.0 / 6.0)


@kernel(inline=True)
def _tails(z):
    """Return c2 - 1/2 and c3 - 1/6 of |z| <= 1 to the last digit of c2 and c3: the terms left out begin at 1/20!."""
    m = -z
    c2 = fma(m, 1.0 / 6402373705728000.0, 1.0 / 20922789888000.0)
    c3 = fma(m, 1.0 / 121645100408832000.0, 1.0 / 355687428096000.0)
    c2 = fma(m, c2, 1.0 / 87178291200.0)
    c3 = fma(m, c3, 1.0 / 1307674368000.0)
    c2 = fma(m, c2, 1.0 / 479001600.0)
    c3 = fma(m, c3, 1.0 / 6227020800.0)
    c2 = fma(m, c2, 1.0 / 3628800.0)
    c3 = fma(m, c3, 1.0 / 39916800.0)
    c2 = fma(m, c2, 1.0 / 40320.0)
    c3 = fma(m, c3, 1.0 / 362880.0)
    c2 = fma(m, c2, 1.0 / 720.0)
    c3 = fma(m, c3, 1.0 / 5040.0)
    c2 = fma(m, c2, 0.25 * SIXTH_REST)
    c3 = fma(m, c3, 1.1564823173178714e-19)
    return fma(m, 1.0 / 24.0, m * c2), fma(m, 1.0 / 120.0, fma(m, c3, SIXTH_REST))


@kernel(inline=True)
def _wide_tails(z):
    """Return c2 - 1/2 and c3 - 1/6 of |z| <= 2.5 to the last digit of c2 and c3."""
    m = -z
    c2, c3 = m * 0.0, m * 0.0
    for k in range(len(EVEN)):
        c2, c3 = fma(m, c2, EVEN[k]), fma(m, c3, ODD[k])
    return m * c2, fma(m, c3, SIXTH_REST)


@kernel
def anomaly_functions(s, beta):
    """Return G0 ... G3 of any s: by the series up to x^2 = 2.5, beyond it by the series of x/2^n and n doublings.

    Beyond x = 1.6 the series of G1 and G0 of a circle would cancel; each doubling adds some rounding errors.
    """
    z = beta * s * s
    doublings = z * 0.0
    for _ in range(DOUBLINGS):
        large = abs(z) > 2.5
        if not any_lane(large):
            break
        doublings = select(large, doublings + 1.0, doublings)
        s = select(large, 0.5 * s, s)
        z = select(large, 0.25 * z, z)
    c2, c3 = _wide_tails(z)
    s2 = s * s
    s3 = s2 * s
    G2, G3 = fma(s2, c2, 0.5 * s2), fma(s3, c3, SIXTH * s3)
    G1, G0 = fma(-beta, G3, s), fma(-beta, G2, 1.0)
    for _ in range(DOUBLINGS):
        going = doublings > 0.0
        if not any_lane(going):
            break
        doublings = select(going, doublings - 1.0, doublings)
        G3 = select(going, 2.0 * fma(G1, G2, G3), G3)
        G2 = select(going, 2.0 * G1 * G1, G2)
        G1 = select(going, 2.0 * G0 * G1, G1)
        G0 = select(going, fma(-beta, G2, 1.0), G0)
    return G0, G1, G2, G3


@kernel(inline=True, exact=True)
def _sum_of_squares(x, y, z):
    """Return x^2 + y^2 + z^2 in doubled precision."""
    a, a_lo = two_product(x, x)
    b, b_lo = two_product(y, y)
    c, c_lo = two_product(z, z)
    s, e = two_sum(a, b)
    s, f = two_sum(s, c)
    return quick_two_sum(s, (e + f) + (a_lo + b_lo + c_lo))


@kernel(inline=True, exact=True)
def _determinant(a, b, c, d):
    """Return a d - b c, almost correctly rounded."""
    p, e = two_product(b, c)
    return fma(a, d, -p) - e


@kernel(inline=True, exact=True)
def _energy(r2, r2_lo, r0, v2, v2_lo, gm):
    """Return beta = 2 gm/r0 - v^2 in doubled precision, and the rounding error of r0 = sqrt(r2)."""
    r_lo = (fma(-r0, r0, r2) + r2_lo) / (r0 + r0)
    ratio = (gm + gm) / r0
    rest = (fma(-ratio, r0, gm + gm) - ratio * r_lo) / r0
    s, e = two_sum(ratio, -v2)
    beta, beta_lo = quick_two_sum(s, e + (rest - v2_lo))
    return beta, beta_lo, r_lo


@kernel(inline=True, exact=True)
def _within_one_period(dt, beta, beta_lo, gm):
    """Return dt minus the nearest number of whole periods 2 pi gm/beta^(3/2), in doubled precision; dt if beta <= 0."""
    bound = beta > 0.0
    beta = select(bound, beta, 1.0)
    root = sqrt(beta)
    root_lo = (fma(-root, root, beta) + beta_lo) / (root + root)
    d, d_lo = two_product(beta, root)
    d_lo = d_lo + fma(beta, root_lo, beta_lo * root)
    n, n_lo = two_product(gm, TWO_PI)
    n_lo = fma(gm, TWO_PI_REST, n_lo)
    period = n / d
    period_lo = (fma(-period, d, n) + fma(-period, d_lo, n_lo)) / d
    for _ in range(2):  # beyond 2^53 periods the first round leaves a remainder
        turns = rint(dt / period)
        p, p_lo = two_product(turns, period)
        rest = ((dt - p) - p_lo) - turns * period_lo
        dt = select(bound * (abs(dt) > 0.5 * period), rest, dt)
    return select(bound * (abs(dt) > period), 0.0, dt)


@kernel(inline=True, exact=True)
def _reconciled(G1, G2, beta, beta_lo):
    """Return G1 and G2 with the smallest change for which G1^2 = G2 (2 - beta G2), which conserves energy."""
    b, b_lo = two_product(beta, G2)
    u, u_lo = two_sum(2.0, -b)
    u_lo = u_lo - fma(beta_lo, G2, b_lo)
    p, p_lo = two_product(G1, G1)
    d, d_lo = two_product(G2, u)
    defect = (p - d) + (p_lo - fma(G2, u_lo, d_lo))
    G0 = 1.0 - b
    share = 0.5 * defect / fma(G0, G0, abs(beta) * G1 * G1)
    return fma(-share * abs(beta), G1, G1), fma(share, G0, G2)


@kernel
def _solve(hard, x, y, z, vx, vy, vz, gm, dt):
    """Return G1/r0, G2/r0, G2, g and r of any step in the lanes that are `hard`: Laguerre's iteration in a bracket.

    On the incoming branch of a hyperbola the sums for dt and r cancel as e^x. There, with s_p at pericentre:

        dt = 2 (r_mid G1(s/2) + gm G3(s/2)),    r = r_p + gm e G2(s - s_p),    r_mid = r at s/2
    """
    r2, r2_lo = _sum_of_squares(x, y, z)
    v2, v2_lo = _sum_of_squares(vx, vy, vz)
    r0 = sqrt(r2)
    beta, beta_lo, r_lo = _energy(r2, r2_lo, r0, v2, v2_lo, gm)
    hx, hy, hz = _determinant(y, vy, z, vz), _determinant(z, vz, x, vx), _determinant(x, vx, y, vy)
    h2 = fma(hx, hx, fma(hy, hy, hz * hz))
    dt = _within_one_period(dt, beta, beta_lo, gm)
    # From here on, time runs forwards.
    sign = select(dt < 0.0, -1.0, 1.0) + 0.0 * dt
    t = abs(dt)
    eta = sign * fma(x, vx, fma(y, vy, z * vz))
    zeta = fma(-beta, r0, gm) - fma(beta_lo, r0, beta * r_lo)
    w = sqrt(abs(beta))
    gm_e = sqrt(maximum(fma(-h2, beta, gm * gm), 0.0))
    # A bound of r that only rounding can exceed; gm_e of a circle is accurate to half the digits.
    pericentre = h2 / (gm + gm_e)
    nearest = maximum(0.99 * pericentre, 2.0**-100 * r0)
    incoming = (beta < 0.0) * (eta < 0.0) * (-beta * r0 > 0.1 * gm)
    passage, revolution = 0.0 * t, TWO_PI + 0.0 * t
    if any_lane(hard * (1.0 - (beta > 0.0))):  # logarithms take as long as two rounds of the iteration
        sinh = -eta * w / gm_e
        passage = log(sinh + sqrt(fma(sinh, sinh, 1.0))) / w
        revolution = select(beta > 0.0, TWO_PI, 2.0 * (2.2 + log(1.0 + 2.0 * t * (w * w * w) / gm_e)))

    # The pericentre passage of a parabola, and of any other conic, takes at least this long.
    high = revolution / w
    high = 1.000001 * minimum(high, power(40.0 * t / gm, 1.0 / 3.0))
    low = 0.0 * t
    s = minimum(high, select(beta > 0.0, t * beta / gm, high))
    s = select((eta >= 0.0) * (zeta >= 0.0), minimum(s, t / r0), s)
    done = 1.0 - (hard * (gm > 0.0) * (t > 0.0))
    start, motion, turn = (r0, r_lo, eta, zeta), (beta, t, gm), (gm_e, pericentre, passage, incoming)
    for _ in range(ROUNDS):
        _, G1, G2, G3 = anomaly_functions(s, beta)
        miss, r, slope = _time(s, (G1, G2, G3), start, motion, turn)
        low = select(miss < 0.0, s, low)
        high = select(miss < 0.0, high, s)
        root = sqrt(abs(16.0 * r * r - 20.0 * miss * slope))
        change = -5.0 * miss / (r + root)
        new = s + change
        new = select((new >= low) * (new <= high), new, 0.5 * (low + high))
        met = abs(miss) <= 2.0**-51 * (t + select(incoming, 0.0, abs(eta * G2)))
        new = select(met * (abs(new - s) > NEAR * s), s, new)  # at a collision r is nothing but rounding errors, too
        change = new - s
        settled = (abs(change) <= 2.0**-30 * s) * (abs(change * slope) <= 2.0**-20 * r) + met
        s = select(done, s, new)
        done = maximum(done, select(settled, 1.0, 0.0) + 0.0 * t)
        if not any_lane(1.0 - done):
            break
    G0, G1, G2, G3 = anomaly_functions(s, beta)
    miss, r, slope = _time(s, (G1, G2, G3), start, motion, turn)
    r = maximum(r, nearest)
    d = -miss / r
    d = fma(-0.5 * d * d, slope / r, d)
    d = select(abs(d) <= NEAR * s, d, 0.0)
    half = 0.5 * d * d
    G2, G3 = fma(half, G0, fma(d, G1, G2)), fma(half, G1, fma(d, G2, G3))
    G1 = fma(-half * beta, G1, fma(d, G0, G1))
    G1, G2 = _reconciled(G1, G2, beta, beta_lo)
    _, r, _ = _time(s + d, (G1, G2, G3), start, motion, turn)
    r = maximum(r, nearest)
    # The form of g with the smaller terms.
    first, second = fma(r0, G1, eta * G2), fma(-gm, G3, t)
    g = select(r0 * abs(G1) + abs(eta * G2) <= 0.5 * gm * abs(G3), first, second)
    straight = gm == 0.0
    G1, G2 = select(straight, 0.0, G1), select(straight, 0.0, G2)
    # r0 of a circle is always rounded in the same direction, so its rounding error is added back.
    first, second = G1 / r0, G2 / r0
    first = first + (fma(-first, r0, G1) - first * r_lo) / r0
    second = second + (fma(-second, r0, G2) - second * r_lo) / r0
    return sign * first, second, G2, select(straight, dt, sign * g), select(straight, r0, r)


@kernel(inline=True)
def _time(s, G, start, motion, turn):
    """Return the time at s minus t, and its derivatives r and dr/ds.

    G : (G1, G2, G3) at s; start : (r0, r_lo, eta, zeta); motion : (beta, t, gm)
    turn : (gm e, pericentre distance, s there, whether the body is falling towards it)
    """
    (G1, G2, G3), (r0, r_lo, eta, zeta), (beta, t, gm), (gm_e, pericentre, passage, incoming) = G, start, motion, turn
    miss = fma(zeta, G3, fma(eta, G2, fma(r_lo, s, fma(r0, s, -t))))
    r = r0 + fma(zeta, G2, fma(eta, G1, r_lo))
    slope = fma(-beta * eta, G2, fma(zeta, G1, eta))
    if any_lane(incoming):
        _, G1, _, G3 = anomaly_functions(0.5 * s, beta)
        _, _, G2, _ = anomaly_functions(fma(0.5, s, -passage), beta)
        miss = select(incoming, fma(2.0 * fma(gm_e, G2, pericentre), G1, fma(2.0 * gm, G3, -t)), miss)
        _, G1, G2, _ = anomaly_functions(s - passage, beta)
        r = select(incoming, fma(gm_e, G2, pericentre), r)
        slope = select(incoming, gm_e * G1, slope)
    return miss, r, slope


@kernel(inline=True)
def kepler_increments(x, y, z, vx, vy, vz, gm, dt):
    """Return (dx, dy, dz, dvx, dvy, dvz), the change of position and velocity in the time dt.

    x ... vz : position and velocity relative to the attracting body, float64 or `Lanes`
    gm : GM of the pair, >= 0; dt : time, either sign, any number of periods; float64, or `Lanes` where x is
    The position must not be 0, and squares must not overflow. A radial orbit is treated as the limit of narrow orbits:
    the motion bounces. Input that is not finite gives results that are not finite. Always terminates.
    """
    r0 = sqrt(fma(x, x, fma(y, y, z * z)))
    near = 1.0 / r0
    eta = fma(x, vx, fma(y, vy, z * vz))
    v2 = fma(vx, vx, fma(vy, vy, vz * vz))
    zeta = fma(v2, r0, -gm)
    beta = (gm - zeta) * near

    # The inverse of the series dt/r0 = s + a s^2 + ...
    tau = dt * near
    a = 0.5 * eta * near * tau
    b = (1.0 / 6.0) * zeta * near * tau * tau
    c = (1.0 / 12.0) * beta * tau * tau
    s = tau * (1.0 + fma(2.0 * a, a, -a - b) + a * (fma(-5.0 * a, a, 5.0 * b) + c))

    c2, c3 = _short_series(beta * s * s)
    G2 = s * s * c2
    G3 = s * s * s * c3
    G1 = fma(-beta, G3, s)
    miss = fma(zeta, G3, fma(eta, G2, fma(r0, s, -dt)))
    r = fma(zeta, G2, fma(eta, G1, r0))
    slope = fma(-beta * eta, G2, fma(zeta, G1, eta))
    bend = fma(-beta, fma(zeta, G2, eta * G1), zeta)
    over = fma(-0.5 * miss, slope, r * r)
    under = fma(r, fma(-miss, slope, r * r), (1.0 / 6.0) * miss * miss * bend)
    s = s - miss * over / under

    s2 = s * s
    s3 = s2 * s
    angle2 = beta * s2
    c2, c3 = _tails(angle2)
    G2 = s2 * (0.5 + c2)
    G3 = s3 * (SIXTH + c3)
    G1 = fma(-beta, G3, s)
    G0 = fma(-beta, G2, 1.0)
    miss = fma(zeta, G3, fma(eta, G2, fma(r0, s, -dt)))
    r = fma(zeta, G2, fma(eta, G1, r0))
    slope = fma(zeta, G1, eta * G0)
    there = 1.0 / r
    d = -miss * there
    turn = slope * there
    d = fma(-0.5 * d * d, turn, d)
    easy = (abs(angle2) <= 1.0) * (abs(d) <= NEAR * abs(s)) * (abs(d * turn) <= NEAR) * (r > 2.0**-10 * r0)
    # On a circle s is nearly the same at every step, and so would be the rounding errors of the G_k: a slow spiral. So
    # the leading terms are rounded last, including d and the rounding of s^2, which differ from step to step.
    half = 0.5 * d * d
    carried = fma(half, G1, d * G2)
    G2 = fma(0.5, s2, fma(s2, c2, fma(0.5, fma(s, s, -s2), fma(half, G0, d * G1))))
    G3 = fma(SIXTH, s3, fma(s3, c3, carried))
    G1 = s + fma(-beta, G3, d)
    r = fma(zeta, G2, fma(eta, G1, r0))
    g = fma(-gm, G3, dt)
    first, second = near * G1, near * G2
    hard = 1.0 - easy
    if any_lane(hard):
        first_hard, second_hard, G2_hard, g_hard, r_hard = _solve(hard, x, y, z, vx, vy, vz, gm, dt)
        first = select(hard, first_hard, first)
        second = select(hard, second_hard, second)
        G2 = select(hard, G2_hard, G2)
        g = select(hard, g_hard, g)
        r = select(hard, r_hard, r)
    there = gm / r
    f = -gm * second
    df = -there * first
    dg = -there * G2
    return (
        fma(f, x, g * vx),
        fma(f, y, g * vy),
        fma(f, z, g * vz),
        fma(df, x, dg * vx),
        fma(df, y, dg * vy),
        fma(df, z, dg * vz),
    )


@kernel
def kepler_flow(state, gm, dt):
    """Advance n points by their own dt, eight in lanes.

    state : (6, n), rows x, y, z, vx, vy, vz; overwritten. gm, dt : (n,). n is a multiple of eight
    """
    for p in range(0, state.shape[1], 8):
        x, y, z = load(state[0], p), load(state[1], p), load(state[2], p)
        vx, vy, vz = load(state[3], p), load(state[4], p), load(state[5], p)
        dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, load(gm, p), load(dt, p))
        store(state[0], p, x + dx)
        store(state[1], p, y + dy)
        store(state[2], p, z + dz)
        store(state[3], p, vx + dvx)
        store(state[4], p, vy + dvy)
        store(state[5], p, vz + dvz)
