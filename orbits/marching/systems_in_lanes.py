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
from orbits.marching.alignment import aligned
from orbits.marching.ready import NAMES, Ready

if TYPE_CHECKING:
    from orbits.marching.marcher import Marcher


class Lanes:
    """The memory in which up to eight marches of one kind are marched together; see `Marcher.kind_in_lanes`."""

    def __init__(self, marchers: Sequence[Marcher]) -> None:
        self._marchers, loops = list(marchers), marchers[0].loops
        form, size = loops.form, 3 * loops.bodies
        width, needed = padded(size), form.lanes_of_systems(size)
        assert needed is not None
        kernel, rows = needed
        self._kernel, self._size = kernel, size
        self._strengths = np.stack([self._marchers[k % len(marchers)].parameters for k in range(WIDTH)])
        self._coefficients = loops.coefficients
        *self._state, self._carries, self._room, self._rows = aligned(
            *[(WIDTH, width)] * 4, (WIDTH, form.carry_rows(size), WIDTH), form.scratch_shape(size), (rows, WIDTH)
        )
        self._path = np.zeros((WIDTH, 2 * (loops.steps + 1) * width))
        for marcher, path in zip(marchers, self._path, strict=False):
            marcher.observe_path(path)

    def march(self, members: Sequence[int], count: int) -> None:
        """Compute the next `count` steps of some of the marches, and leave them there to be taken over."""
        for k in range(WIDTH):  # the first fills the lanes that are left
            state = self._marchers[k if k in members else members[0]].loops.state
            for array, name in zip((*self._state, self._carries), NAMES, strict=True):
                array[k] = state[name]
        evaluations = self._kernel(
            self._coefficients, self._strengths, *self._state, self._carries, self._room, self._rows, self._path, count
        )
        for k in members:
            arrays = [array[k] for array in (*self._state, self._carries)]
            self._marchers[k].loops.ready = Ready(count, evaluations, self._size, arrays)
