"""Massless particles in the steps of the massive bodies, through their recorded stages: eight in lanes, or one after
another with the stages of each in lanes, as their method does it.
"""

from __future__ import annotations

from orbits.kernels.binding import Tag, kernel_of
from orbits.kernels.clocks import step_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full, lane, load, select, store, unit
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.paths import record_particles
from orbits.kernels.state import load_particles, store_particle, store_particles
from orbits.kernels.steps import (
    NOT_FINITE,
    NOWHERE,
    OK,
    Particles,
    Share,
    Storage,
    begin_pair,
    begin_particles,
    keep_pair,
    keep_particles,
    step_pair,
    step_particles,
)
from orbits.marching.following.contract import Room, has_sample, kept_at
from orbits.marching.following.one_by_one import hide, march_each

GROUP = 2 * WIDTH
"""The particles that are marched in lanes at a time."""


@kernel(inline=True)
def march_in_lanes(own, form, method, model, clock, block, particles, room, p, stop):
    """March the particles p ... stop - 1, two groups of eight or one, in lanes."""
    return _march_groups(method, model, clock, block, particles, room, p, stop)


@verb
def _march_groups(method, model, clock, block, particles, room, p, stop):
    return _march_each if kernel_of(method.types[0], "group") == WIDTH else _march_pair


