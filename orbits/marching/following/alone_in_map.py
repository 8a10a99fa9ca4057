"""A massless particle that is marched by a map on Kepler orbits alone, beside others of its group: from any step of a
block to any other, and in and out of the map, with a copy of what is marched of the planets.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.clocks import step_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, lane, load, select, store, unit
from orbits.kernels.maps.jacobi_tables import table_rows
from orbits.kernels.search.encounters_of_particles import encounters_in, seen_at
from orbits.kernels.search.paths import record_one
from orbits.kernels.state import load_particle, store_particle
from orbits.kernels.steps import (
    NOWHERE,
    Particles,
    State,
    Storage,
    begin_particles,
    enter_particles,
    keep_particles,
    leave,
    leave_particles,
    step_particles,
)
from orbits.marching.following.contract import has_sample
from orbits.marching.following.in_lanes import keep_one


class Lone(NamedTuple):
    """The arrays of a particle that is marched alone by the map.

    memory, tables : its memory, (1, 2, 8), and tables of its own; columns : its state, (3, 16) each
    retired, rows : (16, 2) zeros and (16, 8), workspace
    bodies : (4, padded), a state of the bodies; planets : (rows, 8), a copy of what is marched of them
    """

    memory: Any
    tables: Any
    columns: Any
    retired: Any
    rows: Any
    bodies: Any
    planets: Any


class Walk(NamedTuple):
    """What a particle goes through a block of steps with, alone, by the map and by steps of its own.

    method, model, clock, block : as for all particles; rules : see `Rules`; lone : see `Lone`
    storage : the particle's memory as the carry, the scratch of the thread, and tables of its own
    own_method, own_model : of the own steps, and of those of the bodies in whose field they are
    samples : see `orbits.marching.following.contract.SamplesInBlock`
    bodies, stepping : see `orbits.marching.following.particle_excursions.FieldOfPlanets` and
        `orbits.marching.following.own_clocks.OwnStepping`
    """

    method: Any
    model: Any
    clock: Any
    block: Any
    rules: Any
    lone: Any
    storage: Any
    own_method: Any
    own_model: Any
    samples: Any
    bodies: Any
    stepping: Any


@kernel
def _copy_planets(walk, k):
    """Copy what is marched of the planets at the beginning of step k."""
    source = walk.block.begun if k == 0 else walk.block.carries[k - 1]
    for row in range(walk.lone.planets.shape[0]):
        store(walk.lone.planets, row, load(source, row))


@kernel(inline=True)
def _with_planets(walk):
    """Return the storage with the copy of the planets as the carry."""
    return Storage(walk.lone.planets, walk.storage.scratch, walk.storage.stages, walk.storage.share)


@kernel(inline=True)
def state_in(vectors):
    """Return the state that is in (4, padded)."""
    return State(vectors[0], vectors[1], vectors[2], vectors[3])


@kernel
def state_of_planets(walk, k):
    """Return the state of the bodies at the beginning of step k, uncorrected, in doubled precision."""
    _copy_planets(walk, k)
    state, (_, h) = state_in(walk.lone.bodies), step_of(walk.clock, k)
    leave(walk.method, walk.model, h, state, _with_planets(walk))
    return state


@kernel(inline=True)
def _alone():
    """Return a particle in the first lane, and none in the others, for `begin_particles`."""
    x, zero = select(unit(0) > 0.0, full(0.0), full(NOWHERE)), full(0.0)
    return Particles(x, x, x, zero, zero, zero, zero, zero, zero, zero, zero, zero)


@kernel
def march_alone(walk, track, k, steps, p):
    """March particle p by the map, from the beginning of step k, to the beginning of a step that the map cannot follow,
    or to the end of the block; return the number of that step, or `steps`. Its memory is then that of this time.

    track : receives its states in its lane, and has that before step k
    """
    slot = p % WIDTH
    method, model, own = walk.method, walk.model, walk.storage
    if k == 0:
        first = Storage(own.carry, own.scratch, walk.block.stages[0], own.share)
        carry = begin_particles(method, model, _alone(), first)
    else:
        # The table before a step, of a map that has one, is that after the step before it.
        count = table_rows(walk.rules.near.shape[1] - 1)
        for row in range(count if walk.block.stages.shape[1] >= 2 * count else 0):
            store(own.stages, row, load(walk.block.stages[k - 1], count + row))
        carry = begin_particles(method, model, _alone(), own)
    particle = _alone()
    while k < steps:
        t, h = step_of(walk.clock, k)
        storage = Storage(own.carry, own.scratch, walk.block.stages[k], own.share)
        particle, following, _, _ = step_particles(method, model, t, h, particle, carry, storage)
        record_one(
            track, k + 1, slot, lane(particle.x, 0), lane(particle.y, 0), lane(particle.z, 0),
            lane(particle.vx, 0), lane(particle.vy, 0), lane(particle.vz, 0),
        )  # fmt: skip
        if lane(encounters_in(walk.rules, k, seen_at(track, k), seen_at(track, k + 1)), slot) != 0.0:
            break
        k, carry = k + 1, following
        if k < steps and has_sample(walk.samples, k):
            keep_particles(method, carry, own)
            keep_one(walk.samples, k, p, particle_at(track, k, slot), own.carry[0])
    keep_particles(method, carry, own)
    return k


@kernel
def leave_map(walk, k):
    """Return a particle that leaves the map at the beginning of step k, uncorrected, in doubled precision."""
    _copy_planets(walk, k)
    lone = walk.lone
    particles = lone.columns, lone.memory, lone.retired
    leave_particles(walk.method, walk.model, state_in(lone.bodies), particles, lone.rows, _with_planets(walk))
    return load_particle(lone.columns, 0)


@kernel
def enter_map(walk, k, particle):
    """Let a particle enter the map at the beginning of step k."""
    state, lone = state_of_planets(walk, k), walk.lone
    store_particle(lone.columns, 0, particle)
    store(lone.memory[0], 0, full(0.0))
    store(lone.memory[0], 1, full(0.0))
    particles = lone.columns, lone.memory, lone.retired
    enter_particles(walk.method, walk.model, state, particles, lone.rows, _with_planets(walk))


@kernel(inline=True)
def particle_at(track, k, slot):
    """Return the particle that a track has in a lane at the beginning of step k."""
    row, zero = 6 * k, 0.0
    return Particles(
        track[row, slot], track[row + 1, slot], track[row + 2, slot], zero, zero, zero,
        track[row + 3, slot], track[row + 4, slot], track[row + 5, slot], zero, zero, zero,
    )  # fmt: skip
