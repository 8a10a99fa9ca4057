"""Massless particles that take several steps within one of the massive bodies, as observers see them.

Observers look at the states at the beginning of each step of the bodies. For a particle with steps of its own that is
too seldom in encounters and pericentres: there the states after its own steps are logged, those of the bodies are
computed for the same times, and the observers are called for this particle alone, as for a march of unequal steps.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from orbits.integrators.canonical.room import padded_length
from orbits.kernels.binding import bodies
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, load, select, store, unit
from orbits.kernels.search.context import watch_at
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.paths import record_particle
from orbits.kernels.steps import OK
from orbits.marching.following.bodies_between import length_of, state_between
from orbits.marching.following.one_by_one import hide

FEW = 4
"""The number of steps within one of the bodies from which on they are logged for the pericentre they may contain."""

ENTRIES, WANTED = 0, 1
"""The counts of a log: its entries, and whether one of them is worth a look."""

NEVER = 1 << 62
"""A number of steps beyond any block."""

BESIDES = 64
"""The entries of a log besides one for each step of a block."""


class Log(NamedTuple):
    """The states of one particle in a block: at the beginning of each step of the bodies, and after its own.

    observer, context : see `orbits.kernels.search.observers`; no observer is called, and nothing logged, for address 0
    counts : (2,) int64; at : (room, 2), number of a step of the bodies and the part of it that has passed
    times, path, track : of the context, with room for as many states; observers see the particle's lane of track alone
    found : (1,) int64, the number of steps in the last of which a pair may come to its bound, as in `hits`; see
        `orbits.kernels.search.context`
    order : (n,) int64, the bodies of the observers in the order of those of the field
    reaches : (padded n,), those of the observers in this order; seen : (2, padded), workspace
    whole : flat, the states of the bodies at the beginnings of their steps, as the observers see them, each padded
    """

    observer: Any
    context: Any
    counts: Any
    at: Any
    times: Any
    path: Any
    track: Any
    found: Any
    order: Any
    reaches: Any
    seen: Any
    whole: Any


@kernel(inline=True)
def begin_log(log, steps):
    """Prepare a log for a block of `steps` steps."""
    log.found[0] = steps + 1
    log.counts[ENTRIES], log.counts[WANTED] = 0, 0
    if log.context != 0:
        watch = watch_at(log.context)
        for i in range(log.order.shape[0]):
            log.reaches[i] = watch.reaches[log.order[i]]


@kernel(inline=True)
def log_state(method, model, field, log, p, k, part, particle):
    """Log the state of particle p at a part of step k."""
    if log.context == 0:
        return
    if log.counts[ENTRIES] == log.at.shape[0]:
        look(method, model, field, log, p)
    row = log.counts[ENTRIES]
    log.counts[ENTRIES] = row + 1
    log.at[row, 0], log.at[row, 1] = k, part
    record_particle(log.track, row, p % WIDTH, particle)


@kernel(inline=True)
def hide_others(track, p, last):
    """Write NaN into the first entries of a track, up to `last`, for all particles but p: those before it in the group
    have logged their states there as well, at other times.
    """
    mine, nothing = unit(p % WIDTH), full(math.nan)
    for row in range(6 * (last + 1)):
        store(track, row, select(mine > 0.0, load(track, row), nothing))


@kernel(inline=True)
def steps_until(log, row):
    """Return the number of steps of the bodies after which an entry is past."""
    return int(log.at[row, 0]) + (1 if log.at[row, 1] > 0.0 else 0)


@kernel
def look(method, model, field, log, p):
    """Call the observer for the states logged so far, and keep the last one."""
    n, last, first = bodies(model.tag, model.parameters), log.counts[ENTRIES] - 1, p - p % WIDTH
    stride, q, v = padded_length(3 * n), log.seen[0], log.seen[1]
    for row in range(last + 1):
        k, part = int(log.at[row, 0]), log.at[row, 1]
        begin, entry = 2 * k * stride, 2 * row * stride
        log.times[row] = field.times[k]
        if part > 0.0:
            log.times[row] += part * length_of(field, k)
            state_between(method, model, field, k, part, q[: 3 * n], v[: 3 * n])
            for i in range(3 * n):
                at = entry + (i - i % n) + log.order[i % n]
                log.path[at], log.path[at + stride] = q[i], v[i]
        else:
            for i in range(3 * n):
                log.path[entry + i], log.path[entry + stride + i] = log.whole[begin + i], log.whole[begin + stride + i]
    watch = watch_at(log.context)
    hide_others(log.track, p, last)
    call_observer(log.observer, log.context, log.track, field.times[1] - field.times[0], last, first, p + 1)
    if watch.then != 0:
        hit = watch.hits[first // WIDTH]
        if hit <= last:
            log.found[0] = min(log.found[0], steps_until(log, hit))
    if watch.collide != 0:
        touched, own = watch.touched[p], watch.touched_own
        until = steps_until(log, touched) if touched <= last else NEVER
        own[p] = until if own[p] == 0 else min(own[p], until)
    for i in range(6):
        log.track[i, p % WIDTH] = log.track[6 * last + i, p % WIDTH]
    log.at[0, 0], log.at[0, 1], log.counts[ENTRIES] = log.at[last, 0], log.at[last, 1], 1


@kernel(inline=True)
def finish_log(method, model, field, log, p, steps, particle, status, seen, track):
    """Look at a particle at the end of a block, or where it was lost, if it is to be `seen`, and hide it from those who
    look at `track`.
    """
    if log.context != 0 and seen:
        if status == OK:
            log_state(method, model, field, log, p, steps, 0.0, particle)
        if log.counts[ENTRIES] > 1:
            look(method, model, field, log, p)
        hide(track, p, steps)
    log.counts[ENTRIES], log.counts[WANTED] = 0, 0


@kernel(inline=True)
def report_log(log, steps, first, last):
    """Report what was found of particles first ... last - 1, one group, besides what their observer found."""
    if log.context != 0:
        watch, group = watch_at(log.context), first // WIDTH
        watch.hits[group] = min(watch.hits[group], log.found[0])
        if watch.collide != 0:
            for p in range(first, last):
                if watch.touched_own[p] != 0:
                    watch.touched[p] = min(watch.touched[p], watch.touched_own[p])
    log.found[0] = steps + 1
