"""Massless particles with clocks of their own, among massive bodies whose steps are chosen one by one.

A particle takes a step of the bodies as a whole, through their recorded stages, if that resolves its own motion.
Otherwise it covers the step by steps of its own, in the positions of the bodies that the polynomial through their
forces gives, and meets them again at the end of their step. It never affects the bodies or another particle.

A step of a particle is judged as one of the bodies is (see `orbits.marching.clocks.adaptive`), and by the passages in
it: the way relative to a body must not exceed `PASSAGE` times the distance from it. What a fast passage of a light body
does to the forces may hide between the stages; how fast it is cannot. The next step is as long as the last one in units
of the dynamical time S^(-1/2), S = sum_j GM_j / r_j^3, whose values at the stages cost nothing, times the factor by
which the error signal allows it to grow.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from orbits.integrators.canonical.room import padded_length
from orbits.integrators.collocation.lengths import CANCELLED, UNFELT
from orbits.integrators.collocation.rows import LAST, NODES, WEIGHTS
from orbits.kernels.binding import Tag, bodies
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.close_field import gross_field, rate_at
from orbits.kernels.lanes import WIDTH, any_lane, full, largest, load, maximum, minimum, select, store, total
from orbits.kernels.search.context import watch_at
from orbits.kernels.search.paths import record_particle
from orbits.kernels.steps import (
    NOT_FINITE,
    OK,
    TOO_SHORT,
    Method,
    Share,
    Storage,
    end_late,
    prepare,
    step_particles,
)
from orbits.marching.clocks.adaptive import (
    ATTEMPTS,
    CAUTION,
    FIRST_THETA,
    GROWTH,
    LEAST,
    MOST,
    POWER,
    REFUSED,
    TOLERANCE,
    root,
)
from orbits.marching.clocks.variable_steps import FARTHEST, ORIGIN
from orbits.marching.following.bodies_between import PLACES, length_of, place_bodies, time_of
from orbits.marching.following.one_by_one import march_each
from orbits.marching.following.own_steps_log import (
    ENTRIES,
    FEW,
    WANTED,
    begin_log,
    finish_log,
    log_state,
    report_log,
)

BEFORE, NEXT, REACHED = 0, 1, 2
"""The clock of a particle: the length of its last step (0: none), the length proposed for the next one, > 0 (0: none),
and the time of its state since the start of the run, if it could not be stepped to the end of a step of the bodies.
"""

COLUMNS = 4

PASSAGE = 1.0
"""The longest way in a step relative to a body, as a fraction of the distance from it: the attraction in a straight
passage is then integrated by eight nodes to 1e-10 of itself."""

STRETCH = 1.15
"""By how much a step may be longer than proposed, so that fewer of them cover one of the bodies: the error signal is
then at most 2.7 times the tolerance, which would not repeat the step."""

NOISE = 1e-13
"""What rounding errors of positions may leave in the error signal, as a fraction of attractions that cancel."""

ROUNDING = 1e-15
"""What terms with momenta may leave in the error signal by rounding errors, as a fraction of the velocity: all there is
of it in a step of a moment, up to a sample just after the beginning of a step of the bodies."""

MOST_PARTS = 100_000_000
"""The most steps that a particle takes within one of the bodies: a minute."""

SHORTEST = 2.0**-52
"""A step shorter than this fraction of the time since the start counts as zero, except a whole step of the bodies, or
one up to a sample: that may be the next number after the end of a step. (Their step may be longer by any factor.)"""

RATES = 9
"""The row of the scratch of a particle's step that has S at its stages; see
`orbits.integrators.collocation.particles.pull`.
"""


class Shared(NamedTuple):
    """What particles need of whole steps of the bodies, which most of them take.

    coefficients : (steps, rows, 8), for a step after one of `before`, (steps,): 0 if they are not known
    ends : (steps + 1, 6, n + padding), x, y and z of the bodies at the first and at the last stage; the last ones are
        those of a particle's own step. The padding is `ABSENT`
    """

    coefficients: Any
    before: Any
    ends: Any


class OwnStepping(NamedTuple):
    """What a thread needs for steps that particles take by themselves.

    table : the coefficients of a step of a particle, written for each
    numbers : the state of a clock that chooses steps (see `orbits.marching.clocks.adaptive`), of which the tolerance,
        the power and the time at which the block began are read
    field, shared, log : see these
    """

    table: Any
    numbers: Any
    field: Any
    shared: Any
    log: Any


ABSENT, TINY = 1e150, 1e-300


@kernel(inline=True)
def first_length(method, model, field, k, particle):
    """Return the length of the first step of a particle, from its dynamical time at the beginning of step k."""
    stride = padded_length(3 * bodies(model.tag, model.parameters))
    sources = field.path[2 * k * stride : (2 * k + 1) * stride]
    rate = rate_at(model.tag, model.parameters, sources, (particle.x, particle.y, particle.z))
    return min(FIRST_THETA / math.sqrt(rate), FARTHEST) if rate > 0.0 else FARTHEST


@kernel(inline=True)
def copy_ends(n, sources, ends):
    """Copy the positions of the bodies at the first and the last stage, so that bodies are in lanes."""
    for j in range(n):
        ends[0, j], ends[1, j], ends[2, j] = sources[j, 0], sources[n + j, 0], sources[2 * n + j, 0]
        ends[3, j], ends[4, j] = sources[j, WIDTH - 1], sources[n + j, WIDTH - 1]
        ends[5, j] = sources[2 * n + j, WIDTH - 1]


@kernel(inline=True)
def narrowest(n, ends, scratch, reaches):
    """Return the largest of (way / distance)^2 relative to the bodies in the step just taken, from its first and last
    stage, and whether a body is so close that its passage is recorded.

    reaches : see `orbits.kernels.search.context`; empty if passages are not recorded
    """
    Q, last = scratch[3:], WIDTH - 1
    worst = near = full(0.0)
    for first in range(0, n, WIDTH):
        x, y, z = load(ends[0], first) - Q[0, 0], load(ends[1], first) - Q[1, 0], load(ends[2], first) - Q[2, 0]
        u, v = load(ends[3], first) - Q[0, last] - x, load(ends[4], first) - Q[1, last] - y
        w = load(ends[5], first) - Q[2, last] - z
        way2 = u * u + v * v + w * w
        # The point of the straight line between the two that is nearest.
        s = minimum(maximum(-(x * u + y * v + z * w) / maximum(way2, full(TINY)), full(0.0)), full(1.0))
        x, y, z = x + s * u, y + s * v, z + s * w
        distance2 = x * x + y * y + z * z
        worst = maximum(way2 / distance2, worst)
        if reaches.shape[0] > 0:
            reach = load(reaches, first)
            near = near + (distance2 <= reach * reach)
    return largest(worst), any_lane(near)


@kernel(inline=True)
def judged(method, model, numbers, h, particle, storage, ends, reaches):
    """Return the factor by which the next step may be longer than the one of h just taken, or by which it must be
    repeated (see `orbits.marching.clocks.adaptive`), and whether a body is near.
    """
    table, tolerance, power = method.coefficients[0], numbers[TOLERANCE], numbers[POWER]
    last, weights = load(table, LAST), load(table, WEIGHTS)
    inverse = select(weights > 0.0, 1.0 / weights, full(0.0))
    x, y, z = load(storage.carry, 0), load(storage.carry, 1), load(storage.carry, 2)
    rest = max(abs(total(last * x)), max(abs(total(last * y)), abs(total(last * z))))
    most = largest(inverse * maximum(abs(x), maximum(abs(y), abs(z))))
    if rest > tolerance * most:
        Q = storage.scratch[3:]
        pulls = gross_field(model.tag, model.parameters, storage.stages, load(Q, 0), load(Q, 1), load(Q, 2))
        speed = max(abs(particle.vx), max(abs(particle.vy), abs(particle.vz)))
        felt = max(UNFELT, ROUNDING / tolerance) * speed
        most = max(most, max(max(CANCELLED, NOISE / tolerance) * abs(h) * largest(pulls), felt))
    factor = MOST if rest == 0.0 else min(max(root(tolerance * most / rest, power), LEAST), MOST)
    passed, near = narrowest(bodies(model.tag, model.parameters), ends, storage.scratch, reaches)
    if factor * factor * passed > PASSAGE * PASSAGE:
        factor = max(PASSAGE / math.sqrt(passed), LEAST)
    return factor, near


@kernel(inline=True)
def proposed(h, factor, nodes, rates, stages):
    """Return the length proposed for the step after one of h with these rates at its stages."""
    end, before, grown = rates[stages - 1], rates[stages - 2], min(factor, GROWTH)
    middle = 0.5 * (rates[(stages - 1) // 2] + rates[stages // 2])
    if not (end > 0.0 and before > 0.0 and middle > 0.0):
        return min(abs(h) * grown, FARTHEST)
    # S in the middle of the next step, by the slope of its logarithm at the end of this one.
    ratio = math.sqrt(middle / end)
    slope = (end - before) / (end * (nodes[stages - 1] - nodes[stages - 2]))
    ahead = 1.0 - nodes[stages - 1] + 0.5 * grown * min(max(ratio, LEAST), MOST)
    half = 0.5 * min(max(-0.5 * slope * ahead, -1.0), 1.0)
    return min(abs(h) * grown * ratio * (1.0 + half) / (1.0 - half), FARTHEST)  # almost exp(2 half)


@kernel(inline=True)
def follow(method, model, stepping, k, until, seen, p, particle, own, storage):
    """Take particle p through step k of the bodies, or through a part of it.

    method : with the table of `stepping`, an `OwnStepping`, whose log receives its state at the beginning of a whole
        step and, if it takes several steps in an encounter, after each of them
    until : the time since the beginning of the step up to which it is taken, not 0: the length of the step for all
    seen : whether observers see it, as they do whole steps
    own : (4,), its clock; storage : with its L as the carry, and scratch
    Returns (particle, status, evaluations). One that cannot be stepped to the end is where it got to.
    """
    field, shared, log, numbers = stepping.field, stepping.shared, stepping.log, stepping.numbers
    since, H, begun = numbers[ORIGIN] + field.times[k], length_of(field, k), time_of(field, k)
    watched = log.context != 0 and seen
    table, carry, scratch, share = method.coefficients[0], storage.carry, storage.scratch, storage.share
    nodes, stages = load(table, NODES), 0
    while stages < WIDTH and table[WEIGHTS, stages] != 0.0:
        stages += 1
    if own[NEXT] == 0.0:
        own[NEXT] = first_length(method, model, field, k, particle)
    done, steps, evaluations, proposal = 0.0, 0, 0, own[NEXT]
    if watched:
        log_state(method, model, field, log, p, k, 0.0, particle)
    begin, wanted, reaches, n = log.counts[ENTRIES], False, shared.before[:0], bodies(model.tag, model.parameters)
    if watched:
        watch = watch_at(log.context)
        reaches, wanted = log.reaches, watch.then != 0 or watch.collide != 0 or watch.dominant < 0
    while steps < MOST_PARTS:
        left, status, taken = until - done, TOO_SHORT, False
        x_kept, y_kept, z_kept = load(carry, 0), load(carry, 1), load(carry, 2)
        for _ in range(ATTEMPTS):
            parts = max(math.ceil(abs(left) / (STRETCH * proposal)), 1.0)
            h = left if parts == 1.0 else (done + left / parts) - done  # the lengths add up
            alone = done == 0.0 and parts == 1.0
            whole = alone and until == H
            if not alone and not abs(h) > SHORTEST * abs(since + done):
                break
            before = own[BEFORE] if own[BEFORE] != 0.0 else h
            if whole:
                sources, coefficients, ends = field.stages[k], shared.coefficients[k : k + 1], shared.ends[k]
                if shared.before[k] == 0.0:
                    copy_ends(n, sources, ends)
            else:
                sources, coefficients = field.room[PLACES : PLACES + field.stages.shape[1]], method.coefficients
                place_bodies(method, model, field, k, (done + nodes * h) / H, done / H, (done + h) / H)
                ends = shared.ends[shared.before.shape[0]]
                copy_ends(n, sources, ends)
            mine, now = Method(method.tag, coefficients), Storage(carry, scratch, sources, share)
            if not whole:
                prepare(mine, h, before, now)
            elif shared.before[k] != before:
                prepare(mine, h, before, now)
                shared.before[k] = before
            end = time_of(field, k + 1) if parts == 1.0 and until == H else begun + (done + h)
            end_late(mine, end - ((begun + done) + h))
            after, _, status, count = step_particles(mine, model, begun + done, h, particle, carry, now)
            evaluations += count
            factor = 0.5 / CAUTION
            if status == OK:
                factor, near = judged(method, model, numbers, h, after, now, ends, reaches)
                if factor >= REFUSED:
                    particle, taken = after, True
                    proposal = proposed(h, factor, table[NODES], scratch[RATES], stages)
                    own[BEFORE], own[NEXT] = h, proposal
                    wanted |= near
                    break
            proposal = CAUTION * factor * abs(h)
            store(carry, 0, x_kept)
            store(carry, 1, y_kept)
            store(carry, 2, z_kept)
        if not taken:
            own[REACHED] = since + done
            return particle, NOT_FINITE if status == NOT_FINITE else TOO_SHORT, evaluations
        steps += 1
        if parts == 1.0:
            if watched and steps > 1 and (wanted or steps >= FEW):
                log.counts[WANTED] = 1
            elif watched and steps > 1:
                log.counts[ENTRIES] = min(begin, log.counts[ENTRIES])
            return particle, OK, evaluations
        done += h
        if watched:
            log_state(method, model, field, log, p, k, done / H, particle)
    own[REACHED] = since + done
    return particle, TOO_SHORT, evaluations


@kernel(inline=True)
def begin_stepping(own, steps):
    """Prepare for a block of `steps` steps of the bodies."""
    begin_log(own.log, steps)
    for k in range(steps):
        own.field.known[k], own.shared.before[k] = False, 0.0


@kernel(inline=True)
def _begin(own, clock, block):
    begin_stepping(own, block.count[0])


@kernel(inline=True)
def _march(own, form, method, model, clock, block, particles, room, first, last):
    evaluations = march_each(BY_OWN_STEPS, own, method, model, clock, block, particles, room, first, last)
    report_log(own.log, block.count[0], first, last)
    return evaluations


@kernel(inline=True)
def _take_step(own, method, model, clock, block, particles, room, k, p, particle):
    """Take particle p through step k, after a part of it up to each sample in it, which changes nothing."""
    mine, carry, times = Method(method.tag, own.table), particles.memory[p], particles.clocks[p]
    storage = Storage(carry, room.scratch, block.stages[0], Share(p, p + 1, None))
    samples, H, i, last = particles.samples, length_of(own.field, k), 0, 0
    if samples.first.shape[0] > 0:
        i, last = samples.first[k], samples.first[k + 1]
    while True:
        until = samples.behind[i] if i < last else H
        x, y, z = load(carry, 0), load(carry, 1), load(carry, 2)
        before, proposal, reached = times[BEFORE], times[NEXT], times[REACHED]
        after, status, evaluations = particle, OK, 0
        if until != 0.0:
            after, status, evaluations = follow(mine, model, own, k, until, i == last, p, particle, times, storage)
        if i == last:
            return after, status, evaluations
        if status == OK:
            record_particle(samples.states[i], 0, p, after)
        store(carry, 0, x)
        store(carry, 1, y)
        store(carry, 2, z)
        times[BEFORE], times[NEXT], times[REACHED] = before, proposal, reached
        i += 1


@kernel(inline=True)
def _finish(own, method, model, p, steps, particle, status, track):
    """Look at a particle that came close to a body, or may have hit one on the way to where it was lost."""
    seen = own.log.counts[WANTED] != 0
    if status != OK and own.log.context != 0:
        seen = watch_at(own.log.context).collide != 0
    finish_log(method, model, own.field, own.log, p, steps, particle, status, seen, track)


BY_OWN_STEPS = Tag(
    "particles by steps of their own",
    {"begin": _begin, "march": _march, "group": WIDTH, "take_step": _take_step, "finish": _finish},
)
