"""Followers: the ways in which massless particles follow the massive bodies through a block of steps.

In the steps of the bodies (`Follower` itself), by steps of their own (`ByOwnSteps` in `own_memory.py`) or leaving a map
for such steps (`WithExcursions` in `excursion_rules.py`). Which one serves a march is chosen once, when it is bound.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.forms import Array, Form
from orbits.kernels.binding import Tag, kernel_of
from orbits.kernels.lanes import WIDTH
from orbits.marching.following.contract import Block, Followers, Room, follow_block
from orbits.marching.following.in_lanes import IN_LANES, ONE_BY_ONE
from orbits.marching.following.losses import Contact
from orbits.marching.following.lost_particles import LostParticles, Reached, State, seen_of, write_lost
from orbits.marching.following.retirement import Lost
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.pool import Helpers
from orbits.marching.watching.leg_observers import Observers


class Follower(LostParticles):
    """Massless particles that take the steps of the massive bodies, through their recorded stages.

    form : of the method; n : the number of massive bodies; steps : the most in a block; helpers : the threads
    coefficients : of a step of the method

    following : the tag of the way of following; reads_path : whether the states and the carry of the bodies at the
        beginning of each step are to be recorded; shows_samples : whether it shows particles at samples within a block
    track : of the caller's thread, see `Room`
    """

    reads_path: ClassVar[bool] = False
    shows_samples: ClassVar[bool] = False

    def __init__(self, form: Form, n: int, steps: int, helpers: Helpers, coefficients: Any) -> None:
        self._helpers, members = helpers, range(helpers.members)
        self.following = IN_LANES if kernel_of(form.tag.type, "width") in (None, WIDTH) else ONE_BY_ONE
        self._transforms = form.transforms
        self._own_form: Tag = form.tag  # of the method of a particle's own steps
        self._evaluations = np.zeros((helpers.members, WIDTH), dtype=np.int64)  # a cache line for each thread
        shapes = form.scratch_shape(3 * n), (12 * (steps + 1), WIDTH)
        self._rooms = [aligned(*shapes) for _ in members]
        # Records, and the arguments made of them: of the march itself, and of copies of its state, not observed.
        self._bound: dict[bool, tuple[tuple[Any, ...], list[tuple[Any, ...]]]] = {}
        self.track: Array = self._rooms[0][1]

    def put(
        self, state: State, seen: State, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]
    ) -> None:
        """Write where lost particles are seen into the state of a leg, if it marches other variables."""
        if self._transforms:
            write_lost(state, lost, seen_of(seen, lost))

    @staticmethod
    def memory_rows(form: Form) -> int:
        """Return the number of rows of eight that each particle keeps from block to block."""
        return form.particle_carry_rows

    @staticmethod
    def more_arrays(m: int) -> dict[str, tuple[int, ...]]:
        """Return the shapes of what m particles keep besides, by the names that archives have for it."""
        return {}

    def follow(self, tags: tuple[Tag, Tag, Tag], block: Block, particles: Followers, watcher: Observers | None) -> int:
        """March particles through a block of steps, in which those that are lost are noted in `particles.retired`;
        return how many evaluations there were.

        tags : of the method, the Lagrangian and the clock; block, particles : the same records as long as the arrays
            are the same; watcher : what observes them, or None
        """
        steps = int(block.count[0])
        if not steps:
            return 0
        self._prepare(block, watcher, steps)
        known, arguments = self._bound.get(watcher is None, ((), []))
        if not known or block is not known[0] or particles is not known[1]:
            flat = self.following, tags[0], self._own_form, *tags[1:], block, particles
            arguments = [(*flat, *self._own(k, block, watcher)) for k in range(self._helpers.members)]
            self._bound[watcher is None] = (block, particles), arguments
        self._evaluations[:] = 0
        self._helpers.run(follow_block, arguments, steps)
        return int(self._evaluations.sum())

    def _prepare(self, block: Block, watcher: Observers | None, steps: int) -> None:
        """Prepare for a block of steps: by default nothing."""

    def _own(self, member: int, block: Block, watcher: Observers | None) -> tuple[Room, Any]:
        """Return the room of a thread, and the record of this way of following."""
        return self._room(member, watcher), None

    def _room(self, member: int, watcher: Observers | None) -> Room:
        observer, context = (0, 0) if watcher is None else (watcher.observer, watcher.contexts.addresses[1 + member])
        scratch, track = self._rooms[member]
        return Room(scratch, track, observer, context, self._evaluations[member])
