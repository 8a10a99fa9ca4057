"""Clocks whose steps differ in length: what they share.

The steps depend on the state alone, not on the samples: a march stops before the step that would pass its goal, and a
sample is computed on a copy, whose last step ends at the goal.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.integrators.forms import Array
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store
from orbits.marching.clocks.constant import Clock, Place

TIME, TIME_LO, LENGTH, DIRECTION, LIMIT, EXACT, ORIGIN, NEXT = 0, 1, 2, 6, 7, 8, 9, 10
"""The state of such a clock: the time reached, in doubled precision; the last step; the direction 1 or -1; the time
limit; whether a step ends at the limit (1) or the march stops before it (0); the time at which the block began; and the
time at which a step would end that was refused by the limit, or the time reached. Numbers 3 to 5 are the clock's own.
"""

NUMBERS = 11

FARTHEST = sys.float_info.max
"""The time limit of a march without a goal: finite, as all that archives hold."""


def since(block: int) -> int:
    """Return the place in the workspace of the time that terms and forces see when the clock reads 0."""
    return 3 * (block + 1)


@kernel(inline=True)
def step_of(clock, k):
    """Return the time at which step k of a block began, and its length."""
    return clock.numbers[ORIGIN] + clock.room[k], clock.room[k + 1] - clock.room[k]


@kernel(inline=True)
def keep(room, at, state, carry):
    """Copy the state and carry into `room`, starting at `at`."""
    for x in (state.q, state.q_lo, state.p, state.p_lo):
        for k in range(0, x.shape[0], WIDTH):
            store(room, at + k, load(x, k))
        at += x.shape[0]
    for row in range(carry.shape[0]):
        store(room, at + WIDTH * row, load(carry, row))


@kernel(inline=True)
def put_back(room, at, state, carry):
    """Restore the state and carry from `room`, starting at `at`."""
    for x in (state.q, state.q_lo, state.p, state.p_lo):
        for k in range(0, x.shape[0], WIDTH):
            store(x, k, load(room, at + k))
        at += x.shape[0]
    for row in range(carry.shape[0]):
        store(carry, row, load(room, at + WIDTH * row))


def ending(checkpoint: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return a checkpoint of a march whose last step is to end at its goal."""
    clock = checkpoint["clock"].copy()
    clock[[EXACT, NEXT]] = 1.0, clock[TIME]
    return {**checkpoint, "clock": clock}


def is_number(x: object) -> bool:
    """Return whether x is a real number: not a text, nor True or False."""
    return isinstance(x, int | float | np.floating) and not isinstance(x, bool | str)


class ChangingSteps(Clock):
    """Base of clocks whose steps differ in length: their readings are times."""

    @property
    def h(self) -> float:  # type: ignore[override]
        """NaN: the steps have no common length."""
        return math.nan

    @property
    def changes(self) -> bool:
        """Whether steps differ in length."""
        return True

    def towards(self, direction: float) -> ChangingSteps:
        """Return this clock for a run in a direction, 1 or -1."""
        raise NotImplementedError

    def numbers_for(self, integrator: Any) -> Array:
        """Return the state of the clock at the start of a march by a method whose steps it can choose."""
        raise NotImplementedError

    def describe(self, integrator: Any) -> str:
        """Return the steps of a method in words, as in: adaptive steps (tolerance 1e-09)."""
        raise NotImplementedError

    def attribute(self, integrator: Any) -> str:
        """Return the same for a table's attributes, as in: adaptive, tolerance 1e-09."""
        raise NotImplementedError

    def room(self, block: int, size: int) -> int:
        """Return the length of the workspace: the times of a block since its beginning, the lengths of its steps, the
        times at which they begin for terms and forces, that which these see when the clock reads 0, and the state
        before a step.
        """
        return since(block) + 1 + size

    def time(self, reading: Any) -> Any:
        """Return the time that this clock reads: a time is its own reading."""
        return reading * 1.0

    def place(self, time: float | Fraction) -> Place:
        """Return the place of a time: no whole steps, as they are not known beforehand."""
        return Place(0, float(time))

    def places(self, times: ArrayLike) -> tuple[NDArray[np.int64], Array]:
        """Return the places of times: no whole steps, and the times."""
        rest = np.asarray(times, dtype=np.float64)
        return np.zeros(rest.shape, dtype=np.int64), rest