def _march_each(method, model, clock, block, particles, room, p, stop):
    evaluations = 0
    for first in range(p, stop, WIDTH):
        track = room.track if first == p else room.track[room.track.shape[0] // 2 :]
        own = Room(room.scratch, track, room.observer, room.context, room.evaluations)
        evaluations += _march_eight(method, model, clock, block, particles, own, first, min(first + WIDTH, stop))
    return evaluations


@kernel
def _march_eight(method, model, clock, block, particles, room, p, stop):
    """March eight particles, p ... stop - 1, in lanes."""
    (_, h), steps, columns, retired = step_of(clock, 0), block.count[0], particles.columns, particles.retired
    track, storage, one = room.track, _at(block, particles, room, 0, p), _present(columns, retired, p)
    carry = begin_particles(method, model, one, storage)
    record_particles(track, 0, one.x, one.y, one.z, one.vx, one.vy, one.vz)
    evaluations = 0
    for k in range(steps):
        (t, h), storage = step_of(clock, k), _at(block, particles, room, k, p)
        if has_sample(particles.samples, k):
            _keep_eight(method, particles.samples, room, block.stages[k], k, p, one, carry)
        one, carry, _, count = step_particles(method, model, t, h, one, carry, storage)
        record_particles(track, k + 1, one.x, one.y, one.z, one.vx, one.vy, one.vz)
        evaluations += count * (stop - p)
    keep_particles(method, carry, storage)
    _finish(columns, retired, track, steps, p, one, stop)
    call_observer(room.observer, room.context, track, h, steps, p, stop)
    return evaluations


def _march_pair(method, model, clock, block, particles, room, p, stop):
    """March two groups of eight particles, p ... stop - 1, in lanes, so that their instructions overlap."""
    (_, h), steps, columns, retired = step_of(clock, 0), block.count[0], particles.columns, particles.retired
    track, other = room.track, room.track[room.track.shape[0] // 2 :]
    P = p + WIDTH if p + WIDTH < stop else p
    storages = _at(block, particles, room, 0, p), _at(block, particles, room, 0, P)
    one, two = _present(columns, retired, p), _present(columns, retired, P)
    carry = begin_pair(method, model, one, two, storages)
    record_particles(track, 0, one.x, one.y, one.z, one.vx, one.vy, one.vz)
    record_particles(other, 0, two.x, two.y, two.z, two.vx, two.vy, two.vz)
    evaluations = 0
    for k in range(steps):
        (t, h), storages = step_of(clock, k), (_at(block, particles, room, k, p), _at(block, particles, room, k, P))
        if has_sample(particles.samples, k):
            _keep_pair(method, particles.samples, room, block.stages[k], k, p, P, one, two, carry)
        one, two, carry, count = step_pair(method, model, t, h, one, two, carry, storages)
        # At once, as methods that march other variables need these no longer.
        record_particles(track, k + 1, one.x, one.y, one.z, one.vx, one.vy, one.vz)
        record_particles(other, k + 1, two.x, two.y, two.z, two.vx, two.vy, two.vz)
        evaluations += count * (stop - p)
    keep_pair(method, carry, storages)
    _finish(columns, retired, track, steps, p, one, stop)
    call_observer(room.observer, room.context, track, h, steps, p, stop)
    if p < P:
        _finish(columns, retired, other, steps, P, two, stop)
        call_observer(room.observer, room.context, other, h, steps, P, stop)
    return evaluations


@kernel
def _keep_eight(method, samples, room, stages, k, p, one, carry):
    """Keep particles p ... p + 7 at the beginning of step k, in which there is a sample: not in the loop over steps,
    where registers are scarce.
    """
    keep_particles(method, carry, _kept(samples, room, stages, k, p, one))


@kernel
def _keep_pair(method, samples, room, stages, k, p, P, one, two, carry):
    """The same of particles p ... p + 7 and P ... P + 7."""
    keep_pair(method, carry, (_kept(samples, room, stages, k, p, one), _kept(samples, room, stages, k, P, two)))


@kernel
def _kept(samples, room, stages, k, p, particles):
    """Keep particles p ... p + 7 at the beginning of step k, in which there is a sample; return where their carry is to
    be kept.
    """
    columns, memory = kept_at(samples, k)
    store_particles(columns, p, particles)
    return Storage(memory, room.scratch, stages, Share(p, p + WIDTH, None))


@kernel(inline=True)
def _at(block, particles, room, k, p):
    """Return the storage for particles p ... p + 7 in step k, with the stages of that step."""
    return Storage(particles.memory, room.scratch, block.stages[k], Share(p, p + WIDTH, None))


@kernel
def _present(columns, retired, p):
    """Return particles p ... p + 7, with retired ones far away from all others."""
    particles = load_particles(columns, p)
    there, any_retired = full(1.0), False
    for k in range(WIDTH):
        if retired[p + k, 0] != OK:
            there, any_retired = there - unit(k), True
    if not any_retired:
        return particles
    nowhere, zero = full(NOWHERE), full(0.0)
    return Particles(
        select(there > 0.0, particles.x, nowhere),
        select(there > 0.0, particles.y, nowhere),
        select(there > 0.0, particles.z, nowhere),
        select(there > 0.0, particles.x_lo, zero),
        select(there > 0.0, particles.y_lo, zero),
        select(there > 0.0, particles.z_lo, zero),
        select(there > 0.0, particles.vx, zero),
        select(there > 0.0, particles.vy, zero),
        select(there > 0.0, particles.vz, zero),
        select(there > 0.0, particles.vx_lo, zero),
        select(there > 0.0, particles.vy_lo, zero),
        select(there > 0.0, particles.vz_lo, zero),
    )


@kernel
def _finish(columns, retired, track, steps, p, particles, stop):
    """Store eight particles at the end of a block; retire those whose state is no longer finite."""
    kept = load_particles(columns, p)
    store_particles(columns, p, particles)
    for j in range(p, min(p + WIDTH, stop)):
        if retired[j, 0] != OK:
            _put_back(columns, j, kept)
            hide(track, j, steps)
        elif not _is_finite(track, steps, j - p):
            k = steps
            while k > 0 and not _is_finite(track, k, j - p):
                k -= 1
            retired[j, 0], retired[j, 1] = NOT_FINITE, k


@kernel(inline=True)
def _put_back(columns, j, kept):
    """Write back the state of one particle that was loaded earlier."""
    q, q_lo, v, v_lo = columns
    slot = j % WIDTH
    q[0, j], q[1, j], q[2, j] = lane(kept.x, slot), lane(kept.y, slot), lane(kept.z, slot)
    q_lo[0, j], q_lo[1, j], q_lo[2, j] = lane(kept.x_lo, slot), lane(kept.y_lo, slot), lane(kept.z_lo, slot)
    v[0, j], v[1, j], v[2, j] = lane(kept.vx, slot), lane(kept.vy, slot), lane(kept.vz, slot)
    v_lo[0, j], v_lo[1, j], v_lo[2, j] = lane(kept.vx_lo, slot), lane(kept.vy_lo, slot), lane(kept.vz_lo, slot)


@kernel(inline=True)
def _is_finite(track, k, slot):
    """Return whether a particle's state at the beginning of step k is finite."""
    row = 6 * k
    for i in range(6):  # noqa: SIM110 - Numba compiles loops, not all() of a generator
        if track[row + i, slot] * 0.0 != 0.0:
            return False
    return True


@kernel
def keep_one(samples, k, p, particle, carry):
    """Keep a particle and its carry at the beginning of step k, in which there is a sample."""
    columns, memory = kept_at(samples, k)
    store_particle(columns, p, particle)
    for row in range(carry.shape[0]):
        store(memory[p], row, load(carry, row))


@kernel(inline=True)
def take_whole_step(own, method, model, clock, block, particles, room, k, p, particle):
    """Take a particle through step k of the bodies, in one step; return it, the status and the evaluations."""
    (t, h), carry = step_of(clock, k), particles.memory[p]
    if has_sample(particles.samples, k):
        keep_one(particles.samples, k, p, particle, carry)
    storage = Storage(carry, room.scratch, block.stages[k], Share(p, p + 1, None))
    particle, _, status, count = step_particles(method, model, t, h, particle, carry, storage)
    return particle, status, count


@kernel(inline=True)
def march_one_by_one(own, form, method, model, clock, block, particles, room, first, last):
    """March particles one after another, each with its stages in lanes."""
    return march_each(ONE_BY_ONE, own, method, model, clock, block, particles, room, first, last)


IN_LANES = Tag("particles in lanes", {"march": march_in_lanes, "group": GROUP})
ONE_BY_ONE = Tag("particles one by one", {"march": march_one_by_one, "group": WIDTH, "take_step": take_whole_step})
