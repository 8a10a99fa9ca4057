"""Dense output: the motion within a step, from the polynomial through the forces at its stages.

With L_j = h b_j g(Q_j) and shifted Legendre polynomials P_k, at the fraction theta of a step:

    v(theta) = v + sum_j once_j L_j,                 once_j  = sum_k c_kj I_k(theta),   I_k = integral of P_k
    q(theta) = q + h theta v + h sum_j twice_j L_j,  twice_j = sum_k c_kj J_k(theta),   J_k = integral of I_k

c_kj b_j is the k-th Legendre coefficient of the j-th Lagrange polynomial of the nodes: for Gauss,
c_kj = (2k + 1) P_k(c_j).

Where no polynomial resolves the motion, it is that of partial steps: steps of theta h from the beginning of the step,
by the method itself. Their coefficients are those of a step of unit length, stretched; they start cold, so that each
state depends on its own step alone. A method that marches other variables than those seen enters them, and leaves them
again, with a partial step's own coefficients. `stretch`, `dense` and `resolves` are optional functions of a method:

    stretch(method, unit, factor)
        writes the coefficients of steps `factor` times as long as those of `unit`, a method of the same form
    dense(method, h, q, v, kicks, theta, out_q, out_v)
        writes the state at the fraction theta of a step that left `kicks` in the carry
    resolves(method, h, q, kicks, bodies) -> bool
        whether `dense` is as good as a partial step, for bodies with the coordinates all x, all y, all z
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import dimension, of_record
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, load, store
from orbits.kernels.search.paths import record_carry
from orbits.kernels.steps import OK, Method, Model, begin, enter, leave, part
from orbits.kernels.sums.summation import two_sum


@of_record()
def dense(method, h, q, v, kicks, theta, out_q, out_v):
    """Write q and v at the fraction theta of a step of h that began at q and v and left `kicks` in the carry."""


@of_record()
def resolves(method, h, q, kicks, bodies):
    """Return whether the polynomial through the forces of a step is as good as a partial step."""


@of_record(optional=True)
def stretch(method, unit, factor):
    """Write the coefficients of steps `factor` times as long as those of `unit`; nothing for methods without it."""


@kernel(inline=True)
def keep_coefficients(method, unit, factor):
    """Do nothing: the `stretch` of methods whose coefficients do not depend on the length of a step."""


@kernel(inline=True)
def integral(k, x, before, now):
    """Return (P_k+1, I_k) from P_k-1 and P_k at x = 2 theta - 1; with P_-1 = -1, so that I_0 = theta. Floats or
    lanes.
    """
    following = x * now
    if k > 0:
        following = ((2.0 * k + 1.0) * following - float(k) * before) * (1.0 / (k + 1.0))
    return following, (following - before) * (0.5 / (2.0 * k + 1.0))


@kernel(inline=True)
def weights(table, first, rows, theta):
    """Return `once` and `twice` for the eight stages of a register.

    table : has the rows c_k, k = 0 ... rows - 1, from row `first` on
    """
    x = 2.0 * theta - 1.0
    once = twice = full(0.0)
    following, now = integral(0, x, -1.0, 1.0)
    legendre, before, double = 1.0, 0.0, 0.5 * theta * theta
    for k in range(rows):
        after, ahead = integral(k + 1, x, legendre, following)
        if k > 0:
            double = (ahead - before) * (0.5 / (2.0 * k + 1.0))
        row = load(table, first + k)
        once, twice = once + now * row, twice + double * row
        before, now, legendre, following = now, ahead, following, after
    return once, twice


@kernel(inline=True)
def double_integrals(theta, rows, out):
    """Write J_k at eight fractions theta, in lanes, into row k of `out`, for k = 0 ... rows - 1."""
    x = 2.0 * theta - 1.0
    following, now = integral(0, x, full(-1.0), full(1.0))
    legendre, before, double = full(1.0), full(0.0), 0.5 * theta * theta
    for k in range(rows):
        after, ahead = integral(k + 1, x, legendre, following)
        if k > 0:
            double = (ahead - before) * (0.5 / (2.0 * k + 1.0))
        store(out, k, double)
        before, now, legendre, following = now, ahead, following, after


@kernel(inline=True)
def single_integrals(theta, rows, out):
    """Write I_k at eight fractions theta, in lanes, into row k of `out`, for k = 0 ... rows - 1."""
    x = 2.0 * theta - 1.0
    before, now = full(-1.0), full(1.0)
    for k in range(rows):
        following, ahead = integral(k, x, before, now)
        store(out, k, ahead)
        before, now = now, following


@kernel
def motion_within(form, coefficients, lengths, path, kicks, steps, fractions, q, v, done):
    """Write the states at fractions of recorded steps that their polynomials resolve.

    form, coefficients : of the method
    lengths : (steps,); path : (steps + 1, 2, padded), q and v at the beginning of each and at the end of the last one
    kicks : (steps, rows, 8), the carry after each step
    steps, fractions : (m,), number and fraction of the step of each state
    q, v : (m, size), receive the states; done : (m,) bool, which to write in any case; receives which were written
    """
    method = Method(form, coefficients)
    known, good = -1, False
    for i in range(len(steps)):
        k = steps[i]
        if not done[i] and k != known:
            known, good = k, resolves(method, lengths[k], path[k, 0], kicks[k], q.shape[1] // 3)
        done[i] = done[i] or good
        if done[i]:
            dense(method, lengths[k], path[k, 0], path[k, 1], kicks[k], fractions[i], q[i], v[i])


class Parts(NamedTuple):
    """Partial steps, (m,) each: the states that they begin in, the times of these, their lengths, and which to take."""

    starts: Any
    times: Any
    lengths: Any
    missing: Any


@kernel
def partial_steps(form, coefficients, unit, tag, parameters, path, parts, q, v, carries, state, storage):
    """Write the states after partial steps from recorded states.

    coefficients : workspace, like `unit`, those of a step of unit length; both the same for a method without `stretch`
    path : (states, 2, padded), q and v of each, or (states, 4, padded), with their low parts; parts : see `Parts`
    q, v : (m, size), receive the states
    carries : (m, rows, 8), the carry with which each begins, and that after it; (0, rows, 8) for zeros
    state, storage : workspace; see `orbits.kernels.steps`

    Returns the number of the first partial step that fails, and its status; or (-1, 0).
    """
    method, base, model = Method(form, coefficients), Method(form, unit), Model(tag, parameters)
    size, carry, (starts, times, lengths, missing) = dimension(tag, parameters), storage.carry, parts
    for i in range(len(lengths)):
        if missing[i]:
            begun, h = path[starts[i]], lengths[i]
            for k in range(len(state.q)):
                state.q[k], state.q_lo[k], state.p[k], state.p_lo[k] = begun[0, k], 0.0, begun[1, k], 0.0
                if path.shape[1] > 2:
                    state.q_lo[k], state.p_lo[k] = begun[2, k], begun[3, k]
            if h != 0.0:
                for row in range(carry.shape[0]):
                    for k in range(carry.shape[1]):
                        carry[row, k] = carries[i, row, k] if i < carries.shape[0] else 0.0
                stretch(method, base, h)
                enter(method, model, h, state, storage)
                begin(method, model, times[i], h, state, storage)
                status, _, _ = part(method, model, times[i], h, state, storage)
                if status != OK:
                    return i, status
                if i < carries.shape[0]:
                    record_carry(carries, i, carry)
                leave(method, model, h, state, storage)
            for k in range(size):
                q[i, k], v[i, k] = state.q[k], state.p[k]
    return -1, OK


@kernel
def motion_at_checks(once, twice, checks, lengths, path, kicks, coordinates, rows, q, v):
    """Write some coordinates at the same fractions of all recorded steps, from their polynomials.

    once, twice : (registers * width, fractions), the weights of the stages at each; checks : (fractions,), 8 or more
    lengths, path : see `motion_within`; kicks : (steps, rows, width), a register of each coordinate after another
    coordinates : (c,), their numbers; rows : (c,), where they are written
    q, v : (rows, steps, fractions), receive positions and velocities
    """
    width, each = kicks.shape[2], len(checks)
    registers = once.shape[0] // width
    block = kicks.shape[1] // registers
    for c in range(len(coordinates)):
        i = coordinates[c]
        for k in range(len(lengths)):
            h, base, speed, Q, V = lengths[k], path[k, 0, i], path[k, 1, i], q[rows[c], k], v[rows[c], k]
            at = 0
            while at < each:
                at = min(at, each - WIDTH)  # the last ones overlap those before
                way = change = full(0.0)
                for r in range(registers):
                    for j in range(width):
                        L = full(kicks[k, r * block + i, j])
                        way = way + load(twice[r * width + j], at) * L
                        change = change + load(once[r * width + j], at) * L
                store(Q, at, base + h * (load(checks, at) * speed + way))
                store(V, at, speed + change)
                at += WIDTH


@kernel
def times_reached(lengths, lows, times):
    """Write the times after steps of these lengths, (steps + 1, 2), each as the sum of two numbers; the first one is
    given. lows : (steps,), the low parts of the lengths
    """
    for k in range(len(lengths)):
        time, lost = two_sum(times[k, 0], lengths[k])
        times[k + 1, 0], times[k + 1, 1] = two_sum(time, lost + (lows[k] + times[k, 1]))
