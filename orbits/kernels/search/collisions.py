"""The search for steps in which two bodies may come closer than the sum of their radii.

Between the ends of a step, the relative motion of a pair is approximated by a cubic Hermite polynomial, and a bound of
its error is added to the radii. Steps may be found in which nothing collides: the states within them decide.

Let the length of a step be 1, and the relative acceleration sum c_l P_l(2 s - 1). That of the cubic is its part of
degrees 0 and 1; the error is the rest, integrated twice: s^2 (1 - s)^2 times the sum of 4 (l - 2)! / (l + 2)!
c_l P_l''(2 s - 1) over l > 1, which is at most the sum of |c_l| / 2. The coefficients come from the attraction by all
massive bodies at the four Lobatto nodes of the step, on the cubics of all bodies.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import (
    WIDTH,
    any_lane,
    full,
    lane,
    largest,
    load,
    maximum,
    minimum,
    rsqrt_cubed,
    select,
    sqrt,
    total,
    unit,
)
from orbits.kernels.search.context import watch_at
from orbits.kernels.search.cubics import hermite
from orbits.kernels.search.paths import eight_relative, relative, steps_between

SAFETY, UNSEEN = 0.75, 8.0 / 3.0
"""The bound of the error is s^2 (1 - s)^2 times SAFETY (|c_2| + |c_3|) + UNSEEN (|d_0| + |d_1|). SAFETY has half as
much again as 1/2, for higher degrees and for nodes on cubics. d_0 and d_1 are what the acceleration of the cubic has
besides c_0 and c_1: by terms, forces, methods of low order, or a pull too short to be seen at the nodes, which in an
instant moves a pair there by 2 s^2 (1 - s)^2 of its change of velocity.

