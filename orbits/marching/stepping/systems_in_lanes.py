"""Marches of several systems of equal shape, eight at a time in lanes, each with the bits it has alone.

Each system has a `Marcher` of its own, which observes, samples and stores its run. Before its next block of steps, the
block is computed for eight of them at once, and left with each, which takes it over instead of marching the block
itself. All else, such as a block that is repeated up to a step that failed, a march does alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from orbits.integrators.forms import padded
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.approaches_of_planets import SHOWN
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.computed_block import NAMES, Ready

if TYPE_CHECKING:
    from orbits.marching.marcher import Marcher


PATH_BYTES = 2_500_000
"""Size of the recorded states of eight systems, where all are looked at: observers pass through those of each again and
again, and should find them in the cache."""


class Lanes:
    """The memory in which up to eight marches of one kind are marched together; see `Marcher.kind_in_lanes`.

    rows : the workspace of the kernel, which holds the states in lanes
    """

    def __init__(self, marchers: Sequence[Marcher]) -> None:
        self._marchers, loops = list(marchers), marchers[0].loops
        form, size = loops.form, 3 * loops.bodies
        width, needed = padded(size), form.lanes_of_systems(size)
        assert needed is not None
        kernel, rows = needed
        self._kernel, self._size = kernel, size
        self._strengths = np.stack([self._marchers[k % len(marchers)].parameters for k in range(WIDTH)])
        self._coefficients = loops.coefficients
        *self._state, self._carries, self._room, self.rows = aligned(
            *[(WIDTH, width)] * 4, (WIDTH, form.carry_rows(size), WIDTH), form.scratch_shape(size), (rows, WIDTH)
        )
        self._path = np.zeros((WIDTH, 2 * (loops.steps + 1 + SHOWN) * width))
        self._records = [marcher.loops.state["approaches"].copy() for marcher in marchers]
        self._contexts = np.zeros(WIDTH, dtype=np.int64)
        if not all(marcher.looks_for_planets_alone for marcher in marchers):
            for marcher in marchers:
                marcher.block = min(marcher.block, max(1, PATH_BYTES // (16 * width * WIDTH)))
        self._places: list[int] = []

    def march(self, members: Sequence[int], count: int) -> None:
        """Compute the next `count` steps of some of the marches, and leave them there to be taken over."""
        order = [*members, *[members[0]] * (WIDTH - len(members))]  # the first fills the lanes that are left
        self._contexts[:] = 0
        self._take_places(members)
        for lane, k in enumerate(order):
            state, self._strengths[lane] = self._marchers[k].loops.state, self._marchers[k].parameters
            for array, name in zip((*self._state, self._carries), NAMES, strict=True):
                array[lane] = state[name]
        for lane, k in enumerate(members):
            self._contexts[lane] = self._marchers[k].observing_elsewhere(self._records[k])
        if not self._contexts[: len(members)].all():
            self._contexts[:] = 0
        evaluations = self._kernel(
            self._coefficients, self._strengths, *self._state, self._carries, self._room, self.rows, self._path,
            self._contexts, count,
        )  # fmt: skip
        observed = bool(self._contexts[0])
        for lane, k in enumerate(members):
            arrays = [array[lane] for array in (*self._state, self._carries)]
            record = self._records[k] if observed else None
            self._marchers[k].loops.ready = Ready(count, evaluations, self._size, arrays, record)

    def _take_places(self, members: Sequence[int]) -> None:
        """Give each march a row of the path, first those that are marched."""
        places = [*members, *(k for k in range(len(self._marchers)) if k not in members)]
        if places != self._places:
            self._places = places
            for path, k in zip(self._path, places, strict=False):
                self._marchers[k].observe_path(path)
