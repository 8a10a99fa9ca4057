"""Derivatives of forces without a Lagrangian, and of all that acts by parameters, for tangent vectors.

Kernels of forces and terms run on dual numbers (`orbits.kernels.lanes.dual`): once for each coordinate of the bodies
that are varied, and once for each parameter. So none of them has to give a derivative.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types

from orbits.kernels.binding import SumType, first_term, gradients, hessians
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.terms_and_forces import add_acting, add_terms
from orbits.kernels.lanes import load
from orbits.kernels.lanes.dual import duals


class Acting(NamedTuple):
    """Workspace for forces and P parameters, of D coordinates, m internal variables, s stages.

    vectors : the parameters of all terms and forces, vectors as complex numbers; slopes : their derivatives by each
        parameter, (P + 1, length) each, the last row with zeros
    whole : 0 if a parameter is one of the Lagrangian, None if all are of forces
    q, v, f, p : (D,); y, rates : (m,), all complex
    sources : (s, P, 2 d + m), see `write_sources`; more : (s, 2 d + m, 8), those of eight vectors
    first : the number of the vector of the first parameter
    """

    vectors: Any
    slopes: Any
    whole: Any
    q: Any
    v: Any
    f: Any
    p: Any
    y: Any
    rates: Any
    sources: Any
    more: Any
    first: Any


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
def all_hessians(model, t, q, v, out):
    """Write the second derivatives of L, as `orbits.kernels.binding.hessians`."""
    if isinstance(model.types[0], SumType) and len(model.types[0].terms) == 1:
        return lambda model, t, q, v, out: hessians(first_term(model.tag), model.parameters[0], t, q, v, out)
    return lambda model, t, q, v, out: hessians(model.tag, model.parameters, t, q, v, out)


@verb
def viewed(vectors):
    """Return the vectors of complex numbers among parameters as ones of dual numbers."""
    if isinstance(vectors, types.Array):
        return duals
    if not isinstance(vectors, types.BaseTuple) or isinstance(vectors, types.BaseNamedTuple):
        return lambda vectors: vectors
    if len(vectors) == 1:
        return lambda vectors: (viewed(vectors[0]),)
    return lambda vectors: (viewed(vectors[0]), *viewed(vectors[1:]))


@verb
def aim(vectors, slopes, j):
    """Make the slopes of parameters those by parameter j; the last is none."""
    if isinstance(vectors, types.Array):
        return _aim
    if not isinstance(vectors, types.BaseTuple) or isinstance(vectors, types.BaseNamedTuple):
        return lambda vectors, slopes, j: None
    if len(vectors) == 1:
        return lambda vectors, slopes, j: aim(vectors[0], slopes[0], j)

    def each(vectors, slopes, j):
        aim(vectors[0], slopes[0], j)
        aim(vectors[1:], slopes[1:], j)

    return each


@kernel
def _aim(vector, slopes, j):
    for k in range(vector.shape[0]):
        vector[k] = complex(vector[k].real, slopes[j, k])


@kernel
def _place(t, q, v, y, acting):
    """Begin at a stage: no slopes."""
    for k in range(acting.q.shape[0]):
        acting.q[k], acting.v[k] = complex(q[k], 0.0), complex(v[k], 0.0)
    for k in range(acting.y.shape[0]):
        acting.y[k] = complex(y[k], 0.0)


@kernel
def _forces(tag, vectors, t, acting):
    """Write what the forces are into f, and the rates."""
    for k in range(acting.f.shape[0]):
        acting.f[k] = 0j
    for k in range(acting.rates.shape[0]):
        acting.rates[k] = 0j
    q, v, f = duals(acting.q), duals(acting.v), duals(acting.f)
    add_acting(tag, viewed(vectors), t, q, v, duals(acting.y), f, duals(acting.rates))


@verb
def _all_that_changes(tag, vectors, t, acting):
    """Write what depends on parameters into f and p, and the rates."""
    whole = dict(zip(acting.fields, acting.types, strict=True))["whole"]
    if isinstance(whole, types.NoneType):

        def forces(tag, vectors, t, acting):
            for k in range(acting.p.shape[0]):
                acting.p[k] = 0j
            _forces(tag, vectors, t, acting)

        return forces

    def everything(tag, vectors, t, acting):
        for k in range(acting.rates.shape[0]):
            acting.rates[k] = 0j
        q, v, f, p = duals(acting.q), duals(acting.v), duals(acting.f), duals(acting.p)
        _pull(tag, viewed(vectors), t, q, v, duals(acting.y), f, p, duals(acting.rates))

    return everything


@kernel(inline=True)
def coordinate(some, n, a):
    """Return the number of the coordinate, among all, of row a of the varied bodies."""
    return a // some.shape[0] * n + some[a % some.shape[0]]


@verb
def add_forces_to_blocks(model, acting, t, q, v, y, some, inertia, pulls, pushes):
    """Add the derivatives of the forces, over GM of each row, to (e, e) by positions and internal variables, and to
    (e, e) by velocities; rows from d on are those of the rates. Without forces nothing is done.
    """
    if isinstance(acting, types.NoneType) or not model.types[0].forces:
        return lambda model, acting, t, q, v, y, some, inertia, pulls, pushes: None
    return _add_forces


@kernel
def _add_forces(model, acting, t, q, v, y, some, inertia, pulls, pushes):
    n, d, m = inertia.shape[0], 3 * some.shape[0], acting.y.shape[0]
    _place(t, q, v, y, acting)
    for c in range(2 * d + m):
        x, k = (acting.q, coordinate(some, n, c)) if c < d else (acting.v, coordinate(some, n, c - d))
        if c >= 2 * d:
            x, k = acting.y, c - 2 * d
        x[k] = complex(x[k].real, 1.0)
        _forces(model.tag, acting.vectors, t, acting)
        x[k] = complex(x[k].real, 0.0)
        out, b = (pushes, c - d) if d <= c < 2 * d else (pulls, c if c < d else c - d)
        for a in range(d):
            out[a, b] += acting.f[coordinate(some, n, a)].imag * inertia[some[a % some.shape[0]]]
        for a in range(m):
            out[d + a, b] += acting.rates[a].imag


@verb
def write_sources(model, acting, t, q, v, y, some, out):
    """Write the derivatives by parameters into `out`, (P, 2 d + m): of dL/dq with forces, over GM, of the rates, and of
    -dL/dv over GM; nothing without parameters.
    """
    if isinstance(acting, types.NoneType):
        return lambda model, acting, t, q, v, y, some, out: None
    return _write_sources


@kernel
def _write_sources(model, acting, t, q, v, y, some, out):
    d, m, count = 3 * some.shape[0], acting.y.shape[0], out.shape[0]
    if count == 0:
        return
    _place(t, q, v, y, acting)
    strength = acting.vectors[0]
    n = strength.shape[0] - 1
    for j in range(count):
        aim(acting.vectors, acting.slopes, j)
        _all_that_changes(model.tag, acting.vectors, t, acting)
        for a in range(d):
            k = coordinate(some, n, a)
            gm = strength[1 + k % n]
            own = gm.imag / gm.real
            out[j, a] = (acting.f[k].imag - own * acting.f[k].real) / gm.real
            out[j, d + m + a] = (own * acting.p[k].real - acting.p[k].imag) / gm.real
        for a in range(m):
            out[j, d + a] = acting.rates[a].imag
    aim(acting.vectors, acting.slopes, count)


@kernel
def write_sources_now(model, acting, t, q, v, y, some, out):
    """Write the derivatives by parameters; to be called from Python."""
    write_sources(model, acting, t, q, v, y, some, out)


@verb
def write_stage_sources(model, acting, i, t, q, v, y, some):
    """Write the derivatives by parameters at stage i."""
    if isinstance(acting, types.NoneType):
        return lambda model, acting, i, t, q, v, y, some: None
    return lambda model, acting, i, t, q, v, y, some: write_sources(
        model, acting, t, q, v, y, some, acting.sources[i]
    )


@verb
def gather_sources(acting, group):
    """Gather the derivatives by parameters for a group of eight vectors in `more`; those of others are 0."""
    return (lambda acting, group: None) if isinstance(acting, types.NoneType) else _gather


@kernel
def _gather(acting, group):
    stages, rows, lanes = acting.more.shape
    for lane in range(lanes):
        j = lanes * group + lane - acting.first
        known = 0 <= j < acting.sources.shape[1]
        for i in range(stages):
            for a in range(rows):
                acting.more[i, a, lane] = acting.sources[i, j, a] if known else 0.0


@verb
def with_source(x, acting, i, a):
    """Return x with the gathered derivatives by parameters of row a at stage i; x itself without any."""
    if isinstance(acting, types.NoneType):
        return lambda x, acting, i, a: x
    return lambda x, acting, i, a: x + load(acting.more[i], a)
