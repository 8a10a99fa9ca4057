"""The search for zeros of functions of the relative motion of pairs of bodies: brackets of them, in recorded steps.

It does in one pass what `orbits.propagation.events.search.brackets` does with arrays for functions of any kind: a
function is checked at the begin of each step, at eight nodes and at its end, with its slope by a difference to the
right, at the end to the left; there is a bracket where it changes its sign, and where its slopes point towards zero.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, load, store

CLOSING, DISTANCE, HEIGHT = 0, 1, 2
"""What is computed of a relative position q and a velocity v: q.v; q.q - c; n.q - c."""

EDGES = WIDTH + 2
"""The checks in a step with both its ends."""

FAR = 0.5
"""Where tangents meet at more than this share of the function at both checks, it does not come to zero in between. (The
functions are polynomials: none has a dip that the slopes at the checks do not show.)"""

PLACES = 24
"""The fractions of a step at which a function is computed: eight nodes; a little after each; a little after the begin,
a little before the end, and the end; the rest is room.
"""


@kernel(inline=True)
def _along_normal(numbers, x, y, z):
    """Return the component of a vector along a direction."""
    return numbers[0] * x + numbers[1] * y + numbers[2] * z


@kernel(inline=True)
def _of_states(kind, numbers, x, y, z, u, v, w):
    """Return the function of a relative position and velocity."""
    if kind == CLOSING:
        return x * u + y * v + z * w
    if kind == DISTANCE:
        return x * x + y * y + z * z - numbers[3]
    return _along_normal(numbers, x, y, z) - numbers[3]


@kernel(inline=True)
def _between(states, half, a, b, n):
    """Return what three coordinates of body a are above those of body b; of the origin for b < 0."""
    x, y, z = states[half, a], states[half, n + a], states[half, 2 * n + a]
    if b >= 0:
        return x - states[half, b], y - states[half, n + b], z - states[half, 2 * n + b]
    return x, y, z


@kernel(inline=True)
def _differences(kicks, stages, a, b, n, apart):
    """Write what the stages of a step give three coordinates of body a more than those of body b."""
    width = kicks.shape[1]
    block = kicks.shape[0] * width // stages
    for axis in range(3):
        own, other = axis * n + a, axis * n + b
        for first in range(0, stages, width):
            if width == WIDTH:
                change = load(kicks[own], 0)
                if b >= 0:
                    change = change - load(kicks[other], 0)
                store(apart[axis], first, change)
            else:
                for j in range(width):
                    apart[axis, first + j] = kicks[own, j] - (kicks[other, j] if b >= 0 else 0.0)
            own, other = own + block, other + block


@kernel(inline=True)
def _places(apart, weights, stages, at):
    """Return what the stages add to three coordinates at eight of `PLACES`."""
    x = y = z = full(0.0)
    for first in range(0, stages - WIDTH + 1, WIDTH):
        for j in range(WIDTH):  # unrolled
            weight, k = load(weights[first + j], at), first + j
            x, y, z = x + weight * full(apart[0, k]), y + weight * full(apart[1, k]), z + weight * full(apart[2, k])
    for k in range(stages // WIDTH * WIDTH, stages):
        weight = load(weights[k], at)
        x, y, z = x + weight * full(apart[0, k]), y + weight * full(apart[1, k]), z + weight * full(apart[2, k])
    return x, y, z


@kernel(inline=True)
def _heights(numbers, weights, h, states, apart, a, b, n, room):
    """Write the height above a plane at all `PLACES` of a step into `room`; see `_values`."""
    _, twice, checks = weights
    stages = twice.shape[0]
    for j in range(stages):
        apart[0, j] = _along_normal(numbers, apart[0, j], apart[1, j], apart[2, j])
    x, y, z = _between(states, 0, a, b, n)
    u, v, w = _between(states, 1, a, b, n)
    begun, speed = _along_normal(numbers, x, y, z) - numbers[3], _along_normal(numbers, u, v, w)
    for at in range(0, PLACES, WIDTH):
        way = full(0.0)
        for j in range(stages):
            way = way + load(twice[j], at) * full(apart[0, j])
        store(room, at, begun + h * (load(checks, at) * speed + way))


@kernel(inline=True)
def _values(kind, numbers, weights, h, states, apart, a, b, n, room):
    """Write q.v, or the squared distance less its bound, at all `PLACES` of a step into `room`.

    states : of the step; apart : see `_differences`
    """
    once, twice, checks = weights
    stages = once.shape[0]
    x, y, z = _between(states, 0, a, b, n)
    u, v, w = _between(states, 1, a, b, n)
    for at in range(0, PLACES, WIDTH):
        qx, qy, qz = _places(apart, twice, stages, at)
        theta = load(checks, at)
        qx, qy, qz = x + h * (theta * u + qx), y + h * (theta * v + qy), z + h * (theta * w + qz)
        if kind == CLOSING:
            px, py, pz = _places(apart, once, stages, at)
            store(room, at, qx * (u + px) + qy * (v + py) + qz * (w + pz))
        else:
            store(room, at, qx * qx + qy * qy + qz * qz - numbers[3])


@kernel(inline=True)
def _has_any(values, slopes):
    """Return whether there is a bracket between any two of the checks, from the function and its slopes there."""
    last = EDGES - 1 - WIDTH
    for at in range(0, last + 1, last):
        before, after = load(values, at) >= 0.0, load(values, at + 1) >= 0.0
        up = before + before - 1.0  # 1 above zero, -1 below
        turns = (up * load(slopes, at) < 0.0) * (up * load(slopes, at + 1) > 0.0)
        if any_lane(abs(before - after) + turns):
            return True
    return False


@kernel(inline=True)
def _stays_away(values, slopes, i, width):
    """Return whether a function that turns between checks i and i + 1 stays far from zero: its tangents meet there, and
    a smooth one does not dip below that.

    width : of this part of a step, in units of the distance that gives `slopes`
    """
    g, a, b = values[i], slopes[i] * width, slopes[i + 1] * width
    meets = g + a * ((values[i + 1] - g - b) / (a - b))
    return meets / g > FAR and meets / values[i + 1] > FAR


class Function(NamedTuple):
    """What is sought, see `CLOSING`.

    numbers : (4,), a direction n and a number c
    wanted : (2,), whether zeros count at which the function falls from step to step, and rises
    """

    kind: Any
    numbers: Any
    wanted: Any


class Weights(NamedTuple):
    """Of the stages at all `PLACES`, (stages, PLACES), in velocities and in positions; and the fractions, (PLACES,)."""

    once: Any
    twice: Any
    checks: Any


class Recorded(NamedTuple):
    """Recorded steps of so many bodies: see `orbits.kernels.dense.motion_within`."""

    lengths: Any
    path: Any
    kicks: Any
    bodies: Any


class Room(NamedTuple):
    """Workspace, (3, PLACES) and (3, stages)."""

    values: Any
    apart: Any


@kernel
def brackets_of_pairs(function, weights, motion, pairs, first, room, found, places):
    """Write the brackets of zeros in recorded steps from number `first` on, while there is room for those of a step.

    pairs : (columns, 2), numbers of bodies, -1 for the origin
    found : (many, 6), receives both checks, the function there, and its slopes
    places : (many, 3), receives the step, the column, and whether it is an extremum

    Returns the number of brackets, and that of the step at which to go on.
    """
    (kind, numbers, wanted), (lengths, path, kicks, size), apart = function, motion, room.apart
    count, checks = 0, weights.checks
    computed, values, slopes = room.values[0], room.values[1], room.values[2]
    for k in range(first, len(lengths)):
        if count + (EDGES - 1) * len(pairs) > len(found):
            return count, k
        h, states, after = lengths[k], path[k], path[k + 1]
        for column in range(len(pairs)):
            a, b = pairs[column, 0], pairs[column, 1]
            _differences(kicks[k], weights.once.shape[0], a, b, size, apart)
            if kind == HEIGHT:
                _heights(numbers, weights, h, states, apart, a, b, size, computed)
            else:
                _values(kind, numbers, weights, h, states, apart, a, b, size, computed)
            x, y, z = _between(states, 0, a, b, size)
            u, v, w = _between(states, 1, a, b, size)
            values[0] = _of_states(kind, numbers, x, y, z, u, v, w)
            x, y, z = _between(after, 0, a, b, size)
            u, v, w = _between(after, 1, a, b, size)
            # The end of a step is the begin of the next one, as it was marched.
            values[EDGES - 1] = _of_states(kind, numbers, x, y, z, u, v, w)
            slopes[0] = computed[2 * WIDTH] - values[0]
            slopes[EDGES - 1] = computed[2 * WIDTH + 2] - computed[2 * WIDTH + 1]
            nodes = load(computed, 0)
            store(values, 1, nodes)
            store(slopes, 1, load(computed, WIDTH) - nodes)
            if not _has_any(values, slopes):
                continue
            for i in range(EDGES - 1):
                up, turns = values[i] >= 0.0, False
                if up == (values[i + 1] >= 0.0):
                    turns = (slopes[i] < 0.0 < slopes[i + 1]) if up else (slopes[i] > 0.0 > slopes[i + 1])
                    width = (1.0 if i == WIDTH else checks[i]) - (0.0 if i == 0 else checks[i - 1])
                    if not turns or _stays_away(values, slopes, i, width / checks[2 * WIDTH]):
                        continue
                elif not wanted[0 if up else 1]:
                    continue
                row, place = found[count], places[count]
                row[0] = 0.0 if i == 0 else checks[i - 1]
                row[1] = 1.0 if i == WIDTH else checks[i]
                row[2], row[3], row[4], row[5] = values[i], values[i + 1], slopes[i], slopes[i + 1]
                place[0], place[1], place[2] = k, column, turns
                count += 1
    return count, len(lengths)
