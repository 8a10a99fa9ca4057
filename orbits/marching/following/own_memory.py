"""The memory of particles with steps of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.lanes import WIDTH
from orbits.marching.following.bodies_between import PLACES, Field, chart
from orbits.marching.following.contract import Block, Room
from orbits.marching.following.follower import Follower
from orbits.marching.following.losses import Contact
from orbits.marching.following.lost_particles import Reached, State, hit_by, write_lost
from orbits.marching.following.own_clocks import ABSENT, BY_OWN_STEPS, COLUMNS, REACHED, OwnStepping, Shared
from orbits.marching.following.own_steps_log import BESIDES, Log
from orbits.marching.following.retirement import Lost
from orbits.marching.stepping.alignment import aligned, unwritten
from orbits.marching.stepping.pool import Helpers
from orbits.marching.watching.leg_observers import Observers
from orbits.marching.watching.passage_list import BlockList


class OwnMemory:
    """The memory of a thread that marches particles with steps of their own.

    form, coefficients : of these steps; n : the number of massive bodies; steps : the most of these in a block

    arrays : those of a context for observers of these steps; order : of the bodies in the field, (n,) int64
    """

    def __init__(self, form: Form, coefficients: Array, n: int, steps: int) -> None:
        assert isinstance(form, Collocation | CanonicalBodies)
        entries, rows, stride = steps + BESIDES, form.stages_shape(3 * n)[0], padded(3 * n)
        modes, self._table, shared = unwritten(
            (steps, 3 * n, 2 * WIDTH), coefficients.shape, (steps, *coefficients.shape[1:])
        )
        (room,) = aligned((PLACES + rows + 3 * stride, WIDTH))
        self._table[...], shared[...] = coefficients, coefficients
        self._shared = Shared(shared, np.zeros(steps), np.full((steps + 1, 6, padded(n)), ABSENT))
        self._field = chart(form.tableau), modes, np.zeros(steps, dtype=np.bool_), room
        path, times, track = np.zeros(2 * entries * stride), np.zeros(entries), np.full((6 * entries, WIDTH), np.nan)
        self.arrays = {"path": path, "times": times}
        self.order = np.arange(n)
        counts, found = np.zeros(2, dtype=np.int64), np.zeros(1, dtype=np.int64)
        seen = self.order, np.zeros(padded(n)), np.zeros((2, stride))
        self._log = counts, np.zeros((entries, 2)), times, path, track, found, *seen

    def stepping(
        self, numbers: Array, steps: tuple[Any, Any, Any, Any], seen: Array, watched: tuple[int, int]
    ) -> OwnStepping:
        """Return what the kernels need.

        numbers : see `OwnStepping`; steps : times, stages, path and kicks of the bodies, see `Field`
        seen : the path of the bodies as observers see it; watched : the observer, and the context of own steps
        """
        return OwnStepping(
            self._table, numbers, Field(*steps, *self._field), self._shared, Log(*watched, *self._log, seen)
        )


class ByOwnSteps(Follower):
    """Massless particles with clocks of their own, among massive bodies whose steps are chosen one by one; see
    `orbits.marching.following.own_clocks`.

    The arguments are those of `Follower`.
    """

    reads_path = shows_samples = True

    def __init__(self, form: Form, n: int, steps: int, helpers: Helpers, coefficients: Any) -> None:
        super().__init__(form, n, steps, helpers, coefficients)
        self.following = BY_OWN_STEPS
        self._memories = [OwnMemory(form, coefficients, n, steps) for _ in range(helpers.members)]
        self._arrays = [memory.arrays for memory in self._memories]

    @staticmethod
    def more_arrays(m: int) -> dict[str, tuple[int, ...]]:
        """Return the shape of the clocks of m particles."""
        return {"particle_clock": (m, COLUMNS)}

    def sees_falls(self, radius: float) -> bool:
        """Return whether there is a surface to fall on."""
        return radius > 0.0

    def ended_by(self, lost: Lost, count: int) -> int:
        """Return the steps up to the end of the one in which particles are lost: samples in it, and what they hit, may
        come before.
        """
        return min(lost.steps + 1, count)

    def alone(self, state: State) -> NDArray[np.bool_]:
        """Return all."""
        return np.ones(len(state["particle_memory"]), dtype=bool)

    def lists(self, observers: Observers) -> list[BlockList]:
        """Return the lists of passages, all by steps of their own."""
        return observers.lists

    def reached(self, state: State, lost: Lost) -> Reached:
        """Return where lost particles have got to."""
        columns = (f"particle_{name}" for name in ("q", "q_lo", "v", "v_lo"))
        places = {name: state[name][:, lost.particles] for name in columns}
        return {**places, "particle_clock": state["particle_clock"][lost.particles]}

    def put(
        self, state: State, seen: State, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]
    ) -> None:
        """Write where lost particles have got to, and when, into the state of a leg."""
        for k, contact in hit_by(lost, contacts).items():
            reached["particle_q"][:, k], reached["particle_v"][:, k] = contact.q, contact.v
            reached["particle_q_lo"][:, k] = reached["particle_v_lo"][:, k] = 0.0
            reached["particle_clock"][k, REACHED] = contact.time
        write_lost(state, lost, reached)

    def losing_by(self, leg: Any, time: float) -> Any:
        """Return a leg that has lost those that are lost by a time in the next step, and no others of this step."""
        return leg.home.ended_at(time)

    def stop(self, state: State, particles: NDArray[np.intp], time: float) -> None:
        """Note the time at which particles were lost."""
        state["particle_clock"][particles, REACHED] = time

    def places(self, state: State) -> tuple[Array | None, Array | None]:
        """Return the clocks of lost particles."""
        return state["particle_clock"], None

    def _prepare(self, block: Block, watcher: Observers | None, steps: int) -> None:
        if watcher is not None:
            watcher.follow_own_steps(self._arrays)

    def _own(self, member: int, block: Block, watcher: Observers | None) -> tuple[Room, OwnStepping]:
        room = self._room(member, watcher)
        context = 0 if watcher is None else watcher.own_steps.addresses[member]
        steps = block.times, block.stages, block.path, block.carries
        own = self._memories[member].stepping(block.numbers, steps, block.path, (room.observer, context))
        return room, own
