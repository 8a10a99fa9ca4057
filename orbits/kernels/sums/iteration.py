"""Iteration of the stages of an implicit step, to the round-off floor.

A method gives `solve` a kernel `sweep(equations, first)` in a tag. It computes the unknowns of the equations from their
last values, and returns how much they changed, in the first sweep from zero, and whether all else has converged:

    STAGES = Tag("stages of my method", {"sweep": sweep})
    history, evaluations, _, _ = solve(STAGES, equations, history, NEAR_FLOOR, True, LIMIT)
    status = OK if settled(history, CONVERGED) else NOT_CONVERGED

No tolerance is used: a component, one coordinate or the three of a body, is done when its largest change over the
stages stops falling, or when the rate of convergence shows that the next change will be lost in rounding. One more
evaluation then follows, so that the remaining residual is far below one rounding error: a residual with a preferred
sign would act like friction.
"""

from __future__ import annotations

from numba import types

from orbits.kernels.binding import kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import any_lane, largest, load, maximum, minimum, row_maxima, store

LIMIT = 200
"""Number of evaluations after which a step fails."""

PATIENCE = 8
"""How often the change may fail to decrease while it is still far above the floor."""

LOST = 2.0**-53
"""A change below this fraction of the largest stage value is lost in rounding."""

FLOOR = 2.0**-50
"""For coordinates of any Lagrangian, a change below this fraction that has stopped falling is at the floor. A single
change that does not fall proves nothing: forces move the remaining error from one component to another.
"""

TIGHT = 2.0**-46
"""An iteration of any Lagrangian's coordinates that stops above this fraction has stalled, not converged."""

NEAR_FLOOR = 2.0**-40
"""A change below this fraction that has stopped falling is at the floor."""

CONVERGED = 2.0**-24
"""Beyond this fraction a stalled iteration has not converged; in between, cancellation between close bodies may set
the floor.
"""


@verb
def solve(rule, equations, history, floor, again, limit):
    """Sweep over the stages until their changes have stopped falling, and then once more, unless that is left to the
    end of the step.

    rule : a tag with the kernel `sweep`; equations : its first argument
    history : (3 blocks, 8), least change so far, last change and scale, one lane for each component, whose changes in
        each stage (lane) are rows of an array; or these three numbers of a single component, with changes in `Lanes`
    floor : the fraction of its scale below which a change that has stopped falling is at the floor
    again : whether the last sweep is one of these

    Returns (history, sweeps, complete, done): whether all else has converged, and whether changes stopped falling
    within `limit` sweeps.
    """
    sweep = kernel_of(rule, "sweep")
    judge = judge_one if isinstance(history, types.BaseTuple) else judge_rows

    def until_settled(rule, equations, history, floor, again, limit):
        sweeps, patience, last, complete, done = 0, PATIENCE, False, True, False
        while sweeps < limit and not done:
            change, complete = sweep(equations, sweeps == 0)
            sweeps += 1
            if last and complete:
                done = True
            else:
                history, patience, last = judge(change, history, sweeps, patience, floor)
                done = last and not again
        return history, sweeps, complete, done

    return until_settled


@kernel(inline=True)
def judge_rows(change, history, sweep, patience, floor):
    """Judge an iteration by the changes of a sweep.

    Returns, after sweep number 1, 2, ..., the history, the patience that is left, and whether the next sweep is the
    last one: the changes have stopped falling, and are below `floor` or have been given as many chances as there were.
    """
    last = False
    if sweep == 1:
        begin(change, history)
    elif not falling(change, history):
        patience -= 1
        last = patience == 0 or settled(history, floor)
    return history, patience, last


@kernel(inline=True)
def judge_one(change, history, sweep, patience, floor):
    """As `judge_rows`, of a single component."""
    now, last = largest(change), False
    least, before, scale = history if sweep > 1 else (now, now, now)
    if sweep > 1 and not (now < least and now * now > LOST * scale * before):
        patience -= 1
        last = patience == 0 or least <= floor * scale or now <= floor * scale
    return (min(least, now), now, scale), patience, last


@kernel
def begin(change, history):
    """Set the scale of each component from the first stage values, stored in `change` as if they were changes from
    zero.
    """
    blocks = history.shape[0] // 3
    for block in range(blocks):
        scale = row_maxima(change, 8 * block)
        store(history, block, scale)
        store(history, blocks + block, scale)
        store(history, 2 * blocks + block, scale)


@kernel
def falling(change, history):
    """Return whether the largest change of some component is still falling, above the level of rounding."""
    going, blocks = False, history.shape[0] // 3
    for block in range(blocks):
        now = row_maxima(change, 8 * block)
        least = load(history, block)
        last = load(history, blocks + block)
        scale = load(history, 2 * blocks + block)
        going |= any_lane((now < least) * (now * now > LOST * scale * last))
        store(history, block, minimum(now, least))
        store(history, blocks + block, now)
    return going


@kernel
def settled(history, fraction):
    """Return whether every component's least change is below `fraction` of its scale."""
    blocks = history.shape[0] // 3
    for block in range(blocks):
        if any_lane(load(history, block) > fraction * load(history, 2 * blocks + block)):
            return False
    return True


@kernel
def unsettled_body(history, bodies, rows, fraction):
    """Return the first body whose least change exceeds `fraction` of its largest stage value in any of its rows, one or
    three; -1 if none does.
    """
    blocks = history.shape[0] // 3
    for body in range(bodies):
        least, scale = 0.0, 0.0
        for k in range(body, rows * bodies, bodies):
            least = maximum(history[k // 8, k % 8], least)
            scale = maximum(history[2 * blocks + k // 8, k % 8], scale)
        if not least <= fraction * scale:
            return body
    return -1


@kernel
def unsettled_coordinate(history, size, fraction, of_largest):
    """Return the first coordinate whose least change exceeds `fraction` of its own largest stage value and
    `of_largest` of the largest value of all; -1 if none does.

    A coordinate that is small compared with the others may be within their rounding errors: if forces on it cancel, its
    own changes never settle.
    """
    scale, blocks = 0.0, history.shape[0] // 3
    for k in range(size):
        scale = maximum(history[2 * blocks + k // 8, k % 8], scale)
    for k in range(size):
        least = history[k // 8, k % 8]
        if not (least <= fraction * history[2 * blocks + k // 8, k % 8] or least <= of_largest * scale):
            return k
    return -1
