"""How a Wisdom–Holman map is entered and left: from the states that are seen to those that are marched, of planets and
of massless particles among them, by the stages of the entry; see `orbits.kernels.maps.programs`.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full
from orbits.kernels.maps.jacobi import centre_of, difference_of_pairs, sum_of_pairs
from orbits.kernels.maps.jacobi_particles import (
    ATTRACTED,
    ELSEWHERE,
    NUMBER,
    change_momenta,
    flowing_particles,
    interaction,
    kicked_particles,
    moved_particles,
    present,
    store_marched,
    take_particles,
)
from orbits.kernels.maps.jacobi_stages import NO_TABLE
from orbits.kernels.maps.jacobi_tables import flow_rows
from orbits.kernels.maps.layout import ATTRACTING, constant, coordinate, dominant, rooms
from orbits.kernels.maps.programs import DRIFT, FLOW, programs_of, stage_of
from orbits.kernels.maps.stages import (
    at_the_end,
    enter_coordinates,
    is_heliocentric,
    leave_coordinates,
    origin,
    prepare,
    show_coordinates,
    take,
)
from orbits.kernels.maps.terms_by_kind import has_terms, strength_of
from orbits.kernels.maps.terms_of_dominant import change_variables
from orbits.kernels.search.apsides import apsides
from orbits.kernels.steps import NOWHERE


@kernel
def _take_entry(method, model, leaving, planets, room, table):
    """Take the stages of the entry, or back."""
    entry, _ = programs_of(method.coefficients)
    for i in range(entry.shape[0]):
        kind, length = stage_of(entry, i, leaving)
        take(method, model, kind, length, planets, room, table, False)


@kernel
def enter(method, model, h, state, storage):
    """Change to what is marched: other coordinates, and the program that leads there, such as a corrector."""
    planets, (room, _), table = storage.carry, rooms(storage.carry, storage.scratch), storage.stages
    enter_coordinates(method, strength_of(model), state.q, state.q_lo, state.p, state.p_lo, planets, room)
    change_variables(model, planets, room, table, NO_TABLE, -1.0)
    _take_entry(method, model, False, planets, room, table)


@kernel
def leave(method, model, h, state, storage):
    """Change back; what is marched is lost."""
    planets, (room, _), table = storage.carry, rooms(storage.carry, storage.scratch), storage.stages
    prepare(method, strength_of(model), planets, room)
    _take_entry(method, model, True, planets, room, table)
    change_variables(model, planets, room, table, NO_TABLE, 1.0)
    leave_coordinates(method, strength_of(model), planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies, of methods that march within the first Kepler motion of a step."""
    room, copy = rooms(storage.carry, storage.scratch)
    at_the_end(method, storage.carry, room, copy)
    show_coordinates(method, strength_of(model), copy, room, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Write the constants of the planets."""
    room, _ = rooms(storage.carry, storage.scratch)
    prepare(method, strength_of(model), storage.carry, room)


# ----------------------------------------------------------------------------------------------------- with particles


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry."""
    # Those that are retired are at one place, as the padding is.
    there = 1.0 - (particles.x == NOWHERE) * (particles.y == NOWHERE) * (particles.z == NOWHERE)
    return take_particles(storage.carry, storage.share.start, there, storage.scratch)


@kernel(inline=True)
def keep_particles(method, carry, storage):
    """Write eight particles as they are marched into their rows of the carry."""
    store_marched(storage.carry, storage.share.start, carry, storage.scratch)


@kernel
def _take_among(method, model, kind, length, planets, room, table, particles):
    """Take a stage of the planets, and of particles among them; the first table is overwritten.

    particles : their memory, the status of each, workspace, and the share of them
    """
    memory, retired, rows, share = particles
    take(method, model, kind, length, planets, room, table, True)
    for p in range(share.start, share.stop, WIDTH):
        marched = take_particles(memory, p, present(memory, retired, p), rows)
        if kind == DRIFT:
            marched = moved_particles(marched, length)
        elif kind == FLOW:
            flows = flow_rows(strength_of(model).shape[0] - 2)
            marched = flowing_particles(model, table, flows, marched, rows, length)
        else:
            g = interaction(model, table, 0, 0.0, False, marched, rows)
            zero = full(0.0)
            marched = kicked_particles(marched, (zero, zero, zero), length, g)
        store_marched(memory, p, marched, rows)


@kernel
def _take_entry_among(method, model, leaving, planets, room, table, particles):
    """Take the stages of the entry, or back, of the planets, and of particles among them. About a body that is alone a
    corrector leads back to where it began, but not a single motion, without a kick.
    """
    entry, _ = programs_of(method.coefficients)
    alone = strength_of(model).shape[0] == 2 and not has_terms(model)
    for i in range(entry.shape[0] if entry.shape[0] == 1 or not alone else 0):
        kind, length = stage_of(entry, i, leaving)
        _take_among(method, model, kind, length, planets, room, table, particles)


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Write what is marched of particles, those of the share, from the states that are seen.

    state : of the bodies; their planets become what is marched, in the carry
    particles : their `Columns`, their memory, and their rows of a status, (padded, 2) int64: those with another one
        than 0 are left alone
    """
    planets, (room, _), table = storage.carry, rooms(storage.carry, storage.scratch), storage.stages
    (q, q_lo, v, v_lo), memory, retired = particles
    strength, share = strength_of(model), storage.share
    enter_coordinates(method, strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    flows = flow_rows(strength.shape[0] - 2)
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        own = memory[p]
        if own[0, NUMBER] == 0.0:
            own[0, NUMBER] = 1.0 + _place_among(method, strength, planets, room, q, v, p)
        i = int(own[0, NUMBER]) - 1
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = origin(method, strength, planets, room, i, component)
            axis = component % 3
            own[0, component], own[1, component] = difference_of_pairs(x[axis, p], x_lo[axis, p], hi, lo)
        own[0, ATTRACTED] = constant(room, ATTRACTING, i - 1) if i > 0 else strength[1 + dominant(planets)]
    change_variables(model, planets, room, table, flows, -1.0)
    change_momenta(model, table, (memory, retired, rows, share), -1.0)
    _take_entry_among(method, model, False, planets, room, table, (memory, retired, rows, share))


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Write the states that are seen of particles, in doubled precision.

    The carry, the planets as they are marched, and the memory are lost. The rest is as for `enter_particles`.
    """
    planets, (room, _), table = storage.carry, rooms(storage.carry, storage.scratch), storage.stages
    (q, q_lo, v, v_lo), memory, retired = particles
    strength, share = strength_of(model), storage.share
    prepare(method, strength, planets, room)
    _take_entry_among(method, model, True, planets, room, table, (memory, retired, rows, share))
    change_variables(model, planets, room, table, flow_rows(strength.shape[0] - 2), 1.0)
    change_momenta(model, table, (memory, retired, rows, share), 1.0)
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        own = memory[p]
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = origin(method, strength, planets, room, int(own[0, NUMBER]) - 1, component)
            hi, lo = sum_of_pairs(hi, lo, own[0, component], own[1, component])
            x[component % 3, p], x_lo[component % 3, p] = hi, lo


@verb
def _place_among(method, strength, planets, room, q, v, p):
    """Return the place of a particle: how many planets, from the innermost outwards, have semi-major axes below its
    pericentre distance about the dominant body; in democratic heliocentric coordinates 0.
    """
    if is_heliocentric(method):
        return lambda method, strength, planets, room, q, v, p: 0
    return lambda method, strength, planets, room, q, v, p: _planets_inside(strength, planets, room, q, v, p)


@kernel
def _planets_inside(strength, planets, room, q, v, p):
    x, y, z, vx, vy, vz = (
        q[0, p] - centre_of(strength, planets, room, 0, 0)[0],
        q[1, p] - centre_of(strength, planets, room, 0, 1)[0],
        q[2, p] - centre_of(strength, planets, room, 0, 2)[0],
        v[0, p] - centre_of(strength, planets, room, 0, 3)[0],
        v[1, p] - centre_of(strength, planets, room, 0, 4)[0],
        v[2, p] - centre_of(strength, planets, room, 0, 5)[0],
    )
    pericentre = apsides(strength[1 + dominant(planets)], x, y, z, vx, vy, vz).least
    for i in range(strength.shape[0] - 2):
        r2, v2 = 0.0, 0.0
        for k in range(3):
            r2 += coordinate(planets, k, i) ** 2
            v2 += coordinate(planets, 3 + k, i) ** 2
        # 1/a of a planet
        if not (2.0 / r2**0.5 - v2 / constant(room, ATTRACTING, i)) * pericentre > 1.0:
            return i
    return strength.shape[0] - 2
