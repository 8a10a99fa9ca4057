"""The contract of a follower: how massless particles are marched through a block of steps of the massive bodies.

A way of following enters compiled code as a tag, like a method (see `orbits.kernels.steps`), with a record of its own,
`own`. Two functions are resolved at compile time to its kernels:

    begin(own, clock, block)
        called by each thread before its first particles of a block
    march(own, form, method, model, clock, block, particles, room, first, last) -> evaluations
        marches particles first ... last - 1 through the block, and calls the observer for each group of eight. One that
        is lost is noted in `particles.retired`, with the step before which it was; the others go on. `form` is the tag
        of the method of a particle's own steps

and `group` is the number of particles in a piece of the work, a multiple of eight. Nothing that a particle does depends
on another one or on the thread that marches it. In Python, followers are the classes of
`orbits.marching.following.follower`. The other arguments are records that are made once for a march, of what is read
and written in each block.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from orbits.kernels.binding import kernel_of
from orbits.kernels.clocks import Clock
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import WithoutFirst, verb
from orbits.kernels.lanes import WIDTH
from orbits.kernels.rounds import claim_piece, next_round
from orbits.kernels.state import Columns
from orbits.kernels.steps import Method, Model


class Block(NamedTuple):
    """What the massive bodies leave of a block of steps.

    Beside these, kernels get the tags of the method, the Lagrangian and the clock: in a record it would take Numba ten
    microseconds to tell the type of each.

    coefficients, parameters, numbers, times : of the method, the Lagrangian and the clock; see
        `orbits.kernels.steps.Method`, `Model` and `orbits.kernels.clocks.Clock`
    count : (1,) int64, how many steps they took
    stages : (steps, rows, columns), see `orbits.kernels.steps.Storage`
    begun : (rows, 8), their carry before the first step; path : flat, q and v at the beginning of each step and at the
        end, each padded; carries : (steps, rows, 8), their carry after each step. Only for a follower that reads them
    """

    coefficients: Any
    parameters: Any
    numbers: Any
    times: Any
    count: Any
    stages: Any
    begun: Any
    path: Any
    carries: Any


class SamplesInBlock(NamedTuple):
    """The samples that lie in a block, in the order of time.

    first : (steps + 1 or more,) int64; those in step k are first[k] ... first[k + 1] - 1; empty if there are none
    behind : the times from the beginnings of their steps to them, for as many or more
    states : as many, (6, padded) each, NaN; receive q and v of each particle there that gets there. Of a follower that
        takes no parts of steps, (12, padded) each; the first one of each step receives q, q_lo, v and v_lo of all
        particles at its beginning
    memory : as many, each like that of all particles, which the same ones receive there; else empty
    """

    first: Any
    behind: Any
    states: Any
    memory: Any


NO_SAMPLES = SamplesInBlock(
    np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 6, WIDTH)), np.zeros((0, 0, 0, WIDTH))
)


@kernel(inline=True)
def has_sample(samples, k):
    """Return whether there is a sample in step k of a block, or at its beginning."""
    return k + 1 < samples.first.shape[0] and samples.first[k] < samples.first[k + 1]


@kernel(inline=True)
def kept_at(samples, k):
    """Return the columns and the memory in which particles are kept at the beginning of step k, in which there is a
    sample.
    """
    row = samples.first[k]
    states = samples.states[row]
    return Columns(states[0:3], states[3:6], states[6:9], states[9:12]), samples.memory[row]


class Followers(NamedTuple):
    """The massless particles of a march.

    columns : their states, (3, padded) each
    memory : (particles, rows, 8), the carry of each; clocks : (particles, columns), of those that have clocks of their
        own: see `orbits.marching.following.own_clocks.BEFORE`
    retired : (padded, 2) int64, a row for each particle: why it was retired (0: it was not), and before which step of
        the block. One that cannot be stepped is retired alone, and keeps its state before the step
    samples : see `SamplesInBlock`
    """

    columns: Columns
    memory: Any
    clocks: Any
    retired: Any
    samples: SamplesInBlock


class Room(NamedTuple):
    """What a thread has for itself.

    scratch : workspace of a step; track : (rows, 8), receives the states of eight, or of twice eight, particles at the
        beginning of each step
    observer, context : see `orbits.kernels.search.observers`; evaluations : int64, the first of which is their number
    """

    scratch: Any
    track: Any
    observer: Any
    context: Any
    evaluations: Any


@verb
def begin(following, own, clock, block):
    """Prepare for a block."""
    compiled = kernel_of(following, "begin")
    if compiled is None:
        return lambda following, own, clock, block: None
    return WithoutFirst(compiled)


@verb
def march_some(following, own, form, method, model, clock, block, particles, room, first, last):
    """March particles first ... last - 1 through a block."""
    return WithoutFirst(kernel_of(following, "march"))


@verb
def group_of(following):
    """Return the number of particles in a piece of the work."""
    group = kernel_of(following, "group")
    return lambda following: group


@kernel
def follow_block(turns, following, form, own_form, tag, timing, block, particles, room, own):
    """March the massless particles through the steps that the massive bodies have just taken, as one of several
    threads.

    turns : see `orbits.kernels.rounds`; following : the tag of the way of following, and own : its record
    form, own_form, tag, timing : the tags of the method, of that of a particle's own steps, of the Lagrangian and of
        the clock; block, particles, room : see these
    """
    method, model = Method(form, block.coefficients), Model(tag, block.parameters)
    clock, group, count = Clock(timing, block.numbers, block.times), group_of(following), particles.memory.shape[0]
    number = next_round(turns, 0)
    while number > 0:
        begin(following, own, clock, block)
        first = group * claim_piece(turns)
        while first < count:
            last = min(first + group, count)
            room.evaluations[0] += march_some(
                following, own, own_form, method, model, clock, block, particles, room, first, last
            )
            first = group * claim_piece(turns)
        number = next_round(turns, number)
