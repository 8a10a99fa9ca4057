"""What the kernels of massless particles get: records that are made once for a march, of what is read and written in
each block.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.state import Columns


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


class Followers(NamedTuple):
    """The massless particles of a march.

    columns : their states, (3, padded) each
    memory : (particles, rows, 8), the carry of each; clocks : (particles, columns), of those that have clocks of their
        own: see `orbits.marching.following.own_clocks.BEFORE`
    retired : (padded, 2) int64, a row for each particle: why it was retired (0: it was not), and before which step of
        the block. One that cannot be stepped is retired alone, and keeps its state before the step
    """

    columns: Columns
    memory: Any
    clocks: Any
    retired: Any


class Room(NamedTuple):
    """What a thread has for itself.

    scratch : workspace of a step; track : (rows, 8), receives the states of eight, or of twice eight, particles at the
        beginning of each step
    observer, context : see `orbits.kernels.search.observers`; evaluations : (1,) int64, to which its own are added
    """

    scratch: Any
    track: Any
    observer: Any
    context: Any
    evaluations: Any
