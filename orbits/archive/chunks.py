"""The committed chunks of samples: where each ends, and whether its checksum still matches."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.archive.commits import CHUNK
from orbits.archive.schema import Layout
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError, StorageError


class Chunks:
    """The rows of the table of chunks that belong to a commit.

    Each chunk is checked once, when any part of it is first read.
    """

    def __init__(self, storage: Storage, path: Path, layout: Layout, table: NDArray[Any]) -> None:
        self._storage, self._path, self._layout = storage, path, layout
        self._ends = table["samples"].astype(np.int64)
        self._unchecked = np.ones(len(table), dtype=bool)
        self.table = table

    def __len__(self) -> int:
        return len(self.table)

    @property
    def samples(self) -> int:
        """The number of samples in all chunks."""
        return int(self._ends[-1]) if len(self) else 0

    def check(self, samples: NDArray[np.intp]) -> None:
        """Check the chunks of these samples, unless checked before.

        Raises ArchiveError, naming the damaged samples; StorageError if the device cannot be read.
        """
        if self._unchecked.any():
            touched = np.unique(np.searchsorted(self._ends, samples, side="right"))
            for chunk in touched[self._unchecked[touched]]:
                self._check(int(chunk))

    def check_all(self) -> None:
        """Check all chunks, including those checked before. Raises what `check` raises."""
        for chunk in range(len(self)):
            self._check(chunk)

    def damaged(self) -> list[tuple[int, int]]:
        """Return the first and the last sample of each stretch of chunks that fail their check."""
        found: list[tuple[int, int]] = []
        for chunk in range(len(self)):
            first, end = self._ends_of(chunk)
            try:
                self._check(chunk)
            except (ArchiveError, StorageError):
                start = found.pop()[0] if found and found[-1][1] == first - 1 else first
                found.append((start, end - 1))
        return found

    def _ends_of(self, chunk: int) -> tuple[int, int]:
        return int(self._ends[chunk - 1]) if chunk else 0, int(self._ends[chunk])

    def _check(self, chunk: int) -> None:
        first, end = self._ends_of(chunk)
        if samples_crc(self._storage, self._layout, first, end) != int(self.table["crc"][chunk]):
            self._unchecked[chunk] = True
            raise ArchiveError(
                f"{self._path} is damaged: samples {first} to {end - 1} do not hold their checksum. Restore it from a "
                "copy, or read what is whole with orbits.Archive.open(path, salvage=True)."
            )
        self._unchecked[chunk] = False


def samples_crc(storage: Storage, layout: Layout, first: int, end: int) -> int:
    """Return the CRC-32 of the q of samples first ... end - 1, continued over their v."""
    row = layout.q.shape[1] * 24
    crc = storage.checksum(layout.q.offset + first * row, (end - first) * row)
    return storage.checksum(layout.v.offset + first * row, (end - first) * row, crc)


def whole_chunks(storage: Storage, layout: Layout) -> NDArray[Any]:
    """Return the leading rows of the table whose chunks match their checksums, independent of the commits."""
    capacity = layout.q.shape[0]
    table = np.frombuffer(bytes(storage.read(layout.chunks.offset, layout.chunks.size)), dtype=CHUNK)
    whole = first = 0
    for end, crc in zip(table["samples"].tolist(), table["crc"].tolist(), strict=True):
        try:
            if not first < end <= capacity or samples_crc(storage, layout, first, end) != crc:
                break
        except (ArchiveError, StorageError):
            break
        whole, first = whole + 1, end
    return table[:whole]
