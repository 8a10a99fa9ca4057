"""The end of a step of `collocation`: the last sweep over the stages, and their sums, in doubled precision.

The iteration up to here is one of float64 numbers. What it would leave in the state is their rounding: of the positions
of the stages, of the forces and of the sums. So the last sweep is one of pairs (hi, lo): the stages Q = q + h c v +
h sum eta L, where only the last sum, which is small, is one of float64 numbers; the forces there (`accelerate_finely`);
the kicks L, and the sums

    v+ = v + sum_i L_i,     q+ = q + h v + h sum_i (1 - c_i) L_i
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.integrators.collocation.rows import ETA, HB, HC, HC_LO, REST, columns, combine, layers, registers
from orbits.kernels.binding import accelerate_finely, bodies, dimension
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, exact_add, exact_sub, fma, full, load, row_sums, store
from orbits.kernels.steps import NOT_FINITE, OK
from orbits.kernels.sums.summation import add_compensated, quick_two_sum, two_product, two_sum

COARSE = 2.0**10
"""Kicks are split at the last bit of this many times the largest: their first parts, of some forty bits, add up without
rounding errors, and the rounding errors of their rests do not matter.
"""


class Sums(NamedTuple):
    """Sums over the stages of each coordinate, (rows, 8), whose lanes are still to be added: of the kicks h b g, and of
    (1 - c) h b g, the drifts by them; each in parts that add up without rounding errors, and their rests.
    """

    kicks: Any
    kicks_lo: Any
    drifts: Any
    drifts_lo: Any


@kernel(inline=True)
def finish(method, model, h, state, storage):
    """Take the last sweep from the kicks L in `storage.carry`, and the step; return its status.

    The scratch is that of `step`, of which the largest kicks in the history are needed.
    """
    R, coefficients = registers(method), method.coefficients
    q, q_lo, v, v_lo = state
    size, count = dimension(model.tag, model.parameters), bodies(model.tag, model.parameters)
    blocks, parts = (size + WIDTH - 1) // WIDTH, count if count > 0 else size
    rows, groups = WIDTH * blocks, (parts + WIDTH - 1) // WIDTH
    L, Q, scratch = storage.carry, storage.stages, storage.scratch
    block = Q.shape[0] // (R * layers(method))
    g, largest = scratch[:rows], scratch[2 * rows + 2 * groups : 2 * rows + 3 * groups]
    free = scratch[2 * rows + 3 * groups :]
    sums = Sums(free[rows : 2 * rows], scratch[rows : 2 * rows], free[2 * rows : 3 * rows], free[3 * rows :])
    g_lo, Q_lo, close = free[:rows], free[4 * rows :], layers(method) > 1
    for r in range(R):
        table = coefficients[r]
        hc, hc_lo, eta = load(table, HC), load(table, HC_LO), columns(method, table, ETA)
        for k in range(size):
            along, lost = two_product(hc, full(v[k]))
            lost = fma(hc_lo, full(v[k]), lost) + fma(hc, full(v_lo[k]), full(q_lo[k]))
            increment, rest = two_sum(along, h * combine(eta, R, table, L, block, k))
            position, low = two_sum(full(q[k]), increment)
            store(Q, r * block + k, position)
            store(Q_lo, r * block + k, low + (rest + lost))
    for r in range(R):
        hb, remaining = load(coefficients[r], HB), load(coefficients[r], REST)
        places, lows = Q[r * block : (r + 1) * block], Q_lo[r * block : (r + 1) * block]
        accelerate_finely(model.tag, model.parameters, places, lows, close, g, g_lo)
        for i in range(parts):
            splitter = full(COARSE * largest[i >> 3, i & 7])
            for k in range(i, size, parts):
                store(L, r * block + k, add_kick(r, (hb, remaining), g, g_lo, splitter, sums, k))
    if not add_up(size, sums, g):
        return NOT_FINITE
    for b in range(blocks):
        k = WIDTH * b
        v_now, v_rest, kick_lo = load(v, k), load(v_lo, k), load(g, blocks + b)
        x, x_rest = moved_by(
            h, load(q, k), load(q_lo, k), v_now, v_rest, load(g, 2 * blocks + b), load(g, 3 * blocks + b)
        )
        store(q, k, x)
        store(q_lo, k, x_rest)
        v_now, v_rest = add_compensated(v_now, v_rest + kick_lo, load(g, b))
        store(v, k, v_now)
        store(v_lo, k, v_rest)
    return OK


@kernel(inline=True)
def add_kick(r, weights, g, g_lo, splitter, sums, k):
    """Add the kicks by the accelerations (g, g_lo) at the stages of register r, and the drifts by them, to row k of the
    sums; return the kicks.

    weights : h b and 1 - c of these stages
    """
    own, lost = two_product(weights[0], load(g, k))
    lost = fma(weights[0], load(g_lo, k), lost)
    _add_split(r, own, lost, splitter, sums.kicks, sums.kicks_lo, k)
    moved, rest = two_product(weights[1], own)
    _add_split(r, moved, fma(weights[1], lost, rest), splitter, sums.drifts, sums.drifts_lo, k)
    return own


@kernel(inline=True)
def add_up(size, sums, out):
    """Write the sums over stages as pairs in blocks of eight coordinates: kicks, their low parts, drifts, their low
    parts. Return whether they are finite.
    """
    blocks = (size + WIDTH - 1) // WIDTH
    for k in range(size, WIDTH * blocks):
        store(sums.kicks, k, full(0.0))
        store(sums.kicks_lo, k, full(0.0))
        store(sums.drifts, k, full(0.0))
        store(sums.drifts_lo, k, full(0.0))
    finite = True
    for b in range(blocks):
        k = WIDTH * b
        kick, kick_lo = quick_two_sum(row_sums(sums.kicks, k), row_sums(sums.kicks_lo, k))
        drift, drift_lo = quick_two_sum(row_sums(sums.drifts, k), row_sums(sums.drifts_lo, k))
        store(out, b, kick)
        store(out, blocks + b, kick_lo)
        store(out, 2 * blocks + b, drift)
        store(out, 3 * blocks + b, drift_lo)
        finite &= not any_lane(1.0 - (kick * 0.0 == 0.0) * (drift * 0.0 == 0.0))
    return finite


@kernel(inline=True, exact=True)
def _add_split(r, x, x_lo, splitter, rows, lows, k):
    """Add the part of (x, x_lo) down to the last bit of `splitter` to row k of `rows`, the rest to that of `lows`; with
    the first register, r = 0, write them.
    """
    coarse = exact_sub(exact_add(x, splitter), splitter)
    rest = exact_add(exact_sub(x, coarse), x_lo)
    store(rows, k, coarse if r == 0 else exact_add(load(rows, k), coarse))
    store(lows, k, rest if r == 0 else exact_add(load(lows, k), rest))


@kernel(inline=True, exact=True)
def moved_by(h, q, q_lo, v, v_lo, drift, drift_lo):
    """Return (q, q_lo) + h ((v, v_lo) + (drift, drift_lo))."""
    along, a = two_product(v, h)
    across, b = two_product(drift, h)
    s, c = two_sum(along, across)
    return add_compensated(q, exact_add(q_lo, exact_add(exact_add(a, b), fma(v_lo, h, fma(drift_lo, h, c)))), s)
