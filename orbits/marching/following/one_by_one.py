"""Massless particles one after another: what whole steps of the bodies and a particle's own steps have in common.

How a particle goes through a step of the bodies is a tag with the kernels

    take_step(own, method, model, clock, block, particles, room, k, p, particle) -> (particle, status, evaluations)
        takes particle p through step k; one that cannot be stepped to the end is where it got to
    finish(own, method, model, p, steps, particle, status, track), optionally
        called once a particle is at the end of a block, or lost
"""

from __future__ import annotations

import math

from orbits.kernels.binding import kernel_of
from orbits.kernels.clocks import step_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import WithoutFirst, verb
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.paths import record_one, record_particle
from orbits.kernels.state import load_particle, store_particle
from orbits.kernels.steps import OK


@verb
def take_through(way, own, method, model, clock, block, particles, room, k, p, particle):
    """Take particle p through step k of the bodies. Returns (particle, status, evaluations)."""
    return WithoutFirst(kernel_of(way, "take_step"))


@verb
def finish(way, own, method, model, p, steps, particle, status, track):
    """Finish with a particle in a block."""
    compiled = kernel_of(way, "finish")
    if compiled is None:
        return lambda way, own, method, model, p, steps, particle, status, track: None
    return WithoutFirst(compiled)


@kernel(inline=True)
def hide(track, p, steps):
    """Write NaN for a particle into a track of `steps` steps, so that observers of it skip this lane."""
    for k in range(steps + 1):
        record_one(track, k, p % WIDTH, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@kernel(inline=True)
def march_each(way, own, method, model, clock, block, particles, room, first, last):
    """March particles first ... last - 1, at most eight, through a block; first is a multiple of eight."""
    steps, retired, track, evaluations = block.count[0], particles.retired, room.track, 0
    for p in range(first, last):
        if retired[p, 0] != OK:
            hide(track, p, steps)
            continue
        done, status, slot, particle = 0, OK, p % WIDTH, load_particle(particles.columns, p)
        while done < steps and status == OK:
            record_particle(track, done, slot, particle)
            particle, status, count = take_through(
                way, own, method, model, clock, block, particles, room, done, p, particle
            )
            evaluations += count
            if status == OK:
                done += 1
        for k in range(done, steps + 1):
            record_particle(track, k, slot, particle)
        if status != OK:
            retired[p, 0], retired[p, 1] = status, done
        finish(way, own, method, model, p, steps, particle, status, track)
        store_particle(particles.columns, p, particle)
    _, h = step_of(clock, 0)
    call_observer(room.observer, room.context, track, h, steps, first, last)
    return evaluations
