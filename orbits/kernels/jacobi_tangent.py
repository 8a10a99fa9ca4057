"""Tangent vectors that follow a Wisdom–Holman map of planets in Jacobi coordinates: the exact derivative of each step.

The map is marched again by its own kernels, to the same bits, and the vectors with it: through the derivative of the
Kepler motions (`orbits.kernels.kepler_tangent`) and that of the kicks, and through the stages of the corrector at the
start and for what is seen. A kick by the interaction g of `orbits.kernels.jacobi` changes dv by h times

    plain      Dg dq
    lazy       Dg(q + s g) (dq + s Dg dq)
    modified   Dg (dq + s Dg dq) + s D^2 g (g, dq),      s = h^2/12

and as g is a sum of x / |x|^3 over pairs of places, with the same coefficients its derivative is that of the changes of
these.

A tangent vector has for each planet, in the order of the map, dr' and its velocity, and then those of the centre of
mass: (4, 3 (n + 1), 8) for eight vectors, in the order dq, dq_lo, dv, dv_lo.

Sources: Mikkola & Innanen (1999), Celest. Mech. Dyn. Astron. 74, 59; Rein & Tamayo (2016), MNRAS 459, 2275.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.interaction import (
    ATTRACTING,
    CENTRAL,
    FORCE,
    INNER,
    MASS,
    OUTER,
    ROWS,
    SHARE,
    SHIFTED,
    STATE_ROWS,
    interact,
)
from orbits.kernels.jacobi import (
    enter_planets,
    finish_velocities,
    kick_planets,
    leave_planets,
    move_planets,
    prepare_room,
)
from orbits.kernels.kepler import kepler_increments
from orbits.kernels.kepler_tangent import Flow, flow_change, flow_of, pull_bend, pull_change
from orbits.kernels.lanes import WIDTH, fma, full, load, store
from orbits.kernels.steps import Method, Model, Share, State, Storage, begin, step
from orbits.kernels.summation import accumulate, add_product
from orbits.kernels.tangent import measure

FLOW = 22
"""Numbers of a `Flow`."""

STANDARD, MODIFIED, LAZY = 0, 1, 2
"""The kicks."""

HERE, MOVED, ALONG = 0, 1, 2
"""Rows of `VectorRoom.places`: r' and u, six numbers; those of displaced positions; the displacement of both."""


class VectorRoom(NamedTuple):
    """Workspace for n planets and groups of eight vectors.

    flows : (n, 22), see `Flow`; places : (3, n, 6), see `HERE`
    force : (groups, 3n, 8), the change of the interaction for the last kick; change, shifted, offset, pull : (3n, 8)
    """

    flows: Any
    places: Any
    force: Any
    change: Any
    shifted: Any
    offset: Any
    pull: Any


@kernel
def follow_map(
    form, coefficients, tag, parameters, t, h, q, q_lo, p, p_lo, carry, scratch, stages, steps, kick, scale,
    vectors, growth, room
):  # fmt: skip
    """March the map by `steps` steps from time t, and tangent vectors with it.

    kick : `STANDARD`, `MODIFIED` or `LAZY`; scale : the unit of time in which velocities count in |x|
    vectors : (groups, 4, 3 (n + 1), 8); growth : (groups, 5, 8), see `orbits.kernels.tangent`, or none
    The other arguments are those of `orbits.marching.driver.march`.
    """
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    storage = Storage(carry, scratch, stages, Share(0, 3 * (parameters.shape[0] - 1), None))
    count, half, shift = parameters.shape[0] - 2, 0.5 * h, h * h / 12.0
    begin(method, model, t, h, state, storage)
    place_planets(carry, scratch, count, kick, room.places)
    for group in range(vectors.shape[0]):
        change_of_kick(scratch, count, kick, shift, room.places, vectors[group, 0], room.force[group], room)
    for k in range(steps):
        write_flows(carry, scratch, count, h, half, room.flows)
        step(method, model, t, h, state, storage)
        place_planets(carry, scratch, count, kick, room.places)
        for group in range(vectors.shape[0]):
            own, force = vectors[group], room.force[group]
            move_vectors(room.flows, count, h, half, own, force, room.change)
            change_of_kick(scratch, count, kick, shift, room.places, own[0], force, room)
            kick_vectors(count, half, own, force, room.change)
            if growth.shape[0]:
                measure(abs(t) + k * abs(h), abs(h), scale, own, room.change[:0], growth[group])


