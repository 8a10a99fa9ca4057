"""The steps of Wisdom–Holman maps for massless particles, and of planets that leave tables for them."""

from __future__ import annotations

from orbits.integrators.maps.jacobi_form_steps import HALF, LAZY, SHIFT, WHOLE
from orbits.integrators.maps.on_kepler_orbits import keep_particles, taken_particles
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import full, halves
from orbits.kernels.maps.interaction import displace, interact_in, modify_in, registers_of
from orbits.kernels.maps.jacobi import advance_planets, enter_planets, finish_velocities, kick_planets, prepare_room
from orbits.kernels.maps.jacobi_particles import (
    DISPLACED,
    MODIFIED,
    PLAIN,
    drifted_particles,
    half_of_marched,
    interaction,
    joined_marched,
    kicked_particles,
    seen_particles,
    table_rows,
    tabulate,
    tabulate_centres,
    with_interaction,
)
from orbits.kernels.maps.jacobi_particles_entering import enter_among, flow_rows, flowing_particles, leave_among
from orbits.kernels.maps.terms_of_dominant import flow_among, kick_more, strength_of
from orbits.kernels.steps import OK, Particles


@kernel
def _kick_among_particles(registers, model, coefficients, planets, room, stages, first):
    """As `_kick_of_a_step`, with a table for particles, from row `first` of the stages on."""
    strength, count = strength_of(model), strength_of(model).shape[0] - 2
    modified = coefficients[0, LAZY] == 0.0 and coefficients[0, SHIFT] != 0.0
    interact_in(registers, planets, room, count, False)
    if not modified:
        kick_more(model, planets, room)
    tabulate(strength, planets, room, stages, first, PLAIN)
    if modified:
        modify_in(registers, planets, room, count, coefficients[0, SHIFT])
        kick_more(model, planets, room)
        tabulate(strength, planets, room, stages, first, MODIFIED)
    elif coefficients[0, LAZY] != 0.0:
        displace(planets, room, coefficients[0, SHIFT])
        interact_in(registers, planets, room, count, True)
        kick_more(model, planets, room)
        tabulate(strength, planets, room, stages, first, DISPLACED)


@kernel
def begin_among_particles(method, model, t, h, state, storage):
    """As `begin`, with the table before the first step of a block."""
    planets, room = storage.carry, storage.scratch
    prepare_room(strength_of(model), planets, room)
    _kick_among_particles(registers_of(method), model, method.coefficients, planets, room, storage.stages, 0)


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table after it: of the planets to the same bits."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    strength, half, after = model.parameters, coefficients[0, HALF], table_rows(model.parameters.shape[0] - 2)
    advance_planets(planets, room, coefficients[0, WHOLE], half)
    _kick_among_particles(registers_of(method), model, coefficients, planets, room, storage.stages, after)
    finish_velocities(planets, room, half)
    tabulate_centres(strength, planets, room, storage.stages, after)
    return OK, 0, 1


@kernel
def step_with_terms_among_particles(method, model, t, h, state, storage):
    """As `step_with_terms`, with the table after it, and two of the flow of terms."""
    coefficients, planets, room, stages = method.coefficients, storage.carry, storage.scratch, storage.stages
    strength, half = strength_of(model), coefficients[0, HALF]
    count = strength.shape[0] - 2
    after, flows = table_rows(count), flow_rows(count)
    kick_planets(planets, room, half)
    flow_among(model, planets, room, stages, flows, half)
    advance_planets(planets, room, coefficients[0, WHOLE], 0.0)
    finish_velocities(planets, room, 0.0)
    flow_among(model, planets, room, stages, flows + 3 * (count + 1), half)
    _kick_among_particles(registers_of(method), model, coefficients, planets, room, stages, after)
    kick_planets(planets, room, half)
    tabulate_centres(strength, planets, room, stages, after)
    return OK, 0, 1


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry, with g."""
    coefficients, rows, marched = method.coefficients, storage.scratch, taken_particles(particles, storage)
    return with_interaction(model, storage.stages, 0, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles: half a kick, Kepler motions, half a kick. They are returned as observers see
    them.
    """
    marched, (x, y, z, vx, vy, vz) = _stepped(method, model, carry, storage)
    zero = full(0.0)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, 1


@kernel(inline=True)
def _stepped(method, model, carry, storage):
    """Return particles after a step, as they are marched and as observers see them."""
    coefficients, rows, count = method.coefficients, storage.scratch, model.parameters.shape[0] - 2
    half, first = coefficients[0, HALF], table_rows(count)
    marched, ax, ay, az = drifted_particles(carry, coefficients[0, WHOLE], half)
    g = interaction(model, storage.stages, first, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)
    marched = kicked_particles(marched, (ax, ay, az), half, g)
    return marched, seen_particles(storage.stages, first, marched, rows)


@kernel(inline=True)
def begin_pair(method, model, one, two, storages):
    """Return two times eight particles as they are marched."""
    first = begin_particles(method, model, one, storages[0])
    return joined_marched(first, begin_particles(method, model, two, storages[1]))


@kernel(inline=True)
def step_pair(method, model, t, h, one, two, carry, storages):
    """Take one step of two times eight particles, whose instructions alternate."""
    marched, (x, y, z, u, v, w) = _stepped(method, model, carry, storages[0])
    (x0, x1), (y0, y1), (z0, z1) = halves(x), halves(y), halves(z)
    (u0, u1), (v0, v1), (w0, w1), zero = halves(u), halves(v), halves(w), full(0.0)
    one = Particles(x0, y0, z0, zero, zero, zero, u0, v0, w0, zero, zero, zero)
    return one, Particles(x1, y1, z1, zero, zero, zero, u1, v1, w1, zero, zero, zero), marched, 1


@kernel(inline=True)
def keep_pair(method, carry, storages):
    """Write two times eight particles as they are marched into their rows of the carry."""
    keep_particles(method, half_of_marched(carry, 0), storages[0])
    keep_particles(method, half_of_marched(carry, 1), storages[1])


@kernel(inline=True)
def step_particles_with_terms(method, model, t, h, particles, carry, storage):
    """As `step_particles`, with half the flow of terms before and after the Kepler motions."""
    coefficients, rows, count = method.coefficients, storage.scratch, strength_of(model).shape[0] - 2
    half, first, flows = coefficients[0, HALF], table_rows(count), flow_rows(count)
    zero = full(0.0)
    marched = kicked_particles(carry, (zero, zero, zero), half, (carry.gx, carry.gy, carry.gz))
    marched = flowing_particles(model, storage.stages, flows, marched, rows, half)
    marched, ax, ay, az = drifted_particles(marched, coefficients[0, WHOLE], 0.0)
    marched = kicked_particles(marched, (ax, ay, az), 0.0, (carry.gx, carry.gy, carry.gz))
    marched = flowing_particles(model, storage.stages, flows + 3 * (count + 1), marched, rows, half)
    g = interaction(model, storage.stages, first, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)
    marched = kicked_particles(marched, (zero, zero, zero), half, g)
    x, y, z, vx, vy, vz = seen_particles(storage.stages, first, marched, rows)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, 1


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to corrected Jacobi coordinates."""
    planets, room = storage.carry, storage.scratch
    enter_planets(strength_of(model), state.q, state.q_lo, state.p, state.p_lo, planets, room)
    enter_among(model, method.coefficients, planets, room, storage.stages, particles, rows, storage.share)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back; what is marched is lost."""
    planets, room = storage.carry, storage.scratch
    prepare_room(strength_of(model), planets, room)
    leave_among(model, method.coefficients, planets, room, storage.stages, particles, rows, storage.share)
