"""The loops over steps: clock, step and recording.

Arguments are flat, because Python calls these functions: building records for each call would cost more than a step.
The clock determines when a step begins and how long it is (`orbits.kernels.clocks`).
"""

from __future__ import annotations

import math

from orbits.kernels.barrier import Barrier
from orbits.kernels.binding import dimension
from orbits.kernels.clocks import Clock, step_of, take_step
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, full, lane, select, unit
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.paths import record_carry, record_one, record_particle, record_particles, record_strip
from orbits.kernels.state import (
    Columns,
    all_finite,
    load_particle,
    load_particles,
    store_particle,
    store_particles,
)
from orbits.kernels.steps import (
    BEYOND,
    NOT_FINITE,
    NOWHERE,
    OK,
    Method,
    Model,
    Particles,
    Share,
    State,
    Storage,
    begin,
    begin_pair,
    enter,
    enter_particles,
    keep_pair,
    lanes_of,
    leave,
    leave_particles,
    record,
    show,
    step_pair,
    step_particles,
)


@kernel
def march(
    form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, p, p_lo, carry, scratch, stages,
    path, every, kicks, steps
):  # fmt: skip
    """March by `steps` steps.

    timing, numbers, room : the tag of a clock, and its vectors; see `orbits.kernels.clocks`
    q, q_lo, p, p_lo : see `State`; carry, scratch : see `Storage`
    stages : (slots, rows, columns), a slot for each step, or fewer slots that are reused in turn
    path : flat, receives q and p, each padded, at the beginning of each `every`-th step; empty for no recording
    kicks : (steps, rows, 8), receives the carry after each step, for dense output; (0, rows, 8) for no recording

    Returns (status, steps done, body or coordinate, evaluations).
    """
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    clock, size = Clock(timing, numbers, room), dimension(tag, parameters)
    share = Share(0, size, None)
    t, h = step_of(clock, 0)
    begin(method, model, t, h, state, Storage(carry, scratch, stages[0], share))
    evaluations, slot, left, row = 0, 0, 0, 0
    for k in range(steps):
        if left == 0:
            record(method, model, state, Storage(carry, scratch, stages[slot], share), path, row)
            left, row = every, row + 1
        left -= 1
        storage = Storage(carry, scratch, stages[slot], share)
        status, where, count = take_step(clock, method, model, k, state, storage)
        evaluations += count
        if status != OK:
            return status, k, where, evaluations
        if k < kicks.shape[0]:
            record_carry(kicks, k, carry)
        slot = slot + 1 if slot + 1 < stages.shape[0] else 0
    show(method, model, state, Storage(carry, scratch, stages[slot], share))
    return (OK if all_finite(q, p, size) else NOT_FINITE), steps, 0, evaluations


@kernel
def enter_march(form, coefficients, tag, parameters, h, q, q_lo, p, p_lo, carry, scratch, stages):
    """Compute what is marched from what is seen, for a form with `enter`; the arguments are those of `march`."""
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    enter(method, model, h, state, Storage(carry, scratch, stages[0], Share(0, dimension(tag, parameters), None)))


@kernel
def leave_march(form, coefficients, tag, parameters, h, q, q_lo, p, p_lo, carry, scratch, stages):
    """Compute what is seen from what is marched, which is changed: `carry` must be a copy."""
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    leave(method, model, h, state, Storage(carry, scratch, stages[0], Share(0, dimension(tag, parameters), None)))


@kernel
def enter_march_of_particles(
    form, coefficients, tag, parameters, q, q_lo, p, p_lo, carry, scratch, stages,
    columns, columns_lo, speeds, speeds_lo, memory, retired, rows, start, stop
):  # fmt: skip
    """Compute what is marched of particles start ... stop - 1, in `memory`, from what is seen of them and of bodies.

    carry : that of the bodies, a copy, which is lost; scratch : of the bodies; stages : (rows, columns), of a step
    columns, columns_lo, speeds, speeds_lo : (3, padded), positions and velocities of the particles
    memory, retired, rows : see `orbits.kernels.steps.enter_particles`
    """
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    particles = Columns(columns, columns_lo, speeds, speeds_lo), memory, retired
    enter_particles(method, model, state, particles, rows, Storage(carry, scratch, stages, Share(start, stop, None)))


@kernel
def leave_march_of_particles(
    form, coefficients, tag, parameters, q, q_lo, p, p_lo, carry, scratch, stages,
    columns, columns_lo, speeds, speeds_lo, memory, retired, rows, start, stop
):  # fmt: skip
    """Compute what is seen of particles from what is marched, which is changed: `memory` must be a copy as well."""
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    particles = Columns(columns, columns_lo, speeds, speeds_lo), memory, retired
    leave_particles(method, model, state, particles, rows, Storage(carry, scratch, stages, Share(start, stop, None)))


