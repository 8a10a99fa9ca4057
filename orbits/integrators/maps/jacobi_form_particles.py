"""The steps of Wisdom–Holman maps for massless particles, and of planets that leave tables for them."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import full, halves
from orbits.kernels.maps.entering import begin_particles as taken_particles
from orbits.kernels.maps.entering import keep_particles
from orbits.kernels.maps.jacobi import prepare_room
from orbits.kernels.maps.jacobi_particles import (
    drifted_particles,
    flowing_particles,
    half_of_marched,
    interaction,
    joined_marched,
    kicked_particles,
    moved_particles,
    seen_at,
    with_interaction,
)
from orbits.kernels.maps.jacobi_stages import evaluate_kick, take_step
from orbits.kernels.maps.jacobi_tables import flow_rows, table_rows, tabulate_centres
from orbits.kernels.maps.layout import registers_of
from orbits.kernels.maps.programs import KICK, LAZY, SHIFT, WHOLE
from orbits.kernels.maps.terms_by_kind import has_terms, strength_of
from orbits.kernels.steps import OK, Particles


@kernel
def begin_among_particles(method, model, t, h, state, storage):
    """As `begin`, with the table before the first step of a block."""
    planets, room, own = storage.carry, storage.scratch, method.coefficients
    prepare_room(strength_of(model), planets, room)
    evaluate_kick(registers_of(method), model, int(own[0, KICK]), own[0, SHIFT], planets, room, storage.stages, 0)
    tabulate_centres(strength_of(model), planets, room, storage.stages, 0)


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table after it, and two of the flow of terms: of the planets to the same bits."""
    planets, room, table, strength = storage.carry, storage.scratch, storage.stages, strength_of(model)
    after, flows = table_rows(strength.shape[0] - 2), flow_rows(strength.shape[0] - 2)
    take_step(registers_of(method), model, method.coefficients, planets, room, table, after, flows)
    tabulate_centres(strength, planets, room, table, after)
    return OK, 0, 1


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry, with g."""
    own, rows, marched = method.coefficients, storage.scratch, taken_particles(method, model, particles, storage)
    return with_interaction(model, storage.stages, 0, own[0, SHIFT], own[0, KICK] == LAZY, marched, rows)


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles: half a kick, Kepler motions, half a kick, with half the flow of terms before
    and after the motions. They are returned as observers see them.
    """
    seen, marched = _stepped(method, model, carry, storage)
    return seen, marched, OK, 1


@kernel(inline=True)
def _stepped(method, model, carry, storage):
    """Return particles after a step, as observers see them and as they are marched."""
    own, rows, table, count = method.coefficients, storage.scratch, storage.stages, strength_of(model).shape[0] - 2
    kick, first, flows = 0.5 * own[0, WHOLE], table_rows(count), flow_rows(count)
    none = 0.0 * carry.gm
    if has_terms(model):
        marched = kicked_particles(carry, (none, none, none), kick, carry.g)
        marched = flowing_particles(model, table, flows, marched, rows, kick)
        marched = moved_particles(marched, own[0, WHOLE])
        marched = flowing_particles(model, table, flows + 3 * (count + 1), marched, rows, kick)
        change = none, none, none
    else:
        marched, change = drifted_particles(carry, own[0, WHOLE], kick, None)
    g = interaction(model, table, first, own[0, SHIFT], own[0, KICK] == LAZY, marched, rows)
    marched = kicked_particles(marched, change, kick, g)
    return seen_at(table, first + count, marched, rows), marched


@kernel(inline=True)
def begin_pair(method, model, one, two, storages):
    """Return two times eight particles as they are marched."""
    first = begin_particles(method, model, one, storages[0])
    return joined_marched(first, begin_particles(method, model, two, storages[1]))


@kernel(inline=True)
def step_pair(method, model, t, h, one, two, carry, storages):
    """Take one step of two times eight particles, whose instructions alternate."""
    seen, marched = _stepped(method, model, carry, storages[0])
    (x0, x1), (y0, y1), (z0, z1) = halves(seen.x), halves(seen.y), halves(seen.z)
    (u0, u1), (v0, v1), (w0, w1), zero = halves(seen.vx), halves(seen.vy), halves(seen.vz), full(0.0)
    one = Particles(x0, y0, z0, zero, zero, zero, u0, v0, w0, zero, zero, zero)
    return one, Particles(x1, y1, z1, zero, zero, zero, u1, v1, w1, zero, zero, zero), marched, 1


@kernel(inline=True)
def keep_pair(method, carry, storages):
    """Write two times eight particles as they are marched into their rows of the carry."""
    keep_particles(method, half_of_marched(carry, 0), storages[0])
    keep_particles(method, half_of_marched(carry, 1), storages[1])
