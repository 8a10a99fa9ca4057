"""The derivatives of terms of the dominant body in Wisdom–Holman maps: of their kicks, and of their flows.

With the notation of `orbits.kernels.maps.terms_of_dominant`, the derivatives of a term l(u, w) per mass are the block
of its `hessians` for a pair of bodies, the dominant one and a planet. A kick by a term of positions alone changes with

    dg = l_uu du

and the flow of all others, by the midpoint rule with the momenta v', with the rates R, which are linear in

    dR_r = -J (l_wu du + l_ww dw),     dR_v = J (l_uu du + l_uw dw)
    du = S (dr' + h/2 dR_r),           dw = S (dv' + h/2 dR_v + dR_r)

where S leads from Jacobi coordinates to places relative to the dominant body, and J is its transpose with masses. They
are solved as the flow is, by iteration: with two sweeps where momenta differ little from m v.
"""

from __future__ import annotations

from orbits.kernels.binding import adding, other_terms
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import fma, full, load, store
from orbits.kernels.maps.layout import RATE, SHARE, constant, coordinate
from orbits.kernels.maps.programs import LAZY
from orbits.kernels.maps.terms_by_kind import depends_on_positions, depends_on_velocities, is_of_positions
from orbits.kernels.maps.terms_of_dominant import MORE, QUICK, WEAK
from orbits.kernels.tangents.vector_parts import ALONG, HERE, MOVED, add_from_places, add_three, to_places

PAIR = 6
"""Coordinates of a pair of bodies."""

BENDS, PAIR_NUMBERS = 27, 3 * PAIR * PAIR + 2 * PAIR
"""Numbers of the second derivatives of a planet; and of the workspace: those of a pair, its places and velocities."""


_bends_of_kicks = adding("hessians", optional=True, only=is_of_positions)
_bends_of_flows = adding("hessians", optional=True, only=lambda term: not is_of_positions(term))


@kernel(inline=True)
def _clear(curvature):
    for k in range(curvature.shape[0]):
        curvature[k] = 0.0


@kernel
def _keep(curvature, gm, out):
    """Write l_uu, l_uw and l_ww, nine numbers each, from the second derivatives of a pair."""
    for block in range(3):
        for a in range(3):
            for c in range(3):
                at = (block * PAIR + 2 * a + 1) * PAIR + 2 * c + 1
                out[9 * block + 3 * a + c] = curvature[at] / gm


@kernel
def _place_kick(tags, pair, room, which):
    """Write the second derivatives of terms of positions alone at one set of places."""
    strength, q, v = pair[0], room.curvature[3 * PAIR * PAIR :], room.curvature[3 * PAIR * PAIR + PAIR :]
    curvature = room.curvature[: 3 * PAIR * PAIR]
    for i in range(room.mass.shape[0]):
        strength[2] = room.mass[i]
        for k in range(3):
            q[2 * k], q[2 * k + 1], v[2 * k], v[2 * k + 1] = 0.0, room.places[which, i, 3 + k], 0.0, 0.0
        _clear(curvature)
        _bends_of_kicks(tags, strength, pair[1:], 0.0, q, v, curvature)
        _keep(curvature, room.mass[i], room.bends[which, i])


@verb
def place_static(model, kind, room):
    """Write the second derivatives of terms of positions alone at the places of a kick; without any, nothing."""
    if not depends_on_positions(model):
        return lambda model, kind, room: None

    def place(model, kind, room):
        _place_kick(other_terms(model.tag), room.pair, room, HERE)
        if kind == LAZY:
            _place_kick(other_terms(model.tag), room.pair, room, MOVED)

    return place


@kernel
def _bend(bends, block, turned, d, pull, fresh):
    """Write, or add, a block of second derivatives times vectors; turned : the transpose of the block."""
    for i in range(bends.shape[0]):
        x, y, z = load(d, 3 * i), load(d, 3 * i + 1), load(d, 3 * i + 2)
        for a in range(3):
            one, step = (9 * block + a, 3) if turned else (9 * block + 3 * a, 1)
            value = fma(full(bends[i, one]), x, fma(full(bends[i, one + step]), y, bends[i, one + 2 * step] * z))
            store(pull, 3 * i + a, value if fresh else load(pull, 3 * i + a) + value)


@kernel
def _add_static(scratch, which, d, out, room):
    count = room.mass.shape[0]
    to_places(scratch, count, d, room.offset)
    _bend(room.bends[which], 0, False, room.offset, room.pull, True)
    add_from_places(scratch, count, 1.0, room.pull, out, 0)


@verb
def add_static(model, which, d, out, room):
    """Add the change of kicks by terms of positions alone along eight vectors; without any, nothing is done."""
    if not depends_on_positions(model):
        return lambda model, which, d, out, room: None
    return lambda model, which, d, out, room: _add_static(room.scratch, which, d, out, room)


