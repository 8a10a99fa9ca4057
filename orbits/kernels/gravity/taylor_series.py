"""Taylor series of Newtonian motion in doubled precision, about 31 digits: for reference solutions.

In a step, the separations d of the pairs of bodies, u = d . d + eps^2, w = u^(-3/2) and f = w d are power series in the
time, computed term by term with those of the positions:

    u_k = sum_j d_j d_(k-j)              k u_0 w_k = -sum_(j<k) (3/2 (k - j) + j) u_(k-j) w_j
    f_k = sum_j w_j d_(k-j)              (k + 1)(k + 2) q_(k+2) = sum over pairs of GM f_k

Eight pairs are computed at once, in lanes. Time is counted in units of a power of two near the length of a step, so
that high powers neither overflow nor underflow. A step is a fraction of the radius of convergence, which is estimated
from the last two terms of each separation.

Source: Jorba & Zou (2005), Experimental Mathematics 14, 99.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, exact_add, fma, full, load, sqrt, store
from orbits.kernels.sums.summation import add_pairs, multiply_pairs, quick_two_sum, two_product, two_sum

TIME, TIME_LO, UNIT, SHARE, DONE, STEPS = range(6)
"""The clock: the time reached, in doubled precision; the unit of time of the last step, with the sign of the direction;
the length of a step as a fraction of the radius of convergence; the samples and the steps done."""

SERIES = 6
"""Series of a pair: d (three), u, w, and j w_j."""

REACHED, UNDER_WAY, MET, LOST = range(4)
"""All samples are done; the block is; bodies are so close that time stands still; the state is not finite."""


@kernel(inline=True, exact=True)
def scale(a, a_lo, c):
    """Return the pair (a, a_lo) times c."""
    p, e = two_product(a, c)
    return quick_two_sum(p, fma(a_lo, c, e))


@kernel(inline=True, exact=True)
def divide(a, a_lo, c):
    """Return the pair (a, a_lo) divided by c."""
    x = a / c
    return quick_two_sum(x, (fma(-x, c, a) + a_lo) / c)


@kernel(inline=True, exact=True)
def add_multiple(s, s_lo, a, a_lo, b, b_lo):
    """Return the pair (s, s_lo) plus the product of two others."""
    p, e = two_product(a, b)
    t, f = two_sum(s, p)
    return quick_two_sum(t, exact_add(s_lo, exact_add(f, fma(a, b_lo, fma(a_lo, b, e)))))


@kernel(inline=True, exact=True)
def _reciprocal_root(x, x_lo):
    """Return x^(-1/2) as a pair, by an estimate and one step of Newton's method."""
    y = 1.0 / sqrt(x)
    t, t_lo = two_product(y, y)
    t, t_lo = multiply_pairs(t, t_lo, x, x_lo)
    return quick_two_sum(y, 0.5 * y * ((1.0 - t) - t_lo))


@kernel(exact=True)
def _accelerate(gm, pairs, unit, k, body, body_lo, f, f_lo):
    """Write terms k + 2 of the positions from terms k of the forces of all pairs, (3 groups, 8)."""
    n, groups = gm.shape[0], f.shape[0] // 3
    for m in range(body.shape[1]):
        body[k + 2, m] = body_lo[k + 2, m] = 0.0
    for p in range(pairs.shape[0]):
        i, j, g, lane = pairs[p, 0], pairs[p, 1], p // WIDTH, p % WIDTH
        if i == j:
            continue
        to_i, to_j = gm[j] * (unit * unit), -gm[i] * (unit * unit)
        for c in range(3):
            x, x_lo = f[c * groups + g, lane], f_lo[c * groups + g, lane]
            a, b = c * n + i, c * n + j
            body[k + 2, a], body_lo[k + 2, a] = add_multiple(body[k + 2, a], body_lo[k + 2, a], x, x_lo, to_i, 0.0)
            body[k + 2, b], body_lo[k + 2, b] = add_multiple(body[k + 2, b], body_lo[k + 2, b], x, x_lo, to_j, 0.0)
    for m in range(3 * n):
        body[k + 2, m], body_lo[k + 2, m] = divide(body[k + 2, m], body_lo[k + 2, m], (k + 1.0) * (k + 2.0))


@kernel(inline=True, exact=True)
def _separations(k, g, n, pairs, groups, body, body_lo, pair, pair_lo):
    """Write terms k of the separations of group g."""
    for c in range(3):
        row = (SERIES * k + c) * groups + g
        for lane in range(WIDTH):
            i, j = c * n + pairs[WIDTH * g + lane, 0], c * n + pairs[WIDTH * g + lane, 1]
            x, x_lo = add_pairs(body[k, j], body_lo[k, j], -body[k, i], -body_lo[k, i])
            pair[row, lane], pair_lo[row, lane] = x, x_lo


