"""Tangent vectors that follow a Wisdom–Holman map of planets: the exact derivative of each step, stage by stage.

A step of every such map is a sequence of stages, rows (kind, length) of its program: Kepler motions,
kicks, flows of terms. The map is marched by its own kernels, to the same bits. On a copy of its state the stages of the
step are taken one by one, and the vectors with them, each by the derivative of the stage where the copy stands:
`orbits.kernels.tangents.of_kepler_flow`, `map_stages`. As the derivative of each stage is symplectic wherever it is
taken, that of the step is so to round-off. A new method is a new sequence; a new stage a kind, a motion of the copy and
one of the vectors.

What leads from the states that are seen to those that are marched, such as a corrector, is a sequence of stages too,
taken when a march is entered, and backwards when it is left. The change of coordinates is linear, so that vectors go
through that of states.

A tangent vector has for each planet, in the order of the map, its place and velocity in the coordinates of the map, and
then those of the centre of mass: (4, 3 (n + 1), 8) for eight vectors, in the order dq, dq_lo, dv, dv_lo.

Sources: Mikkola & Innanen (1999), Celest. Mech. Dyn. Astron. 74, 59; Rein & Tamayo (2016), MNRAS 459, 2275.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full, load, store
from orbits.kernels.maps.jacobi_stages import NO_TABLE, evaluate_kick, kick_planets
from orbits.kernels.maps.layout import (
    FORCE,
    ROWS,
    STATE_ROWS,
    body_of,
    copy_rows,
    dominant,
    registers_in,
)
from orbits.kernels.maps.orbits import change_of_place, change_of_velocity, kicked, orbits_of
from orbits.kernels.maps.programs import (
    DRIFT,
    FLOW,
    KIND,
    LAZY,
    LENGTH,
    MODIFIED,
    SHIFT,
    STANDARD,
    programs_of,
    stage_of,
)
from orbits.kernels.maps.stages import enter_coordinates, is_heliocentric, leave_coordinates, prepare, take
from orbits.kernels.maps.terms_by_kind import strength_of
from orbits.kernels.maps.terms_of_dominant import change_variables
from orbits.kernels.maps.threes import load_three, store_three, times
from orbits.kernels.steps import Method, Model, begin, step
from orbits.kernels.sums.summation import add_product
from orbits.kernels.tangents.map_stages import (
    add_three,
    change_of_kick,
    change_variables_of_vectors,
    flow_vectors,
    kick_heliocentric_vectors,
)
from orbits.kernels.tangents.of_kepler_flow import Flow, flow_change, flow_of
from orbits.kernels.tangents.through_stages import measure

NUMBERS_OF_A_FLOW = 3 + 3 + 4 * 4
"""Numbers of a `Flow`."""

UNKNOWN, KNOWN = 0, 1
"""What is known of a kick at a place: nothing; or the interaction, and its change along the vectors."""


class VectorRoom(NamedTuple):
    """Workspace for n planets and groups of eight vectors.

    planets, scratch : a copy of what is marched, and its `room`; another : a second copy
    state : (4, padded), q, q_lo, v, v_lo of all bodies
    gm : (registers, 8), that about which a planet moves; mass : (n,), its own
    flows : (registers, 22, 8), see `Flow`
    numbers : (8, 3n, 16), see `orbits.kernels.tangents.map_stages`; force : (groups, 3n, 8), the change of the kick
    """

    planets: Any
    scratch: Any
    another: Any
    state: Any
    gm: Any
    mass: Any
    flows: Any
    numbers: Any
    force: Any


@kernel
def follow_map(form, coefficients, tag, parameters, t, h, state, storage, steps, scale, fan, room):
    """March the map by `steps` steps from time t, and tangent vectors with it.

    form, coefficients, tag, parameters : of the method and of the Lagrangian; see `orbits.kernels.steps`
    scale : the unit of time in which velocities count in |x|
    fan : vectors (groups, 4, 3 (n + 1), 8), no kicks, and their growth; see `orbits.kernels.tangents.through_stages`
    """
    method, model, carry, scratch = Method(form, coefficients), Model(tag, parameters), storage.carry, storage.scratch
    vectors, kicks, growth = fan
    begin(method, model, t, h, state, storage)
    _, program = programs_of(coefficients)
    last = program.shape[0] - 1
    final, length = int(program[last, KIND]), program[last, LENGTH]
    ends_with_kick = final in (STANDARD, MODIFIED, LAZY)
    motion = last - 1 if ends_with_kick else last
    ends_with_motion = int(program[motion, KIND]) == DRIFT  # whose end the step itself tells
    copy_rows(carry, room.planets)
    known = UNKNOWN
    for k in range(steps):
        for row in range(motion if ends_with_motion else motion + 1):
            known = _take(method, model, int(program[row, KIND]), program[row, LENGTH], known, vectors, room)
        step(method, model, t, h, state, storage)
        if ends_with_motion:
            write_flows(room.planets, carry, scratch, -length if ends_with_kick else 0.0, program[motion, LENGTH], room)
        copy_rows(carry, room.planets)
        if ends_with_motion:
            _move(program[motion, LENGTH], vectors, room)
        known = UNKNOWN
        if ends_with_kick:  # where the first kick of the next step is: at the same bits in any block of steps
            _copy_force(scratch, room.scratch)
            _kick_vectors(method, model, final, length, UNKNOWN, vectors, room)
            known = KNOWN
        if growth.shape[0]:
            for group in range(vectors.shape[0]):
                measure(abs(t) + k * abs(h), abs(h), scale, vectors[group], kicks[group], growth[group])


@kernel
def enter_with_vectors(form, coefficients, tag, parameters, state, carry, vectors, room):
    """Change to what is marched, with the vectors, (groups, 4, 3 (n + 1), 8): from the order of the bodies to that of
    the map, with the centre of mass at the end.
    """
    method, model, planets = Method(form, coefficients), Model(tag, parameters), room.planets
    strength = strength_of(model)
    copy_rows(carry, planets)
    enter_coordinates(method, strength, state.q, state.q_lo, state.p, state.p_lo, planets, room.scratch)
    _keep_masses(method, strength, room)
    for group in range(vectors.shape[0]):
        _enter_coordinates(method, strength, vectors[group], room)
    change_variables_of_vectors(model, -1.0, vectors, room)
    change_variables(model, planets, room.scratch, room.scratch, NO_TABLE, -1.0)
    _take_entry(method, model, False, vectors, room)
    copy_rows(planets, carry)


@kernel
def leave_with_vectors(form, coefficients, tag, parameters, state, carry, vectors, room):
    """Undo `enter_with_vectors`; what is marched is lost."""
    method, model, planets = Method(form, coefficients), Model(tag, parameters), room.planets
    strength = strength_of(model)
    copy_rows(carry, planets)
    prepare(method, strength, planets, room.scratch)
    _take_entry(method, model, True, vectors, room)
    change_variables_of_vectors(model, 1.0, vectors, room)
    change_variables(model, planets, room.scratch, room.scratch, NO_TABLE, 1.0)
    leave_coordinates(method, strength, planets, room.scratch, state.q, state.q_lo, state.p, state.p_lo)
    for group in range(vectors.shape[0]):
        _leave_coordinates(method, strength, vectors[group], room)


@kernel
def _enter_coordinates(method, strength, vectors, room):
    """Change eight vectors from those of the bodies to those of the planets and the centre of mass."""
    n, state, planets = strength.shape[0] - 1, room.state, room.another
    copy_rows(room.planets, planets)
    for lane in range(WIDTH):
        for part in range(4):
            for a in range(3 * n):
                state[part, a % 3 * n + a // 3] = vectors[part, a, lane]
        enter_coordinates(method, strength, state[0], state[1], state[2], state[3], planets, room.scratch)
        for part in range(4):
            for a in range(3 * n):
                row, slot = _element(planets, n - 1, part, a)
                vectors[part, a, lane] = planets[row, slot]


@kernel
def _leave_coordinates(method, strength, vectors, room):
    """Undo `_enter_coordinates`."""
    n, state, planets = strength.shape[0] - 1, room.state, room.another
    copy_rows(room.planets, planets)
    for lane in range(WIDTH):
        for part in range(4):
            for a in range(3 * n):
                row, slot = _element(planets, n - 1, part, a)
                planets[row, slot] = vectors[part, a, lane]
        leave_coordinates(method, strength, planets, room.scratch, state[0], state[1], state[2], state[3])
        for part in range(4):
            for a in range(3 * n):
                vectors[part, a, lane] = state[part, a % 3 * n + a // 3]


@kernel(inline=True)
def _element(planets, count, part, a):
    """Return where the array of planets has row a of a part of a vector: row and column."""
    i, component, low = a // 3, a % 3 + part // 2 * 3, part % 2
    if i == count:
        return STATE_ROWS * registers_in(planets) + low, component
    return STATE_ROWS * (i // WIDTH) + component + 6 * low, i % WIDTH


@verb
def _adds_up(method):
    """Return whether a planet moves about all bodies inside it, and not about the dominant one alone."""
    return (lambda method: False) if is_heliocentric(method) else (lambda method: True)


@kernel
def _keep_masses(method, strength, room):
    """Write GM of the planets, and that about which each of them moves, in their order."""
    inside = strength[1 + dominant(room.planets)]
    for i in range(strength.shape[0] - 2):
        gm = strength[1 + body_of(room.planets, i)]
        if _adds_up(method):
            inside += gm
        room.mass[i], room.gm[i // WIDTH, i % WIDTH] = gm, inside


@kernel
def _take_entry(method, model, leaving, vectors, room):
    """Take the stages of the entry, or back."""
    entry, _ = programs_of(method.coefficients)
    for i in range(entry.shape[0]):
        kind, length = stage_of(entry, i, leaving)
        _take(method, model, kind, length, UNKNOWN, vectors, room)


@kernel(inline=True)
def _take(method, model, kind, length, known, vectors, room):
    """Take a stage, of the copy and of the vectors. Returns what is known of a kick where they are; known : before."""
    planets, scratch = room.planets, room.scratch
    if kind == DRIFT:
        copy_rows(planets, room.another[: STATE_ROWS * registers_in(planets)])
        take(method, model, kind, length, planets, scratch, scratch, False)
        write_flows(room.another, planets, scratch, 0.0, length, room)
        _move(length, vectors, room)
        return UNKNOWN
    if kind == FLOW:
        flow_vectors(model, length, vectors, room)
        take(method, model, kind, length, planets, scratch, scratch, False)
        return UNKNOWN
    _kick(method, model, kind, length, known, vectors, room)
    return KNOWN


@kernel(inline=True)
def _copy_force(scratch, copy):
    """Copy the interaction of the planets."""
    for first in range(FORCE, copy.shape[0] - WIDTH, ROWS):
        store_three(copy, first, load_three(scratch, first))


@kernel(inline=True)
def _move(length, vectors, room):
    """Advance the vectors through the Kepler motions of `write_flows`."""
    for group in range(vectors.shape[0]):
        move_vectors(room.flows, room.mass.shape[0], length, vectors[group])


@verb
def _kick(method, model, kind, length, known, vectors, room):
    """Take a kick; known : what is known of it where the planets are."""
    return _kick_in_heliocentric if is_heliocentric(method) else _kick_in_jacobi


def _kick_in_heliocentric(method, model, kind, length, known, vectors, room):
    for group in range(vectors.shape[0]):
        kick_heliocentric_vectors(strength_of(model), length, vectors[group], room)
    take(method, model, kind, length, room.planets, room.scratch, room.scratch, False)


def _kick_in_jacobi(method, model, kind, length, known, vectors, room):
    planets, scratch, shift = room.planets, room.scratch, method.coefficients[0, SHIFT]
    if known == UNKNOWN:
        evaluate_kick(None, model, kind, shift, planets, scratch, scratch, NO_TABLE)
    _kick_vectors(method, model, kind, length, known, vectors, room)
    kick_planets(planets, scratch, length)


@kernel(inline=True)
def _kick_vectors(method, model, kind, length, known, vectors, room):
    """Take a kick of the vectors alone, in Jacobi coordinates; known : as before, of how it changes along them."""
    for group in range(vectors.shape[0]):
        force = room.force[group]
        if known == UNKNOWN:
            change_of_kick(model, kind, method.coefficients[0, SHIFT], vectors[group, 0], force, room)
        kick_vectors(room.mass.shape[0], length, vectors[group], force)


@kernel
def write_flows(before, after, scratch, kick, h, room):
    """Write the `Flow` of each planet in a Kepler motion of h.

    before, after : where it began, and where it ended but for a kick by the interaction of `scratch`, which leads back
    """
    for register in range(room.gm.shape[0]):
        first, rows = STATE_ROWS * register, room.flows[register]
        start, end = orbits_of(full(0.0), before[first:]), orbits_of(full(0.0), after[first:])
        if kick != 0.0:
            end = kicked(end, times(kick, load_three(scratch, ROWS * register + FORCE)))
        way, change = change_of_place(start, end), change_of_velocity(start, end)
        flow = flow_of(start.place, start.velocity, load(room.gm, register), full(h), way, change)
        store_three(rows, 0, flow.place)
        store_three(rows, 3, flow.velocity)
        _store_four(rows, 6, flow.f)
        _store_four(rows, 10, flow.g)
        _store_four(rows, 14, flow.df)
        _store_four(rows, 18, flow.dg)


@kernel(inline=True)
def _store_four(rows, first, values):
    store_three(rows, first, values)
    store(rows, first + 3, values[3])


@kernel(inline=True)
def _flow_at(flows, i):
    """Return the `Flow` of planet i."""
    f, k = flows[i // WIDTH], i % WIDTH
    place, velocity = (f[0, k], f[1, k], f[2, k]), (f[3, k], f[4, k], f[5, k])
    return Flow(place, velocity, _four(f, 6, k), _four(f, 10, k), _four(f, 14, k), _four(f, 18, k))


@kernel(inline=True)
def _four(rows, first, k):
    return rows[first, k], rows[first + 1, k], rows[first + 2, k], rows[first + 3, k]


@kernel
def move_vectors(flows, count, h, vectors):
    """Advance vectors through the Kepler motions."""
    q, q_lo, v, v_lo = vectors[0], vectors[1], vectors[2], vectors[3]
    for i in range(count):
        a = 3 * i
        way, change = flow_change(_flow_at(flows, i), load_three(q, a), load_three(v, a))
        add_three(q, q_lo, a, way)
        add_three(v, v_lo, a, change)
    for k in range(3):
        a = 3 * count + k
        x, x_lo = add_product(load(q, a), load(q_lo, a), full(h), load(v, a), load(v_lo, a))
        store(q, a, x)
        store(q_lo, a, x_lo)


@kernel
def kick_vectors(count, kick, vectors, force):
    """Add `kick` times the change of the interaction to dv."""
    for i in range(count):
        add_three(vectors[2], vectors[3], 3 * i, times(kick, load_three(force, 3 * i)))