Measured in steps of up to 1.5 local radians, h sqrt(GM / r^3) for all bodies all along the step: 57,428 pairs that meet
on Kepler orbits of e <= 0.99, near a planet, a moon or a binary star, among two to six planets, or about one another.
No error is above the bound anywhere in a step; the largest is 0.72 of it, and in the median the bound is twice the
error. Of 32,572 pairs in longer steps, four meet where the error is larger, by up to 2.8 times."""

NODE = 0.5 - 0.1 * math.sqrt(5.0)
"""The second of the four Lobatto nodes of a step; the others are its ends and 1 - NODE."""

WIDE, SHARE_OF_WAY = 2.0, 0.05
"""The bound is computed for pairs that come near within 16 s^2 (1 - s)^2 (WIDE S + SHARE_OF_WAY W), where W is the way
in a step, and S the difference of its chord from the mean of the velocities at its ends, plus a sixth of their change:
at least three times the error of each of these 57,428 pairs."""

ROUGH = 0.15
"""Partial steps of methods below order 4 do not follow the cubic between the ends of a step: they are off by at most
this share of the largest change of velocity times its length, as long as a step is no longer than a radian."""

CONTACT = 1e-9
"""The fraction of the sum of radii by which bodies in contact may overlap: what bounces begins there."""

NEVER = 2.0
"""What is returned for a contact that there is not: a fraction beyond the end of a step."""

ROUNDS, STANDSTILL = 64, 4e-16
"""The most parts in which a cubic is followed, and the fraction of a step below which no further one is worth it."""

TINY = 1e-300
"""Squared chords below this count as none."""


def roughness(order: int) -> float:
    """Return the share of the changes of velocities by which a method of this order needs more room than others."""
    return ROUGH if order < 4 else 0.0


@kernel
def fraction_of_contact(first, second, h, reach, margin, slack):
    """Return the first fraction of a step at which a pair may come closer than `reach`, or `NEVER`.

    first, second : relative positions and velocities at its ends, six numbers each; h : its length
    margin : by how much the motion may differ from the cubic at a fraction s, divided by s^2 (1 - s)^2
    slack : by how much partial steps may differ from it besides

    The cubic is followed in parts. In each the distance falls no faster than along a parabola: that of its projection
    on the direction at the beginning, with the largest acceleration ahead. A pair that overlaps is taken to be in
    contact.
    """
    (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = first, second
    u0, v0, w0, u1, v1, w1 = h * u0, h * v0, h * w0, h * u1, h * v1, h * w1
    ax, ay, az, bx, by, bz = x1 - x0 - u0, y1 - y0 - v0, z1 - z0 - w0, u1 - u0, v1 - v0, w1 - w0
    slack = 6.75 * slack
    cx, cy, cz = 3.0 * ax - bx, 3.0 * ay - by, 3.0 * az - bz
    dx, dy, dz = bx - 2.0 * ax, by - 2.0 * ay, bz - 2.0 * az
    ex, ey, ez = cx + 3.0 * dx, cy + 3.0 * dy, cz + 3.0 * dz
    s, end2 = 0.0, ex * ex + ey * ey + ez * ez
    for _ in range(ROUNDS):
        x, y = x0 + s * (u0 + s * (cx + s * dx)), y0 + s * (v0 + s * (cy + s * dy))
        z = z0 + s * (w0 + s * (cz + s * dz))
        u, v = u0 + s * (2.0 * cx + 3.0 * s * dx), v0 + s * (2.0 * cy + 3.0 * s * dy)
        w = w0 + s * (2.0 * cz + 3.0 * s * dz)
        ex, ey, ez = cx + 3.0 * s * dx, cy + 3.0 * s * dy, cz + 3.0 * s * dz
        distance = math.sqrt(x * x + y * y + z * z)
        if not distance > 0.0:
            return s
        # Both vanish where the state is known, like s^2, and the margin also at the end of the step like (1 - s)^2.
        left = 1.0 - s
        gap = max(distance - reach - s * s * left * (margin * left + slack), 0.0)
        slope = (x * u + y * v + z * w) / distance - s * (2.0 * margin * left * (left - s) + slack * (2.0 - 3.0 * s))
        # Half the acceleration of a cubic is linear in s: largest at one of the ends.
        bent = math.sqrt(max(ex * ex + ey * ey + ez * ez, end2)) + margin + slack
        root = math.sqrt(slope * slope + 4.0 * bent * gap)
        if slope < 0.0:
            part = 2.0 * gap / (root - slope)
        elif bent > 0.0:
            part = 0.5 * (slope + root) / bent
        else:
            return NEVER
        if part <= STANDSTILL:
            return s
        s += part
        if s >= 1.0:
            return NEVER
    return s


@kernel(inline=True)
def _wide_margin(first, second, h):
    """Return a margin, as of `fraction_of_contact`, that costs little; see `WIDE`."""
    (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = first, second
    x, y, z, u0, v0, w0, u1, v1, w1 = x1 - x0, y1 - y0, z1 - z0, h * u0, h * v0, h * w0, h * u1, h * v1, h * w1
    way = math.sqrt(max(x * x + y * y + z * z, u0 * u0 + v0 * v0 + w0 * w0, u1 * u1 + v1 * v1 + w1 * w1))
    x, y, z, u, v, w = x - 0.5 * (u0 + u1), y - 0.5 * (v0 + v1), z - 0.5 * (w0 + w1), u1 - u0, v1 - v0, w1 - w0
    off = math.sqrt(x * x + y * y + z * z) + math.sqrt(u * u + v * v + w * w) / 6.0
    return 16.0 * (WIDE * off + SHARE_OF_WAY * way)


@kernel(inline=True)
def _at_nodes(a, b, c, d):
    """Return numbers for the four nodes in lanes: of the first body of a pair, then of the second one."""
    return a * (unit(0) + unit(4)) + b * (unit(1) + unit(5)) + c * (unit(2) + unit(6)) + d * (unit(3) + unit(7))


@kernel(inline=True)
def _apart(field, j, k, coordinate, s, h):
    """Return a coordinate of massive body j relative to body k at fractions of a step; field : see `margin_of_cubic`"""
    strength, path, begin, stride = field
    a = begin + coordinate * (strength.shape[0] - 1)
    b, c, d = a + stride, a + 2 * stride, a + 3 * stride
    x, _, _ = hermite(
        s, h, path[a + j] - path[a + k], path[b + j] - path[b + k], path[c + j] - path[c + k], path[d + j] - path[d + k]
    )
    return x


@kernel(inline=True)
def _besides(weights, a, b):
    """Return the length of a weighted sum over lanes of three coordinates, less another vector."""
    x, y, z = total(weights * a[0]) - b[0], total(weights * a[1]) - b[1], total(weights * a[2]) - b[2]
    return math.sqrt(x * x + y * y + z * z)


@kernel
def margin_of_cubic(field, row, j, first, second, h):
    """Return a bound of the error of the cubic between the ends of a step, divided by s^2 (1 - s)^2; see `SAFETY`.
    At most `_wide_margin`, which a third body met at a node would exceed.

    field : (strength, path, begin, stride) of n massive bodies: the squared softening length and their GM; an array in
        which their q, v at one end and q, v at the other begin at `begin`, each (3, n), `stride` numbers apart
    row : the first body of the pair, n or more if it is massless; j : the second one
    first, second : position and velocity of the first body relative to the second at the ends, six numbers each
    """
    strength, (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = field[0], first, second
    n, one = strength.shape[0] - 1, unit(0) + unit(1) + unit(2) + unit(3)
    s, side = _at_nodes(0.0, NODE, 1.0 - NODE, 1.0), 2.0 * one - 1.0
    X, _, _ = hermite(s, h, one * x0, one * u0, one * x1, one * u1)
    Y, _, _ = hermite(s, h, one * y0, one * v0, one * y1, one * v1)
    Z, _, _ = hermite(s, h, one * z0, one * w0, one * z1, one * w1)
    # What the two attract each other, as if both attracted the first one.
    w = (strength[1 + j] + (strength[1 + row] if row < n else 0.0)) * rsqrt_cubed(
        select(one > 0.0, strength[0] + X * X + Y * Y + Z * Z, full(1.0))
    )
    ax, ay, az = -w * X, -w * Y, -w * Z
    for k in range(n):
        if k != row and k != j:
            x, y, z = _apart(field, j, k, 0, s, h), _apart(field, j, k, 1, s, h), _apart(field, j, k, 2, s, h)
            x, y, z = x + X, y + Y, z + Z
            w = strength[1 + k] * rsqrt_cubed(strength[0] + x * x + y * y + z * z)
            ax, ay, az = ax - w * x, ay - w * y, az - w * z
    ax, ay, az = h * h * side * ax, h * h * side * ay, h * h * side * az
    x, y, z, u, v, w = x1 - x0 - h * u0, y1 - y0 - h * v0, z1 - z0 - h * w0, h * (u1 - u0), h * (v1 - v0), h * (w1 - w0)
    a, root5 = (ax, ay, az), math.sqrt(5.0)
    c2 = _besides(_at_nodes(5.0, -5.0, -5.0, 5.0) / 12.0, a, (0.0, 0.0, 0.0))
    c3 = _besides(_at_nodes(-1.0, root5, -root5, 1.0) / 4.0, a, (0.0, 0.0, 0.0))
    d0 = _besides(_at_nodes(1.0, 5.0, 5.0, 1.0) / 12.0, a, (u, v, w))
    c1 = 3.0 * u - 6.0 * x, 3.0 * v - 6.0 * y, 3.0 * w - 6.0 * z
    d1 = _besides(_at_nodes(-1.0, -root5, root5, 1.0) / 4.0, a, c1)
    margin, wide = SAFETY * (c2 + c3) + UNSEEN * (d0 + d1), _wide_margin(first, second, h)
    return margin if margin < wide else wide


@kernel(inline=True)
def _may_touch(field, row, j, first, second, h, reach, slack):
    """Return whether a pair may come closer than `reach` within a step at whose beginning it does not overlap; for the
    other arguments see `margin_of_cubic` and `fraction_of_contact`.
    """
    closest = (1.0 - CONTACT) * reach
    if not first[0] * first[0] + first[1] * first[1] + first[2] * first[2] >= closest * closest:
        return False
    if second[0] * second[0] + second[1] * second[1] + second[2] * second[2] < reach * reach:
        return True
    if fraction_of_contact(first, second, h, reach, _wide_margin(first, second, h), slack) > 1.0:
        return False
    if fraction_of_contact(first, second, h, reach, 0.0, slack) <= 1.0:
        return True
    margin = margin_of_cubic(field, row, j, first, second, h)
    return fraction_of_contact(first, second, h, reach, margin, slack) <= 1.0


@kernel
def touching(i, states, numbers, field, h, radii, slack, found):
    """Write into `found`, (n,), which bodies may touch massive body i within a step, by the verdict of `find_touch`.

    states : (4, n, 3), q and v at its beginning, q and v at its end; radii : (n,)
    numbers : (n,) int64, of the bodies among the massive ones, or as many as these are; field : see `margin_of_cubic`
    """
    q0, v0, q1, v1 = states[0], states[1], states[2], states[3]
    for j in range(len(radii)):
        reach = radii[i] + radii[j]
        first = (
            q0[j, 0] - q0[i, 0], q0[j, 1] - q0[i, 1], q0[j, 2] - q0[i, 2],
            v0[j, 0] - v0[i, 0], v0[j, 1] - v0[i, 1], v0[j, 2] - v0[i, 2],
        )  # fmt: skip
        second = (
            q1[j, 0] - q1[i, 0], q1[j, 1] - q1[i, 1], q1[j, 2] - q1[i, 2],
            v1[j, 0] - v1[i, 0], v1[j, 1] - v1[i, 1], v1[j, 2] - v1[i, 2],
        )  # fmt: skip
        found[j] = j != i and reach > 0.0 and _may_touch(field, numbers[j], numbers[i], first, second, h, reach, slack)


@kernel(inline=True)
def _near_the_chord(h, first, second, reach):
    """Return for eight pairs whether `_wide_margin` and the cubic may bring them within `reach`, by the distance from
    the chord; first, second : relative positions and velocities at the ends of a step, six numbers each
    """
    (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = first, second
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    u0, v0, w0, u1, v1, w1 = h * u0 - x, h * v0 - y, h * w0 - z, h * u1 - x, h * v1 - y, h * w1 - z
    chord2 = x * x + y * y + z * z
    s = minimum(maximum(-(x0 * x + y0 * y + z0 * z) / maximum(chord2, full(TINY)), full(0.0)), full(1.0))
    x0, y0, z0 = x0 + s * x, y0 + s * y, z0 + s * z
    # With d the sum of the differences of the velocities from the chord c: the cubic is at most 4/27 d from it, S at
    # most 2/3 d, and the way at most c + d.
    d = sqrt(2.0 * (u0 * u0 + v0 * v0 + w0 * w0 + u1 * u1 + v1 * v1 + w1 * w1))
    room = reach + (4.0 / 27.0 + 2.0 / 3.0 * WIDE + SHARE_OF_WAY) * d + SHARE_OF_WAY * sqrt(chord2)
    return x0 * x0 + y0 * y0 + z0 * z0 < room * room


@kernel(inline=True)
def _first_of_eight(context, track, h, found, j, row, valid, slack):
    """Return `found`, the numbers of steps after which each of the rows row ... row + 7 may have touched a body, also
    for body j and the rows whose lane is 1 in `valid`; slack : see `fraction_of_contact`
    """
    watch = watch_at(context)
    P, radii = watch.stride, watch.radii
    reach = full(radii[j]) + load(radii, row)
    valid = valid * (reach > 0.0)
    if not any_lane(valid):
        return found
    near = 2.0 * (reach + slack) * (reach + slack)
    x0 = y0 = z0 = u0 = v0 = w0 = full(0.0)
    for k in range(int(largest(found))):
        x, y, z, u, v, w = eight_relative(watch, track, j, row, k)
        if k > 0:
            length = h * steps_between(watch, h, k - 1, k)
            third = length * length / 9.0
            # The polynomial lies within the hull of its control points, x0, x0 + h v0 / 3, x1 - h v1 / 3 and x1.
            before = third * (u0 * u0 + v0 * v0 + w0 * w0)
            after = third * (u * u + v * v + w * w)
            chord = (x - x0) * (x - x0) + (y - y0) * (y - y0) + (z - z0) * (z - z0)
            way = maximum(before, 2.0 * chord + 2.0 * after)
            # There is room for 1.41 times this way besides, as (r + 2.41 w)^2 <= 2 (r^2 + 5.81 w^2).
            close = valid * (x0 * x0 + y0 * y0 + z0 * z0 < near + 12.0 * way)
            if any_lane(close):
                close = close * _near_the_chord(length, (x0, y0, z0, u0, v0, w0), (x, y, z, u, v, w), reach + slack)
                field = watch.strength, watch.path, 2 * (k - 1) * P, P
                for i in range(WIDTH):
                    if lane(close, i) != 0.0 and k < lane(found, i):
                        first = relative(watch, track, row + i, j, k - 1)
                        second = relative(watch, track, row + i, j, k)
                        if _may_touch(field, row + i, j, first, second, length, lane(reach, i), slack):
                            found = select(unit(i) > 0.0, full(1.0 * k), found)
        x0, y0, z0, u0, v0, w0 = x, y, z, u, v, w
    return found


@kernel(inline=True)
def _slack(watch, track, h, steps):
    """Return `ROUGH` times the largest change of velocity in a step times its length, for methods that need it."""
    n, P, path, most = watch.bodies, watch.stride, watch.path, 0.0
    if watch.rough == 0.0:
        return 0.0
    for k in range(steps):
        length, b = h * steps_between(watch, h, k, k + 1), (2 * k + 1) * P
        for i in range(b, b + n):
            u, v, w = path[i + 2 * P] - path[i], path[i + 2 * P + n] - path[i + n], path[i + 2 * P + 2 * n]
            w = w - path[i + 2 * n]
            most = max(most, length * length * (u * u + v * v + w * w))
        if track.shape[0] > 0:
            d = 6 * k + 3
            u, v = load(track, d + 6) - load(track, d), load(track, d + 7) - load(track, d + 1)
            w = load(track, d + 8) - load(track, d + 2)
            square = length * length * (u * u + v * v + w * w)
            most = max(most, largest(select(square > 0.0, square, full(0.0))))
    return watch.rough * math.sqrt(most)


@kernel
def find_touch(context, track, h, steps, start, stop):
    """Find the first step in which two bodies may touch, among massive bodies start ... stop - 1 with all before them,
    or each of the particles start ... start + 7 may touch a massive body if `track` is not empty.

    The number of steps after it, or steps + 1, is written into `watch.touched`.
    """
    watch = watch_at(context)
    found, slack = full(steps + 1.0), _slack(watch, track, h, steps)
    if track.shape[0] > 0:
        last, valid = min(start + WIDTH, stop), full(0.0)
        for p in range(start, last):
            valid = valid + unit(p - start)
        for j in range(watch.bodies):
            found = _first_of_eight(context, track, h, found, j, watch.bodies + start, valid, slack)
        for p in range(start, last):
            watch.touched[p] = int(lane(found, p - start))
        return
    for i in range(start, stop - 1):
        for first in range(i + 1, stop, WIDTH):
            valid = full(0.0)
            for j in range(first, min(first + WIDTH, stop)):
                valid = valid + unit(j - first)
            found = full(-largest(-_first_of_eight(context, track, h, found, i, first, valid, slack)))
    watch.touched[watch.touched.shape[0] - 1] = int(lane(found, 0))
