"""Threads that share the work on a block: those that come in time take part, and none waits for one that has not come.

The thread that has a block opens a round and claims its pieces one after another; the other threads claim pieces as
well, as long as there are some. Then the round is closed, once those within have finished theirs. Between rounds they
watch for the next one and do not sleep: a thread that is woken may be given the processor of the thread that wakes it,
and then the two take turns. With rounds of a millisecond, two threads took as long as one. A thread that has watched
in vain for a while leaves.

The counters are an int64 vector of `COUNTERS` elements, all 0 at first, read and changed atomically.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.barrier import SPINS, add, give_way, read, write
from orbits.kernels.compile import kernel

OPEN, ROUNDS, CLAIMED, WITHIN, DISMISSED = 0, 8, 16, 24, 32
"""Indices of the counters, each in a cache line of its own: the number of the open round, or 0; the rounds so far; the
pieces claimed; the other threads within the round; and whether they are to leave."""

COUNTERS = 40


class Turns(NamedTuple):
    """What a thread knows of the rounds.

    counters : int64, shared by all threads; member : its number, 0 for the one that opens the rounds
    patience : how often one of the others looks for the next round before it leaves
    """

    counters: Any
    member: Any
    patience: Any


@kernel
def claim_piece(turns):
    """Return the next of the pieces 0, 1, ... of the round."""
    return add(turns.counters, CLAIMED, 1)


@kernel
def next_round(turns, last):
    """Open a round, or close the last one after waiting for the others within it; as one of the others, leave the last
    one, and watch for the next and enter it. Return the number of the round, or 0 if there is none.

    last : 0 before the first one
    """
    counters, member, patience = turns
    looks = 0
    if member == 0:
        if last == 0:
            write(counters, CLAIMED, 0)
            number = add(counters, ROUNDS, 1) + 1
            write(counters, OPEN, number)
            return number
        write(counters, OPEN, 0)
        while read(counters, WITHIN) > 0:
            looks += 1
            if looks > SPINS:
                give_way()
        return 0
    if last > 0:
        add(counters, WITHIN, -1)
    while looks <= patience and read(counters, DISMISSED) == 0:
        if read(counters, OPEN) > last:
            # Once it is within, the round stays open until it leaves; it may have been closed before.
            add(counters, WITHIN, 1)
            now = read(counters, OPEN)
            if now > last:
                return now
            add(counters, WITHIN, -1)
        looks += 1
        if looks > SPINS:
            give_way()
    return 0
