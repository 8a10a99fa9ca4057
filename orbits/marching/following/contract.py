"""The contract of a follower: how massless particles are marched through a block of steps of the massive bodies.

A way of following enters compiled code as a tag, like a method (see `orbits.kernels.steps`), with a record of its own,
`own`. Two functions are resolved at compile time to its kernels:

    begin(own, method, model, clock, block, steps)
        called by each thread before its first particles of a block
    march(own, form, method, model, clock, block, particles, room, first, last) -> evaluations
        marches particles first ... last - 1 through the block, and calls the observer for each group of eight. One that
        is lost is noted in `particles.retired`, with the step before which it was; the others go on. `form` is the tag
        of the method of a particle's own steps

and `group` is the number of particles in a piece of the work, a multiple of eight. Nothing that a particle does depends
on another one or on the thread that marches it. In Python, followers are the classes of
`orbits.marching.following.follower`.
"""

from __future__ import annotations

from orbits.kernels.binding import kernel_of
from orbits.kernels.clocks import Clock
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.rounds import begin_round, claim_piece, end_round
from orbits.kernels.steps import Method, Model


@verb
def group_of(following):
    """Return the number of particles in a piece of the work."""
    group = kernel_of(following, "group")
    return lambda following: group


@verb
def begin(following, own, method, model, clock, block, steps):
    """Prepare for a block of `steps` steps."""
    compiled = kernel_of(following, "begin")
    if compiled is None:
        return lambda following, own, method, model, clock, block, steps: None
    return lambda following, own, method, model, clock, block, steps: compiled(own, method, model, clock, block, steps)


@verb
def march_some(following, own, form, method, model, clock, block, particles, room, first, last):
    """March particles first ... last - 1 through the block."""
    compiled = kernel_of(following, "march")
    return lambda following, own, form, method, model, clock, block, particles, room, first, last: compiled(
        own, form, method, model, clock, block, particles, room, first, last
    )


@kernel
def follow_block(turns, following, form, own_form, tag, timing, block, particles, room, own):
    """March the massless particles through the steps that the massive bodies have just taken, as one of several
    threads.

    turns : see `orbits.kernels.rounds`; following : the tag of the way of following, and own : its record
    form, own_form, tag, timing : the tags of the method, of that of a particle's own steps, of the Lagrangian and of
        the clock; block, particles, room : see `orbits.marching.following.block`
    """
    method, model = Method(form, block.coefficients), Model(tag, block.parameters)
    clock, group, count = Clock(timing, block.numbers, block.times), group_of(following), particles.memory.shape[0]
    number = begin_round(turns)
    while number > 0:
        begin(following, own, method, model, clock, block, block.count[0])
        first = group * claim_piece(turns)
        while first < count:
            last = min(first + group, count)
            room.evaluations[0] += march_some(
                following, own, own_form, method, model, clock, block, particles, room, first, last
            )
            first = group * claim_piece(turns)
        number = end_round(turns, number)
