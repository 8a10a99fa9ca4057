"""Memory for vectors that are read eight elements at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from mmap import ACCESS_COPY, mmap

import numpy as np

from orbits.integrators.forms import Array, padded
from orbits.kernels.lanes import WIDTH

FEW = 1 << 17
"""The size from which on zeros are left to the system: a megabyte, which takes longer to write than to ask for."""


def aligned(*shapes: tuple[int, ...], made: Callable[[int], Array] = np.zeros) -> list[Array]:
    """Return zeros of these shapes, each aligned to a cache line: with eight lanes across two lines, a step of `Gauss`
    takes up to a sixth longer.
    """
    total, places = _places(shapes)
    memory = made(total)
    first = -(memory.__array_interface__["data"][0] // memory.itemsize) % WIDTH
    return [memory[first + begin : first + end].reshape(shape) for shape, begin, end in places]


unwritten = partial(aligned, made=np.empty)
"""The same for what is written before it is read: clearing megabytes would take a good part of a short run."""


def zeros_on_demand(size: int) -> Array:
    """Return zeros, of which those that are never touched take no time, if they are many: memory of the system itself.
    A block of steps that are chosen may end after a few of the thousands for which it has room.
    """
    if size < FEW:
        return np.zeros(size)
    # A copy of its own in a process that is forked: shared memory is the default.
    return np.frombuffer(mmap(-1, size * np.dtype(np.float64).itemsize, access=ACCESS_COPY))


@lru_cache(maxsize=256)
def _places(shapes: tuple[tuple[int, ...], ...]) -> tuple[int, list[tuple[tuple[int, ...], int, int]]]:
    """Return the elements that arrays of these shapes take, and where each begins and ends."""
    places, begin = [], 0
    for shape in shapes:
        size = math.prod(shape)
        places.append((shape, begin, begin + size))
        begin += padded(size) - WIDTH
    return begin + WIDTH, places
