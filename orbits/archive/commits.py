"""Commits of samples: a table of chunks with their checksums, and one commit row for each of two checkpoints.

An interrupted commit leaves the row of the previous commit, and all data it refers to, unchanged: new samples are
written after the committed ones, and its checkpoint and row overwrite those of the last commit but one.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

SLOTS = 2

_MOST_COMMITS = 2**63  # out of reach of any run, so that the count can always be increased

CHUNK = np.dtype([("samples", "<u8"), ("crc", "<u4")])
"""One row for each chunk: samples in the file up to its end; CRC-32 of its q, continued over its v. 12 bytes."""

_FIELDS = [
    ("sequence", "<u8"),  # 1, 2, 3, ...; 0 if there is no commit yet
    ("samples", "<u8"),  # samples committed
    ("chunks", "<u8"),  # rows of the table of chunks that belong to them
    ("chunks_crc", "<u4"),  # CRC-32 of these rows
    ("checkpoint_crc", "<u4"),  # CRC-32 of the checkpoint's arrays in the order of their names
    ("row_crc", "<u4"),  # CRC-32 of the 32 bytes before
]
_PACKED = np.dtype(_FIELDS)
ROW_BYTES = _PACKED.itemsize

_IN_PAGES: Any = {
    "names": list(_PACKED.names or ()),
    "formats": [kind for _, kind in _FIELDS],
    "offsets": [0, 8, 16, 24, 28, 32],
    "itemsize": 4096,
}
ROW: np.dtype[Any] = np.dtype(_IN_PAGES)
"""The size of a commit row in the file: each of the two has its own page, so that no torn write affects both."""


@dataclass(frozen=True)
class Commit:
    """One commit: the numbers of samples and chunks, and the checkpoint after them."""

    sequence: int
    samples: int
    chunks: int
    chunks_crc: int
    checkpoint_crc: int

    @property
    def slot(self) -> int:
        """The slot, 0 or 1, of the checkpoint and row of this commit."""
        return (self.sequence - 1) % SLOTS

    def encoded(self) -> bytes:
        """Return the bytes of the row in the file."""
        row = np.zeros((), dtype=_PACKED)
        for field in ("sequence", "samples", "chunks", "chunks_crc", "checkpoint_crc"):
            row[field] = getattr(self, field)
        body = row.tobytes()[:-4]
        return body + zlib.crc32(body).to_bytes(4, "little")


def decoded(row: bytes | bytearray, slot: int) -> Commit | None:
    """Return the commit in the row of `slot`, or None if there is none, or it is incomplete."""
    if zlib.crc32(row[: ROW_BYTES - 4]) != int.from_bytes(row[ROW_BYTES - 4 : ROW_BYTES], "little"):
        return None
    values = np.frombuffer(bytes(row[:ROW_BYTES]), dtype=_PACKED)[0]
    commit = Commit(*(int(values[field]) for field, _ in _FIELDS[:-1]))
    return commit if 0 < commit.sequence < _MOST_COMMITS and commit.slot == slot else None
