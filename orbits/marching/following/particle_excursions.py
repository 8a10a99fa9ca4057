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
from orbits.kernels.clocks import Clock, step_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, lane, load, select, store, unit
from orbits.kernels.maps.jacobi_particles import ELSEWHERE, NUMBER
from orbits.kernels.maps.jacobi_tables import table_rows
from orbits.kernels.search.context import watch_at
from orbits.kernels.search.encounters_of_particles import (
    Rules,
    encountering,
    encounters_in,
    may_return,
    measure_bodies,
    seen_at,
)
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.paths import record_one, record_particle
from orbits.kernels.state import Columns, load_particle, store_particle
from orbits.kernels.steps import (
    NOWHERE,
    OK,
    Method,
    Model,
    Particles,
    Share,
    State,
    Storage,
    begin_particles,
    enter_particles,
    keep_particles,
    leave,
    leave_particles,
    step,
    step_particles,
)
from orbits.marching.following.bodies_between import Field
from orbits.marching.following.own_clocks import BEFORE, NEXT, REACHED, Shared, follow
from orbits.marching.following.own_steps_log import ENTRIES, WANTED, Log, begin_log, hide, log_state, look
from orbits.marching.stepping.driver import march_particles

SKIPPED = -1
"""The status of a particle that is away, while others are marched in lanes."""

GROUP = 2 * WIDTH
"""The particles that are marched in lanes at a time."""

BEGUN, PART, MORE_ROWS = 0, 3, 2
"""The memory of a particle that is away: from this column of the first row on, the first two numbers of its clock (see
`orbits.marching.following.own_clocks.BEFORE`); if it was lost, the part of a step that it took; in the other three rows
L. These are two rows more than a particle has that is marched by the map alone."""


def parts_taken(memory: Array) -> Array:
    """Return the parts of a step that lost particles have taken by steps of their own, from the memory of all."""
    parts: Array = np.where(memory[:, 0, NUMBER] == ELSEWHERE, memory[:, 0, PART], 0.0)
    return parts


class Map(NamedTuple):
    """The map in a block of steps, as a particle that is marched alone needs it.

    method, model, clock : as for all particles; stages : (steps, rows, 8), the tables of the planets
    begun, carries : what is marched of the planets before the first step, and after each, (steps, rows, 8)
    rules : see `Rules`
    storage : the particle's memory, (1, 2, 8), as the carry, the scratch of the task, and tables of its own
    columns : its state, (3, 16) each; retired : (16, 2) zeros; rows : (16, 8), workspace
    bodies : (4, padded), a state of the bodies; planets : (rows, 8), a copy of what is marched of them
    """

    method: Any
    model: Any
    clock: Any
    stages: Any
    begun: Any
    carries: Any
    rules: Any
    storage: Any
    columns: Any
    retired: Any
    rows: Any
    bodies: Any
    planets: Any


class Away(NamedTuple):
    """What a particle needs for steps of its own.

    method, field, shared, log : see `orbits.marching.following.own_clocks.follow`, as `clock`, whose numbers alone are
        read
    model : with the bodies in the order of the map, `log.order`, as in `field`: so no sum over them depends on another
    whole : the coefficients of a step of the bodies; scratch : of one of these, and of a particle's own
    carry, times : (3, 8) and (4,), of its own steps; reached : (steps,) bool, the steps of the bodies in `field`
    bodies : (4, padded), a state of the bodies in this order
    """

    method: Any
    model: Any
    clock: Any
    field: Any
    shared: Any
    log: Any
    whole: Any
    scratch: Any
    carry: Any
    times: Any
    reached: Any
    bodies: Any


@kernel
def _copy_planets(here, k):
    """Copy what is marched of the planets at the beginning of step k."""
    source = here.begun if k == 0 else here.carries[k - 1]
    for row in range(here.planets.shape[0]):
        store(here.planets, row, load(source, row))


@kernel(inline=True)
def _with_planets(here):
    """Return the storage with the copy of the planets as the carry."""
    return Storage(here.planets, here.storage.scratch, here.storage.stages, here.storage.share)


