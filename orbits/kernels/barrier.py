"""Threads that go through one compiled loop together: where they wait for each other, and how they share work.

The counters are an int64 vector of `COUNTERS` elements, all 0 when the loop begins. They are changed and read as
atoms, and what a thread wrote before a meeting, all threads read after it.
"""

from __future__ import annotations

import sys

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from orbits.kernels.compile import kernel
from orbits.kernels.lanes.type import element_pointer

ARRIVED, CLAIMED, ABANDONED = 0, 8, 16
"""Places of the counters, each in a line of the processor's cache of its own."""

COUNTERS = 24

SPINS = 2000
"""How often a thread looks whether the others have come, before it lets another program have the processor."""

_YIELD = "SwitchToThread" if sys.platform == "win32" else "sched_yield"


@intrinsic
def _add(typingctx, counters, place):
    """Add one to a counter; return what it was."""

    def codegen(context, builder, sig, args):
        pointer = _pointer(context, builder, sig, args)
        return builder.atomic_rmw("add", pointer, ir.Constant(ir.IntType(64), 1), "seq_cst")

    return types.int64(counters, place), codegen


@intrinsic
def _read(typingctx, counters, place):
    """Return a counter as it is now."""

    def codegen(context, builder, sig, args):
        return builder.load_atomic(_pointer(context, builder, sig, args), "seq_cst", 8)

    return types.int64(counters, place), codegen


@intrinsic
def _give_way(typingctx):
    """Let another thread or program have the processor."""

    def codegen(context, builder, sig, args):
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.IntType(32), []), _YIELD)
        builder.call(function, [])
        return context.get_dummy_value()

    return types.void(), codegen


def _pointer(context, builder, sig, args):
    place = context.cast(builder, args[1], sig.args[1], types.int64)
    return element_pointer(context, builder, sig.args[0], args[0], place)


@kernel
def meet(counters, team, meeting):
    """Wait until all of a team have come to a meeting; the first one is number 1."""
    _add(counters, ARRIVED)
    looks = 0
    while _read(counters, ARRIVED) < team * meeting and _read(counters, ABANDONED) == 0:
        looks += 1
        if looks > SPINS:
            _give_way()


@kernel
def claim(counters, team, round_, count):
    """Return the next of the pieces 0 ... count - 1 of a round, or `count` when all are taken.

    Each of the team asks until it is told so, once, before it goes to a meeting; rounds count from 0 and are of one
    size.
    """
    piece = _add(counters, CLAIMED) - round_ * (count + team)
    return piece if 0 <= piece < count else count


@kernel(inline=True)
def _accelerate_together(share, model, q, g):
    """Write the accelerations of all bodies, each thread those of the pieces that it claims."""
    counters, threads, _, rounds = share.barrier
    pieces = (bodies(model.tag, model.parameters) + PIECE - 1) // PIECE
    round_ = rounds[0]
    rounds[0] = round_ + 1
    meet(counters, threads, 2 * round_ + 1)
    piece = claim(counters, threads, round_, pieces)
    while piece < pieces:
        accelerate_piece(model, q, g, piece)
        piece = claim(counters, threads, round_, pieces)
    meet(counters, threads, 2 * round_ + 2)