@kernel
def leave_each(form, coefficients, tag, parameters, h, begun, carries, room, carry, scratch, stages, path):
    """Write the states that are seen at the ends of steps, for a form with `leave`.

    begun, carries : the carry before the first step, and after each, (steps, rows, 8)
    room, carry : workspace, (4, padded), and like `begun`; path : (steps + 1, 2, padded), receives q and p
    The other arguments are those of `march`.
    """
    method, model, size = Method(form, coefficients), Model(tag, parameters), dimension(tag, parameters)
    state, storage = State(room[0], room[1], room[2], room[3]), Storage(carry, scratch, stages[0], Share(0, size, None))
    for step in range(path.shape[0]):
        seen = begun if step == 0 else carries[step - 1]
        for row in range(carry.shape[0]):
            for k in range(carry.shape[1]):
                carry[row, k] = seen[row, k]
        leave(method, model, h, state, storage)
        for k in range(size):
            path[step, 0, k], path[step, 1, k] = room[0, k], room[2, k]


@kernel
def march_to_each(
    form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, p, p_lo, carry, scratch, stages,
    limits, limit, own_numbers, own, own_carry, out
):  # fmt: skip
    """March from one state up to each of several times, in steps that a clock chooses, on a copy.

    limits : (m,), the times; limit : the index of the time limit in the state of the clock, whose next number is set to
        1: the last step ends there
    own_numbers, own, own_carry : workspace like `numbers`, (4, padded) for the state, and like `carry`
    out : (m, 2, size), receives q and p at each
    The other arguments are those of `march`; the state does not change.

    Returns (number of times reached, status of the step that failed).
    """
    method, model, size = Method(form, coefficients), Model(tag, parameters), dimension(tag, parameters)
    clock, share = Clock(timing, own_numbers, room), Share(0, size, None)
    state, storage = State(own[0], own[1], own[2], own[3]), Storage(own_carry, scratch, stages[0], share)
    for i in range(len(limits)):
        for k in range(q.shape[0]):
            own[0, k], own[1, k], own[2, k], own[3, k] = q[k], q_lo[k], p[k], p_lo[k]
        for row in range(carry.shape[0]):
            for k in range(carry.shape[1]):
                own_carry[row, k] = carry[row, k]
        for k in range(len(numbers)):
            own_numbers[k] = numbers[k]
        own_numbers[limit], own_numbers[limit + 1] = limits[i], 1.0
        begin(method, model, numbers[0], 0.0, state, storage)
        status = OK
        while status == OK:
            status, _, _ = take_step(clock, method, model, 0, state, storage)
        if status != BEYOND:
            return i, status
        for k in range(size):
            out[i, 0, k], out[i, 1, k] = own[0, k], own[2, k]
    return len(limits), OK


