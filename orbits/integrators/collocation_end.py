"""The end of a step of `collocation`: the last sweep over the stages, and their sums, in doubled precision.

The iteration up to here is one of float64 numbers. What it would leave in the state is their rounding: of the positions
of the stages, of the forces and of the sums. So the last sweep is one of pairs (hi, lo): the stages Q = q + h c v +
h sum eta L, where only the last sum, which is small, is one of float64 numbers; the forces there (`accelerate_finely`);
the kicks L, and the sums

    v+ = v + sum_i L_i,     q+ = q + h v + h sum_i (1 - c_i) L_i
"""

from __future__ import annotations

from orbits.integrators.collocation_rows import ETA, HB, HC, HC_LO, REST, columns, combine, layers, registers
from orbits.kernels.binding import accelerate_finely, dimension
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, exact_add, fma, full, load, store
from orbits.kernels.steps import NOT_FINITE, OK
from orbits.kernels.summation import add_compensated, two_product, two_row_sums, two_sum


@kernel(inline=True)
def finish(method, model, h, state, storage):
    """Take the last sweep from the kicks L in `storage.carry`, and the step; return its status.

    The scratch is that of `step`: the changes, the history and the increments are not needed any more.
    """
    R, coefficients = registers(method), method.coefficients
    q, q_lo, v, v_lo = state
    size = dimension(model.tag, model.parameters)
    blocks = (size + WIDTH - 1) // WIDTH
    rows = WIDTH * blocks
    L, Q, scratch = storage.carry, storage.stages, storage.scratch
    block = Q.shape[0] // (R * layers(method))
    g, sums = scratch[:rows], scratch[rows : rows + 3 * blocks]
    L_lo = scratch[rows + 3 * blocks : rows + 3 * blocks + R * block]
    free = scratch[rows + 3 * blocks + R * block :]
    Q_lo, g_lo, close = free[: R * block], free[R * block :], layers(method) > 1
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
        hb = load(coefficients[r], HB)
        places, lows = Q[r * block : (r + 1) * block], Q_lo[r * block : (r + 1) * block]
        accelerate_finely(model.tag, model.parameters, places, lows, close, g, g_lo)
        for k in range(size):
            own, lost = two_product(hb, load(g, k))
            store(L, r * block + k, own)
            store(L_lo, r * block + k, fma(hb, load(g_lo, k), lost))
        for k in range(size, rows):
            store(L_lo, r * block + k, full(0.0))
    finite = True
    for b in range(blocks):
        kick, kick_lo, drift, drift_lo = full(0.0), full(0.0), full(0.0), full(0.0)
        for r in range(R):
            own, own_lo, moved, moved_lo = two_row_sums(L, L_lo, r * block + WIDTH * b, coefficients[r, REST])
            kick, lost = two_sum(kick, own)
            kick_lo = kick_lo + (lost + own_lo)
            drift, lost = two_sum(drift, moved)
            drift_lo = drift_lo + (lost + moved_lo)
        store(sums, b, kick)
        store(sums, blocks + b, kick_lo)
        store(sums, 2 * blocks + b, drift)
        store(Q_lo, b, drift_lo)
        finite &= not any_lane(1.0 - (kick * 0.0 == 0.0) * (drift * 0.0 == 0.0))
    if not finite:
        return NOT_FINITE
    for b in range(blocks):
        k = WIDTH * b
        v_now, v_rest, kick_lo = load(v, k), load(v_lo, k), load(sums, blocks + b)
        x, x_rest = _moved(
            h, load(q, k), load(q_lo, k), v_now, v_rest, load(sums, 2 * blocks + b), load(Q_lo, b)
        )
        store(q, k, x)
        store(q_lo, k, x_rest)
        v_now, v_rest = add_compensated(v_now, v_rest + kick_lo, load(sums, b))
        store(v, k, v_now)
        store(v_lo, k, v_rest)
    return OK


@kernel(inline=True, exact=True)
def _moved(h, q, q_lo, v, v_lo, drift, drift_lo):
    """Return (q, q_lo) + h ((v, v_lo) + (drift, drift_lo))."""
    along, a = two_product(v, h)
    across, b = two_product(drift, h)
    s, c = two_sum(along, across)
    return add_compensated(q, exact_add(q_lo, exact_add(exact_add(a, b), fma(v_lo, h, fma(drift_lo, h, c)))), s)
