"""Massless particles that leave a map on Kepler orbits for steps of their own, where it cannot follow them, and return.

For each group of eight, a block of steps is marched in lanes first, as for all particles. One that comes to a step
that the map cannot follow (`orbits.kernels.search.encounters_of_particles`), or that was away when the block began, is
then marched through the block again, alone: by the map up to the beginning of that step, where it leaves with the
planets, uncorrected, in doubled precision; from there on by steps of its own, as among bodies whose steps are chosen
(`orbits.marching.following.own_clocks`); and from the beginning of the first step that the map can take, which may be
in a later block, by the map again. It is entered there as at the start of a run, with a new place in the planets'
order.

The planets within a step are those of one step of Gauss from their uncorrected state at its beginning: off by the
error of the map in one step. All that is known of a particle that is away is its state, in the columns of all, and its
memory: `orbits.kernels.maps.jacobi_particles.ELSEWHERE` in the place of its number, its clock, and L of its last step;
see `BEGUN`. So its way depends neither on blocks nor on any other particle.

It is not reversible in time, nor symplectic: where a particle leaves, and where it returns, depends on the direction.

Source: Chambers (1999), MNRAS 304, 793; Rein et al. (2019), MNRAS 485, 5490.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from orbits.integrators.forms import Array
from orbits.kernels.binding import Tag
from orbits.kernels.clocks import step_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, lane, load, store
from orbits.kernels.maps.jacobi_particles import ELSEWHERE, NUMBER
from orbits.kernels.search.encounters_of_particles import Rules, encountering, may_return, measure_bodies, seen_at
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.paths import record_particle, record_strip
from orbits.kernels.state import load_particle, store_particle
from orbits.kernels.steps import OK, Method, Model, Share, Storage, step
from orbits.marching.clocks.variable_steps import ORIGIN
from orbits.marching.following.alone_in_map import (
    Walk,
    enter_map,
    leave_map,
    march_alone,
    particle_at,
    state_in,
    state_of_planets,
)
from orbits.marching.following.bodies_between import length_of
from orbits.marching.following.contract import Room, has_sample, kept_at
from orbits.marching.following.in_lanes import GROUP, march_in_lanes
from orbits.marching.following.own_clocks import BEFORE, NEXT, REACHED, begin_stepping, follow
from orbits.marching.following.own_steps_log import finish_log, log_state, report_log

SKIPPED = -1
"""The status of a particle that is away, while others are marched in lanes."""

BEGUN, PART, MORE_ROWS = 0, 3, 2
"""The memory of a particle that is away: from this column of the first row on, the first two numbers of its clock (see
`orbits.marching.following.own_clocks.BEFORE`); if it was lost, the part of a step that it took; in the other three rows
L. These are two rows more than a particle has that is marched by the map alone."""


def parts_taken(memory: Array) -> Array:
    """Return the parts of a step that lost particles have taken by steps of their own, from the memory of all."""
    parts: Array = np.where(memory[:, 0, NUMBER] == ELSEWHERE, memory[:, 0, PART], 0.0)
    return parts


class Excursions(NamedTuple):
    """What a thread needs for particles that leave the map.

    near, extent, limits : (2, n), (3, n) and (3,), see `Rules`; the last has the number of the dominant body, its GM,
        and the bound of h v / r
    kept : (16, 4, 8), workspace for memories; lone : see `orbits.marching.following.alone_in_map.Lone`
    bodies : see `FieldOfPlanets`
    stepping : see `orbits.marching.following.own_clocks.OwnStepping`
    """

    near: Any
    extent: Any
    limits: Any
    kept: Any
    lone: Any
    bodies: Any
    stepping: Any


class FieldOfPlanets(NamedTuple):
    """The arrays of steps of the bodies by Gauss, in whose field a particle takes steps of its own.

    parameters : of the Lagrangian, with the bodies in the order of the map, as in the field: so no sum over them
        depends on another
    coefficients : of a step of the bodies; scratch : of one of these, and of a particle's own
    carry, clock : (3, 8) and (4,), of its own steps; reached : (steps,) bool, the steps that the bodies have taken
    state : (4, padded), of the bodies in this order
    """

    parameters: Any
    coefficients: Any
    scratch: Any
    carry: Any
    clock: Any
    reached: Any
    state: Any


@kernel(inline=True)
def _in_order(order, source, out):
    """Write a vector of the bodies in the order of the map."""
    n = order.shape[0]
    for i in range(n):
        for axis in range(0, 3 * n, n):
            out[axis + i] = source[axis + order[i]]


@kernel
def _learn_step(walk, k):
    """Let the bodies take step k by Gauss, from their state at its beginning; return the status."""
    (t, h), bodies, field = step_of(walk.clock, k), walk.bodies, walk.stepping.field
    state_of_planets(walk, k)
    state, carry = state_in(bodies.state), field.kicks[k]
    for part in range(4):
        _in_order(walk.stepping.log.order, walk.lone.bodies[part], bodies.state[part])
    record_strip(field.path, k, state.q, state.p, 0, state.q.shape[0])
    for row in range(carry.shape[0]):
        store(carry, row, full(0.0))
    storage = Storage(carry, bodies.scratch, field.stages[k], Share(0, state.q.shape[0], None))
    status, _, _ = step(Method(walk.own_method.tag, bodies.coefficients), walk.own_model, t, h, state, storage)
    bodies.reached[k] = True
    return status


@kernel
def _log_map(walk, track, p, slot, start, stop):
    """Log the states of a particle at the beginnings of steps start ... stop - 1, by the map."""
    for k in range(start, stop):
        particle = particle_at(track, k, slot)
        log_state(walk.own_method, walk.own_model, walk.stepping.field, walk.stepping.log, p, k, 0.0, particle)


@kernel
def _go_through(walk, columns, track, p, steps, is_away):
    """March particle p, alone, through a block of `steps` steps, by the map and by steps of its own.

    walk : with its memory at the beginning; columns : with its state then, if it is away
    Returns (whether it is away, status, step before which it was lost, evaluations); its memory, its state in `columns`
    and its lane of the track are those at the end, or where it was lost.
    """
    slot, k, evaluations, status, left = p % WIDTH, 0, 0, OK, False
    particle = load_particle(columns, p)
    while k < steps and status == OK:
        if is_away and not left:
            record_particle(track, k, slot, particle)
            if has_sample(walk.samples, k):
                columns_there, memory_there = kept_at(walk.samples, k)
                store_particle(columns_there, p, particle)
                _keep_memory(walk, True, memory_there[p])
            if may_return(walk.rules, k, seen_at(track, k), slot):
                enter_map(walk, k, particle)
                is_away = False
        if not is_away:
            begun = k
            k = march_alone(walk, track, begun, steps, p)
            evaluations += k - begun
            _log_map(walk, track, p, slot, begun, k)
            if k < steps:
                particle, is_away, left = leave_map(walk, k), True, True
                for i in range(3):
                    store(walk.bodies.carry, i, full(0.0))
                walk.bodies.clock[BEFORE], walk.bodies.clock[NEXT] = 0.0, 0.0
            continue
        record_particle(track, k, slot, particle)
        if not walk.bodies.reached[k]:
            status = _learn_step(walk, k)
        if status == OK:
            share, field = Share(p, p + 1, None), walk.stepping.field
            storage = Storage(walk.bodies.carry, walk.bodies.scratch, field.stages[k], share)
            clock, until = walk.bodies.clock, length_of(field, k)
            particle, status, count = follow(
                walk.own_method, walk.own_model, walk.stepping, k, until, True, p, particle, clock, storage
            )
            evaluations += count
        k, left = k + 1 if status == OK else k, False
    if is_away:
        store_particle(columns, p, particle)
        if status == OK:
            record_particle(track, steps, slot, particle)
    else:
        store_particle(columns, p, particle_at(track, steps, slot))
    return is_away, status, k, evaluations


@kernel
def _take_memory(walk, kept):
    """Take the memory of a particle at the beginning of a block."""
    memory = walk.lone.memory[0]
    store(memory, 0, load(kept, 0))
    store(memory, 1, load(kept, 1))
    for i in range(3):
        store(walk.bodies.carry, i, load(kept, 1 + i))
    walk.bodies.clock[BEFORE], walk.bodies.clock[NEXT] = kept[0, BEGUN], kept[0, BEGUN + 1]


@kernel
def _keep_memory(walk, is_away, own):
    """Write the memory of a particle at the end of a block."""
    memory = walk.lone.memory[0]
    for i in range(4):
        store(own, i, full(0.0))
    if is_away:
        clock = walk.bodies.clock
        own[0, NUMBER], own[0, BEGUN], own[0, BEGUN + 1] = ELSEWHERE, clock[BEFORE], clock[NEXT]
        for i in range(3):
            store(own, 1 + i, load(walk.bodies.carry, i))
    else:
        store(own, 0, load(memory, 0))
        store(own, 1, load(memory, 1))


@kernel
def _begin(own, clock, block):
    """Learn how far the planets come in a block, and write the times of their steps as a clock that chooses them would;
    see `orbits.marching.following.bodies_between.length_of`.
    """
    (begun, h), steps = step_of(clock, 0), block.count[0]
    times, reached = own.stepping.field.times, own.bodies.reached
    for k in range(steps + 1):
        times[k], times[2 * (reached.shape[0] + 1) + k] = k * h, step_of(clock, k)[0]
    for k in range(steps):
        reached[k], times[reached.shape[0] + 1 + k] = False, h
    own.stepping.numbers[ORIGIN] = begun
    begin_stepping(own.stepping, steps)
    measure_bodies(_rules(own, block, h), steps)


@kernel(inline=True)
def _rules(own, block, h):
    limits = own.limits
    return Rules(own.near, own.extent, block.path, own.lone.bodies.shape[1], int(limits[0]), limits[1], h, limits[2])


@kernel(inline=True)
def _march(own, form, method, model, clock, block, particles, room, first, last):
    """March particles first ... last - 1 in lanes through the tables of the planets, and by steps of their own where
    the map cannot follow them.
    """
    (_, h), steps, memory, retired = step_of(clock, 0), block.count[0], particles.memory, particles.retired
    lone, stepping = own.lone, own.stepping
    walk = Walk(
        method, model, clock, block, _rules(own, block, h), lone,
        Storage(lone.memory, room.scratch, lone.tables, Share(0, 1, None)),
        Method(form, stepping.table), Model(model.tag, own.bodies.parameters), particles.samples, own.bodies, stepping,
    )  # fmt: skip
    for p in range(first, last):
        for i in range(memory.shape[1]):
            store(own.kept[p - first], i, load(memory[p], i))
        if retired[p, 0] == OK and memory[p, 0, NUMBER] == ELSEWHERE:
            retired[p, 0] = SKIPPED
    blind = Room(room.scratch, room.track, 0, 0, room.evaluations)
    evaluations = march_in_lanes(None, form, method, model, clock, block, particles, blind, first, last)
    for begin in range(first, last, WIDTH):
        end = min(begin + WIDTH, last)
        track = room.track[: 6 * (steps + 1)] if begin == first else room.track[room.track.shape[0] // 2 :]
        met = encountering(walk.rules, track, steps)
        for p in range(begin, end):
            is_away = retired[p, 0] == SKIPPED
            if not (is_away or lane(met, p - begin) != 0.0):
                continue
            _take_memory(walk, own.kept[p - first])
            is_away, status, done, count = _go_through(walk, particles.columns, track, p, steps, is_away)
            evaluations += count
            retired[p, 0], retired[p, 1] = status, done if status != OK else 0
            _keep_memory(walk, is_away, memory[p])
            if status != OK:
                since = stepping.numbers[ORIGIN] + stepping.field.times[done]
                memory[p, 0, PART] = (own.bodies.clock[REACHED] - since) / h
            particle = load_particle(particles.columns, p)
            finish_log(
                walk.own_method, walk.own_model, stepping.field, stepping.log, p, steps, particle, status, True, track
            )
        call_observer(room.observer, room.context, track, h, steps, begin, last)
        report_log(stepping.log, steps, begin, end)
    return evaluations


EXCURSIONS = Tag("particles that leave a map", {"begin": _begin, "march": _march, "group": GROUP})