@kernel(inline=True, exact=True)
def _square(k, g, groups, pair, pair_lo):
    """Return terms k of d . d."""
    u, u_lo = full(0.0), full(0.0)
    for j in range((k + 1) // 2):
        for c in range(3):
            a, b = (SERIES * j + c) * groups + g, (SERIES * (k - j) + c) * groups + g
            u, u_lo = add_multiple(u, u_lo, load(pair, a), load(pair_lo, a), load(pair, b), load(pair_lo, b))
    u, u_lo = u + u, u_lo + u_lo
    if k % 2 == 0:
        for c in range(3):
            a = (SERIES * (k // 2) + c) * groups + g
            x, x_lo = load(pair, a), load(pair_lo, a)
            u, u_lo = add_multiple(u, u_lo, x, x_lo, x, x_lo)
    return u, u_lo


@kernel(inline=True, exact=True)
def _power(k, g, groups, pair, pair_lo):
    """Return terms k of u^(-3/2) from those of u up to k, and from its own up to k - 1."""
    y, y_lo = _reciprocal_root(load(pair, 3 * groups + g), load(pair_lo, 3 * groups + g))
    y2, y2_lo = multiply_pairs(y, y_lo, y, y_lo)
    if k == 0:
        return multiply_pairs(y2, y2_lo, y, y_lo)
    w, w_lo, v, v_lo = full(0.0), full(0.0), full(0.0), full(0.0)
    for j in range(k):
        a, b = (SERIES * (k - j) + 3) * groups + g, (SERIES * j + 4) * groups + g
        u, u_lo = load(pair, a), load(pair_lo, a)
        w, w_lo = add_multiple(w, w_lo, u, u_lo, load(pair, b), load(pair_lo, b))
        v, v_lo = add_multiple(v, v_lo, u, u_lo, load(pair, b + groups), load(pair_lo, b + groups))
    w, w_lo = scale(w, w_lo, full(-1.5 * k))
    w, w_lo = add_pairs(w, w_lo, 0.5 * v, 0.5 * v_lo)
    w, w_lo = multiply_pairs(w, w_lo, y2, y2_lo)
    return divide(w, w_lo, full(1.0 * k))


@kernel(inline=True, exact=True)
def _force(k, c, g, groups, pair, pair_lo):
    """Return terms k of component c of w d."""
    f, f_lo = full(0.0), full(0.0)
    for j in range(k + 1):
        b, a = (SERIES * j + 4) * groups + g, (SERIES * (k - j) + c) * groups + g
        f, f_lo = add_multiple(f, f_lo, load(pair, b), load(pair_lo, b), load(pair, a), load(pair_lo, a))
    return f, f_lo


@kernel(inline=True, exact=True)
def _put(pair, pair_lo, row, x, x_lo):
    """Store eight pairs (hi, lo)."""
    store(pair, row, x)
    store(pair_lo, row, x_lo)


@kernel(exact=True)
def expand(gm, pairs, shift, unit, body, body_lo, pair, pair_lo):
    """Fill the series of a step, whose first two terms, the positions and velocities, are there.

    gm (n,); pairs (8 groups, 2), the indices of two bodies each, or (0, 0) where the last group is filled up
    shift (groups, 8) : eps^2 for each pair, and 1 where the last group is filled up
    unit : of time
    body, body_lo : (terms, 3n or more), coordinates of the bodies, all x, then all y, then all z
    pair, pair_lo : (6 terms groups + 3 groups, 8), series of the pairs, and the last terms of f
    """
    n, groups, terms = gm.shape[0], shift.shape[0], body.shape[0]
    first_f = SERIES * terms * groups
    for k in range(terms - 2):
        for g in range(groups):
            row = SERIES * k * groups + g
            _separations(k, g, n, pairs, groups, body, body_lo, pair, pair_lo)
            u, u_lo = _square(k, g, groups, pair, pair_lo)
            if k == 0:
                u, u_lo = add_pairs(u, u_lo, load(shift, g), full(0.0))
            _put(pair, pair_lo, row + 3 * groups, u, u_lo)
            w, w_lo = _power(k, g, groups, pair, pair_lo)
            _put(pair, pair_lo, row + 4 * groups, w, w_lo)
            w, w_lo = scale(w, w_lo, full(1.0 * k))
            _put(pair, pair_lo, row + 5 * groups, w, w_lo)
            for c in range(3):
                f, f_lo = _force(k, c, g, groups, pair, pair_lo)
                _put(pair, pair_lo, first_f + c * groups + g, f, f_lo)
        _accelerate(gm, pairs, unit, k, body, body_lo, pair[first_f:], pair_lo[first_f:])


@kernel(exact=True)
def evaluate(body, body_lo, x, x_lo, unit, out):
    """Write positions and velocities, (4, 3n or more) with their low parts, at the time (x, x_lo) of the series."""
    terms = body.shape[0]
    x8, x8_lo = full(x), full(x_lo)
    for m in range(0, body.shape[1], WIDTH):
        q, q_lo = load(body[terms - 1], m), load(body_lo[terms - 1], m)
        v, v_lo = scale(q, q_lo, full(terms - 1.0))
        for k in range(terms - 2, -1, -1):
            b, b_lo = load(body[k], m), load(body_lo[k], m)
            q, q_lo = multiply_pairs(q, q_lo, x8, x8_lo)
            q, q_lo = add_pairs(b, b_lo, q, q_lo)
            if k > 0:
                v, v_lo = multiply_pairs(v, v_lo, x8, x8_lo)
                b, b_lo = scale(b, b_lo, full(1.0 * k))
                v, v_lo = add_pairs(b, b_lo, v, v_lo)
        store(out[0], m, q)
        store(out[1], m, q_lo)
        store(out[2], m, v / full(unit))
        store(out[3], m, v_lo / full(unit))


@kernel
def _radius(pairs, groups, terms, pair):
    """Return the radius of convergence as the last two terms of the separations show it."""
    least = math.inf
    for p in range(pairs.shape[0]):
        if pairs[p, 0] == pairs[p, 1]:
            continue
        g, lane = p // WIDTH, p % WIDTH
        for k in range(terms - 4, terms - 2):
            first = last = 0.0
            for c in range(3):
                first = max(first, abs(pair[c * groups + g, lane]))
                last = max(last, abs(pair[(SERIES * k + c) * groups + g, lane]))
            if not last <= math.inf:
                return math.nan
            if last > 0.0:
                least = min(least, (first / last) ** (1.0 / k))
    return least


@kernel
def march_series(gm, pairs, shift, clock, state, times, out, series, most):
    """March to the last of `times`, for at most `most` steps; return REACHED, UNDER_WAY, MET or LOST.

    gm, pairs, shift : as in `expand`; clock : see TIME ... STEPS
    state : (4, 3n or more) positions and velocities with their low parts, at the time of the clock
    times : (samples,) in the order of the march; out : (samples, 4, 3n or more), filled from sample clock[DONE] on
    series : (body, body_lo, pair, pair_lo) of `expand`
    """
    body, body_lo, pair, pair_lo = series
    samples, size, terms = times.shape[0], state.shape[1], body.shape[0]
    for _ in range(most):
        unit = clock[UNIT]
        for m in range(size):
            body[0, m], body_lo[0, m] = state[0, m], state[1, m]
            body[1, m], body_lo[1, m] = state[2, m] * unit, state[3, m] * unit
        expand(gm, pairs, shift, unit, body, body_lo, pair, pair_lo)
        radius = _radius(pairs, shift.shape[0], terms, pair)
        left = ((times[samples - 1] - clock[TIME]) - clock[TIME_LO]) / unit
        x = min(clock[SHARE] * radius, left)
        if not x >= 0.0:
            return LOST
        h = x * unit
        if x < left and clock[TIME] + h == clock[TIME]:
            return MET
        end, end_lo = two_sum(clock[TIME], h)
        end, end_lo = two_sum(end, end_lo + clock[TIME_LO])
        sample = int(clock[DONE])
        while sample < samples and (x == left or ((times[sample] - end) - end_lo) / unit <= 0.0):
            a, a_lo = two_sum(times[sample], -clock[TIME])
            a, a_lo = quick_two_sum(a, a_lo - clock[TIME_LO])
            evaluate(body, body_lo, a / unit, a_lo / unit, unit, out[sample])
            sample += 1
        clock[DONE] = sample
        clock[STEPS] += 1
        if sample == samples:
            return REACHED
        evaluate(body, body_lo, x, 0.0, unit, state)
        clock[TIME], clock[TIME_LO] = end, end_lo
        clock[UNIT] = math.copysign(2.0 ** math.floor(math.log2(abs(h))), unit)
    return UNDER_WAY
