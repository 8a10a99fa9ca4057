"""Memory for vectors that are read eight elements at a time."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from orbits.integrators.forms import Array, padded
from orbits.kernels.lanes import WIDTH


def aligned(*shapes: tuple[int, ...]) -> list[Array]:
    """Return zeros of these shapes, each aligned to a cache line: with eight lanes across two lines, a step of `Gauss`
    takes up to a sixth longer.
    """
    total, places = _places(shapes)
    memory = np.zeros(total)
    first = -(memory.__array_interface__["data"][0] // memory.itemsize) % WIDTH
    return [memory[first + begin : first + end].reshape(shape) for shape, begin, end in places]


@lru_cache(maxsize=256)
def _places(shapes: tuple[tuple[int, ...], ...]) -> tuple[int, list[tuple[tuple[int, ...], int, int]]]:
    """Return the elements that arrays of these shapes take, and where each begins and ends."""
    places, begin = [], 0
    for shape in shapes:
        size = math.prod(shape)
        places.append((shape, begin, begin + size))
        begin += padded(size) - WIDTH
    return begin + WIDTH, places
