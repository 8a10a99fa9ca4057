"""A massless particle that is marched by a map on Kepler orbits alone, beside others of its group: from any step of a
block to any other, and in and out of the map, with a copy of what is marched of the planets.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.clocks import step_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import full, lane, load, select, store, unit
from orbits.kernels.maps.jacobi_particles import table_rows
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


class Map(NamedTuple):
    """The map in a block of steps, as a particle that is marched alone needs it.

    method, model, clock, block : as for all particles; rules : see `Rules`; lone : see `Lone`
    storage : the particle's memory as the carry, the scratch of the thread, and tables of its own
    """

    method: Any
    model: Any
    clock: Any
    block: Any
    rules: Any
    lone: Any
    storage: Any


@kernel
def _copy_planets(here, k):
    """Copy what is marched of the planets at the beginning of step k."""
    source = here.block.begun if k == 0 else here.block.carries[k - 1]
    for row in range(here.lone.planets.shape[0]):
        store(here.lone.planets, row, load(source, row))


@kernel(inline=True)
def _with_planets(here):
    """Return the storage with the copy of the planets as the carry."""
    return Storage(here.lone.planets, here.storage.scratch, here.storage.stages, here.storage.share)


@kernel(inline=True)
def state_in(vectors):
    """Return the state that is in (4, padded)."""
    return State(vectors[0], vectors[1], vectors[2], vectors[3])


@kernel
def state_of_planets(here, k):
    """Return the state of the bodies at the beginning of step k, uncorrected, in doubled precision."""
    _copy_planets(here, k)
    state, (_, h) = state_in(here.lone.bodies), step_of(here.clock, k)
    leave(here.method, here.model, h, state, _with_planets(here))
    return state


@kernel(inline=True)
def _alone():
    """Return a particle in the first lane, and none in the others, for `begin_particles`."""
    x, zero = select(unit(0) > 0.0, full(0.0), full(NOWHERE)), full(0.0)
    return Particles(x, x, x, zero, zero, zero, zero, zero, zero, zero, zero, zero)


@kernel
def march_alone(here, track, k, steps, slot):
    """March a particle by the map, from the beginning of step k, to the beginning of a step that the map cannot follow,
    or to the end of the block; return the number of that step, or `steps`. Its memory is then that of this time.

    track, slot : receives its states in this lane, and has that before step k
    """
    method, model, own = here.method, here.model, here.storage
    if k == 0:
        first = Storage(own.carry, own.scratch, here.block.stages[0], own.share)
        carry = begin_particles(method, model, _alone(), first)
    else:
        # The table before a step, of a map that has one, is that after the step before it.
        count = table_rows(here.rules.near.shape[1] - 1)
        for row in range(count if here.block.stages.shape[1] >= 2 * count else 0):
            store(own.stages, row, load(here.block.stages[k - 1], count + row))
        carry = begin_particles(method, model, _alone(), own)
    particle = _alone()
    while k < steps:
        t, h = step_of(here.clock, k)
        storage = Storage(own.carry, own.scratch, here.block.stages[k], own.share)
        particle, following, _, _ = step_particles(method, model, t, h, particle, carry, storage)
        record_one(
            track, k + 1, slot, lane(particle.x, 0), lane(particle.y, 0), lane(particle.z, 0),
            lane(particle.vx, 0), lane(particle.vy, 0), lane(particle.vz, 0),
        )  # fmt: skip
        if lane(encounters_in(here.rules, k, seen_at(track, k), seen_at(track, k + 1)), slot) != 0.0:
            break
        k, carry = k + 1, following
    keep_particles(method, carry, own)
    return k


@kernel
def leave_map(here, k):
    """Return a particle that leaves the map at the beginning of step k, uncorrected, in doubled precision."""
    _copy_planets(here, k)
    lone = here.lone
    particles = lone.columns, lone.memory, lone.retired
    leave_particles(here.method, here.model, state_in(lone.bodies), particles, lone.rows, _with_planets(here))
    return load_particle(lone.columns, 0)


@kernel
def enter_map(here, k, particle):
    """Let a particle enter the map at the beginning of step k."""
    state, lone = state_of_planets(here, k), here.lone
    store_particle(lone.columns, 0, particle)
    store(lone.memory[0], 0, full(0.0))
    store(lone.memory[0], 1, full(0.0))
    particles = lone.columns, lone.memory, lone.retired
    enter_particles(here.method, here.model, state, particles, lone.rows, _with_planets(here))


@kernel(inline=True)
def particle_at(track, k, slot):
    """Return the particle that a track has in a lane at the beginning of step k."""
    row, zero = 6 * k, 0.0
    return Particles(
        track[row, slot], track[row + 1, slot], track[row + 2, slot], zero, zero, zero,
        track[row + 3, slot], track[row + 4, slot], track[row + 5, slot], zero, zero, zero,
    )  # fmt: skip
