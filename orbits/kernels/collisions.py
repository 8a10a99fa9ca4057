"""The search for the first step of a block in which two bodies may come closer than the sum of their radii.

Between the ends of a step, the relative motion of a pair is approximated by a cubic Hermite polynomial. Its error is
allowed for by a margin, so that steps may be found in which nothing collides: the states within them decide.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, load, maximum, unit
from orbits.kernels.paths import least_distance, relative, steps_between
from orbits.kernels.watch import flat, watch_at

MARGIN = 0.1
"""The margin, as a fraction of the difference between a step's chord and the mean of the velocities at its ends times
its length; that of the cubic from the motion is smaller while a step covers less than a radian."""

CONTACT = 1e-9
"""The fraction of the sum of radii by which bodies in contact may overlap: what bounces begins there."""


@kernel(inline=True)
def _may_touch(watch, track, row, j, step, h, reach):
    """Return whether a pair may come closer than `reach` within a step at whose beginning it does not overlap."""
    x0, y0, z0, u0, v0, w0 = relative(watch, track, row, j, step)
    x1, y1, z1, u1, v1, w1 = relative(watch, track, row, j, step + 1)
    closest = (1.0 - CONTACT) * reach
    if not x0 * x0 + y0 * y0 + z0 * z0 >= closest * closest:
        return False
    half = 0.5 * h
    x, y, z = x1 - x0 - half * (u0 + u1), y1 - y0 - half * (v0 + v1), z1 - z0 - half * (w0 + w1)
    limit = reach + MARGIN * (x * x + y * y + z * z) ** 0.5
    if x1 * x1 + y1 * y1 + z1 * z1 < limit * limit:
        return True
    if (x0 * u0 + y0 * v0 + z0 * w0) * h < 0.0 <= (x1 * u1 + y1 * v1 + z1 * w1) * h:
        return least_distance(watch, track, row, j, step, h)[0] < limit * limit
    return False


@kernel(inline=True)
def _first_of_eight(context, track, h, found, j, row, valid):
    """Return the number of steps after which body j may have touched one of the rows row ... row + 7 whose lane is 1
    in `valid`, if it is less than `found`, and else `found`.
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
    near = 2.0 * reach * reach
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
            # The margin is less than a third of this way, and (r + m)^2 <= 2 (r^2 + m^2).
            close = valid * (x0 * x0 + y0 * y0 + z0 * z0 < near + 4.0 * way)
            if any_lane(close):
                for i in range(WIDTH):
                    if lane(close, i) != 0.0 and _may_touch(watch, track, row + i, j, k - 1, length, lane(reach, i)):
                        return k
        x0, y0, z0, u0, v0, w0 = x, y, z, u, v, w
    return found


@kernel
def find_touch(context, track, h, steps, start, stop):
    """Find the first step in which two bodies may touch, among massive bodies start ... stop - 1 with all before them,
    or between particles start ... start + 7 and massive bodies if `track` is not empty.

    The number of steps after it, or steps + 1, is written into `watch.touched`.
    """
    watch = watch_at(context)
    found = steps + 1
    if track.shape[0] > 0:
        valid = full(0.0)
        for p in range(start, min(start + WIDTH, stop)):
            valid = valid + unit(p - start)
        for j in range(watch.bodies):
            found = _first_of_eight(context, track, h, found, j, watch.bodies + start, valid)
        watch.touched[start // WIDTH] = found
        return
    for i in range(start, stop - 1):
        for first in range(i + 1, stop, WIDTH):
            valid = full(0.0)
            for j in range(first, min(first + WIDTH, stop)):
                valid = valid + unit(j - first)
            found = _first_of_eight(context, track, h, found, i, first, valid)
    watch.touched[watch.touched.shape[0] - 1] = found
