"""The search for steps in which two bodies may come closer than the sum of their radii.

Between the ends of a step, the relative motion of a pair is approximated by a cubic Hermite polynomial, and a bound of
its error, as measured, is added to the radii. Steps may be found in which nothing collides: the states within them
decide.
"""

from __future__ import annotations

import math

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, largest, load, maximum, select, unit
from orbits.kernels.paths import relative, steps_between
from orbits.kernels.watch import flat, watch_at

GROWTH, SHARE = 0.9, 0.3
"""The cubic is off by at most min(GROWTH sqrt(S / W), SHARE) S, where W is the way in a step, and S the difference of
its chord from the mean of the velocities at its ends times its length, plus a sixth of their change. Measured for
15,650 pairs that meet on Kepler orbits of e <= 0.99, in steps of up to 1.5 local radians, h sqrt(GM / r^3): 9 were off
by more, by up to 16 percent, none of them below 0.3. Near a third body, whose pull may cancel the tide of the star in
S, 2 to 16 percent were off by more at 0.1 to 1.5 radians: such a pair is missed if it is small against that error."""

ROUGH = 0.15
"""Partial steps of methods below order 4 do not follow the cubic between the ends of a step: they are off by at most
this share of the largest change of velocity times its length, as long as a step is no longer than a radian."""

CONTACT = 1e-9
"""The fraction of the sum of radii by which bodies in contact may overlap: what bounces begins there."""

NEVER = 2.0
"""What is returned for a contact that there is not: a fraction beyond the end of a step."""

ROUNDS, STANDSTILL = 64, 4e-16
"""The most parts in which a cubic is followed, and the fraction of a step below which no further one is worth it."""


def roughness(order: int) -> float:
    """Return the share of the changes of velocities by which a method of this order needs more room than others."""
    return ROUGH if order < 4 else 0.0


@kernel
def fraction_of_contact(first, second, h, reach, slack):
    """Return the first fraction of a step at which a pair may come closer than `reach`, or `NEVER`.

    first, second : relative positions and velocities at its ends, six numbers each; h : its length
    slack : by how much the motion may differ from the cubic, besides the bound of its error

    The cubic is followed in parts. In each the distance falls no faster than along a parabola: that of its projection
    on the direction at the beginning, with the largest acceleration ahead. A pair that overlaps is taken to be in
    contact.
    """
    (x0, y0, z0, u0, v0, w0), (x1, y1, z1, u1, v1, w1) = first, second
    u0, v0, w0, u1, v1, w1 = h * u0, h * v0, h * w0, h * u1, h * v1, h * w1
    ax, ay, az, bx, by, bz = x1 - x0 - u0, y1 - y0 - v0, z1 - z0 - w0, u1 - u0, v1 - v0, w1 - w0
    bend = ax - 0.5 * bx, ay - 0.5 * by, az - 0.5 * bz
    chord2 = (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0) + (z1 - z0) * (z1 - z0)
    way = math.sqrt(max(chord2, u0 * u0 + v0 * v0 + w0 * w0, u1 * u1 + v1 * v1 + w1 * w1))
    off = math.sqrt(bend[0] * bend[0] + bend[1] * bend[1] + bend[2] * bend[2])
    off += math.sqrt(bx * bx + by * by + bz * bz) / 6.0
    margin = 16.0 * min(GROWTH * math.sqrt(off / way), SHARE) * off if way > 0.0 else 0.0
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
def _may_touch(first, second, h, reach, slack):
    """Return whether a pair may come closer than `reach` within a step at whose beginning it does not overlap."""
    closest = (1.0 - CONTACT) * reach
    if not first[0] * first[0] + first[1] * first[1] + first[2] * first[2] >= closest * closest:
        return False
    if second[0] * second[0] + second[1] * second[1] + second[2] * second[2] < reach * reach:
        return True
    return fraction_of_contact(first, second, h, reach, slack) <= 1.0


@kernel
def touching(i, states, h, radii, slack, found):
    """Write into `found`, (n,), which bodies may touch body i within a step, by the verdict of `find_touch`.

    states : (4, n, 3), q and v at its beginning, q and v at its end; radii : (n,)
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
        found[j] = j != i and reach > 0.0 and _may_touch(first, second, h, reach, slack)


@kernel(inline=True)
def _first_of_eight(context, track, h, found, j, row, valid, slack):
    """Return the number of steps after which body j may have touched one of the rows row ... row + 7 whose lane is 1
    in `valid`, if it is less than `found`, and else `found`; slack : see `fraction_of_contact`
    """
    watch = watch_at(context)
    n, P, path, radii = watch.bodies, watch.stride, watch.path, watch.radii
    states, begin, spacing, half, stride = path, row, n, P, 2 * P
    if row >= n:
        states, begin, spacing, half, stride = flat(track), 0, WIDTH, 3 * WIDTH, 6 * WIDTH
    reach = full(radii[j]) + load(radii, row)
    valid = valid * (reach > 0.0)
    if not any_lane(valid):
        return found
    near = 2.0 * (reach + slack) * (reach + slack)
    x0 = y0 = z0 = u0 = v0 = w0 = full(0.0)
    for k in range(found):
        a, c = 2 * k * P + j, begin + k * stride
        b, d = a + P, c + half
        x, y, z = load(states, c) - path[a], load(states, c + spacing) - path[a + n], load(states, c + 2 * spacing)
        z = z - path[a + 2 * n]
        u, v, w = load(states, d) - path[b], load(states, d + spacing) - path[b + n], load(states, d + 2 * spacing)
        w = w - path[b + 2 * n]
        if k > 0:
            length = h * steps_between(watch, h, k - 1, k)
            third = length * length / 9.0
            # The polynomial lies within the hull of its control points, x0, x0 + h v0 / 3, x1 - h v1 / 3 and x1.
            before = third * (u0 * u0 + v0 * v0 + w0 * w0)
            after = third * (u * u + v * v + w * w)
            chord = (x - x0) * (x - x0) + (y - y0) * (y - y0) + (z - z0) * (z - z0)
            way = maximum(before, 2.0 * chord + 2.0 * after)
            # The margin is at most 1.41 times this way, and (r + 2.41 w)^2 <= 2 (r^2 + 5.81 w^2).
            close = valid * (x0 * x0 + y0 * y0 + z0 * z0 < near + 12.0 * way)
            if any_lane(close):
                for i in range(WIDTH):
                    if lane(close, i) != 0.0:
                        first = relative(watch, track, row + i, j, k - 1)
                        second = relative(watch, track, row + i, j, k)
                        if _may_touch(first, second, length, lane(reach, i), slack):
                            return k
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
    or between particles start ... start + 7 and massive bodies if `track` is not empty.

    The number of steps after it, or steps + 1, is written into `watch.touched`.
    """
    watch = watch_at(context)
    found, slack = steps + 1, _slack(watch, track, h, steps)
    if track.shape[0] > 0:
        valid = full(0.0)
        for p in range(start, min(start + WIDTH, stop)):
            valid = valid + unit(p - start)
        for j in range(watch.bodies):
            found = _first_of_eight(context, track, h, found, j, watch.bodies + start, valid, slack)
        watch.touched[start // WIDTH] = found
        return
    for i in range(start, stop - 1):
        for first in range(i + 1, stop, WIDTH):
            valid = full(0.0)
            for j in range(first, min(first + WIDTH, stop)):
                valid = valid + unit(j - first)
            found = _first_of_eight(context, track, h, found, i, first, valid, slack)
    watch.touched[watch.touched.shape[0] - 1] = found
