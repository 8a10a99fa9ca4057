"""The compiled loops of a map that marches other variables than those seen, which its `enter` and `leave` lead to and
from: coordinates about a dominant body, through a corrector.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import Share, State, Storage
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.step_times import Behind
from orbits.marching.stepping import driver
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.bound_loops import BoundLoops, particles_in
from orbits.marching.watching.leg_observers import Observers


class LoopsOfMap(BoundLoops):
    """What marches a block of steps of a map. What is seen is computed where it is wanted, from a copy of the carry."""

    def is_seen(self, steps: int) -> bool:
        """Whether what is marched is what is seen, after so many steps: before the first, both are kept."""
        return not steps

    def enter(self, state: dict[str, Array], clock: Clock, retired: NDArray[np.int64] | None = None) -> None:
        """Compute what is marched with this clock from what is seen."""
        driver.enter_march(*self._transformation(state, clock))
        self._transform_particles(driver.enter_march_of_particles, state, clock, retired)

    def leave(
        self,
        state: dict[str, Array],
        clock: Clock,
        retired: NDArray[np.int64] | None = None,
        particles: NDArray[np.intp] | None = None,
    ) -> None:
        """Compute what is seen from what is marched with this clock, in a copy of a state that is not marched on."""
        self.leave_particles(state, clock, retired, particles)
        driver.leave_march(*self._transformation(state, clock))

    def leave_particles(
        self,
        state: dict[str, Array],
        clock: Clock,
        retired: NDArray[np.int64] | None = None,
        particles: NDArray[np.intp] | None = None,
    ) -> None:
        """Compute what is seen of particles alone."""
        self._transform_particles(driver.leave_march_of_particles, state, clock, retired, particles)

    def _transform_particles(
        self,
        kernel: Any,
        state: dict[str, Array],
        clock: Clock,
        retired: NDArray[np.int64] | None,
        some: NDArray[np.intp] | None = None,
    ) -> None:
        """Call `enter_march_of_particles` or `leave_march_of_particles` for all particles, in threads, or for some."""
        if not self._shares:
            return
        bound = self.bound(clock, self.times)
        bodies = State(*(state[name] for name in ("q", "q_lo", "v", "v_lo")))
        columns = particles_in(state)
        gone = np.zeros((columns.q.shape[1], 2), dtype=np.int64) if retired is None else retired
        particles = columns, state["particle_memory"], gone

        def transform(start: int, stop: int) -> None:
            shapes = state["memory"].shape, self._scratch.shape, self._stages.shape[1:], (2 * WIDTH, WIDTH)
            carry, scratch, stages, rows = aligned(*shapes)
            carry[...] = state["memory"]
            storage = Storage(carry, scratch, stages, Share(start, stop, None))
            kernel(*bound[:4], bodies, particles, rows, storage)

        if some is None:
            self._helpers.each(transform, self._shares)
        else:
            count = state["particle_memory"].shape[0]
            for k in sorted({int(p) // WIDTH for p in some}):
                transform(WIDTH * k, min(WIDTH * (k + 1), count))

    def records_carries(self, dense: bool) -> bool:
        """Whether the carries of all steps are recorded: states are computed from them."""
        return dense

    def tells_beginnings(self, recorded: bool) -> bool:
        """Whether the states at the beginnings of steps are known: from the carries."""
        return True

    def keep_lows(self, wanted: bool) -> None:
        """Record no low parts: the carries have them."""

    def beginnings(self, observers: Observers, count: int, behind: Behind) -> Array:
        """Return nothing: observers see states that are good enough for them, not to step on from."""
        return np.zeros(0)

    def seen(self, path: Array, carries: Array | None) -> Array:
        """Return the states where steps left these carries, (m, 4, padded)."""
        assert carries is not None
        return self._seen_at(carries, 4)

    def motion(self, observers: Observers, count: int, begun: Array) -> tuple[Array, Array]:
        """Return the states at the ends of the steps of the last block, from the carries."""
        return self._seen_at(np.concatenate([begun[None], self.kicks[:count]]), 2), self.kicks[:0]

    def _seen_at(self, carries: Array, rows: int) -> Array:
        """Return q and v where steps left these carries, (m, 2, padded), or for four rows with their low parts."""
        width = len(self.state["q"])
        room, carry = aligned((4, width), carries.shape[1:])
        path = np.zeros((len(carries), rows, width))
        bound, room_for_steps = self.bound(self._clock, self.times)[:4], (carry, self._scratch, self._stages)
        driver.leave_each(*bound, self._clock.h, carries, room, *room_for_steps, path)
        return path

    def _transformation(self, state: dict[str, Array], clock: Clock) -> tuple[Any, ...]:
        vectors = (state["q"], state["q_lo"], state["v"], state["v_lo"], state["memory"])
        return *self.bound(clock, self.times)[:4], clock.h, *vectors, self._scratch, self._stages


def loops_of(form: Form, *problem: Any) -> BoundLoops:
    """Return the compiled loops of a form; problem : the other arguments of `BoundLoops`."""
    return (LoopsOfMap if form.transforms else BoundLoops)(form, *problem)
