"""Threads that run one compiled loop together: how they synchronize and divide the work.

The counters are an int64 vector of `COUNTERS` elements, all 0 when the loop begins. They are read and changed
atomically, and everything written before a meeting is visible to all threads after it.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from orbits.kernels.binding import accelerate, accelerate_some, bodies
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes.type import element_pointer

ARRIVED, CLAIMED, ABANDONED = 0, 8, 16
"""Indices of the counters, each in a cache line of its own."""

COUNTERS = 24

PIECE = 64
"""Number of bodies whose accelerations a thread computes at a time: whole pairs of registers."""

SPINS = 2000
"""How often a thread checks for the others before it yields the processor."""


class Barrier(NamedTuple):
    """The meeting point of threads.

    counters : (COUNTERS,) int64, shared by all threads
    threads : the number of threads
    rounds : (1,) int64, the number of shared evaluations of this thread so far
    """

    counters: Any
    threads: Any
    rounds: Any


_YIELD = "SwitchToThread" if sys.platform == "win32" else "sched_yield"


@intrinsic
def add(typingctx, counters, place, number):
    """Add a number to a counter; return its previous value."""

    def codegen(context, builder, sig, args):
        number = context.cast(builder, args[2], sig.args[2], types.int64)
        return builder.atomic_rmw("add", _pointer(context, builder, sig, args), number, "seq_cst")

    return types.int64(counters, place, number), codegen


@intrinsic
def read(typingctx, counters, place):
    """Return the current value of a counter."""

    def codegen(context, builder, sig, args):
        return builder.load_atomic(_pointer(context, builder, sig, args), "seq_cst", 8)

    return types.int64(counters, place), codegen


@intrinsic
def write(typingctx, counters, place, number):
    """Set a counter."""

    def codegen(context, builder, sig, args):
        number = context.cast(builder, args[2], sig.args[2], types.int64)
        builder.store_atomic(number, _pointer(context, builder, sig, args), "seq_cst", 8)
        return context.get_dummy_value()

    return types.void(counters, place, number), codegen


@intrinsic
def give_way(typingctx):
    """Yield the processor to another thread or program."""

    def codegen(context, builder, sig, args):
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.IntType(32), []), _YIELD)
        builder.call(function, [])
        return context.get_dummy_value()

    return types.void(), codegen


def _pointer(context, builder, sig, args):
    place = context.cast(builder, args[1], sig.args[1], types.int64)
    return element_pointer(context, builder, sig.args[0], args[0], place)


@kernel
def meet(counters, threads, meeting):
    """Wait until all threads have arrived at a meeting; the first meeting has number 1."""
    add(counters, ARRIVED, 1)
    looks = 0
    while read(counters, ARRIVED) < threads * meeting and read(counters, ABANDONED) == 0:
        looks += 1
        if looks > SPINS:
            give_way()


@kernel
def claim(counters, threads, round_, count):
    """Return the next of the pieces 0 ... count - 1 of a round, or `count` if all are taken.

    Each thread must receive `count` exactly once before it goes to a meeting; rounds are numbered from 0 and have equal
    sizes.
    """
    piece = add(counters, CLAIMED, 1) - round_ * (count + threads)
    return piece if 0 <= piece < count else count


@verb
def accelerate_shared(share, model, q, g):
    """Write the accelerations of all bodies, by one thread, or by several together."""
    if isinstance(share.types[2], types.NoneType):
        return lambda share, model, q, g: accelerate(model.tag, model.parameters, q, g)
    return lambda share, model, q, g: accelerate_together(share.barrier, model, q, g)


@kernel
def accelerate_together(barrier, model, q, g):
    """Write the accelerations of all bodies; each thread computes the pieces that it claims."""
    n = bodies(model.tag, model.parameters)
    pieces = (n + PIECE - 1) // PIECE
    round_ = barrier.rounds[0]
    barrier.rounds[0] = round_ + 1
    meet(barrier.counters, barrier.threads, 2 * round_ + 1)
    piece = claim(barrier.counters, barrier.threads, round_, pieces)
    while piece < pieces:
        accelerate_some(model.tag, model.parameters, q, g, PIECE * piece, min(PIECE * (piece + 1), n))
        piece = claim(barrier.counters, barrier.threads, round_, pieces)
    meet(barrier.counters, barrier.threads, 2 * round_ + 2)
