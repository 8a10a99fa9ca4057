"""Memory for vectors that are read eight elements at a time."""

from __future__ import annotations

import math

import numpy as np

from orbits.integrators.forms import Array, padded
from orbits.kernels.lanes import WIDTH


def aligned(*shapes: tuple[int, ...]) -> list[Array]:
    """Return zeros of these shapes, each aligned to a cache line: with eight lanes across two lines, a step of `Gauss`
    takes up to a sixth longer.
    """
    sizes = [math.prod(shape) for shape in shapes]
    rooms = [padded(size) for size in sizes]
    memory = np.zeros(sum(rooms))
    begin = -(memory.__array_interface__["data"][0] // memory.itemsize) % WIDTH
    out = []
    for shape, size, room in zip(shapes, sizes, rooms, strict=True):
        out.append(memory[begin : begin + size].reshape(shape))
        begin += room - WIDTH
    return out
