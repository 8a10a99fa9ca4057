"""Tangent vectors that follow a Wisdom–Holman map of planets: the exact derivative of each step, stage by stage.

A step of every such map is a sequence of stages, rows (kind, length) that its form gives (`stages_of`): Kepler motions,
kicks, flows of terms. The map is marched by its own kernels, to the same bits. On a copy of its state the stages of the
step are taken one by one, and the vectors with them, each by the derivative of the stage where the copy stands:
`orbits.kernels.tangents.of_kepler_flow`, `of_jacobi_kicks`, `of_heliocentric_kicks`, `of_terms`. As the derivative of
each stage is symplectic wherever it is taken, that of the step is so to round-off. A new method is a new sequence; a
new stage a kind, a motion of the copy and one of the vectors.

What leads from the states that are seen to those that are marched, such as a corrector, is a sequence of stages too,
taken when a march is entered, and backwards when it is left.

A tangent vector has for each planet, in the order of the map, its place and velocity in the coordinates of the map, and
then those of the centre of mass: (4, 3 (n + 1), 8) for eight vectors, in the order dq, dq_lo, dv, dv_lo.

Sources: Mikkola & Innanen (1999), Celest. Mech. Dyn. Astron. 74, 59; Rein & Tamayo (2016), MNRAS 459, 2275.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.flow import kepler_increments
from orbits.kernels.lanes import WIDTH, full, load, store
from orbits.kernels.maps.heliocentric import (
    drift_heliocentric,
    enter_heliocentric,
    kick_heliocentric,
    prepare_heliocentric,
)
from orbits.kernels.maps.interaction import STATE_ROWS, displace, interact, modify
from orbits.kernels.maps.jacobi import enter_planets, finish_velocities, kick_planets, move_planets, prepare_room
from orbits.kernels.maps.stages import DRIFT, FLOW, HELIOCENTRIC_DRIFT, HELIOCENTRIC_KICK, LAZY, MODIFIED, STANDARD
from orbits.kernels.maps.terms_of_dominant import flow, kick_more, strength_of, to_momenta, to_velocities
from orbits.kernels.steps import Method, Model, Share, State, Storage, begin, enter, leave, step
from orbits.kernels.sums.summation import add_product
from orbits.kernels.tangents.of_heliocentric_kicks import (
    from_heliocentric,
    kick_heliocentric_vectors,
    place_heliocentric,
    to_heliocentric,
)
from orbits.kernels.tangents.of_jacobi_kicks import change_of_kick, place_planets, to_bodies, to_jacobi
from orbits.kernels.tangents.of_kepler_flow import Flow, flow_change, flow_of
from orbits.kernels.tangents.of_terms import flow_vectors, momenta_of_vectors, place_static, velocities_of_vectors
from orbits.kernels.tangents.through_stages import measure
from orbits.kernels.tangents.vector_parts import add_three

NUMBERS_OF_A_FLOW = 22
"""Numbers of a `Flow`."""


class VectorRoom(NamedTuple):
    """Workspace for n planets and groups of eight vectors.

    planets, scratch : a copy of what is marched, and its `room`
    gm, mass : (n,), that about which a planet moves, and its own
    flows : (n, 22), see `Flow`; places : (3, n, 6), see `orbits.kernels.tangents.of_jacobi_kicks`
    bends : (3, n, 27), second derivatives of terms, see `orbits.kernels.tangents.of_terms`; pair, curvature : of a pair
        of bodies: the parameters of the terms, and workspace
    force : (groups, 3n, 8), the change of the kick; shifted, offset, pull, further : (3n, 8); rates : (6n, 8)
    """

    planets: Any
    scratch: Any
    gm: Any
    mass: Any
    flows: Any
    places: Any
    bends: Any
    pair: Any
    curvature: Any
    force: Any
    shifted: Any
    offset: Any
    pull: Any
    further: Any
    rates: Any


@kernel
def follow_map(
    form, coefficients, tag, parameters, t, h, q, q_lo, p, p_lo, carry, scratch, stages, steps, program, shift, scale,
    vectors, growth, room
):  # fmt: skip
    """March the map by `steps` steps from time t, and tangent vectors with it.

    program : the stages of a step, (s, 2); shift : h^2/12, of modified and lazy kicks
    scale : the unit of time in which velocities count in |x|
    vectors : (groups, 4, 3 (n + 1), 8); growth : (groups, 5, 8), see `orbits.kernels.tangents.through_stages`, or none
    The other arguments are those of `orbits.marching.stepping.driver.march`.
    """
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    count = strength_of(model).shape[0] - 2
    storage = Storage(carry, scratch, stages, Share(0, 3 * (count + 1), None))
    begin(method, model, t, h, state, storage)
    last = program.shape[0] - 1
    ends_with_kick = _is_kick(int(program[last, 0]))
    _copy(carry, room.planets)
    kicked = False
    for k in range(steps):
        for row in range(last):
            kicked = _take(model, int(program[row, 0]), program[row, 1], kicked, shift, vectors, room)
        if not ends_with_kick:
            kicked = _take(model, int(program[last, 0]), program[last, 1], kicked, shift, vectors, room)
        step(method, model, t, h, state, storage)
        _copy(carry, room.planets)
        if ends_with_kick:  # where the first kick of the next step is: at the same bits in any block of steps
            kicked = _take(model, int(program[last, 0]), program[last, 1], False, shift, vectors, room)
            _copy_velocities(carry, room.planets)
        if growth.shape[0]:
            for group in range(vectors.shape[0]):
                measure(abs(t) + k * abs(h), abs(h), scale, vectors[group], room.pull[:0], growth[group])


@kernel(inline=True)
def _is_kick(kind):
    return kind in (STANDARD, MODIFIED, LAZY)


@kernel(inline=True)
def _is_heliocentric(program):
    return program.shape[0] > 0 and int(program[0, 0]) >= HELIOCENTRIC_DRIFT


@kernel
def _copy(planets, copy):
    for row in range(planets.shape[0]):
        store(copy, row, load(planets, row))


@kernel
def _copy_velocities(planets, copy):
    for row in range((planets.shape[0] - 2) // (STATE_ROWS + 1) * STATE_ROWS):
        if row % 6 >= 3:
            store(copy, row, load(planets, row))


@kernel
def enter_with_vectors(
    form, coefficients, tag, parameters, h, q, q_lo, p, p_lo, carry, scratch, stages, entry, shift, vectors, room
):  # fmt: skip
    """Change to what is marched, with the vectors, (groups, 4, 3 (n + 1), 8): from the order of the bodies to that of
    the map, with the centre of mass at the end; entry : the stages that lead there.
    """
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    strength = strength_of(model)
    count = strength.shape[0] - 2
    storage = Storage(carry, scratch, stages, Share(0, 3 * (count + 1), None))
    heliocentric = _is_heliocentric(entry)
    _copy(carry, room.planets)
    if heliocentric:
        enter_heliocentric(strength, q, q_lo, p, p_lo, room.planets, room.scratch)
    else:
        enter_planets(strength, q, q_lo, p, p_lo, room.planets, room.scratch)
    _keep_masses(strength, room.planets, heliocentric, room)
    central = _central(strength, room.planets)
    for group in range(vectors.shape[0]):
        if heliocentric:
            to_heliocentric(room.planets, room.mass, central, count, vectors[group], room.shifted)
        else:
            to_jacobi(room.planets, room.scratch, count, vectors[group], room.shifted)
    if not heliocentric:
        momenta_of_vectors(model, vectors, room)
        to_momenta(model, room.planets, room.scratch, stages, -1)
    kicked = False
    for row in range(entry.shape[0]):
        kicked = _take(model, int(entry[row, 0]), entry[row, 1], kicked, shift, vectors, room)
    enter(method, model, h, state, storage)


@kernel
def leave_with_vectors(
    form, coefficients, tag, parameters, h, q, q_lo, p, p_lo, carry, scratch, stages, entry, shift, vectors, room
):  # fmt: skip
    """Undo `enter_with_vectors`; what is marched is lost."""
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    strength = strength_of(model)
    count = strength.shape[0] - 2
    storage = Storage(carry, scratch, stages, Share(0, 3 * (count + 1), None))
    heliocentric = _is_heliocentric(entry)
    _copy(carry, room.planets)
    if heliocentric:
        prepare_heliocentric(strength, room.planets, room.scratch)
    else:
        prepare_room(strength, room.planets, room.scratch)
    kicked = False
    for back in range(entry.shape[0]):
        row = entry.shape[0] - 1 - back
        kicked = _take(model, int(entry[row, 0]), -entry[row, 1], kicked, shift, vectors, room)
    if not heliocentric:
        to_velocities(model, room.planets, room.scratch, stages, -1)
        velocities_of_vectors(model, vectors, room)
    leave(method, model, h, state, storage)
    central = _central(strength, room.planets)
    for group in range(vectors.shape[0]):
        if heliocentric:
            from_heliocentric(room.planets, room.mass, central, count, vectors[group], room.shifted)
        else:
            to_bodies(room.planets, room.scratch, count, vectors[group], room.shifted)


@kernel(inline=True)
def _central(strength, planets):
    """Return GM of the dominant body, also of one that is alone."""
    return strength[1 + int(planets[planets.shape[0] // (STATE_ROWS + 1) * STATE_ROWS, 6])]


@kernel
def _keep_masses(strength, planets, heliocentric, room):
    """Write GM of the planets, and that about which each of them moves, in their order."""
    numbers = planets.shape[0] // (STATE_ROWS + 1) * STATE_ROWS
    central = _central(strength, planets)
    inside = central
    for i in range(strength.shape[0] - 2):
        gm = strength[1 + int(planets[numbers + 2 + i // WIDTH, i % WIDTH])]
        inside += gm
        room.mass[i], room.gm[i] = gm, central if heliocentric else inside


@kernel
def _take(model, kind, length, kicked, shift, vectors, room):
    """Take a stage, of the copy and of the vectors. Returns whether the change of a kick is known where they are.

    kicked : whether it is known before
    """
    planets, scratch, count = room.planets, room.scratch, room.mass.shape[0]
    if kind in (DRIFT, HELIOCENTRIC_DRIFT):
        write_flows(planets, room.gm, length, room.flows)
        if kind == DRIFT:
            move_planets(planets, scratch, length, 0.0)
            finish_velocities(planets, scratch, 0.0)
        else:
            drift_heliocentric(planets, scratch, length)
        for group in range(vectors.shape[0]):
            move_vectors(room.flows, count, length, vectors[group])
        return False
    if kind == FLOW:
        flow(model, planets, scratch, length)
        flow_vectors(model, length, vectors, room)
        return False
    if kind == HELIOCENTRIC_KICK:
        place_heliocentric(planets, room.places)
        kick_heliocentric(planets, scratch, count, length)
        central = _central(strength_of(model), planets)
        for group in range(vectors.shape[0]):
            kick_heliocentric_vectors(room.mass, central, length, vectors[group], room)
        return False
    if not kicked:
        _place_kick(model, kind, shift, room)
        for group in range(vectors.shape[0]):
            change_of_kick(model, kind, shift, vectors[group, 0], room.force[group], room)
    kick_planets(planets, scratch, length)
    for group in range(vectors.shape[0]):
        kick_vectors(count, length, vectors[group], room.force[group])
    return True


@kernel
def _place_kick(model, kind, shift, room):
    """Write the interaction for a kick, and where its derivative is taken."""
    planets, scratch, count = room.planets, room.scratch, room.mass.shape[0]
    interact(planets, scratch, count, False)
    if kind == LAZY:
        kick_more(model, planets, scratch)
        displace(planets, scratch, shift)
        interact(planets, scratch, count, True)
    elif kind == MODIFIED:
        modify(planets, scratch, count, shift)
    kick_more(model, planets, scratch)
    place_planets(planets, scratch, count, kind, room.places)
    place_static(model, kind, room)


@kernel
def write_flows(planets, gm, h, flows):
    """Write the `Flow` of each planet for a Kepler motion of h."""
    for i in range(gm.shape[0]):
        first, slot = STATE_ROWS * (i // WIDTH), i % WIDTH
        x, y, z = planets[first, slot], planets[first + 1, slot], planets[first + 2, slot]
        vx, vy, vz = planets[first + 3, slot], planets[first + 4, slot], planets[first + 5, slot]
        dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, gm[i], h)
        flow = flow_of(x, y, z, vx, vy, vz, gm[i], h, dx, dy, dz, dvx, dvy, dvz)
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
def move_vectors(flows, count, h, vectors):
    """Advance vectors through the Kepler motions."""
    q, q_lo, v, v_lo = vectors[0], vectors[1], vectors[2], vectors[3]
    for i in range(count):
        a = 3 * i
        x, y, z = load(q, a), load(q, a + 1), load(q, a + 2)
        vx, vy, vz = load(v, a), load(v, a + 1), load(v, a + 2)
        dx, dy, dz, dvx, dvy, dvz = flow_change(_read(flows[i]), x, y, z, vx, vy, vz)
        add_three(q, q_lo, a, dx, dy, dz)
        add_three(v, v_lo, a, dvx, dvy, dvz)
    for k in range(3):
        a = 3 * count + k
        x, x_lo = add_product(load(q, a), load(q_lo, a), full(h), load(v, a), load(v_lo, a))
        store(q, a, x)
        store(q_lo, a, x_lo)


@kernel
def kick_vectors(count, kick, vectors, force):
    """Add `kick` times the change of the interaction to dv."""
    for i in range(count):
        a = 3 * i
        x, y, z = kick * load(force, a), kick * load(force, a + 1), kick * load(force, a + 2)
        add_three(vectors[2], vectors[3], a, x, y, z)
