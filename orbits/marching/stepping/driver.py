"""The loops over steps: clock, step and recording.

Arguments of `march` are flat, because Python calls it for each block: five records would cost 9 microseconds, more than
steps of few bodies. What is called once a run, or for thousands of bodies, takes records; for particles at a sample,
records without tags, the types of which take Numba as long as the work on ten particles.
The clock determines when a step begins and how long it is (`orbits.kernels.clocks`).
"""

from __future__ import annotations

from orbits.kernels.barrier import Barrier
from orbits.kernels.binding import dimension
from orbits.kernels.clocks import Clock, step_of, take_step
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.paths import record_carry, record_strip
from orbits.kernels.state import all_finite
from orbits.kernels.steps import (
    NOT_FINITE,
    OK,
    Method,
    Model,
    Share,
    State,
    Storage,
    begin,
    enter,
    enter_particles,
    leave,
    leave_particles,
    record,
    show,
)


@kernel
def march(
    form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, p, p_lo, carry, scratch, stages,
    path, lows, every, kicks, steps
):  # fmt: skip
    """March by `steps` steps.

    timing, numbers, room : the tag of a clock, and its vectors; see `orbits.kernels.clocks`
    q, q_lo, p, p_lo : see `State`; carry, scratch : see `Storage`
    stages : (slots, rows, columns), a slot for each step, or fewer slots that are reused in turn
    path : flat, receives q and p, each padded, at the beginning of each `every`-th step; empty for no recording
    lows : the same for their low parts
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
            record_strip(lows, row, q_lo, p_lo, 0, size)
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
def enter_march_of_particles(form, coefficients, tag, parameters, state, particles, rows, storage):
    """Compute what is marched of particles from what is seen of them and of bodies.

    state, storage : records, see `orbits.kernels.steps`. The carry is a copy of that of the bodies, and is lost; the
        stages are those of a step; the share is of the particles
    particles : (`Columns` of positions and velocities, memory, retired); these and rows : see `enter_particles` there
    """
    enter_particles(Method(form, coefficients), Model(tag, parameters), state, particles, rows, storage)


@kernel
def leave_march_of_particles(form, coefficients, tag, parameters, state, particles, rows, storage):
    """Compute what is seen of particles from what is marched, which is changed: the memory must be a copy as well."""
    leave_particles(Method(form, coefficients), Model(tag, parameters), state, particles, rows, storage)


@kernel
def leave_each(form, coefficients, tag, parameters, h, carries, room, carry, scratch, stages, path):
    """Write the states that are seen where steps left these carries, for a form with `leave`.

    carries : (states, rows, 8); room, carry : workspace, (4, padded), and like one of them
    path : (states, 2 or 4, padded), receives q and p, and their low parts
    The other arguments are those of `march`.
    """
    method, model, size = Method(form, coefficients), Model(tag, parameters), dimension(tag, parameters)
    state, storage = State(room[0], room[1], room[2], room[3]), Storage(carry, scratch, stages[0], Share(0, size, None))
    for i in range(path.shape[0]):
        for row in range(carry.shape[0]):
            for k in range(carry.shape[1]):
                carry[row, k] = carries[i, row, k]
        leave(method, model, h, state, storage)
        for k in range(size):
            path[i, 0, k], path[i, 1, k] = room[0, k], room[2, k]
            if path.shape[1] > 2:
                path[i, 2, k], path[i, 3, k] = room[1, k], room[3, k]


@kernel
def march_together(counters, threads, member, rounds, fresh, method, model, clock, state, room, path, lows, steps):
    """March thousands of bodies as one of several threads: each moves a share of the coordinates.

    rounds : (threads, 8) int64, a row for each thread; its second number is the number of evaluations
    fresh : whether the scratch already holds what `begin` would write
    method, model, clock, state : records, see `orbits.kernels.steps`; room : (carry, scratch, stages)
    path, lows, steps : see `march`
    """
    carry, scratch, stages = room
    size = dimension(model.tag, model.parameters)
    groups = (size + WIDTH - 1) // WIDTH
    start, stop = WIDTH * (groups * member // threads), min(WIDTH * (groups * (member + 1) // threads), size)
    share = Share(start, stop, Barrier(counters, threads, rounds[member]))
    rounds[member, 0], rounds[member, 1] = 0, 0
    if not fresh:
        t, h = step_of(clock, 0)
        begin(method, model, t, h, state, Storage(carry, scratch, stages[0], share))
    for k in range(steps):
        record_strip(path, k, state.q, state.p, start, stop)
        record_strip(lows, k, state.q_lo, state.p_lo, start, stop)
        storage = Storage(carry, scratch, stages[k % stages.shape[0]], share)
        _, _, count = take_step(clock, method, model, k, state, storage)
        rounds[member, 1] += count
