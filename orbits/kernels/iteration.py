"""Fixed-point iteration of the stages of an implicit step, to the round-off floor.

No tolerance is used: a component, one coordinate or the three of a body, is done when its largest change over the
stages stops falling, or when the rate of convergence shows that the next change will be lost in rounding. One more
evaluation then follows, so that the remaining residual is far below one rounding error: a residual with a preferred
sign would act like friction.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import any_lane, load, maximum, minimum, row_maxima, store

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


@kernel
def begin(change, history, blocks):
    """Set the scale of each component from the first stage values, stored in `change` as if they were changes from
    zero.
    """
    for block in range(blocks):
        scale = row_maxima(change, 8 * block)
        store(history, block, scale)
        store(history, blocks + block, scale)
        store(history, 2 * blocks + block, scale)


@kernel
def falling(change, history, blocks):
    """Return whether the largest change of some component is still falling, above the level of rounding.

    change : (8 * blocks, 8), |new - old| of each component (row) in each stage (lane)
    history : (3 * blocks, 8), one lane for each component: least change so far, last change, scale
    """
    going = False
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
def settled(history, blocks, fraction):
    """Return whether every component's least change is below `fraction` of its scale."""
    for block in range(blocks):
        if any_lane(load(history, block) > fraction * load(history, 2 * blocks + block)):
            return False
    return True


@kernel(inline=True)
def judged(change, history, blocks, sweep, patience, fraction):
    """Return, after sweep number 1, 2, ..., the patience that is left and whether the next sweep is the last one: the
    changes have stopped falling, and are below `fraction` or have been given as many chances as there were.
    """
    last = False
    if sweep == 1:
        begin(change, history, blocks)
    elif not falling(change, history, blocks):
        patience -= 1
        last = patience == 0 or settled(history, blocks, fraction)
    return patience, last


@kernel
def unsettled_part(history, blocks, parts, fraction):
    """Return the first part whose least change exceeds `fraction` of its scale; -1 if none does."""
    for i in range(parts):
        if not history[i // 8, i % 8] <= fraction * history[2 * blocks + i // 8, i % 8]:
            return i
    return -1


@kernel
def unsettled_body(history, blocks, bodies, fraction):
    """Return the first body whose least change exceeds `fraction` of its largest stage value in any direction; -1 if
    none does.
    """
    for body in range(bodies):
        least, scale = 0.0, 0.0
        for axis in range(3):
            k = axis * bodies + body
            least = maximum(history[k // 8, k % 8], least)
            scale = maximum(history[2 * blocks + k // 8, k % 8], scale)
        if not least <= fraction * scale:
            return body
    return -1


@kernel
def unsettled_coordinate(history, blocks, size, fraction, of_largest):
    """Return the first coordinate whose least change exceeds `fraction` of its own largest stage value and
    `of_largest` of the largest value of all; -1 if none does.

    A coordinate that is small compared with the others may be within their rounding errors: if forces on it cancel, its
    own changes never settle.
    """
    scale = 0.0
    for k in range(size):
        scale = maximum(history[2 * blocks + k // 8, k % 8], scale)
    for k in range(size):
        least = history[k // 8, k % 8]
        if not (least <= fraction * history[2 * blocks + k // 8, k % 8] or least <= of_largest * scale):
            return k
    return -1
