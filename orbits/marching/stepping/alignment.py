"""Memory for vectors that are read eight elements at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from orbits.integrators.forms import Array, padded
from orbits.kernels.lanes import WIDTH

KEPT_BYTES = 1 << 24
"""Memory of up to twice this size stays with the process when runs free it, for the next ones: the C library of Linux
keeps as much from the first time on that an array of this size is freed (mallopt(3), M_MMAP_THRESHOLD). New pages take
two microseconds each on a virtual machine, and a run of 200 steps with a massless body touched 500 of them.
"""
np.empty(KEPT_BYTES, dtype=np.uint8)


def aligned(*shapes: tuple[int, ...], made: Callable[[int], Array] = np.zeros) -> list[Array]:
    """Return zeros of these shapes, each aligned to a cache line: with eight lanes across two lines, a step of `Gauss`
    takes up to a sixth longer.
    """
    total, places = _places(shapes)
    memory = made(total)
    first = -(memory.__array_interface__["data"][0] // memory.itemsize) % WIDTH
    return [memory[first + begin : first + end].reshape(shape) for shape, begin, end in places]


unwritten = partial(aligned, made=np.empty)
"""The same for what is written before it is read, but for the last lanes, of no body: clearing megabytes would take a
good part of a short run.
"""


@lru_cache(maxsize=256)
def _places(shapes: tuple[tuple[int, ...], ...]) -> tuple[int, list[tuple[tuple[int, ...], int, int]]]:
    """Return the elements that arrays of these shapes take, and where each begins and ends."""
    places, begin = [], 0
    for shape in shapes:
        size = math.prod(shape)
        places.append((shape, begin, begin + size))
        begin += padded(size) - WIDTH
    return begin + WIDTH, places
