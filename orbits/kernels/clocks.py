"""The contract of a clock: when the steps of a march are, and how long.

A clock enters compiled code as a tag, as a method does (see `orbits.kernels.steps`), with a vector of numbers: all that
it knows. Each function below is resolved at compile time to the clock's own:

    step_of(clock, k) -> (t, h)
        when step k of a block begins, and how long it is

Python makes clocks of `orbits.marching.clocks`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from orbits.kernels.binding import OPTIONS, Tag, kernel_of
from orbits.kernels.compile import kernel


class Clock(NamedTuple):
    """When steps are: the tag of a kind of clock, and its numbers in a vector."""

    tag: Any
    numbers: Any


def step_of(clock, k):
    """Return when step k of a block begins, and how long it is."""
    raise NotImplementedError("step_of() is for compiled code only")


@overload(step_of, jit_options=OPTIONS)
def _step_of(clock, k):
    compiled = kernel_of(clock.types[0], "step_of")
    return compiled and (lambda clock, k: compiled(clock, k))


START, FIRST, LENGTH = 0, 1, 2
"""The numbers of constant steps: when the march began, how many steps it has taken, and the length of a step."""


@kernel(inline=True)
def constant_step_of(clock, k):
    """Return t = start + (first + k) h and h: no error of summation grows with the steps."""
    h = clock.numbers[LENGTH]
    return clock.numbers[START] + (clock.numbers[FIRST] + k) * h, h


CONSTANT_STEPS = Tag("constant-steps", {"step_of": constant_step_of})
