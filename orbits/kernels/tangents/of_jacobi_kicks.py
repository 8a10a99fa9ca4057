"""The derivative of kicks by the interaction of planets in Jacobi coordinates, and of the change to them.

A kick by the interaction g of `orbits.kernels.maps.jacobi` changes dv by h times

    plain      Dg dq
    lazy       Dg(q + s g) (dq + s Dg dq)
    modified   Dg (dq + s Dg dq) + s D^2 g (g, dq),      s = h^2/12

and as g is a sum of x / |x|^3 over pairs of places, with the same coefficients its derivative is that of the changes of
these. Terms of positions alone are in g, but for the change of the modified kick; see
`orbits.kernels.tangents.of_terms`.

Sources: Mikkola & Innanen (1999), Celest. Mech. Dyn. Astron. 74, 59; Rein & Tamayo (2016), MNRAS 459, 2275.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import fma, full, load, store
from orbits.kernels.maps.layout import (
    ATTRACTING,
    CENTRAL,
    INNER,
    MASS,
    OUTER,
    SHARE,
    SHIFTED,
    body_of,
    constant,
    coordinate,
    dominant,
)
from orbits.kernels.maps.programs import LAZY, MODIFIED, STANDARD
from orbits.kernels.tangents.of_kepler_flow import pull_bend, pull_change
from orbits.kernels.tangents.of_terms import add_static
from orbits.kernels.tangents.vector_parts import ALONG, HERE, MOVED, to_places


@kernel
def place_planets(kick, room):
    """Write the places at which the derivative of a kick is taken, and for the modified kick the displacement."""
    scratch, places, count = room.scratch, room.places, room.mass.shape[0]
    for i in range(count):
        for k in range(3):
            places[HERE, i, k] = coordinate(room.planets, k, i)
            places[MOVED if kick == LAZY else ALONG, i, k] = constant(scratch, SHIFTED + k, i)
    _write_places(scratch, count, places[HERE])
    if kick != STANDARD:
        _write_places(scratch, count, places[MOVED if kick == LAZY else ALONG])


@kernel
def _write_places(scratch, count, places):
    """Write u from r', or the displacement of one from that of the other."""
    for k in range(3):
        inside = 0.0
        for i in range(count):
            places[i, 3 + k] = inside + places[i, k]
            inside = fma(constant(scratch, SHARE, i), places[i, k], inside)


@kernel
def change_of_kick(model, kick, shift, d, out, room):
    """Write the change of the interaction of a kick along eight vectors, with terms of positions alone.

    d : (3n or more, 8), dr'; out : (3n, 8)
    """
    scratch, count, places = room.scratch, room.mass.shape[0], room.places
    _change(scratch, count, places[HERE], places[HERE], False, d, out, room)
    if kick != MODIFIED:
        add_static(model, HERE, d, out, room)
    if kick == STANDARD:
        return
    for a in range(3 * count):
        store(room.shifted, a, fma(full(shift), load(out, a), load(d, a)))
    if kick == LAZY:
        _change(scratch, count, places[MOVED], places[MOVED], False, room.shifted, out, room)
        add_static(model, MOVED, room.shifted, out, room)
        return
    _change(scratch, count, places[HERE], places[HERE], False, room.shifted, out, room)
    for a in range(3 * count):  # what follows writes over it
        store(room.shifted, a, load(out, a))
    _change(scratch, count, places[HERE], places[ALONG], True, d, out, room)
    for a in range(3 * count):
        store(out, a, load(out, a) + load(room.shifted, a))
    add_static(model, HERE, d, out, room)


@kernel
def pulls_of_pairs(mass, places, first, along, bend, offset, pull):
    """Write the change of the attraction of planets by each other, at the places in columns from `first` on, along
    `offset`; bend : that of its change along a displacement.
    """
    count, a, b = mass.shape[0], first + 1, first + 2
    for i in range(3 * count):
        store(pull, i, full(0.0))
    for i in range(count):
        for j in range(i):
            ux, uy, uz = load(offset, 3 * i), load(offset, 3 * i + 1), load(offset, 3 * i + 2)
            ux, uy, uz = load(offset, 3 * j) - ux, load(offset, 3 * j + 1) - uy, load(offset, 3 * j + 2) - uz
            tx, ty, tz = _of_pair(
                places[j, first] - places[i, first], places[j, a] - places[i, a], places[j, b] - places[i, b],
                along[j, first] - along[i, first], along[j, a] - along[i, a], along[j, b] - along[i, b],
                bend, ux, uy, uz,
            )  # fmt: skip
            mine, other = full(mass[i]), full(mass[j])
            _add_to(pull, 3 * i, other, tx, ty, tz)
            _add_to(pull, 3 * j, -mine, tx, ty, tz)