@kernel
def march_together(
    counters, threads, member, rounds, fresh,
    form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, p, p_lo, carry, scratch, stages, path, steps
):  # fmt: skip
    """March thousands of bodies as one of several threads: each moves a share of the coordinates.

    rounds : (threads, 8) int64, a row for each thread; its second number is the number of evaluations
    fresh : whether the scratch already holds what `begin` would write
    The other arguments are those of `march`.
    """
    method, model, state = Method(form, coefficients), Model(tag, parameters), State(q, q_lo, p, p_lo)
    clock, size = Clock(timing, numbers, room), dimension(tag, parameters)
    groups = (size + WIDTH - 1) // WIDTH
    start, stop = WIDTH * (groups * member // threads), min(WIDTH * (groups * (member + 1) // threads), size)
    share = Share(start, stop, Barrier(counters, threads, rounds[member]))
    rounds[member, 0], rounds[member, 1] = 0, 0
    if not fresh:
        t, h = step_of(clock, 0)
        begin(method, model, t, h, state, Storage(carry, scratch, stages[0], share))
    for k in range(steps):
        record_strip(path, k, q, p, start, stop)
        storage = Storage(carry, scratch, stages[k % stages.shape[0]], share)
        _, _, count = take_step(clock, method, model, k, state, storage)
        rounds[member, 1] += count


@kernel
def march_particles(
    form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, v, v_lo, carry, scratch, stages, retired,
    steps, start, stop, observer, context, track
):  # fmt: skip
    """March massless particles start ... stop - 1 by `steps` steps through the stages of the massive bodies.

    q, q_lo, v, v_lo : (3, padded); carry : (particles, rows, 8); stages : (steps, rows, columns)
    retired : (padded, 2) int64, a row for each particle: why it was retired (0: it was not), and before which step.
        A particle that cannot be stepped is retired alone, and keeps its state before the step
    observer, context : see `orbits.kernels.search.observers`
    track : (rows, 8), receives the states of eight, or of twice eight, particles at the beginning of each step

    Returns the number of evaluations.
    """
    method, model, columns = Method(form, coefficients), Model(tag, parameters), Columns(q, q_lo, v, v_lo)
    clock, storage = Clock(timing, numbers, room), Storage(carry, scratch, stages, Share(0, 0, None))
    block, watched = (steps, start, stop), (observer, context, track)
    return _march_particles(method, model, clock, columns, storage, retired, block, watched)


@verb
def _march_particles(method, model, clock, columns, storage, retired, block, watched):
    """March particles in the layout of their method: eight in lanes, or one with its stages in lanes."""
    march = _march_in_lanes if lanes_of(method) == WIDTH else _march_one_by_one
    return lambda method, model, clock, columns, storage, retired, block, watched: march(
        method, model, clock, columns, storage, retired, block, watched
    )


@kernel(inline=True)
def _march_in_lanes(method, model, clock, columns, storage, retired, block, watched):
    """March two groups of eight particles in lanes, so that their instructions overlap."""
    (steps, start, stop), (_, h) = block, step_of(clock, 0)
    observer, context, track = watched
    other = track[track.shape[0] // 2 :]
    evaluations = 0
    for p in range(start, stop, 2 * WIDTH):
        P = p + WIDTH if p + WIDTH < stop else p
        storages = _at(storage, 0, p, p + WIDTH), _at(storage, 0, P, P + WIDTH)
        one, two = _present(columns, retired, p), _present(columns, retired, P)
        carry = begin_pair(method, model, one, two, storages)
        record_particles(track, 0, one.x, one.y, one.z, one.vx, one.vy, one.vz)
        record_particles(other, 0, two.x, two.y, two.z, two.vx, two.vy, two.vz)
        for k in range(steps):
            (t, h), storages = step_of(clock, k), (_at(storage, k, p, p + WIDTH), _at(storage, k, P, P + WIDTH))
            one, two, carry, count = step_pair(method, model, t, h, one, two, carry, storages)
            # At once, as methods that march other variables need these no longer.
            record_particles(track, k + 1, one.x, one.y, one.z, one.vx, one.vy, one.vz)
            record_particles(other, k + 1, two.x, two.y, two.z, two.vx, two.vy, two.vz)
            evaluations += count * min(2 * WIDTH, stop - p)
        keep_pair(method, carry, storages)
        _finish(columns, retired, track, steps, p, one, stop)
        call_observer(observer, context, track, h, steps, p, stop)
        if p < P:
            _finish(columns, retired, other, steps, P, two, stop)
            call_observer(observer, context, other, h, steps, P, stop)
    return evaluations


@kernel(inline=True)
def _march_one_by_one(method, model, clock, columns, storage, retired, block, watched):
    """March the particles one after another."""
    (steps, start, stop), (_, h) = block, step_of(clock, 0)
    observer, context, track = watched
    evaluations = 0
    for p in range(start, stop):
        lane_of_p = p % WIDTH
        particle, carry, done = load_particle(columns, p), storage.carry[p], 0
        if retired[p, 0] != OK:
            for k in range(steps + 1):
                record_one(track, k, lane_of_p, math.nan, math.nan, math.nan, 0.0, 0.0, 0.0)
        else:
            while done < steps:
                record_particle(track, done, lane_of_p, particle)
                (t, h), now = step_of(clock, done), _at(storage, done, p, p + 1)
                particle, carry, status, count = step_particles(method, model, t, h, particle, carry, now)
                evaluations += count
                if status != OK:
                    retired[p, 0], retired[p, 1] = status, done
                    break
                done += 1
            for k in range(done, steps + 1):
                record_particle(track, k, lane_of_p, particle)
            store_particle(columns, p, particle)
        if lane_of_p == WIDTH - 1 or p == stop - 1:
            call_observer(observer, context, track, h, steps, p - lane_of_p, stop)
    return evaluations


@kernel(inline=True)
def _at(storage, k, start, stop):
    """Return the storage for particles start ... stop - 1 in step k, with the stages of that step."""
    return Storage(storage.carry, storage.scratch, storage.stages[k], Share(start, stop, None))


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
            for k in range(steps + 1):
                track[6 * k, j - p] = math.nan
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