@kernel
def _place_flow(tags, pair, half, known, room):
    """Write the second derivatives at the midpoint of a flow that has been taken, from the rates in `scratch`.

    half : that of its length; known : 1 if velocities are momenta, which the rates lead to velocities, 0 if they are
        velocities. Returns whether momenta differ much from m v.
    """
    planets, scratch = room.planets, room.scratch
    strength, q, v = pair[0], room.curvature[3 * PAIR * PAIR :], room.curvature[3 * PAIR * PAIR + PAIR :]
    curvature, strong = room.curvature[: 3 * PAIR * PAIR], False
    for k in range(3):
        q[2 * k], v[2 * k] = 0.0, 0.0
    bx, by, bz, bu, bv, bw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(room.mass.shape[0]):
        rx, ry, rz = constant(scratch, RATE, i), constant(scratch, RATE + 1, i), constant(scratch, RATE + 2, i)
        x, y, z = coordinate(planets, 0, i), coordinate(planets, 1, i), coordinate(planets, 2, i)
        u, s, w = coordinate(planets, 3, i), coordinate(planets, 4, i), coordinate(planets, 5, i)
        strong = strong or rx * rx + ry * ry + rz * rz > WEAK * (u * u + s * s + w * w)
        x, y, z = x - half * rx, y - half * ry, z - half * rz
        u = u - half * constant(scratch, RATE + 3, i) + known * rx
        s = s - half * constant(scratch, RATE + 4, i) + known * ry
        w = w - half * constant(scratch, RATE + 5, i) + known * rz
        q[1], q[3], q[5] = bx + x, by + y, bz + z
        v[1], v[3], v[5] = bu + u, bv + s, bw + w
        share = constant(scratch, SHARE, i)
        bx, by, bz = bx + share * x, by + share * y, bz + share * z
        bu, bv, bw = bu + share * u, bv + share * s, bw + share * w
        strength[2] = room.mass[i]
        _clear(curvature)
        _bends_of_flows(tags, strength, pair[1:], 0.0, q, v, curvature)
        _keep(curvature, room.mass[i], room.bends[ALONG, i])
    return strong


@kernel
def _rates(half, known, strong, vectors, room):
    """Write the change of the rates along eight vectors into `room.rates`: of r', then of its velocity."""
    count, scratch, rates, bends = room.mass.shape[0], room.scratch, room.rates, room.bends[ALONG]
    size = 3 * count
    for a in range(2 * size):
        store(rates, a, full(0.0))
    sweeps = 1 if known == 0.0 else (QUICK + 2 * MORE if strong else QUICK)
    for _ in range(sweeps):
        for a in range(size):
            store(room.shifted, a, fma(full(half), load(rates, a), load(vectors[0], a)))
        to_places(scratch, count, room.shifted, room.offset)
        for a in range(size):
            moved = fma(full(half), load(rates, size + a), known * load(rates, a))
            store(room.shifted, a, load(vectors[2], a) + moved)
            store(rates, a, full(0.0))
            store(rates, size + a, full(0.0))
        _bend(bends, 0, False, room.offset, room.pull, True)
        _bend(bends, 1, True, room.offset, room.further, True)
        to_places(scratch, count, room.shifted, room.offset)
        _bend(bends, 1, False, room.offset, room.pull, False)
        _bend(bends, 2, False, room.offset, room.further, False)
        add_from_places(scratch, count, -1.0, room.further, rates, 0)
        add_from_places(scratch, count, 1.0, room.pull, rates, size)


@kernel
def _advance_vectors(h, count, moving, vectors, rates):
    """Add h times the rates to dv', and if `moving` to dr'."""
    for i in range(count):
        a, b = 3 * i, 3 * (count + i)
        if moving:
            add_three(vectors[0], vectors[1], a, h * load(rates, a), h * load(rates, a + 1), h * load(rates, a + 2))
            add_three(vectors[2], vectors[3], a, h * load(rates, b), h * load(rates, b + 1), h * load(rates, b + 2))
        else:
            add_three(vectors[2], vectors[3], a, h * load(rates, a), h * load(rates, a + 1), h * load(rates, a + 2))


@kernel
def _flow_with_vectors(tags, h, vectors, room):
    strong = _place_flow(tags, room.pair, 0.5 * h, 1.0, room)
    for group in range(vectors.shape[0]):
        _rates(0.5 * h, 1.0, strong, vectors[group], room)
        _advance_vectors(h, room.mass.shape[0], True, vectors[group], room.rates)


@verb
def flow_vectors(model, h, vectors, room):
    """Advance vectors by the flow of terms that depend on velocities, of h, which the planets have just taken; without
    any such terms, nothing is done.
    """
    if not depends_on_velocities(model):
        return lambda model, h, vectors, room: None
    return lambda model, h, vectors, room: _flow_with_vectors(other_terms(model.tag), h, vectors, room)


@kernel
def _change_variables(tags, known, sign, vectors, room):
    """Add `sign` times the change of the rates of r' to dv'; known : whether these are of momenta."""
    strong = _place_flow(tags, room.pair, 0.0, 0.0, room)
    for group in range(vectors.shape[0]):
        _rates(0.0, known, strong, vectors[group], room)
        _advance_vectors(sign, room.mass.shape[0], False, vectors[group], room.rates)


@verb
def momenta_of_vectors(model, vectors, room):
    """Change dv' to those of momenta, before the planets' velocities are changed to momenta; without terms that depend
    on velocities nothing is done.
    """
    if not depends_on_velocities(model):
        return lambda model, vectors, room: None
    return lambda model, vectors, room: _change_variables(other_terms(model.tag), 0.0, -1.0, vectors, room)


@verb
def velocities_of_vectors(model, vectors, room):
    """Undo `momenta_of_vectors`, after the planets' momenta have been changed to velocities."""
    if not depends_on_velocities(model):
        return lambda model, vectors, room: None
    return lambda model, vectors, room: _change_variables(other_terms(model.tag), 1.0, 1.0, vectors, room)
