"""Tangent vectors that follow a march: the exact derivative of each step, through the stages of the bodies.

Stepping commutes with differentiation: the derivative of a partitioned Runge–Kutta step is the same step of the
variational equations dq'' = G(q) dq, G = dg/dq. Once the bodies have taken the step, G is known at its stages, and
the equations are linear. With the stage velocities eliminated,

    L_i = h w_i G_i dQ_i,                    dQ_i = dq + h c_i dv + h sum_j eta_ij L_j
    dv+ = dv + sum_i kick_i L_i,             dq+ = dq + h dv + h sum_i rest_i L_i

where w_i = b_i, kick_i = 1 and rest_i = 1 - c_i for a symplectic method (see `orbits.marching.tangents.of_bodies`).
Explicit methods need one sweep over the stages; the stages of implicit ones are iterated to the round-off floor.
Nothing is written that the march reads. For terms that depend on velocities see
`orbits.kernels.tangents.through_momenta`.

Eight tangent vectors are in the lanes of a register: a vector of d coordinates has d rows.

Source: Hairer, Lubich & Wanner (2006), sec. VI.4.1.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from orbits.kernels.binding import SumType, accelerate, dimension, tides
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import any_lane, full, load, maximum, store
from orbits.kernels.steps import Model
from orbits.kernels.sums.summation import accumulate, add_product
from orbits.kernels.tangents.by_duals import add_tides_of_terms
from orbits.kernels.tangents.growth import add_growth

NODE, WEIGHT, KICK, REST, ETA = 0, 1, 2, 3, 4
"""The columns of a table: c, w, kick and rest of each stage; from `ETA` on eta, then the continuation: the weights of L
at the stages of one step in the guess for those of the next."""

ALIKE = 0.1
"""The relative difference of successive steps up to which the continuation is used; other steps start cold."""

FLOOR, STALLED = 2.0**-52, 1e-11
"""The stages have converged when none changes by more than `FLOOR` of the largest, or when changes below `STALLED` of
it no longer fall by half."""

SWEEPS = 100


class Course(NamedTuple):
    """Consecutive steps of a march: times (k + 1,), lengths (k,); path (k + 1, 2, padded), q and v at these times."""

    times: Any
    lengths: Any
    path: Any


class Fan(NamedTuple):
    """Tangent vectors, eight in a group.

    vectors : (groups, 4, d, 8), dq, dv and their low parts, in the order dq, dq_lo, dv, dv_lo
    kicks : (groups, s d, 8), L of the step before, from which the next iteration starts
    growth : (groups, 5, 8), see `orbits.kernels.tangents.growth`; with no groups if growth is not measured
    """

    vectors: Any
    kicks: Any
    growth: Any


class Room(NamedTuple):
    """Workspace for D coordinates of the bodies, d of the vectors, s stages.

    Q, g : (s, padded) positions and accelerations of the stages
    tides : (s, d, d), G at the stages; dQ : (d, 8); ahead, rows : (s,) and (s, 8)
    duals : for terms, see `orbits.kernels.tangents.by_duals`
    """

    Q: Any
    g: Any
    tides: Any
    dQ: Any
    ahead: Any
    rows: Any
    duals: Any


@kernel
def follow(tag, parameters, table, course, before, fan, some, inertia, scale, room):
    """Let tangent vectors follow the steps of a march.

    tag, parameters : see `Model`: of a record with a tag Numba takes up to 0.6 ms to tell the type
    table : (s, 4 + 2 s); before : the length of the step before the first, 0 if there is none
    some : (m,) int64, the bodies that are varied, in ascending order; d = 3 m; inertia : (n,), 1 / GM of all
    scale : the unit of time in which velocities count in |x|

    Returns the number of steps followed: fewer than those of the course if the stages of the next do not converge.
    """
    model, s, explicit = Model(tag, parameters), table.shape[0], is_explicit(table)
    joined = explicit and are_joined(table)
    for k in range(course.lengths.shape[0]):
        t, h = course.times[k], course.lengths[k]
        if h == 0.0:  # with which a march may end
            continue
        warm = abs(h - before) <= ALIKE * abs(h)
        if not place_stages(model, table, explicit, warm, h, course.path[k], course.path[k + 1], room):
            return k
        if joined and before != 0.0:
            for a in range(room.tides.shape[1]):
                for b in range(room.tides.shape[2]):
                    room.tides[0, a, b] = room.tides[s - 1, a, b]
        for i in range(1 if joined and before != 0.0 else 0, s):
            at = t + table[i, NODE] * h
            write_tides(model, at, room.Q[i], room.duals, some, room.tides[i])
        for g in range(fan.vectors.shape[0]):
            if not advance(table, explicit, warm, h, room.tides, fan.vectors[g], fan.kicks[g], room):
                return k
            if fan.growth.shape[0]:
                measure(abs(t), abs(h), scale, fan.vectors[g], fan.kicks[g], fan.growth[g])
        before = h
    return course.lengths.shape[0]


@kernel
def is_explicit(table):
    """Return whether each stage depends on those before it alone."""
    for i in range(table.shape[0]):
        for j in range(i, table.shape[0]):
            if table[i, ETA + j] != 0.0:
                return False
    return True


@kernel
def are_joined(table):
    """Return whether the first stage is the start of a step and the last one its end, so that successive steps have it
    in common.
    """
    last = table.shape[0] - 1
    joined = last > 0 and table[0, NODE] == 0.0 and table[last, NODE] == 1.0
    for j in range(last + 1):
        joined = joined and table[0, ETA + j] == 0.0 and table[last, ETA + j] == table[j, REST]
    return joined


@kernel
def place_stages(model, table, explicit, warm, h, start, end, room):
    """Write the positions of the bodies at the stages of a step from `start` to `end`, (2, padded) each.

    warm : whether the accelerations at the stages of the step before serve as a guess; otherwise it is the cubic
    through both states. Returns whether the iteration of the stages converges.
    """
    Q, g, s, size = room.Q, room.g, table.shape[0], dimension(model.tag, model.parameters)
    q, v = start[0], start[1]
    if warm and not explicit:
        continued(table, g, size, room.ahead)
    for i in range(s):
        x = table[i, NODE]
        for k in range(size):
            if explicit:
                increment = x * v[k]
                for j in range(i):
                    increment += table[i, ETA + j] * (h * table[j, WEIGHT]) * g[j, k]
                Q[i, k] = q[k] + h * increment
            else:
                way = end[0, k] - q[k]
                bend = h * ((1.0 - x) * v[k] - x * end[1, k]) + way * (2.0 * x - 1.0)
                Q[i, k] = q[k] + x * (way + (1.0 - x) * bend)
        if (explicit and i < s - 1) or not (explicit or warm):
            accelerate(model.tag, model.parameters, Q[i], g[i])
    last = math.inf
    for _sweep in range(0 if explicit else SWEEPS):
        change = reach = 0.0
        for i in range(s):
            for k in range(size):
                increment = table[i, NODE] * v[k]
                for j in range(s):
                    increment += table[i, ETA + j] * (h * table[j, WEIGHT]) * g[j, k]
                new = q[k] + h * increment
                change, reach = max(change, abs(new - Q[i, k])), max(reach, abs(new - q[k]), 1e-3 * abs(new))
                Q[i, k] = new
            accelerate(model.tag, model.parameters, Q[i], g[i])
        if change <= FLOOR * reach or (change <= STALLED * reach and not change <= 0.5 * last):
            return True
        if change * 0.0 != 0.0:
            return False
        last = change
    return explicit


@verb
def write_tides(model, t, q, duals, some, out):
    """Write G, the derivative of the accelerations of some bodies by their positions, (d, d)."""
    if not isinstance(model.types[0], SumType):
        return lambda model, t, q, duals, some, out: tides(model.tag, model.parameters, q, some, out)

    def of_a_sum(model, t, q, duals, some, out):
        tides(model.tag, model.parameters, q, some, out)
        add_tides_of_terms(model, duals, t, q, some, out)

    return of_a_sum


@kernel
def continued(table, g, size, ahead):
    """Replace the accelerations at the stages of a step by a guess for those of the next; ahead : (s,), workspace."""
    s = table.shape[0]
    for k in range(size):
        for i in range(s):
            ahead[i] = 0.0
            for j in range(s):
                ahead[i] += table[i, ETA + s + j] * (table[j, WEIGHT] * g[j, k])
        for i in range(s):
            g[i, k] = ahead[i] / table[i, WEIGHT]


@kernel
def guess(table, warm, kicks, d, rows):
    """Replace L of the step before by a guess for the next step; rows : (s, 8), workspace."""
    s = table.shape[0]
    for a in range(d):
        for i in range(s):
            value = full(0.0)
            if warm:
                for j in range(s):
                    value = value + table[i, ETA + s + j] * load(kicks, j * d + a)
            store(rows, i, value)
        for i in range(s):
            store(kicks, i * d + a, load(rows, i))


@kernel
def advance(table, explicit, warm, h, tides, vectors, kicks, room):
    """Take a step of eight tangent vectors, (4, d, 8). Returns whether the iteration of the stages converges."""
    s, d, dQ = table.shape[0], tides.shape[1], room.dQ
    if not explicit:
        guess(table, warm, kicks, d, room.rows)
    q, q_lo, v, v_lo = vectors[0], vectors[1], vectors[2], vectors[3]
    last, settled = full(math.inf), explicit
    for _sweep in range(1 if explicit else SWEEPS):
        change, size = full(0.0), full(0.0)
        for i in range(s):
            weight = h * table[i, WEIGHT]
            for a in range(0, d, 3):  # three rows at once, whose instructions overlap
                c = table[i, NODE]
                x, y, z = c * load(v, a), c * load(v, a + 1), c * load(v, a + 2)
                for j in range(i if explicit else s):
                    eta, k = table[i, ETA + j], j * d + a
                    x, y, z = x + eta * load(kicks, k), y + eta * load(kicks, k + 1), z + eta * load(kicks, k + 2)
                store(dQ, a, load(q, a) + (load(q_lo, a) + h * x))
                store(dQ, a + 1, load(q, a + 1) + (load(q_lo, a + 1) + h * y))
                store(dQ, a + 2, load(q, a + 2) + (load(q_lo, a + 2) + h * z))
            for a in range(0, d, 3):
                x, y, z = full(0.0), full(0.0), full(0.0)
                for b in range(d):
                    other = load(dQ, b)
                    x, y = x + tides[i, a, b] * other, y + tides[i, a + 1, b] * other
                    z = z + tides[i, a + 2, b] * other
                x, y, z, k = weight * x, weight * y, weight * z, i * d + a
                off = maximum(abs(x - load(kicks, k)), abs(y - load(kicks, k + 1)))
                change = maximum(change, maximum(off, abs(z - load(kicks, k + 2))))
                size = maximum(size, maximum(abs(x), maximum(abs(y), abs(z))))
                store(kicks, k, x)
                store(kicks, k + 1, y)
                store(kicks, k + 2, z)
        if not explicit:
            stalled = (change <= STALLED * size) * (change > 0.5 * last)
            if not any_lane((1.0 - (change <= FLOOR * size)) * (1.0 - stalled)):  # true for NaN
                settled = True
                break
            last = change
    for a in range(d):
        kick, drift = full(0.0), full(0.0)
        for i in range(s):
            kick = kick + table[i, KICK] * load(kicks, i * d + a)
            drift = drift + table[i, REST] * load(kicks, i * d + a)
        x, x_lo = add_product(load(q, a), load(q_lo, a), full(h), load(v, a), load(v_lo, a))
        x, x_lo = accumulate(x, x_lo, h * drift)
        w, w_lo = accumulate(load(v, a), load(v_lo, a), kick)
        store(q, a, x)
        store(q_lo, a, x_lo)
        store(v, a, w)
        store(v_lo, a, w_lo)
    return settled


@kernel
def squares(scale, vectors):
    """Return |dq|^2 + scale^2 |dv|^2 of eight vectors."""
    total = full(0.0)
    for a in range(vectors.shape[1]):
        x, w = load(vectors[0], a), scale * load(vectors[2], a)
        total = total + (x * x + w * w)
    return total


@kernel
def measure(t, h, scale, vectors, kicks, growth):
    """Add a step of h > 0 from t >= 0 to the growth of eight vectors, and scale them if they are large."""
    factor = add_growth(t, h, squares(scale, vectors), growth)
    if any_lane(factor < 1.0):
        for part in range(4):
            for a in range(vectors.shape[1]):
                store(vectors[part], a, factor * load(vectors[part], a))
        for a in range(kicks.shape[0]):
            store(kicks, a, factor * load(kicks, a))
