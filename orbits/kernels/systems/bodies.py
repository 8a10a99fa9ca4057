"""Kicks and drifts of eight systems at once, by Newton's gravity, with the bits of
`orbits.integrators.kicks_and_drifts.splitting`.

Rows are the coordinates of a system in their order, with those of eight systems in lanes.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.gravity.pair_sums import TILE
from orbits.kernels.lanes import WIDTH, full, load, rsqrt_cubed, store, transposed
from orbits.kernels.sums.summation import accumulate, add_product

MOST_BODIES = TILE
"""The most bodies of a system: those whose attractions are summed in one go."""


def rows_of_bodies(size: int) -> int:
    """Return the rows of workspace for `size` coordinates: q, q_lo, v, v_lo and accelerations; softening, and GM."""
    return 5 * _block(size) + 1 + size // 3


def _block(size):
    return (size + WIDTH - 1) // WIDTH * WIDTH


_rows_of_a_vector = kernel(_block, inline=True)


@kernel(inline=True)
def _gather(vectors, size, rows, first):
    """Write a vector of each of eight systems, (8, padded), into rows."""
    for k in range(_rows_of_a_vector(size)):
        store(rows, first + k, full(0.0))
    for system in range(WIDTH):
        for k in range(size):
            rows[first + k, system] = vectors[system, k]


@kernel(inline=True)
def _scatter(rows, first, size, at, vectors):
    """Write a vector of each of eight systems from rows, in whole lanes; at : where it begins."""
    for k in range(0, size, WIDTH):
        a, b, c, d, e, f, g, h = transposed(rows, first + k)
        store(vectors[0], at + k, a)
        store(vectors[1], at + k, b)
        store(vectors[2], at + k, c)
        store(vectors[3], at + k, d)
        store(vectors[4], at + k, e)
        store(vectors[5], at + k, f)
        store(vectors[6], at + k, g)
        store(vectors[7], at + k, h)


@kernel
def accelerate_in_lanes(rows, n, q, g, strengths):
    """Write the accelerations of the bodies into the rows from g on.

    Each pair is evaluated once, and enters the sum of each of the two in the order of the partners.
    """
    for k in range(3 * n):
        store(rows, g + k, full(0.0))
    softening2 = load(rows, strengths)
    for i in range(n):
        x, y, z = load(rows, q + i), load(rows, q + n + i), load(rows, q + 2 * n + i)
        ax, ay, az = load(rows, g + i), load(rows, g + n + i), load(rows, g + 2 * n + i)
        own = load(rows, strengths + 1 + i)
        for j in range(i + 1, n):
            dx, dy, dz = load(rows, q + j) - x, load(rows, q + n + j) - y, load(rows, q + 2 * n + j) - z
            near = rsqrt_cubed(softening2 + dx * dx + dy * dy + dz * dz)
            w, back = near * load(rows, strengths + 1 + j), near * own
            ax, ay, az = ax + w * dx, ay + w * dy, az + w * dz
            store(rows, g + j, load(rows, g + j) - back * dx)
            store(rows, g + n + j, load(rows, g + n + j) - back * dy)
            store(rows, g + 2 * n + j, load(rows, g + 2 * n + j) - back * dz)
        store(rows, g + i, ax)
        store(rows, g + n + i, ay)
        store(rows, g + 2 * n + i, az)


@kernel(inline=True)
def _kick(rows, size, v, h, g):
    block = _rows_of_a_vector(size)
    for k in range(size):
        hi, lo = accumulate(load(rows, v + k), load(rows, v + block + k), h * load(rows, g + k))
        store(rows, v + k, hi)
        store(rows, v + block + k, lo)


@kernel(inline=True)
def _drift(rows, size, h, v):
    block = _rows_of_a_vector(size)
    for k in range(size):
        hi, lo = add_product(
            load(rows, k), load(rows, block + k), h, load(rows, v + k), load(rows, v + block + k)
        )
        store(rows, k, hi)
        store(rows, block + k, lo)


@kernel
def march_bodies(coefficients, strengths, q, q_lo, v, v_lo, carries, room, rows, path, contexts, steps):
    """March eight systems by `steps` steps of kicks and drifts; return the evaluations of each.

    coefficients : of `Splitting`; strengths : (8, 1 + n), see `orbits.kernels.gravity.pair_sums`
    q, q_lo, v, v_lo : (8, padded), the states; rows : workspace, see `rows_of_bodies`
    path : (8, length), receives q and v of each system, each padded, at the beginning of each step; contexts : not used
    """
    n = strengths.shape[1] - 1
    size, width = 3 * n, q.shape[1]
    block = _rows_of_a_vector(size)
    speeds, g, masses = 2 * block, 4 * block, 5 * block
    _gather(q, size, rows, 0)
    _gather(q_lo, size, rows, block)
    _gather(v, size, rows, speeds)
    _gather(v_lo, size, rows, speeds + block)
    for system in range(WIDTH):
        for k in range(1 + n):
            rows[masses + k, system] = strengths[system, k]
    kicks, drifts, last = coefficients[0], coefficients[1], coefficients.shape[1] - 1
    if kicks[0] != 0.0 and kicks[last] != 0.0:
        accelerate_in_lanes(rows, n, 0, g, masses)
    evaluations = 0
    for step in range(steps):
        _scatter(rows, 0, size, 2 * step * width, path)
        _scatter(rows, speeds, size, (2 * step + 1) * width, path)
        if kicks[0] != 0.0:
            if kicks[last] == 0.0:
                accelerate_in_lanes(rows, n, 0, g, masses)
                evaluations += 1
            _kick(rows, size, speeds, kicks[0], g)
        for i in range(last):
            _drift(rows, size, drifts[i], speeds)
            if kicks[i + 1] != 0.0:
                accelerate_in_lanes(rows, n, 0, g, masses)
                evaluations += 1
                _kick(rows, size, speeds, kicks[i + 1], g)
    _scatter(rows, 0, size, 0, q)
    _scatter(rows, block, size, 0, q_lo)
    _scatter(rows, speeds, size, 0, v)
    _scatter(rows, speeds + block, size, 0, v_lo)
    return evaluations
