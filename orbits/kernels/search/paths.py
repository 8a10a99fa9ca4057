"""The states at the beginning of each step of a block: recorded by the loop, read by observers after the block.

Rows are the massive bodies, then the massless particles; `track` has the states of eight particles at a time.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store
from orbits.kernels.search.context import flat
from orbits.kernels.search.cubics import distance2_at


@kernel(inline=True)
def steps_between(watch, h, begin, end):
    """Return the time from the beginning of one step to that of another, in units of h: the number of steps if all have
    the same length.
    """
    if watch.times.shape[0] == 0:
        return 1.0 * (end - begin)
    return (watch.times[end] - watch.times[begin]) / h


@kernel(inline=True)
def steps_within(watch, h, begin, last, span):
    """Return the number of steps that end within a time `span`, in units of h, after the beginning of one, up to the
    beginning of another: at least one.
    """
    if watch.times.shape[0] == 0:
        return int(min(max(span, 1.0), 1.0 * (last - begin)))
    count = 1
    while count < last - begin and steps_between(watch, h, begin, begin + count + 1) <= span:
        count += 1
    return count


@kernel(inline=True)
def reading(watch, step, s):
    """Return the reading of the clock at the fraction s of a step: a number of steps, or the time."""
    if watch.times.shape[0] == 0:
        return watch.first + step + s
    begin = watch.times[step]
    if s > 0.0:
        return watch.origin + watch.pace * (begin + s * (watch.times[step + 1] - begin))
    return watch.origin + watch.pace * begin


@kernel(inline=True)
def relative(watch, track, row, j, step):
    """Return the position and velocity of a row relative to body j at the beginning of a step."""
    n, path = watch.bodies, watch.path
    a = 2 * step * watch.stride + j
    b = a + watch.stride
    # The indices of the row's x and v_x, and the offset of the next component.
    states, c, d, spacing = path, a - j + row, b - j + row, n
    if row >= n:
        first = 6 * WIDTH * step + (row - n) % WIDTH
        states, c, d, spacing = flat(track), first, first + 3 * WIDTH, WIDTH
    return (
        states[c] - path[a],
        states[c + spacing] - path[a + n],
        states[c + 2 * spacing] - path[a + 2 * n],
        states[d] - path[b],
        states[d + spacing] - path[b + n],
        states[d + 2 * spacing] - path[b + 2 * n],
    )


@kernel(inline=True)
def eight_relative(watch, track, j, row, step):
    """Return the same of the eight rows from `row` on, in lanes: massive bodies, or the particles of `track`."""
    n, path, a = watch.bodies, watch.path, 2 * step * watch.stride + j
    b = a + watch.stride
    states, c, d, spacing = path, a - j + row, b - j + row, n
    if row >= n:
        states, c, d, spacing = flat(track), 6 * WIDTH * step, 6 * WIDTH * step + 3 * WIDTH, WIDTH
    return (
        load(states, c) - path[a],
        load(states, c + spacing) - path[a + n],
        load(states, c + 2 * spacing) - path[a + 2 * n],
        load(states, d) - path[b],
        load(states, d + spacing) - path[b + n],
        load(states, d + 2 * spacing) - path[b + 2 * n],
    )


@kernel(inline=True)
def record_carry(kicks, step, carry):
    """Write the carry of the bodies after a step into `kicks`, (steps, rows, 8)."""
    for row in range(carry.shape[0]):
        store(kicks[step], row, load(carry, row))


@kernel(inline=True)
def record_strip(path, step, q, v, start, stop):
    """Write coordinates start ... stop - 1 of the bodies at the beginning of a step into `path`, unless it is empty;
    start is a multiple of 8.
    """
    if path.shape[0] > 0:
        first = 2 * step * q.shape[0]
        for k in range(start, stop, WIDTH):
            store(path, first + k, load(q, k))
            store(path, first + q.shape[0] + k, load(v, k))


@kernel(inline=True)
def record_particles(track, step, x, y, z, vx, vy, vz):
    """Write the states of eight particles at the beginning of a step into `track`."""
    row = 6 * step
    store(track, row, x)
    store(track, row + 1, y)
    store(track, row + 2, z)
    store(track, row + 3, vx)
    store(track, row + 4, vy)
    store(track, row + 5, vz)


@kernel(inline=True)
def record_one(track, k, slot, x, y, z, vx, vy, vz):
    """Write the state of one particle at the beginning of step k into lane `slot` of `track`."""
    row = 6 * k
    track[row, slot], track[row + 1, slot], track[row + 2, slot] = x, y, z
    track[row + 3, slot], track[row + 4, slot], track[row + 5, slot] = vx, vy, vz


@kernel(inline=True)
def record_particle(track, k, slot, particle):
    """As `record_one`, for a particle."""
    record_one(track, k, slot, particle.x, particle.y, particle.z, particle.vx, particle.vy, particle.vz)


@kernel(inline=True)
def least_distance(watch, track, row, j, step, h):
    """Return the squared distance, the fraction of the step and the squared speed at the least distance in a step."""
    first, second = relative(watch, track, row, j, step), relative(watch, track, row, j, step + 1)
    low, high, s = 0.0, 1.0, 0.5
    d2 = speed2 = 0.0
    for _ in range(48):
        d2, fall, slope, speed2 = distance2_at(s, h, first, second)
        if fall < 0.0:
            low = s
        else:
            high = s
        # Newton's method within the bounds.
        s_next = s - fall / slope if slope > 0.0 else low
        if not low < s_next < high:
            s_next = 0.5 * (low + high)
        if abs(s_next - s) <= 1e-9:
            break
        s = s_next
    return d2, s, speed2
