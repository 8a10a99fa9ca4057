"""The contract of a clock: when the steps of a march are, and how long.

A clock enters compiled code as a tag, as a method does (see `orbits.kernels.steps`), with a vector of numbers: all that
it knows. Each function below is resolved at compile time to the clock's own:

    step_of(clock, k) -> (t, h)
        when step k of a block begins, and how long it is; of a clock that chooses, once the step is taken
    take_step(clock, method, model, k, state, storage) -> (status, where, evaluations)
        step k of a block: chosen, taken by the method and, where the clock refuses it, taken again. The status is that
        of the last one, `BEYOND` where it would lead past what the march is bound for, `TOO_SHORT` where it vanishes

Python makes clocks of `orbits.marching.clocks`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from orbits.kernels.binding import OPTIONS, Tag, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.steps import step


class Clock(NamedTuple):
    """When steps are: the tag of a kind of clock, what it knows, in a vector, and a vector that it is free to use."""

    tag: Any
    numbers: Any
    room: Any


def step_of(clock, k):
    """Return when step k of a block begins, and how long it is."""
    raise NotImplementedError("step_of() is for compiled code only")


@overload(step_of, jit_options=OPTIONS)
def _step_of(clock, k):
    compiled = kernel_of(clock.types[0], "step_of")
    return compiled and (lambda clock, k: compiled(clock, k))


def take_step(clock, method, model, k, state, storage):
    """Take step k of a block. Returns (status, where, evaluations)."""
    raise NotImplementedError("take_step() is for compiled code only")


@overload(take_step, jit_options=OPTIONS)
def _take_step(clock, method, model, k, state, storage):
    compiled = kernel_of(clock.types[0], "take_step")
    return compiled and (
        lambda clock, method, model, k, state, storage: compiled(clock, method, model, k, state, storage)
    )


START, FIRST, LENGTH = 0, 1, 2
"""The numbers of constant steps: when the march began, how many steps it has taken, and the length of a step."""


@kernel(inline=True)
def constant_step_of(clock, k):
    """Return t = start + (first + k) h and h: no error of summation grows with the steps."""
    h = clock.numbers[LENGTH]
    return clock.numbers[START] + (clock.numbers[FIRST] + k) * h, h


@kernel(inline=True)
def take_constant_step(clock, method, model, k, state, storage):
    """Take a step; none is refused."""
    t, h = constant_step_of(clock, k)
    return step(method, model, t, h, state, storage)


CONSTANT_STEPS = Tag("constant-steps", {"step_of": constant_step_of, "take_step": take_constant_step})
