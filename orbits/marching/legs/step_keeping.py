"""Passing on the states at the ends of steps, for the dense output of a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.base import APART, Integrator
from orbits.integrators.forms import Array
from orbits.marching.clocks.step_times import UNLIMITED
from orbits.marching.legs.interruptions import Interruption, LegWatcher

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg


def steps_apart(integrator: Integrator, massive: NDArray[np.bool_]) -> int:
    """Return the number of steps between the states that are kept of a run, for dense output: 1 if partial steps lead
    on from each. With massless particles, and for methods whose states are costly to see, a march does.
    """
    return integrator.keeps_every if massive.all() else APART


def keep_steps(
    leg: Leg, keep: Callable[[Array, Array, Array], None], take_back: Callable[[int], None] = lambda count: None
) -> None:
    """Let a leg pass on its states after each block; see `StepKeeper`. Those of chosen steps on excursions are not."""
    apart = steps_apart(leg.problem.integrator, np.asarray(leg.problem.massive))
    leg.loop.listeners.append(StepKeeper(apart, keep, take_back))


class StepKeeper(LegWatcher):
    """Passes on the states at the ends of all steps of a leg, or of every `APART`-th; see `steps_apart`.

    keep : called after each block with times, (k, 2), each as the sum of two numbers, and q and v, (k, n, 3), in the
        order of the caller
    take_back : called with a number of states passed last that are no longer of the run; see `Leg.go_back`
    """

    def __init__(
        self, apart: int, keep: Callable[[Array, Array, Array], None], take_back: Callable[[int], None]
    ) -> None:
        self._apart, self._keep, self._take_back = apart, keep, take_back

    def most(self, leg: Leg) -> int:
        """Return the number of steps up to the next state that is kept."""
        return APART - leg.step % APART if self._apart > 1 else UNLIMITED

    def commit(self, leg: Leg, begun: int, last: Interruption | None) -> IntegrationError | None:
        """Pass on the states of the block."""
        count = leg.step - begun
        if not count:
            return None
        if self._apart == 1:
            n = len(leg.problem.bodies)
            states = leg.observers.recorded(count)[1:, :, : 3 * n].reshape(count, 2, 3, n).transpose(1, 0, 3, 2)
            self._keep(leg.times.pairs()[1:], *states)
        elif leg.step % APART == 0:
            q, v = leg.state()
            self._keep(leg.times.pairs()[-1:], q[None], v[None])
        return None

    def go_back(self, leg: Leg, steps: int, count: int) -> None:
        """Take back the states after the first `steps` steps of the block of `count` that was committed last."""
        self._take_back(int(leg.step % APART == 0) if self._apart > 1 else count - steps)