@kernel(inline=True)
def _in_order(order, source, first, out, begin):
    """Write a vector of the bodies in the order of the map; first, begin : where it begins, and where it goes."""
    n = order.shape[0]
    for i in range(n):
        for axis in range(0, 3 * n, n):
            out[begin + axis + i] = source[first + axis + order[i]]


@kernel
def _state_of_bodies(here, away, k):
    """Return the state of the bodies at the beginning of step k, uncorrected, in doubled precision, and write it into
    the path of the field.
    """
    _copy_planets(here, k)
    state, (_, h) = State(here.bodies[0], here.bodies[1], here.bodies[2], here.bodies[3]), step_of(here.clock, k)
    leave(here.method, here.model, h, state, _with_planets(here))
    order, path, stride = away.log.order, away.field.path, state.q.shape[0]
    _in_order(order, state.q, 0, path, 2 * k * stride)
    _in_order(order, state.p, 0, path, (2 * k + 1) * stride)
    return state


@kernel
def _learn_step(here, away, k):
    """Let the bodies take step k by Gauss, from their state at its beginning; return the status."""
    (t, h), carry = step_of(here.clock, k), away.field.kicks[k]
    _state_of_bodies(here, away, k)
    state = State(away.bodies[0], away.bodies[1], away.bodies[2], away.bodies[3])
    for part in range(4):
        _in_order(away.log.order, here.bodies[part], 0, away.bodies[part], 0)
    for row in range(carry.shape[0]):
        store(carry, row, full(0.0))
    storage = Storage(carry, away.scratch, away.field.stages[k], Share(0, state.q.shape[0], None))
    status, _, _ = step(Method(away.method.tag, away.whole), away.model, t, h, state, storage)
    away.reached[k] = True
    return status


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
        carry = begin_particles(method, model, _alone(), Storage(own.carry, own.scratch, here.stages[0], own.share))
    else:
        # The table before a step, of a map that has one, is that after the step before it.
        count = table_rows(here.rules.near.shape[1] - 1)
        for row in range(count if here.stages.shape[1] >= 2 * count else 0):
            store(own.stages, row, load(here.stages[k - 1], count + row))
        carry = begin_particles(method, model, _alone(), own)
    particle = _alone()
    while k < steps:
        t, h = step_of(here.clock, k)
        storage = Storage(own.carry, own.scratch, here.stages[k], own.share)
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
def _leave_map(here, k):
    """Return a particle that leaves the map at the beginning of step k, uncorrected, in doubled precision."""
    _copy_planets(here, k)
    state = State(here.bodies[0], here.bodies[1], here.bodies[2], here.bodies[3])
    particles = here.columns, here.storage.carry, here.retired
    leave_particles(here.method, here.model, state, particles, here.rows, _with_planets(here))
    return load_particle(here.columns, 0)


@kernel
def _enter_map(here, away, k, particle):
    """Let a particle enter the map at the beginning of step k."""
    state, memory = _state_of_bodies(here, away, k), here.storage.carry
    store_particle(here.columns, 0, particle)
    store(memory[0], 0, full(0.0))
    store(memory[0], 1, full(0.0))
    particles = here.columns, memory, here.retired
    enter_particles(here.method, here.model, state, particles, here.rows, _with_planets(here))


@kernel
def _log_map(here, away, track, p, slot, start, stop):
    """Log the states of a particle at the beginnings of steps start ... stop - 1, by the map."""
    for k in range(start, stop):
        row, zero = 6 * k, 0.0
        log_state(
            away.method, away.model, away.field, away.log, p, k, 0.0,
            Particles(
                track[row, slot], track[row + 1, slot], track[row + 2, slot], zero, zero, zero,
                track[row + 3, slot], track[row + 4, slot], track[row + 5, slot], zero, zero, zero,
            ),
        )  # fmt: skip


