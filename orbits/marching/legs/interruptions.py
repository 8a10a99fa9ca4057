"""Why a block of a leg ends early, and the contract of what looks at blocks."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from orbits.errors import IntegrationError
from orbits.marching.clocks.step_times import UNLIMITED

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg


class Kind(IntEnum):
    """Why a block ends at a step. A watcher looks at the block that those before it have shortened: the last one that
    finds something decides.
    """

    FAILED = 0  # the step cannot be taken
    ENCOUNTER = 1  # the map cannot follow massive bodies in the step, or can again after it
    LOST = 2  # massless particles are lost in the step
    REFUSED = 3  # massive bodies meet in the step, which the method does not follow
    FULL = 4  # the list of the block overflowed
    BOUND = 5  # a pair may come to a bound, or touch, in the last step; or the energy error is above its bound


class Interruption(NamedTuple):
    """The end of a block after `step` of its steps, and the error that it means, if any."""

    step: int
    kind: Kind
    error: IntegrationError | None = None


class Block(NamedTuple):
    """The block of a leg that was just marched: the number of its steps, of those before it, and about their length."""

    steps: int
    begun: int
    h: float


class LegWatcher:
    """What looks at the blocks of a leg. One that is absent costs nothing.

    For each block: `forget` before it is marched, and `see` after, unless it has no steps, both again whenever it is
    marched again to an earlier step; `look`, which returns why it ends early; and `commit`, once it is known where.
    """

    def most(self, leg: Leg) -> int:
        """Return the most steps of the next block."""
        return UNLIMITED

    def see(self, leg: Leg, block: Block) -> None:
        """Look at a block that was just marched."""

    def forget(self) -> None:
        """Forget what was seen of the last block."""

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return why the block of `count` steps that was just marched ends early, or None."""
        return None

    def commit(self, leg: Leg, begun: int, last: Interruption | None) -> IntegrationError | None:
        """Keep what was found in the block, from step `begun` of the leg to where it is now, and return the error that
        it means, if any.

        last : why it ended there, or None
        """
        return None

    def go_back(self, leg: Leg, steps: int, count: int) -> None:
        """Forget all but what was found in the first `steps` steps of the block of `count` that was committed last."""