@kernel
def enter_with_vectors(coefficients, strength, q, q_lo, p, p_lo, planets, scratch, vectors, room):
    """Change to corrected Jacobi coordinates, with the vectors, (groups, 4, 3 (n + 1), 8): from the order of the bodies
    to that of the map, with the centre of mass at the end.
    """
    enter_planets(strength, q, q_lo, p, p_lo, planets, scratch)
    count = strength.shape[0] - 2
    for group in range(vectors.shape[0]):
        _to_jacobi(planets, scratch, count, vectors[group], room.change)
    _correct(coefficients, planets, scratch, count, 1.0, vectors, room)


@kernel
def leave_with_vectors(coefficients, strength, q, q_lo, p, p_lo, planets, scratch, vectors, room):
    """Undo `enter_with_vectors`; what is marched is lost."""
    prepare_room(strength, planets, scratch)
    count = strength.shape[0] - 2
    _correct(coefficients, planets, scratch, count, -1.0, vectors, room)
    leave_planets(strength, planets, scratch, q, q_lo, p, p_lo)
    for group in range(vectors.shape[0]):
        _to_bodies(planets, scratch, count, vectors[group], room.change)


@kernel
def _correct(coefficients, planets, scratch, count, sign, vectors, room):
    """Apply the corrector, or its inverse for sign = -1; see `orbits.integrators.wisdom_holman`."""
    stages = coefficients.shape[0] - 1
    for i in range(stages):
        row = 1 + i if sign > 0.0 else stages - i
        drift = sign * coefficients[row, 0]
        write_flows(planets, scratch, count, drift, 0.0, room.flows)
        move_planets(planets, scratch, drift, 0.0)
        finish_velocities(planets, scratch, 0.0)
        other = row if sign > 0.0 else row - 1
        length = sign * coefficients[other, 1] if other > 0 else 0.0
        if length != 0.0:
            interact(planets, scratch, count, False)
            place_planets(planets, scratch, count, STANDARD, room.places)
        for group in range(vectors.shape[0]):
            own, force = vectors[group], room.force[group]
            move_vectors(room.flows, count, drift, 0.0, own, force, room.change)
            if length != 0.0:
                change_of_kick(scratch, count, STANDARD, 0.0, room.places, own[0], force, room)
            kick_vectors(count, length, own, force, room.change)
        if length != 0.0:
            kick_planets(planets, scratch, length)