@kernel
def _go_through(here, away, columns, track, p, steps, is_away):
    """March particle p, alone, through a block of `steps` steps, by the map and by steps of its own.

    here : with its memory at the beginning; columns : with its state then, if it is away
    Returns (whether it is away, status, step before which it was lost, evaluations); its memory, its state in `columns`
    and its lane of the track are those at the end, or where it was lost.
    """
    slot, k, evaluations, status, left = p % WIDTH, 0, 0, OK, False
    particle = load_particle(columns, p)
    while k < steps and status == OK:
        if is_away and not left:
            record_particle(track, k, slot, particle)
            if may_return(here.rules, k, seen_at(track, k), slot):
                _enter_map(here, away, k, particle)
                is_away = False
        if not is_away:
            begun = k
            k = march_alone(here, track, begun, steps, slot)
            evaluations += k - begun
            _log_map(here, away, track, p, slot, begun, k)
            if k < steps:
                particle, is_away, left = _leave_map(here, k), True, True
                for i in range(3):
                    store(away.carry, i, full(0.0))
                away.times[BEFORE], away.times[NEXT] = 0.0, 0.0
            continue
        record_particle(track, k, slot, particle)
        if not away.reached[k]:
            status = _learn_step(here, away, k)
        if status == OK:
            scratch = Storage(away.carry, away.scratch, away.field.stages[k], Share(p, p + 1, None))
            particle, status, count = follow(
                away.method, away.model, away.clock, away.field, away.shared, k, p, particle, away.times, scratch,
                away.log,
            )  # fmt: skip
            evaluations += count
        k, left = k + 1 if status == OK else k, False
    if is_away:
        store_particle(columns, p, particle)
        if status == OK:
            record_particle(track, steps, slot, particle)
    else:
        row, zero = 6 * steps, 0.0
        store_particle(columns, p, Particles(
            track[row, slot], track[row + 1, slot], track[row + 2, slot], zero, zero, zero,
            track[row + 3, slot], track[row + 4, slot], track[row + 5, slot], zero, zero, zero,
        ))  # fmt: skip
    return is_away, status, k, evaluations


@kernel
def _take_memory(here, away, kept):
    """Take the memory of a particle at the beginning of a block."""
    memory = here.storage.carry[0]
    store(memory, 0, load(kept, 0))
    store(memory, 1, load(kept, 1))
    for i in range(3):
        store(away.carry, i, load(kept, 1 + i))
    away.times[BEFORE], away.times[NEXT] = kept[0, BEGUN], kept[0, BEGUN + 1]


@kernel
def _keep_memory(here, away, is_away, own):
    """Write the memory of a particle at the end of a block."""
    memory = here.storage.carry[0]
    for i in range(4):
        store(own, i, full(0.0))
    if is_away:
        own[0, NUMBER], own[0, BEGUN], own[0, BEGUN + 1] = ELSEWHERE, away.times[BEFORE], away.times[NEXT]
        for i in range(3):
            store(own, 1 + i, load(away.carry, i))
    else:
        store(own, 0, load(memory, 0))
        store(own, 1, load(memory, 1))


@kernel
def _look(here, away, columns, track, p, steps, status):
    """Let observers see the particle at all its steps, alone, and hide it from those of the others."""
    if away.log.context != 0:
        if status == OK:
            log_state(away.method, away.model, away.field, away.log, p, steps, 0.0, load_particle(columns, p))
        look(away.method, away.model, away.field, away.log, p)
        hide(away.log, p, steps, track)
    away.log.counts[ENTRIES], away.log.counts[WANTED] = 0, 0


