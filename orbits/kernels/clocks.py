"""The contract of a clock: the times and lengths of the steps of a march.

A clock enters compiled code as a tag, like a method (see `orbits.kernels.steps`), with a vector of numbers: its state.
Each function below is resolved at compile time to the clock's own:

    step_of(clock, k) -> (t, h)
        the time at which step k of a block begins, and its length; for a clock that chooses, after the step is taken
    take_step(clock, method, model, k, state, storage) -> (status, where, evaluations)
        chooses step k of a block, lets the method take it, and repeats it if the clock rejects it. The status is that
        of the last attempt; `BEYOND` if the step would pass the goal of the march, `TOO_SHORT` if its length vanishes

In Python, clocks are the classes of `orbits.marching.clocks.clock`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import Tag, of_record
from orbits.kernels.compile import kernel
from orbits.kernels.steps import step


class Clock(NamedTuple):
    """A clock: the tag of its kind, the vector of its state, and a vector of workspace."""

    tag: Any
    numbers: Any
    room: Any


@of_record()
def step_of(clock, k):
    """Return the time at which step k of a block begins, and its length."""


@of_record()
def take_step(clock, method, model, k, state, storage):
    """Take step k of a block. Returns (status, where, evaluations)."""


START, FIRST, LENGTH = 0, 1, 2
"""The state of constant steps: the start of the march, the number of steps taken, and the length of a step."""


@kernel(inline=True)
def constant_step_of(clock, k):
    """Return t = start + (first + k) h, and h: no rounding errors accumulate over the steps."""
    h = clock.numbers[LENGTH]
    return clock.numbers[START] + (clock.numbers[FIRST] + k) * h, h


@kernel(inline=True)
def take_constant_step(clock, method, model, k, state, storage):
    """Take a step; none is rejected."""
    t, h = constant_step_of(clock, k)
    return step(method, model, t, h, state, storage)


CONSTANT_STEPS = Tag("constant-steps", {"step_of": constant_step_of, "take_step": take_constant_step})
