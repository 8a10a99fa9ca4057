"""The contract of a step: the compiled functions of a method, their arguments, and how the driver finds them.

A step is a function of values. It is independent of recording, observers, samples, threads and files; the loop that
calls it (`orbits.marching.stepping.driver`) is independent of stages. A method enters compiled code as a tag, like a
Lagrangian (see `orbits.kernels.binding`), and each function below is resolved at compile time to the method's own:

    begin(method, model, t, h, state, storage)
        computes what is derived from the state, such as the first force; called at the beginning of a block of steps.
        For forms divided among threads it depends on q alone, and is skipped if q is that at the end of the last block
    step(method, model, t, h, state, storage) -> (status, where, evaluations)
        one step of h from time t, in place. A step that fails returns the body or coordinate. It may leave state and
        carry invalid: to go on, restore both and call `begin` again. Explicit methods always succeed: the driver checks
        once a block that the state is finite
    enter(method, model, h, state, storage), leave(method, model, h, state, storage)
        for methods that march other variables than those seen: compute what is marched, in `storage.carry`, from the
        state that is seen, and the reverse; called at the start of a run, before and after partial steps, and on
        copies: outputs do not change the run
    show(method, model, state, storage)
        the same as `leave` to the accuracy that observers of each step need, and fast: called before each step that is
        recorded, with rows of the record instead of the state, and at the end of a block
    prepare(method, h, before, storage)
        for clocks that change h: writes the coefficients of a step of h that follows one of `before`
    end_late(method, by)
        for the same clocks: tells how much later than t + h the next step ends, by their rounding
    signal(method, model, h, state, storage) -> float
        the fraction of the forces that the step just taken did not resolve: 0 for none, 1 for all
    elapsed(method, state, storage) -> (dt, dt_lo)
        for steps of another variable than time: the time that the step just taken took, in doubled precision
    part(method, model, t, h, state, storage) -> (status, where, evaluations)
        for steps of another variable than time: a step that takes the time h, with coefficients of its own; for other
        forms it is `step`
    begin_particles(method, model, particles, storage) -> carry
    step_particles(method, model, t, h, particles, carry, storage) -> (particles, carry, status, evaluations)
        the same for massless particles, which are passed as values: eight in lanes, or one with its stages in lanes,
        depending on the constant `width` of the method. `storage.stages` has the stages of the massive bodies.
        In lanes the status is ignored: a particle that cannot be stepped becomes NaN in its lane, and is detected after
        the block; `begin_particles` is called for lanes only, whose carry lasts for one block
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import kernel_of, of_record
from orbits.kernels.compile.verbs import verb
from orbits.kernels.search.paths import record_strip

OK, NOT_CONVERGED, NOT_FINITE, NOT_REGULAR = 0, 1, 2, 3
"""The status of a step."""

IMPACT = 6
"""The status of a massless particle that has hit a body."""

NEAR_A_PLANET, NOT_RESOLVED = 7, 8
"""The status of a massless particle that came closer to a planet, or to the dominant body, than its method can
follow."""

INNER_NOT_CONVERGED = 9
"""The status of a step in which the internal variables of a force have not converged."""

NOWHERE = 1e6
"""Position of the padding in the last group of eight particles, of retired particles, and of lanes without a particle,
which nothing attracts: finite, and never read. Observers see NaN for a retired particle, so that every comparison with
it is false.
"""

NO_MULTIPLIERS = 20
"""The status of a step with constraints from whose end nothing leads back to them, or at which they are dependent."""

BEYOND, TOO_SHORT = 4, 5
"""Why a clock took no step: it would pass the goal, or it is too short to change the time."""


class State(NamedTuple):
    """The state of d coordinates: vectors padded to whole lanes; (q, q_lo) and (p, p_lo) have doubled precision.

    In second-order form p holds the velocities. The coordinates of n bodies are all x, then all y, then all z.
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
    """The problem: the tag of a Lagrangian, and its parameters."""

    tag: Any
    parameters: Any


class Method(NamedTuple):
    """The method: the tag of a form, and its coefficients for steps of this length."""

    tag: Any
    coefficients: Any


class Share(NamedTuple):
    """The coordinates start ... stop - 1 that one thread advances, with start a multiple of eight; for massless
    particles, the numbers of those in the lanes, or of the single one.

    barrier : None for a single thread, else a `Barrier`
    """

    start: Any
    stop: Any
    barrier: Any


