"""Derivatives of all that acts at a stage, by positions, velocities, internal variables and parameters.

Kernels of Lagrangians, terms and forces run on dual numbers (`orbits.kernels.lanes.dual`), along eight directions at
once. So none of them has to give a derivative.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types

from orbits.kernels.binding import SumType, first_term, gradients
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.terms_and_forces import add_acting, add_terms
from orbits.kernels.lanes import WIDTH, get, lane, put, store
from orbits.kernels.lanes.dual import duals, slopes
from orbits.kernels.maps.terms_by_kind import strength_of
from orbits.kernels.steps import Model


class OnDuals(NamedTuple):
    """Workspace for D coordinates and m internal variables, in dual numbers.

    vectors : the parameters of all that acts, (length,) each; with P parameters to differentiate by, (length, 16)
    by_parameters : the derivatives of these vectors, (P, length) each; None without any
    count : (P,), not read
    q, v, f, p : (D, 16); y, rates : (m, 16)
    """

    vectors: Any
    by_parameters: Any
    count: Any
    q: Any
    v: Any
    f: Any
    p: Any
    y: Any
    rates: Any


@verb
def all_gradients(model, t, q, v, y, f, p, rates):
    """Write dL/dq with all forces into f, dL/dv into p, and the rates of the internal variables y."""
    if not isinstance(model.types[0], SumType):
        return lambda model, t, q, v, y, f, p, rates: gradients(model.tag, model.parameters, t, q, v, f, p)
    return lambda model, t, q, v, y, f, p, rates: _pull(model.tag, model.parameters, t, q, v, y, f, p, rates)


@kernel
def _pull(tag, parameters, t, q, v, y, f, p, rates):
    gradients(first_term(tag), parameters[0], t, q, v, f, p)
    add_terms(tag, parameters, t, q, v, f, p)
    add_acting(tag, parameters, t, q, v, y, f, rates)


@verb
def viewed(vectors):
    """Return the vectors among parameters, (length, 16), as ones of dual numbers."""
    if isinstance(vectors, types.Array):
        return duals if vectors.ndim == 2 else lambda vectors: vectors
    if not isinstance(vectors, types.BaseTuple) or isinstance(vectors, types.BaseNamedTuple):
        return lambda vectors: vectors
    if len(vectors) == 1:
        return lambda vectors: (viewed(vectors[0]),)
    return lambda vectors: (viewed(vectors[0]), *viewed(vectors[1:]))


@verb
def aim(vectors, by_parameters, j, slot):
    """Make the derivatives of the parameters along one of eight directions those by parameter j, or 0 if j is none."""
    if isinstance(by_parameters, types.Array):
        return _aim
    if not isinstance(by_parameters, types.BaseTuple) or isinstance(vectors, types.BaseNamedTuple):
        return lambda vectors, by_parameters, j, slot: None
    if len(vectors) == 1:
        return lambda vectors, by_parameters, j, slot: aim(vectors[0], by_parameters[0], j, slot)

    def each(vectors, by_parameters, j, slot):
        aim(vectors[0], by_parameters[0], j, slot)
        aim(vectors[1:], by_parameters[1:], j, slot)

    return each


@kernel
def _aim(vector, by_parameters, j, slot):
    for k in range(vector.shape[0]):
        vector[k, WIDTH + slot] = by_parameters[j, k] if 0 <= j < by_parameters.shape[0] else 0.0


@kernel(inline=True)
def coordinate(some, n, a):
    """Return the number of the coordinate, among all, of row a of the varied bodies."""
    return a // some.shape[0] * n + some[a % some.shape[0]]


@kernel
def add_tides_of_terms(model, work, t, q, some, out):
    """Add the derivatives of the accelerations of some bodies, by their positions, of all terms but the first, which
    depend on positions alone; out : (d, d)
    """
    n, d, strength = work.q.shape[0] // 3, out.shape[0], model.parameters[0]
    work.q[:], work.v[:] = 0.0, 0.0
    for k in range(3 * n):
        work.q[k, 0] = q[k]
    f, p = duals(work.f), duals(work.p)
    for first in range(0, d, WIDTH):
        _turn(work, first, d, d, some, 1.0)
        for k in range(3 * n):
            put(f, k, 0.0)
        add_terms(model.tag, model.parameters, t, duals(work.q), duals(work.v), f, p)
        for a in range(d):
            k = coordinate(some, n, a)
            change = slopes(get(f, k) / strength[1 + k % n])
            for c in range(first, min(first + WIDTH, d)):
                out[a, c] += lane(change, c - first)
        _turn(work, first, d, d, some, 0.0)


@kernel
def write_blocks(model, work, t, q, v, y, some, out):
    """Write the derivatives of F = dL/dq with all forces and of dL/dv - GM v of some bodies, over GM, and of the rates
    of the internal variables.

    out : (2, d + m, columns), rows of F and of the rates, then rows of dL/dv - GM v; columns of the d positions, the m
        internal variables, the P parameters and the d velocities, and of what fills eight directions
    """
    places, speeds, inner = work.q, work.v, work.y
    n, d, m = places.shape[0] // 3, 3 * some.shape[0], y.shape[0]
    by_velocity = d + m + work.count.shape[0]
    places[:], speeds[:], inner[:] = 0.0, 0.0, 0.0
    for k in range(3 * n):
        places[k, 0], speeds[k, 0] = q[k], v[k]
    for k in range(m):
        inner[k, 0] = y[k]
    known, f, p, rates = Model(model.tag, viewed(work.vectors)), duals(work.f), duals(work.p), duals(work.rates)
    for first in range(0, by_velocity + d, WIDTH):
        _turn(work, first, d, by_velocity, some, 1.0)
        all_gradients(known, t, duals(places), duals(speeds), duals(inner), f, p, rates)
        for a in range(d):
            k = coordinate(some, n, a)
            gm = strength_of(known)[1 + k % n]
            store(out[0, a], first, slopes(get(f, k) / gm))
            store(out[1, a], first, slopes(get(p, k) / gm))
        for a in range(m):
            store(out[0, d + a], first, slopes(get(rates, a)))
        _turn(work, first, d, by_velocity, some, 0.0)
    for a in range(d):
        out[1, a, by_velocity + a] -= 1.0


@kernel
def blocks_of(tag, parameters, work, t, q, v, y, some, out):
    """As `write_blocks`, for calls from Python: see `orbits.kernels.tangents.through_stages.follow`."""
    write_blocks(Model(tag, parameters), work, t, q, v, y, some, out)


@kernel
def _turn(work, first, d, by_velocity, some, size):
    """Begin or end the derivatives along eight directions, those of the columns of `write_blocks` from `first` on."""
    n, m = work.q.shape[0] // 3, work.y.shape[0]
    for slot in range(WIDTH):
        c = first + slot
        if c < d:
            work.q[coordinate(some, n, c), WIDTH + slot] = size
        elif c < d + m:
            work.y[c - d, WIDTH + slot] = size
        elif by_velocity <= c < by_velocity + d:
            work.v[coordinate(some, n, c - by_velocity), WIDTH + slot] = size
        aim(work.vectors, work.by_parameters, c - d - m if size > 0.0 else -1, slot)