@kernel(inline=True)
def _constant(scratch, row, i):
    return scratch[ROWS * (i // WIDTH) + row, i % WIDTH]


@kernel
def write_flows(planets, scratch, count, h, kick, flows):
    """Write the `Flow` of each planet for a step of h after `kick` times the interaction."""
    for i in range(count):
        first, other, slot = STATE_ROWS * (i // WIDTH), ROWS * (i // WIDTH) + FORCE, i % WIDTH
        x, y, z = planets[first, slot], planets[first + 1, slot], planets[first + 2, slot]
        vx, vy, vz = planets[first + 3, slot], planets[first + 4, slot], planets[first + 5, slot]
        if kick != 0.0:
            vx, vy = fma(kick, scratch[other, slot], vx), fma(kick, scratch[other + 1, slot], vy)
            vz = fma(kick, scratch[other + 2, slot], vz)
        gm = _constant(scratch, ATTRACTING, i)
        dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, gm, h)
        flow = flow_of(x, y, z, vx, vy, vz, gm, h, dx, dy, dz, dvx, dvy, dvz)
        _write(flows[i], flow)


@kernel(inline=True)
def _write(row, flow):
    row[0], row[1], row[2], row[3], row[4], row[5] = flow.x, flow.y, flow.z, flow.vx, flow.vy, flow.vz
    row[6], row[7], row[8], row[9] = flow.f, flow.g, flow.df, flow.dg
    row[10], row[11], row[12] = flow.fa, flow.fb, flow.fc
    row[13], row[14], row[15] = flow.ga, flow.gb, flow.gc
    row[16], row[17], row[18] = flow.ea, flow.eb, flow.ec
    row[19], row[20], row[21] = flow.ha, flow.hb, flow.hc


@kernel(inline=True)
def _read(row):
    return Flow(
        row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9], row[10],
        row[11], row[12], row[13], row[14], row[15], row[16], row[17], row[18], row[19], row[20], row[21],
    )  # fmt: skip


@kernel
def place_planets(planets, scratch, count, kick, places):
    """Write the places at which the derivative of a kick is taken, and for the modified kick the displacement."""
    for i in range(count):
        first, other, slot = STATE_ROWS * (i // WIDTH), ROWS * (i // WIDTH) + SHIFTED, i % WIDTH
        for k in range(3):
            places[HERE, i, k] = planets[first + k, slot]
            places[MOVED if kick == LAZY else ALONG, i, k] = scratch[other + k, slot]
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
            inside = fma(_constant(scratch, SHARE, i), places[i, k], inside)


@kernel
def move_vectors(flows, count, h, kick, vectors, force, change):
    """Advance dq through the Kepler motions, after `kick` times the change of the interaction; `change` receives that
    of dv, by the kick included.
    """
    q, q_lo, v, v_lo = vectors[0], vectors[1], vectors[2], vectors[3]
    for i in range(count):
        a = 3 * i
        kx, ky, kz = full(0.0), full(0.0), full(0.0)
        if kick != 0.0:
            kx, ky, kz = kick * load(force, a), kick * load(force, a + 1), kick * load(force, a + 2)
        vx, vy, vz = load(v, a) + kx, load(v, a + 1) + ky, load(v, a + 2) + kz
        x, y, z = load(q, a), load(q, a + 1), load(q, a + 2)
        dx, dy, dz, dvx, dvy, dvz = flow_change(_read(flows[i]), x, y, z, vx, vy, vz)
        _add(q, q_lo, a, dx, dy, dz)
        store(change, a, dvx + kx)
        store(change, a + 1, dvy + ky)
        store(change, a + 2, dvz + kz)
    for k in range(3):
        a = 3 * count + k
        x, x_lo = add_product(load(q, a), load(q_lo, a), full(h), load(v, a), load(v_lo, a))
        store(q, a, x)
        store(q_lo, a, x_lo)


@kernel(inline=True)
def _add(hi, lo, a, x, y, z):
    b, b_lo = accumulate(load(hi, a), load(lo, a), x)
    c, c_lo = accumulate(load(hi, a + 1), load(lo, a + 1), y)
    d, d_lo = accumulate(load(hi, a + 2), load(lo, a + 2), z)
    store(hi, a, b)
    store(hi, a + 1, c)
    store(hi, a + 2, d)
    store(lo, a, b_lo)
    store(lo, a + 1, c_lo)
    store(lo, a + 2, d_lo)


@kernel
def kick_vectors(count, kick, vectors, force, change):
    """Add `change`, and `kick` times the change of the interaction, to dv, rounded once."""
    for i in range(count):
        a = 3 * i
        x, y, z = load(change, a), load(change, a + 1), load(change, a + 2)
        if kick != 0.0:
            x, y = fma(full(kick), load(force, a), x), fma(full(kick), load(force, a + 1), y)
            z = fma(full(kick), load(force, a + 2), z)
        _add(vectors[2], vectors[3], a, x, y, z)


@kernel
def change_of_kick(scratch, count, kick, shift, places, d, out, room):
    """Write the change of the interaction of a kick along eight vectors.

    d : (3n or more, 8), dr'; out : (3n, 8)
    """
    _change(scratch, count, places[HERE], places[HERE], False, d, out, room)
    if kick == STANDARD:
        return
    for a in range(3 * count):
        store(room.shifted, a, fma(full(shift), load(out, a), load(d, a)))
    if kick == LAZY:
        _change(scratch, count, places[MOVED], places[MOVED], False, room.shifted, out, room)
        return
    _change(scratch, count, places[HERE], places[HERE], False, room.shifted, out, room)
    for a in range(3 * count):  # what follows writes over it
        store(room.shifted, a, load(out, a))
    _change(scratch, count, places[HERE], places[ALONG], True, d, out, room)
    for a in range(3 * count):
        store(out, a, load(out, a) + load(room.shifted, a))


@kernel
def _change(scratch, count, places, along, bend, d, out, room):
    """Write the change of the interaction along d at some places; bend : that of its change along a displacement."""
    offset, pull = room.offset, room.pull
    bx, by, bz = full(0.0), full(0.0), full(0.0)
    for i in range(count):
        x, y, z = load(d, 3 * i), load(d, 3 * i + 1), load(d, 3 * i + 2)
        store(offset, 3 * i, bx + x)
        store(offset, 3 * i + 1, by + y)
        store(offset, 3 * i + 2, bz + z)
        w = full(_constant(scratch, SHARE, i))
        bx, by, bz = fma(w, x, bx), fma(w, y, by), fma(w, z, bz)
        store(pull, 3 * i, full(0.0))
        store(pull, 3 * i + 1, full(0.0))
        store(pull, 3 * i + 2, full(0.0))
    for i in range(count):
        for j in range(i):
            ux, uy, uz = load(offset, 3 * i), load(offset, 3 * i + 1), load(offset, 3 * i + 2)
            ux, uy, uz = load(offset, 3 * j) - ux, load(offset, 3 * j + 1) - uy, load(offset, 3 * j + 2) - uz
            tx, ty, tz = _of_pair(
                places[j, 3] - places[i, 3], places[j, 4] - places[i, 4], places[j, 5] - places[i, 5],
                along[j, 3] - along[i, 3], along[j, 4] - along[i, 4], along[j, 5] - along[i, 5], bend, ux, uy, uz,
            )  # fmt: skip
            mine, other = full(_constant(scratch, MASS, i)), full(_constant(scratch, MASS, j))
            _add_to(pull, 3 * i, other, tx, ty, tz)
            _add_to(pull, 3 * j, -mine, tx, ty, tz)
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
        attracting, share = full(_constant(scratch, ATTRACTING, i)), full(-_constant(scratch, CENTRAL, i))
        outer, inner = full(_constant(scratch, OUTER, i)), full(_constant(scratch, INNER, i))
        mass, sun = full(_constant(scratch, MASS, i)), full(-central)
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
def _to_jacobi(planets, scratch, count, vectors, room):
    """Change eight vectors from the order of the bodies to the planets' order, relative to those inside."""
    numbers = STATE_ROWS * (scratch.shape[0] // ROWS)
    sun = int(planets[numbers, 6])
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            inside = load(rows, 3 * sun + k)
            for i in range(count):
                body = int(planets[numbers + 2 + i // WIDTH, i % WIDTH])
                d = load(rows, 3 * body + k) - inside
                store(room, 3 * i + k, d)
                inside = fma(full(_constant(scratch, SHARE, i)), d, inside)
            for i in range(count):
                store(rows, 3 * i + k, load(room, 3 * i + k))
            store(rows, 3 * count + k, inside)


@kernel
def _to_bodies(planets, scratch, count, vectors, room):
    """Undo `_to_jacobi`."""
    numbers = STATE_ROWS * (scratch.shape[0] // ROWS)
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            inside = load(rows, 3 * count + k)
            for i in range(count):
                store(room, 3 * i + k, load(rows, 3 * i + k))
            for back in range(count):
                i = count - 1 - back
                body = int(planets[numbers + 2 + i // WIDTH, i % WIDTH])
                d = load(room, 3 * i + k)
                inside = fma(full(-_constant(scratch, SHARE, i)), d, inside)
                store(rows, 3 * body + k, inside + d)
            store(rows, 3 * int(planets[numbers, 6]) + k, inside)