class Storage(NamedTuple):
    """The arrays that a step reads and writes in addition to the state.

    carry : (rows, 8), kept from step to step and in archives; zeros for a cold start
    scratch : (rows, columns), workspace; explicit methods keep the last force there between `begin` and `step`
    stages : (rows, columns), the stages of the step, from which massless particles are accelerated
    share : the coordinates to advance
    """

    carry: Any
    scratch: Any
    stages: Any
    share: Any


@of_record(optional=True)
def begin(method, model, t, h, state, storage):
    """Compute what is derived from the state; does nothing for a method without `begin`."""


@of_record()
def step(method, model, t, h, state, storage):
    """Take one step. Returns (status, where, evaluations)."""


@of_record(optional=True)
def enter(method, model, h, state, storage):
    """Compute what is marched from what is seen; does nothing for a method that marches this."""


@of_record(optional=True)
def leave(method, model, h, state, storage):
    """Compute what is seen from what is marched; does nothing for a method that marches this."""


@of_record(optional=True)
def show(method, model, state, storage):
    """Compute what observers see; does nothing for a method that marches what is seen."""


@verb
def record(method, model, state, storage, path, row):
    """Write what observers see into a row of `path`, (rows * 2 * padded,), see `orbits.kernels.search.paths`."""
    compiled = _kernel(method, "show")
    if compiled is None:
        return lambda method, model, state, storage, path, row: record_strip(
            path, row, state.q, state.p, storage.share.start, storage.share.stop
        )

    def show_in_path(method, model, state, storage, path, row):
        if path.shape[0] > 0:
            width = state.q.shape[0]
            first = 2 * row * width
            q, p = path[first : first + width], path[first + width : first + 2 * width]
            compiled(method, model, State(q, state.q_lo, p, state.p_lo), storage)

    return show_in_path


@of_record()
def prepare(method, h, before, storage):
    """Write the coefficients of a step of h that follows one of `before`."""


@of_record(optional=True)
def end_late(method, by):
    """Tell a method by how much the end of its next step is later than t + h, as the clock rounds; for one that needs
    to know.
    """


@of_record()
def signal(method, model, h, state, storage):
    """Return the fraction of the forces that the step just taken did not resolve."""


@of_record()
def elapsed(method, state, storage):
    """Return the time that the step just taken took, as a pair in doubled precision."""


@verb
def part(method, model, t, h, state, storage):
    """Take a step that takes the time h. Returns (status, where, evaluations)."""
    return _kernel(method, "part") or _kernel(method, "step")


@verb
def begin_particles(method, model, particles, storage):
    """Return the carry of particles at the beginning of a block of steps; by default there is none, but a number."""
    return _kernel(method, "begin_particles") or (lambda method, model, particles, storage: OK)


@of_record()
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of massless particles. Returns (particles, carry, status, evaluations)."""


@of_record(optional=True)
def keep_particles(method, carry, storage):
    """Keep the carry of eight particles at the end of a block; by default it is lost."""


@verb
def begin_pair(method, model, one, two, storages):
    """Return the carry of two times eight particles at the beginning of a block; by default that of each."""
    compiled = _kernel(method, "begin_pair")
    if compiled is None:
        return lambda method, model, one, two, storages: (
            begin_particles(method, model, one, storages[0]),
            begin_particles(method, model, two, storages[1]),
        )
    return compiled


@verb
def step_pair(method, model, t, h, one, two, carry, storages):
    """Take one step of two times eight particles, by default of each. Returns (one, two, carry, evaluations of one)."""
    compiled = _kernel(method, "step_pair")
    if compiled is not None:
        return compiled

    def step_each(method, model, t, h, one, two, carry, storages):
        one, first, _, count = step_particles(method, model, t, h, one, carry[0], storages[0])
        two, second, _, _ = step_particles(method, model, t, h, two, carry[1], storages[1])
        return one, two, (first, second), count

    return step_each


@verb
def keep_pair(method, carry, storages):
    """Keep the carry of two times eight particles at the end of a block; by default that of each."""
    compiled = _kernel(method, "keep_pair")
    if compiled is not None:
        return compiled

    def keep_each(method, carry, storages):
        keep_particles(method, carry[0], storages[0])
        keep_particles(method, carry[1], storages[1])

    return keep_each


@of_record()
def enter_particles(method, model, state, particles, rows, storage):
    """Compute what is marched of particles from what is seen."""


@of_record()
def leave_particles(method, model, state, particles, rows, storage):
    """Compute what is seen of particles from what is marched."""


def _kernel(method, name):
    """Return the kernel of that name of a method's tag; `method` is the Numba type of a `Method`."""
    return kernel_of(method.types[0], name)