@kernel
def march_handing_over(
    form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, v, v_lo, memory, scratch, stages, retired,
    steps, start, stop, observer, context, track,
    begun, carries, path, near, extent, limits, kept, own_memory, own_tables, own_columns, own_retired, rows, bodies,
    planets,
    own_form, own_table, own_whole, own_parameters, own_numbers, times, own_scratch, own_stages, own_path, own_kicks,
    chart, modes, known, between, tables, before, ends, own_carry, own_times, own_bodies, reached,
    own_context, counts, at, log_times, log_path, log_track, found, order, reaches, seen
):  # fmt: skip
    """March massless particles start ... stop - 1 by `steps` steps through the tables of the planets, and by steps of
    their own where the map cannot follow them; the first arguments are those of `march_particles`.

    near, extent : see `Rules`; limits : (3,), the number of the dominant body, its GM, and the bound of h v / r
    kept : (16, 4, 8), workspace for memories; own_memory ... planets : see `Map`; own_columns : (4, 3, 16)
    own_form ... reached : see `Away`, `orbits.marching.following.bodies_between.Field` and
    `orbits.marching.following.own_clocks.Shared` own_context ... found : see
    `orbits.marching.following.own_steps_log.Log`

    Returns the number of evaluations.
    """
    clock, stride = Clock(timing, numbers, room), bodies.shape[1]
    t, h = step_of(clock, 0)
    rules = Rules(near, extent, path, stride, int(limits[0]), limits[1], h, limits[2])
    method, model, columns = Method(form, coefficients), Model(tag, parameters), Columns(q, q_lo, v, v_lo)
    here = Map(
        method, model, clock, stages, begun, carries, rules,
        Storage(own_memory, scratch, own_tables, Share(0, 1, None)),
        Columns(own_columns[0], own_columns[1], own_columns[2], own_columns[3]), own_retired, rows, bodies, planets,
    )  # fmt: skip
    for k in range(steps):
        known[k], before[k], reached[k] = False, 0.0, False
        times[k], times[reached.shape[0] + 1 + k] = k * h, h
        times[2 * (reached.shape[0] + 1) + k] = step_of(clock, k)[0]
    times[steps], times[2 * (reached.shape[0] + 1) + steps] = steps * h, step_of(clock, steps)[0]
    away = Away(
        Method(own_form, own_table), Model(tag, own_parameters), Clock(timing, own_numbers, times),
        Field(t, times, own_stages, own_path, own_kicks, chart, modes, known, between), Shared(tables, before, ends),
        Log(observer, own_context, counts, at, log_times, log_path, log_track, found, order, reaches, seen, path),
        own_whole, own_scratch, own_carry, own_times, reached, own_bodies,
    )  # fmt: skip
    evaluations = 0
    begin_log(away.log, steps)
    measure_bodies(rules, steps)
    for first in range(start, stop, GROUP):
        last = min(first + GROUP, stop)
        for p in range(first, last):
            for i in range(memory.shape[1]):
                store(kept[p - first], i, load(memory[p], i))
            if retired[p, 0] == OK and memory[p, 0, NUMBER] == ELSEWHERE:
                retired[p, 0] = SKIPPED
        evaluations += march_particles(
            form, coefficients, tag, parameters, timing, numbers, room, q, q_lo, v, v_lo, memory, scratch, stages,
            retired, steps, first, last, 0, 0, track,
        )  # fmt: skip
        for begin in range(first, last, WIDTH):
            states = track[: 6 * (steps + 1)] if begin == first else track[track.shape[0] // 2 :]
            met = encountering(rules, states, steps)
            for p in range(begin, min(begin + WIDTH, last)):
                is_away = retired[p, 0] == SKIPPED
                if not (is_away or lane(met, p - begin) != 0.0):
                    continue
                _take_memory(here, away, kept[p - first])
                is_away, status, done, count = _go_through(here, away, columns, states, p, steps, is_away)
                evaluations += count
                retired[p, 0], retired[p, 1] = status, done if status != OK else 0
                _keep_memory(here, away, is_away, memory[p])
                if status != OK:
                    memory[p, 0, PART] = (own_times[REACHED] - (t + times[done])) / h
                _look(here, away, columns, states, p, steps, status)
            call_observer(observer, context, states, h, steps, begin, last)
            if context != 0:
                hits, group = watch_at(context).hits, begin // WIDTH
                hits[group] = min(hits[group], found[0])
            found[0] = steps + 1
    return evaluations
