"""The states of a leg at samples, which change nothing: they are computed from the steps that the leg takes anyway.

The state within a step is that after a partial step of the method from the state at its beginning with its low parts,
which are recorded where samples lie within steps: of a block of steps, all in one compiled call. A method that marches
other variables than those seen, or whose carry has more than a guess, needs the carry after each step, which is
recorded in blocks with several samples. For massless particles see `orbits.marching.legs.samples_of_particles`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import proxy

import numpy as np

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.kernels.lanes import WIDTH
from orbits.marching.clocks.step_times import UNLIMITED, Behind, Place, Places
from orbits.marching.following.contract import NO_SAMPLES, SamplesInBlock
from orbits.marching.legs import within_step
from orbits.marching.legs.interruptions import LegWatcher

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg
    from orbits.marching.legs.march import March


class Samples:
    """States of a march at samples, to each of which it leads in turn."""

    def __init__(self, march: March) -> None:
        self._march = march

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to: if there are several, those that it `passed` are
        known after it.
        """
        return 1

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched, with states that are known."""
        return 0

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched, before anything else is asked of the
        march. Raises an IntegrationError if a partial step to one fails; the march is then at the beginning of the
        block.
        """
        raise NotImplementedError

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at the first m >= 1 of these places, up to which the march has advanced."""
        q, v = self._march.state_at(places.at(0))
        return q[None], v[None]

    def of_particles(self, count: int) -> SamplesInBlock:
        """Return the samples in the block of `count` steps that the massive bodies have just taken at which particles
        are to be shown as they follow.
        """
        return NO_SAMPLES

    def come_before(self, step: int) -> bool:
        """Return whether there are samples, within a step of the block or at its beginning, that come before the loss
        of particles in it: the block then ends there, and they are lost in the next one.
        """
        return False

    def accounts(self) -> Array:
        """Return what is known of each force at each of the states returned last, (m or 1, forces, columns)."""
        return self._march.accounts()[None]


class SamplesOfLeg(Samples, LegWatcher):
    """States of a leg at samples, by partial steps from the states at the beginnings of steps."""

    def __init__(self, leg: Leg) -> None:
        self._leg: Leg = proxy(leg)
        form = leg.stepper.form
        self._recorded = leg.stepper.loops.tells_beginnings(leg.observers.records_all)
        self._stays = np.ones((form.carry_rows(3 * len(leg.problem.bodies)), WIDTH))
        form.forget(self._stays)
        self._reads_carries = bool(self._stays.any())
        self._most = UNLIMITED

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to."""
        leg, self._most = self._leg, UNLIMITED
        if not self._recorded:
            return 1
        loops = leg.stepper.loops
        loops.keep_lows(bool(places.rests[: leg.times.led_to(places, leg.block)].any()))
        if not self._reads_carries:
            return len(places.steps)
        most = loops.most_kept
        count = leg.times.led_to(places, min(leg.block, most))
        loops.keep_carries(count > 1)
        if count > 1:
            self._most = most
        return max(count, 1)

    def most(self, leg: Leg) -> int:
        """Return the most steps of the next block, if the carry after each is recorded."""
        return self._most

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched."""
        return self._leg.times.passed(places)

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched."""
        leg = self._leg
        loops, behind, count = leg.stepper.loops, leg.times.behind(places), leg.loop.taken
        path = loops.beginnings(leg.observers, count, behind)
        carries = None
        if self._reads_carries:
            carries = loops.kicks[np.maximum(behind.steps - 1, 0)]
            carries[behind.steps == 0] = leg.loop.begun["memory"]
        try:
            return self._behind(path, carries, behind)
        except IntegrationError:  # the leg has not passed what is not known
            leg.go_back(0)
            raise

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at those of these places that lie in the next step with any."""
        first = places.at(0)
        if self._leg.times.is_at(first):
            return self._of_copy(first)
        try:
            return self._in_next_step(places)
        except IntegrationError:  # no step from there, or no partial one; steps that are chosen anew may lead there
            return self.ahead(places.between(0, 1)) if len(places.steps) > 1 else self._of_copy(first)

    def _in_next_step(self, places: Places) -> tuple[Array, Array]:
        """The same, by partial steps; an IntegrationError if the step, or a part of it, cannot be taken."""
        state, behind, numbers = self._leg.times.ahead_of(self._leg, places, self._pass)
        self._let_follow(behind, numbers)
        count = len(behind.steps) if self._reads_carries else 0
        carries = np.repeat(state["memory"][None], count, axis=0) if count else None
        path = np.empty((len(behind.steps), 4, len(state["q"])))
        for row, name in enumerate(("q", "v", "q_lo", "v_lo")):
            path[:, row] = state[name]
        return self._behind(path, carries, behind)

    def _pass(self, numbers: Array) -> None:
        """Let particles follow the bodies in a step before that of `Ahead`."""

    def _let_follow(self, behind: Behind, numbers: Array | None) -> None:
        """Let particles follow the bodies in the step of `Ahead`, up to places in it."""

    def accounts(self) -> Array:
        """Return what is known of each force at each of the states returned last, (m or 1, forces, columns)."""
        if not self._leg.problem.forces:
            return np.zeros((1, 0, FIGURES))
        return np.stack([self._leg.stepper.accounts(state) for state in self._leg.shown])

    def _of_copy(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v), each (1, n, 3), at a place, to which a copy is marched."""
        q, v = within_step.state_at(self._leg, place)
        return q[None], v[None]

    def _behind(self, path: Array, carries: Array | None, behind: Behind) -> tuple[Array, Array]:
        """Return the states behind those of a path, (m, 2, padded), or (m, 4, padded) with their low parts.

        carries : (m, rows, 8), those with which the steps begin, a copy; None for a form that needs none
        """
        leg, steps, count = self._leg, np.arange(len(behind.steps)), len(behind.steps)
        n = len(leg.problem.bodies)
        path = leg.stepper.loops.seen(path, carries)
        if carries is not None:
            carries *= self._stays
        q, v = np.ascontiguousarray(path[:, :2, : 3 * n].swapaxes(0, 1))
        within = behind.parts != 0.0
        if within.any():
            leg.stepper.partial_steps().take(path, steps, behind.begun, behind.parts, within, q, v, carries)
        leg.shown = [leg.stepper.state]
        if carries is not None and leg.problem.forces:
            leg.shown = [{**leg.stepper.state, "memory": carry} for carry in carries]
        return q.reshape(count, 3, n).swapaxes(1, 2), v.reshape(count, 3, n).swapaxes(1, 2)
