"""Tangent vectors that follow a march of bodies with terms that depend on velocities, with forces without a Lagrangian,
or of parameters; see `orbits.kernels.tangents.through_stages`.

The step is one of positions and momenta, and so is its derivative. Momenta count per mass: w = p / m, which is v
without such terms. With F = dL/dq and all forces, and the derivatives of F / m and p / m - v at the stages by what
they depend on, Z = (dQ, dY, dtheta, dV), see `orbits.kernels.tangents.by_duals`,

    dQ_i = dq + sum_j mu_ij K_j,         dW_i = dw + sum_j mu_bar_ij L_j,        dV_i = dW_i - [p / m - v]' Z_i
    K_i = h b_i dV_i,                    L_i = h b_i [F / m]' Z_i
    dq+ = dq + sum_i K_i,                dw+ = dw + sum_i L_i

The internal variables y of forces are stepped like momenta: with dY at the end of dW, and the derivatives of y' in the
last rows of L. The vector of a parameter theta has dtheta = 1, which does not change. The stages are iterated to the
round-off floor, those of the bodies first.

Source: Hairer, Lubich & Wanner (2006), sec. VI.4.1, VI.6.2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from orbits.kernels.binding import SumType, dimension, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.ephemeris.chebyshev import given_in, held_by, place_given
from orbits.kernels.lanes import any_lane, full, load, maximum, select, store
from orbits.kernels.steps import Model
from orbits.kernels.sums.summation import accumulate
from orbits.kernels.tangents.by_duals import all_gradients, write_blocks
from orbits.kernels.tangents.through_stages import FLOOR, NODE, STALLED, SWEEPS, WEIGHT, measure

MU = 2
"""The columns of a table: c and b of each stage; from `MU` on mu, then mu_bar."""


class MomentaRoom(NamedTuple):
    """Workspace for D coordinates of the bodies, d of the vectors, m internal variables, P parameters, e = d + m, s
    stages.

    Q, V, f, p : (s, padded) positions, velocities, forces and momenta of the stages; w : (padded,), w of the bodies
    blocks : (s, 2, e, C or more), derivatives at the stages, see `write_blocks`; Z, dW : (C, 8), (e, 8), C = e + P + d
    y : (m,), the internal variables; Y, rates : (s, m), they and their rates at the stages
    ahead, given : (8,) and (2 D, 8), for bodies of an ephemeris; the latter empty without them
    duals : see `OnDuals`
    """

    Q: Any
    V: Any
    f: Any
    p: Any
    w: Any
    blocks: Any
    Z: Any
    dW: Any
    y: Any
    Y: Any
    rates: Any
    ahead: Any
    given: Any
    duals: Any


@kernel
def follow_momenta(tag, parameters, table, course, before, fan, some, inertia, scale, room):
    """As `orbits.kernels.tangents.through_stages.follow`, with vectors of dq and dw, (groups, 4, e + P, 8), and kicks
    (groups, s (e + d), 8): L and K.

    before : not used: the stages start from those of the step before, whatever its length
    """
    model = Model(tag, parameters)
    for k in range(course.lengths.shape[0]):
        t, h = course.times[k], course.lengths[k]
        if h == 0.0:  # with which a march may end
            continue
        if not place_stages(model, table, t, h, course.path[k], course.path[k + 1], inertia, room):
            return k
        for i in range(table.shape[0]):
            at = t + table[i, NODE] * h
            write_blocks(model, room.duals, at, room.Q[i], room.V[i], room.Y[i], some, room.blocks[i])
        for g in range(fan.vectors.shape[0]):
            if not advance(table, h, 3 * some.shape[0], room.blocks, fan.vectors[g], fan.kicks[g], room):
                return k
            if fan.growth.shape[0]:
                measure(abs(t), abs(h), scale, fan.vectors[g], fan.kicks[g], fan.growth[g])
        for a in range(room.y.shape[0]):
            for i in range(table.shape[0]):
                room.y[a] += h * table[i, WEIGHT] * room.rates[i, a]
    return course.lengths.shape[0]


@verb
def place_held(model, table, t, h, n, room):
    """Write where given bodies are at the stages of a step, and return how many these are."""
    if not isinstance(model.types[0], SumType) or not any(kernel_of(x, "given") for x in model.types[0].terms):
        return lambda model, table, t, h, n, room: 0
    return _place_held


@kernel
def _place_held(model, table, t, h, n, room):
    given, rows = given_in(model.tag, model.parameters), room.given
    held = held_by(given)
    for i in range(table.shape[0]):
        room.ahead[i] = h * table[i, NODE]
    place_given(given, t, load(room.ahead, 0), n, rows[: 3 * n], rows[3 * n :])
    for i in range(table.shape[0]):
        for k in range(3 * n):
            if k % n < held:
                room.Q[i, k], room.V[i, k] = rows[k, i], rows[3 * n + k, i]
    return held


@kernel
def place_stages(model, table, t, h, start, end, inertia, room):
    """Write positions and velocities of the bodies at the stages of a step. Returns whether their iteration
    converges.
    """
    Q, V, f, p, w, Y, rates, s = room.Q, room.V, room.f, room.p, room.w, room.Y, room.rates, table.shape[0]
    q, v = start[0], start[1]
    size, n = dimension(model.tag, model.parameters), inertia.shape[0]
    all_gradients(model, t, q, v, room.y, f[0], w, rates[0])
    for k in range(size):
        w[k] = w[k] * inertia[k % n]
        for i in range(s):
            V[i, k] = v[k] + table[i, NODE] * (end[1, k] - v[k])
    held = place_held(model, table, t, h, n, room)
    last = math.inf
    for _sweep in range(SWEEPS):
        settled = True
        for i in range(s):
            for k in range(size):
                if k % n < held:
                    continue
                way = 0.0
                for j in range(s):
                    way += table[i, MU + j] * (h * table[j, WEIGHT]) * V[j, k]
                Q[i, k] = q[k] + way
            for a in range(room.y.shape[0]):
                turned = 0.0
                for j in range(s):
                    turned += table[i, MU + s + j] * (h * table[j, WEIGHT]) * rates[j, a]
                new = room.y[a] + turned
                settled = settled and abs(new - Y[i, a]) <= STALLED * abs(new)
                Y[i, a] = new
        for i in range(s):
            all_gradients(model, t + table[i, NODE] * h, Q[i], V[i], Y[i], f[i], p[i], rates[i])
        change = reach = 0.0
        for i in range(s):
            for k in range(size):
                if k % n < held:
                    continue
                kick = 0.0
                for j in range(s):
                    kick += table[i, MU + s + j] * (h * table[j, WEIGHT]) * f[j, k]
                new = V[i, k] + (w[k] + (kick - p[i, k]) * inertia[k % n])
                change, reach = max(change, abs(new - V[i, k])), max(reach, abs(new))
                V[i, k] = new
        if settled and (change <= FLOOR * reach or (change <= STALLED * reach and not change <= 0.5 * last)):
            return True
        if change * 0.0 != 0.0:
            return False
        last = change
    return False


@kernel
def advance(table, h, d, blocks, vectors, kicks, room):
    """Take a step of eight tangent vectors, (4, e + P, 8). Returns whether the iteration of the stages converges.

    kicks : (s (e + d), 8), L of all stages, then K
    """
    s, e, rows = table.shape[0], blocks.shape[2], vectors.shape[1]
    Z, dW = room.Z, room.dW
    q, q_lo, w, w_lo = vectors[0], vectors[1], vectors[2], vectors[3]
    L, K, columns = kicks[: s * e], kicks[s * e :], rows + d
    for a in range(e, rows):
        store(Z, a, load(q, a))
    last, settled = full(math.inf), False
    for _sweep in range(SWEEPS):
        change, size, moved, way = full(0.0), full(0.0), full(0.0), full(0.0)  # of L, and of K
        for i in range(s):
            hb = h * table[i, WEIGHT]
            for a in range(e):
                y = load(w_lo, a)
                for j in range(s):
                    y = y + table[i, MU + s + j] * load(L, j * e + a)
                store(dW, a, load(w, a) + y)
            for a in range(d):
                x = load(q_lo, a)
                for j in range(s):
                    x = x + table[i, MU + j] * load(K, j * d + a)
                store(Z, a, load(q, a) + x)
                store(Z, rows + a, load(K, i * d + a) * (1.0 / hb))
            for a in range(d, e):
                store(Z, a, load(dW, a))
            for a in range(d):
                x = load(dW, a)
                for b in range(columns):
                    x = x - blocks[i, 1, a, b] * load(Z, b)
                moved, way = maximum(moved, abs(hb * x - load(K, i * d + a))), maximum(way, abs(hb * x))
                store(K, i * d + a, hb * x)
                store(Z, rows + a, x)
            for a in range(e):
                pull = full(0.0)
                for b in range(columns):
                    pull = pull + blocks[i, 0, a, b] * load(Z, b)
                new = hb * pull
                change, size = maximum(change, abs(new - load(L, i * e + a))), maximum(size, abs(new))
                store(L, i * e + a, new)
        off = maximum(select(size > 0.0, change / size, full(0.0)), select(way > 0.0, moved / way, full(0.0)))
        if not any_lane((off > FLOOR) * (1.0 - (off <= STALLED) * (off > 0.5 * last))):
            settled = True
            break
        last = off
    for a in range(e):
        kick = full(0.0)
        for i in range(s):
            kick = kick + load(L, i * e + a)
        y, y_lo = accumulate(load(w, a), load(w_lo, a), kick)
        store(w, a, y)
        store(w_lo, a, y_lo)
    for a in range(d):
        drift = full(0.0)
        for i in range(s):
            drift = drift + load(K, i * d + a)
        x, x_lo = accumulate(load(q, a), load(q_lo, a), drift)
        store(q, a, x)
        store(q_lo, a, x_lo)
    return settled