@kernel
def _change(scratch, count, places, along, bend, d, out, room):
    """Write the change of the interaction along d at some places; bend : that of its change along a displacement."""
    offset, pull = room.offset, room.pull
    to_places(scratch, count, d, offset)
    pulls_of_pairs(room.mass, places, 3, along, bend, offset, pull)
    # m_0 = (m_0 / M_(i-1)) / (1 / M_(i-1))
    central = scratch[CENTRAL, 0] / scratch[INNER, 0]
    hx, hy, hz = full(0.0), full(0.0), full(0.0)
    for back in range(count):
        i = count - 1 - back
        a = 3 * i
        near = _of_pair(
            places[i, 3], places[i, 4], places[i, 5], along[i, 3], along[i, 4], along[i, 5], bend,
            load(offset, a), load(offset, a + 1), load(offset, a + 2),
        )  # fmt: skip
        kepler = _of_pair(
            places[i, 0], places[i, 1], places[i, 2], along[i, 0], along[i, 1], along[i, 2], bend,
            load(d, a), load(d, a + 1), load(d, a + 2),
        )  # fmt: skip
        fx, fy, fz = load(pull, a), load(pull, a + 1), load(pull, a + 2)
        attracting, share = full(constant(scratch, ATTRACTING, i)), full(-constant(scratch, CENTRAL, i))
        outer, inner = full(constant(scratch, OUTER, i)), full(constant(scratch, INNER, i))
        mass, sun = full(constant(scratch, MASS, i)), full(-central)
        store(out, a, fma(attracting, fma(share, near[0], kepler[0]), fma(outer, fx, inner * hx)))
        store(out, a + 1, fma(attracting, fma(share, near[1], kepler[1]), fma(outer, fy, inner * hy)))
        store(out, a + 2, fma(attracting, fma(share, near[2], kepler[2]), fma(outer, fz, inner * hz)))
        hx, hy = fma(mass, fma(sun, near[0], fx), hx), fma(mass, fma(sun, near[1], fy), hy)
        hz = fma(mass, fma(sun, near[2], fz), hz)


@kernel(inline=True)
def _add_to(rows, a, mass, x, y, z):
    store(rows, a, fma(mass, x, load(rows, a)))
    store(rows, a + 1, fma(mass, y, load(rows, a + 1)))
    store(rows, a + 2, fma(mass, z, load(rows, a + 2)))


@kernel(inline=True)
def _of_pair(x, y, z, ex, ey, ez, bend, dx, dy, dz):
    """Return the change of (x, y, z) / r^3, or of its change along (ex, ey, ez), in lanes."""
    X, Y, Z = full(x), full(y), full(z)
    if bend:
        return pull_bend(X, Y, Z, full(ex), full(ey), full(ez), dx, dy, dz)
    return pull_change(X, Y, Z, dx, dy, dz)


@kernel
def to_jacobi(vectors, room):
    """Change eight vectors from the order of the bodies to the planets' order, relative to those inside."""
    planets, scratch, count, kept = room.planets, room.scratch, room.mass.shape[0], room.shifted
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            inside = load(rows, 3 * dominant(planets) + k)
            for i in range(count):
                d = load(rows, 3 * body_of(planets, i) + k) - inside
                store(kept, 3 * i + k, d)
                inside = fma(full(constant(scratch, SHARE, i)), d, inside)
            for i in range(count):
                store(rows, 3 * i + k, load(kept, 3 * i + k))
            store(rows, 3 * count + k, inside)


@kernel
def to_bodies(vectors, room):
    """Undo `to_jacobi`."""
    planets, scratch, count, kept = room.planets, room.scratch, room.mass.shape[0], room.shifted
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            inside = load(rows, 3 * count + k)
            for i in range(count):
                store(kept, 3 * i + k, load(rows, 3 * i + k))
            for back in range(count):
                i = count - 1 - back
                d = load(kept, 3 * i + k)
                inside = fma(full(-constant(scratch, SHARE, i)), d, inside)
                store(rows, 3 * body_of(planets, i) + k, inside + d)
            store(rows, 3 * dominant(planets) + k, inside)
