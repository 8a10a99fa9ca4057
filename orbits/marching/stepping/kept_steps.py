"""The states at the beginnings of all steps of a run, from which dense output begins: in memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PIECE_BYTES = 16 * 1024 * 1024
"""Size of the pieces in which states are kept: adding to them moves nothing."""


class KeptSteps(Protocol):
    """States at the beginnings of steps, in the order of the run: in memory, or in an archive.

    times : (rows, 2), since the epoch, each as the sum of two numbers
    """

    @property
    def times(self) -> Array:
        """(rows, 2)."""

    def __len__(self) -> int:
        """Return the number of states."""

    def states(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return q and v, (m, bodies, 3), of m rows."""


class StepsInMemory:
    """States of so many bodies that grow by pieces; see `KeptSteps`."""

    def __init__(self, bodies: int) -> None:
        self._bodies = bodies
        self._length = max(16, PIECE_BYTES // (48 * bodies))
        self._pieces: list[tuple[Array, Array, Array]] = []
        self._count = 0
        self._times = np.empty((0, 2))

    def __len__(self) -> int:
        return self._count

    @property
    def nbytes(self) -> int:
        """The memory of all states, in bytes."""
        return self._count * (48 * self._bodies + 16)

    @property
    def times(self) -> Array:
        """(rows, 2), since the epoch, each as the sum of two numbers."""
        if len(self._times) != self._count:
            self._times = np.concatenate([times for times, _, _ in self.pieces()])
        return self._times

    def add(self, times: Array, q: Array, v: Array) -> None:
        """Add states: times (k, 2), q and v (k, bodies, 3)."""
        done = 0
        while done < len(times):
            at = self._count % self._length
            if at == 0:
                shape = (self._length, self._bodies, 3)
                self._pieces.append((np.empty((self._length, 2)), np.empty(shape), np.empty(shape)))
            end = min(len(times), done + self._length - at)
            for piece, new in zip(self._pieces[-1], (times, q, v), strict=True):
                piece[at : at + end - done] = new[done:end]
            self._count += end - done
            done = end

    def pieces(self) -> Iterator[tuple[Array, Array, Array]]:
        """Yield times, q and v of consecutive states."""
        for k, piece in enumerate(self._pieces):
            count = min(self._length, self._count - k * self._length)
            yield piece[0][:count], piece[1][:count], piece[2][:count]

    def take_back(self, count: int) -> None:
        """Forget the last states, as many as were added last or fewer."""
        self._count -= count
        self._pieces, self._times = self._pieces[: -(-self._count // self._length)], np.empty((0, 2))

    def clear(self) -> None:
        """Forget all states."""
        self._pieces, self._count, self._times = [], 0, np.empty((0, 2))

    def states(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return q and v, (m, bodies, 3), of m rows."""
        q, v = np.empty((2, len(rows), self._bodies, 3))
        piece, within = np.divmod(rows, self._length)
        for k in np.unique(piece):
            own = piece == k
            q[own], v[own] = self._pieces[k][1][within[own]], self._pieces[k][2][within[own]]
        return q, v

    def __reduce__(self) -> Any:
        return of_pieces, (self._bodies, list(self.pieces()))


def of_pieces(bodies: int, pieces: list[tuple[Array, Array, Array]]) -> StepsInMemory:
    """Return states from pieces of times, q and v."""
    kept = StepsInMemory(bodies)
    for piece in pieces:
        kept.add(*piece)
    return kept
