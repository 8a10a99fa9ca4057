"""The states at the beginnings of all steps of a run, from which dense output begins: in an archive.

    /steps/t          (room, 2)            times, each as the sum of two numbers
    /steps/q, /steps/v   (room, bodies, 3)
    /steps/chunks     (chunks,)            checksums of chunks of `chunk_rows` states that are full

The number of committed states, and the checksums of the chunk that is not full, are in the checkpoint, as the array
`KEPT`: states that an interrupted commit has written are behind those of the last one.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.archive.storage import Storage, raw_bytes
from orbits.errors import ArchiveError
from orbits.marching.stepping.kept_steps import of_pieces

Floats = NDArray[np.float64]
Piece = tuple[Floats, Floats, Floats]

KEPT = "kept_steps"
"""The array of a checkpoint, (5,) uint64, with the fields of `Kept`."""

CHUNK_BYTES = 4 * 1024 * 1024

STEP_CHUNK = np.dtype([("t", "<u4"), ("q", "<u4"), ("v", "<u4")])
"""The CRC-32 of the times, positions and velocities of a chunk. 12 bytes."""


def chunk_rows(bodies: int) -> int:
    """Return the number of states in a chunk."""
    return max(1, CHUNK_BYTES // (48 * bodies))


def bytes_per_step(bodies: int) -> int:
    """Return the size of a state and its time."""
    return 48 * bodies + 16


class Kept(NamedTuple):
    """The committed states.

    rows : their number; table : CRC-32 of the checksums of full chunks
    t, q, v : CRC-32 of the times, positions and velocities after the last full chunk
    """

    rows: int = 0
    table: int = 0
    t: int = 0
    q: int = 0
    v: int = 0

    def encoded(self) -> NDArray[np.uint64]:
        """Return the array for the checkpoint."""
        return np.array(self, dtype="<u8")


NOTHING_KEPT = Kept().encoded()


@dataclass(frozen=True)
class StepPlaces:
    """The places in the file of these arrays; see `orbits.archive.schema.Place`."""

    t: Any
    q: Any
    v: Any
    chunks: Any

    @property
    def room(self) -> int:
        """The number of states for which there is room."""
        return int(self.t.shape[0])

    @property
    def bodies(self) -> int:
        """The number of bodies."""
        return int(self.q.shape[1])

    def arrays(self) -> tuple[tuple[Any, int], ...]:
        """Return the places of times, positions and velocities, with the bytes of a row of each."""
        return (self.t, 16), (self.q, 24 * self.bodies), (self.v, 24 * self.bodies)


def write_steps(storage: Storage, places: StepPlaces, last: Kept, pieces: Iterable[Piece]) -> Kept:
    """Write states behind those committed last; return what is then kept. The caller handles OSError."""
    length = chunk_rows(places.bodies)
    rows, table, *sums = last
    for piece in pieces:
        done = 0
        while done < len(piece[0]):
            end = min(len(piece[0]), done + length - rows % length)
            for k, ((place, size), array) in enumerate(zip(places.arrays(), piece, strict=True)):
                data = raw_bytes(np.ascontiguousarray(array[done:end], dtype="<f8"))
                storage.write(place.offset + rows * size, data)
                sums[k] = zlib.crc32(data, sums[k])
            rows, done = rows + end - done, end
            if rows % length == 0:
                row = np.array(tuple(sums), dtype=STEP_CHUNK).tobytes()
                storage.write(places.chunks.offset + (rows // length - 1) * STEP_CHUNK.itemsize, row)
                table, sums = zlib.crc32(row, table), [0, 0, 0]
    return Kept(rows, table, *sums)


class ArchivedSteps:
    """The committed states of an archive, checked when they are first read; see `KeptSteps`.

    Raises ArchiveError for damage: of the times at once, of the states when one of their chunk is read.
    """

    def __init__(self, storage: Storage, places: StepPlaces, encoded: NDArray[np.uint64]) -> None:
        self._storage, self._places, self._kept = storage, places, Kept(*encoded.tolist())
        self._length = chunk_rows(places.bodies)
        if self._kept.rows > places.room:
            raise self._damage(f"{self._kept.rows} steps are claimed where {places.room} have room")
        full = self._kept.rows // self._length
        table = bytes(storage.read(places.chunks.offset, full * STEP_CHUNK.itemsize))
        if zlib.crc32(table) != self._kept.table:
            raise self._damage("the table of the chunks of steps does not hold its checksum")
        self._sums = [*np.frombuffer(table, dtype=STEP_CHUNK).tolist(), self._kept[2:]]
        self._unchecked = np.ones(len(self._sums), dtype=bool)
        self._times: Floats | None = None
        self._mapped: tuple[Floats, Floats] | None = None

    def __len__(self) -> int:
        return self._kept.rows

    @property
    def kept(self) -> Kept:
        """Their number and checksums."""
        return self._kept

    @property
    def times(self) -> Floats:
        """(rows, 2), since the epoch, each as the sum of two numbers."""
        if self._times is None:
            for chunk in range(len(self._sums)):
                self._check(chunk, (0,))
            times = np.empty((len(self), 2), dtype="<f8")
            if len(self):
                self._storage.read_into(raw_bytes(times), self._places.t.offset)
            lengths = np.diff(times, axis=0).sum(axis=1)  # before a collision they are less than a float64 time shows
            if not (np.isfinite(times).all() and ((lengths > 0.0).all() or (lengths < 0.0).all())):
                raise self._damage("its steps are not in the order of their times")
            self._times = np.asarray(times, dtype=np.float64)
        return self._times

    def states(self, rows: NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Return q and v, (m, bodies, 3), of m rows."""
        for chunk in np.unique(rows // self._length):
            if self._unchecked[chunk]:
                self._check(int(chunk), (1, 2))
                self._unchecked[chunk] = False
        if self._mapped is None:
            self._mapped = self._map(self._places.q), self._map(self._places.v)
        return self._mapped[0][rows], self._mapped[1][rows]

    def check_all(self) -> None:
        """Check all states, including those checked before."""
        for chunk in range(len(self._sums)):
            self._check(chunk, (0, 1, 2))

    def pieces(self) -> Iterable[Piece]:
        """Yield times, q and v of consecutive states, a chunk at a time."""
        for first in range(0, len(self), self._length):
            rows = np.arange(first, min(first + self._length, len(self)))
            yield (self.times[rows], *self.states(rows))

    def __reduce__(self) -> Any:
        """Copy and pickle as states in memory."""
        return of_pieces, (self._places.bodies, list(self.pieces()))

    def _map(self, place: Any) -> Floats:
        with os.fdopen(os.dup(self._storage.fileno()), "rb") as file:
            shape = (len(self), *place.shape[1:])
            return np.memmap(file, dtype="<f8", mode="r", offset=place.offset, shape=shape).view(np.ndarray)

    def _check(self, chunk: int, which: tuple[int, ...]) -> None:
        first, end = chunk * self._length, min((chunk + 1) * self._length, len(self))
        for k in which:
            place, size = self._places.arrays()[k]
            found = self._storage.checksum(place.offset + first * size, (end - first) * size)
            if found != self._sums[chunk][k]:
                self._unchecked[chunk] = True
                raise self._damage(f"steps {first} to {end - 1} do not hold their checksum")

    def _damage(self, what: str) -> ArchiveError:
        return ArchiveError(
            f"{self._storage.path} is damaged: {what}. Restore it from a copy, or read the samples that are whole with "
            "orbits.Archive.open(path, salvage=True)."
        )
