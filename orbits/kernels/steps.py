"""The contract of a step: what a method's compiled functions take, and how the driver finds them.

A step is a function of values. It knows nothing of recording, watching, sampling, threads or files; the loop that calls
it (`orbits.marching.driver`) knows nothing of stages. A method enters compiled code as a tag, as a Lagrangian does (see
`orbits.kernels.binding`), and each function below is resolved at compile time to the method's own:

    begin(method, model, t, h, state, storage)
        what can be derived from the state, such as the first force; called when a block of steps begins.
        For forms that threads share it depends on q alone, and is left out where q is that of the last block's end
    step(method, model, t, h, state, storage) -> (status, where, evaluations)
        one step of h from time t, in place. One that fails says at which body or coordinate. It may spoil state and
        carry: to go on, restore both and call `begin` again. Explicit methods always succeed: whether the state is
        finite is looked at once a block
    prepare(method, h, before, storage)
        for clocks that change h: write the coefficients of steps of h, after one of `before`
    signal(method, model, storage) -> float
        how much of the forces the step just taken could not resolve: 0 for none, 1 for all
    begin_particles(method, model, particles, storage) -> carry
    step_particles(method, model, t, h, particles, carry, storage) -> (particles, carry, status, evaluations)
        the same for massless particles, which are values: eight in lanes, or one with its stages in lanes, as the
        constant `width` of the method says. `storage.stages` is what the massive bodies' step went through.
        In lanes the status goes unread: what cannot be stepped becomes NaN in its lane, and is found there after the
        block; `begin_particles` is called for lanes only, and what they carry ends with the block
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from orbits.kernels.binding import OPTIONS, kernel_of
from orbits.kernels.lanes import WIDTH

OK, NOT_CONVERGED, NOT_FINITE, NOT_REGULAR = 0, 1, 2, 3
"""What became of a step."""

BEYOND, TOO_SHORT = 4, 5
"""Why a clock took none: it would lead too far, or it is too short to change the time."""


class State(NamedTuple):
    """Where d coordinates are: vectors padded to whole lanes; (q, q_lo) and (p, p_lo) are numbers of doubled precision.

    In second-order form the velocities stand for the momenta p. Of n bodies all x come first, then all y, all z.
    """

    q: Any
    q_lo: Any
    p: Any
    p_lo: Any


class Particles(NamedTuple):
    """Positions and velocities of massless particles with their low parts: eight in `Lanes`, or one in float64."""

    x: Any
    y: Any
    z: Any
    x_lo: Any
    y_lo: Any
    z_lo: Any
    vx: Any
    vy: Any
    vz: Any
    vx_lo: Any
    vy_lo: Any
    vz_lo: Any


class Model(NamedTuple):
    """What is solved: the tag of a Lagrangian, and its parameters."""

    tag: Any
    parameters: Any


class Method(NamedTuple):
    """How it is solved: the tag of a form of a method, and its numbers for steps of this length."""

    tag: Any
    coefficients: Any


class Share(NamedTuple):
    """The coordinates that are one thread's to move, start ... stop - 1, start being a multiple of eight; of massless
    particles the numbers of those in the lanes, or of the one.

    barrier : None for a thread alone, else a `Barrier`
    """

    start: Any
    stop: Any
    barrier: Any


class Storage(NamedTuple):
    """What a step finds and leaves beside the state.

    carry : (rows, 8), carried from step to step and into archives; zeros for a cold start
    scratch : (rows, columns), free to use; explicit methods keep the last force there between `begin` and `step`
    stages : (rows, columns), where the step goes through: what massless particles feel
    share : which coordinates to move
    """

    carry: Any
    scratch: Any
    stages: Any
    share: Any


def begin(method, model, t, h, state, storage):
    """Prepare what is derived from the state; nothing for a method without it."""
    raise NotImplementedError("begin() is for compiled code only")


@overload(begin, jit_options=OPTIONS)
def _begin(method, model, t, h, state, storage):
    compiled = _kernel(method, "begin")
    if compiled is None:
        return lambda method, model, t, h, state, storage: None
    return lambda method, model, t, h, state, storage: compiled(method, model, t, h, state, storage)


def step(method, model, t, h, state, storage):
    """Take one step. Returns (status, where, evaluations)."""
    raise NotImplementedError("step() is for compiled code only")


@overload(step, jit_options=OPTIONS)
def _step(method, model, t, h, state, storage):
    compiled = _kernel(method, "step")
    return compiled and (lambda method, model, t, h, state, storage: compiled(method, model, t, h, state, storage))


def prepare(method, h, before, storage):
    """Write the coefficients of steps of h, after one of `before`."""
    raise NotImplementedError("prepare() is for compiled code only")


@overload(prepare, jit_options=OPTIONS)
def _prepare(method, h, before, storage):
    compiled = _kernel(method, "prepare")
    return compiled and (lambda method, h, before, storage: compiled(method, h, before, storage))


def signal(method, model, storage):
    """Return how much of the forces the step just taken could not resolve."""
    raise NotImplementedError("signal() is for compiled code only")


@overload(signal, jit_options=OPTIONS)
def _signal(method, model, storage):
    compiled = _kernel(method, "signal")
    return compiled and (lambda method, model, storage: compiled(method, model, storage))


def begin_particles(method, model, particles, storage):
    """Return what particles carry into a block of steps; by default their rows of `storage.carry`."""
    raise NotImplementedError("begin_particles() is for compiled code only")


@overload(begin_particles, jit_options=OPTIONS)
def _begin_particles(method, model, particles, storage):
    compiled = _kernel(method, "begin_particles")
    if compiled is None:
        return lambda method, model, particles, storage: storage.carry
    return lambda method, model, particles, storage: compiled(method, model, particles, storage)


def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of massless particles. Returns (particles, carry, status, evaluations)."""
    raise NotImplementedError("step_particles() is for compiled code only")


@overload(step_particles, jit_options=OPTIONS)
def _step_particles(method, model, t, h, particles, carry, storage):
    compiled = _kernel(method, "step_particles")
    return compiled and (
        lambda method, model, t, h, particles, carry, storage: compiled(method, model, t, h, particles, carry, storage)
    )


def lanes_of(method):
    """Return how many particles `step_particles` of a `Method` of that Numba type takes at once: 8 or 1."""
    return _kernel(method, "width") or WIDTH


def _kernel(method, name):
    """Return what a method's tag has under a name; `method` is the Numba type of a `Method`."""
    return kernel_of(method.types[0], name)
