"""What steps of changing length ask of `collocation`: coefficients for a new length, and the error signal of a step."""

from __future__ import annotations

from orbits.integrators.collocation.rows import BARYCENTRIC, ETA, HB, HC, HC_LO, LAST, NODES, WEIGHTS, columns, combine
from orbits.kernels.binding import bodies, dimension, gross_attraction
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, fma, full, load, maximum, row_maxima, row_sums, select, store, unit
from orbits.tableaux.symplectic import FAR

CANCELLED = 1e-6
"""The share of the attractions on a body below which their sum does not count as its force."""


UNFELT = 2.0**-26
"""The share of its velocity below which a kick of a body does not count: the usual tolerance of it is then lost in
rounding the velocity, and terms with momenta leave their own rounding, as in a step of a moment."""

TINY = 1e-300
"""Divides where there is no force, without dividing by zero."""


@kernel
def prepare(method, h, before, storage):
    """Write `Collocation.coefficients` for a step of h that follows one of `before`; for one register."""
    table = method.coefficients[0]
    ells = storage.scratch[storage.scratch.shape[0] - WIDTH :]  # after the increments of the last coordinate
    look_ahead(table, h, before, ells)
    eta = columns(method, table, ETA)
    for j in range(WIDTH):
        store(table, ETA + WIDTH + j, combine(eta, 1, table, ells, 0, j))


@kernel(inline=True)
def look_ahead(table, h, before, ells):
    """Write the coefficients that depend on h alone, and eight rows that lead from the kicks of the step before to
    those at the stages that lie ahead, by the polynomial through their forces.
    """
    nodes, weights = load(table, NODES), load(table, WEIGHTS)
    ratio = h / before
    hc = h * nodes
    store(table, HC, hc)
    store(table, HC_LO, fma(nodes, full(h), -hc))
    store(table, HB, h * weights)
    scaled = ratio * weights
    if abs(ratio) > FAR:  # a polynomial is useless far from its nodes
        for j in range(WIDTH):
            store(ells, j, ratio * unit(j))
    else:
        # The Lagrange polynomials of the nodes of the step before: products of all factors but one.
        ahead = 1.0 + ratio * nodes
        f0, f1, f2 = _factor(table, ahead, 0), _factor(table, ahead, 1), _factor(table, ahead, 2)
        f3, f4, f5 = _factor(table, ahead, 3), _factor(table, ahead, 4), _factor(table, ahead, 5)
        f6, f7 = _factor(table, ahead, 6), _factor(table, ahead, 7)
        first, second = (f0 * f1) * (f2 * f3), (f4 * f5) * (f6 * f7)
        rest0, rest1, rest2, rest3 = (f2 * f3) * second, (f0 * f1) * second, (f6 * f7) * first, (f4 * f5) * first
        store(ells, 0, (table[BARYCENTRIC, 0] * scaled) * (f1 * rest0))
        store(ells, 1, (table[BARYCENTRIC, 1] * scaled) * (f0 * rest0))
        store(ells, 2, (table[BARYCENTRIC, 2] * scaled) * (f3 * rest1))
        store(ells, 3, (table[BARYCENTRIC, 3] * scaled) * (f2 * rest1))
        store(ells, 4, (table[BARYCENTRIC, 4] * scaled) * (f5 * rest2))
        store(ells, 5, (table[BARYCENTRIC, 5] * scaled) * (f4 * rest2))
        store(ells, 6, (table[BARYCENTRIC, 6] * scaled) * (f7 * rest3))
        store(ells, 7, (table[BARYCENTRIC, 7] * scaled) * (f6 * rest3))


@kernel(inline=True)
def _factor(table, x, j):
    """Return x - c_j, or 1 past the last stage."""
    return x - table[NODES, j] if table[WEIGHTS, j] != 0.0 else full(1.0)


@kernel
def signal(method, model, h, state, storage):
    """Return the last Legendre coefficient of the forces on a body in the step of h just taken, as a fraction of the
    largest force on it; the maximum over all bodies. For one register.

    Where attractions cancel, the force that remains is round-off: no force counts as less than `CANCELLED` of the sum
    of their magnitudes; and none as less than gives a kick of `UNFELT` of the velocity.
    """
    table, L, scratch = method.coefficients[0], storage.carry, storage.scratch
    size, count = dimension(model.tag, model.parameters), bodies(model.tag, model.parameters)
    blocks = (size + WIDTH - 1) // WIDTH
    rows = WIDTH * blocks
    last, weights = load(table, LAST), load(table, WEIGHTS)
    inverse = select(weights > 0.0, 1.0 / weights, full(0.0))
    sums, sizes = scratch[rows : rows + blocks], scratch[rows + blocks : rows + 2 * blocks]
    products, room = scratch[:rows], scratch[rows + 2 * blocks :]
    for k in range(size):
        store(products, k, last * load(L, k))
    for i in range(count):
        most = abs(inverse * load(L, i))
        store(room, i, maximum(most, maximum(abs(inverse * load(L, count + i)), abs(inverse * load(L, 2 * count + i)))))
    for b in range(blocks):
        store(sums, b, abs(row_sums(products, WIDTH * b)))
    for b in range((count + WIDTH - 1) // WIDTH):
        store(sizes, b, row_maxima(room, WIDTH * b))
    worst, judge = 0.0, -1
    for i in range(count):
        ratio = _last_of(sums, count, i) / max(sizes[i >> 3, i & 7], TINY)
        if ratio > worst:
            worst, judge = ratio, i
    if judge < 0 or sizes[judge >> 3, judge & 7] >= least_kick(model, h, state, judge):
        return worst
    worst = 0.0
    for i in range(count):
        worst = max(worst, _last_of(sums, count, i) / max(sizes[i >> 3, i & 7], least_kick(model, h, state, i)))
    return worst


@kernel(inline=True)
def _last_of(sums, count, i):
    """Return the last Legendre coefficient of body i, the largest of three components in consecutive elements."""
    y, z = count + i, 2 * count + i
    return max(sums[i >> 3, i & 7], max(sums[y >> 3, y & 7], sums[z >> 3, z & 7]))


@kernel(inline=True)
def least_kick(model, h, state, i):
    """Return the least kick that counts as the force on body i."""
    n, v = bodies(model.tag, model.parameters), state.p
    felt = UNFELT * max(abs(v[i]), max(abs(v[n + i]), abs(v[2 * n + i])))
    return max(CANCELLED * abs(h) * gross_attraction(model.tag, model.parameters, state.q, i), max(felt, TINY))
