"""What makes samples count: a table of chunks with their checksums, and one commit row for each of two checkpoints.

A commit that is stopped half way leaves the row of the commit before it, and all that this row stands for, untouched:
new samples lie behind the committed ones, and its checkpoint and its row go where those of the last but one were.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

SLOTS = 2

_MOST_COMMITS = 2**63  # no run gets there, and one more can always be counted

CHUNK = np.dtype([("samples", "<u8"), ("crc", "<u4")])
"""One row for each chunk: samples in the file up to its end; CRC-32 of its q, continued over its v. 12 bytes."""

_FIELDS = [
    ("sequence", "<u8"),  # 1, 2, 3, ...; 0 where there is no commit yet
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
"""A commit row as it lies in the file: each of the two has a page of its own, so that no torn write reaches both."""


@dataclass(frozen=True)
class Commit:
    """One commit: how many samples and chunks there are, and which checkpoint comes after them."""

    sequence: int
    samples: int
    chunks: int
    chunks_crc: int
    checkpoint_crc: int

    @property
    def slot(self) -> int:
        """Which of the two checkpoints, and rows, belongs to this commit."""
        return (self.sequence - 1) % SLOTS

    def encoded(self) -> bytes:
        """Return the row as it stands in the file."""
        row = np.zeros((), dtype=_PACKED)
        for field in ("sequence", "samples", "chunks", "chunks_crc", "checkpoint_crc"):
            row[field] = getattr(self, field)
        body = row.tobytes()[:-4]
        return body + zlib.crc32(body).to_bytes(4, "little")


def decoded(row: bytes | bytearray, slot: int) -> Commit | None:
    """Return the commit in the row of `slot`, or None where none is, or none that was written to its end."""
    if zlib.crc32(row[: ROW_BYTES - 4]) != int.from_bytes(row[ROW_BYTES - 4 : ROW_BYTES], "little"):
        return None
    values = np.frombuffer(bytes(row[:ROW_BYTES]), dtype=_PACKED)[0]
    commit = Commit(*(int(values[field]) for field, _ in _FIELDS[:-1]))
    return commit if 0 < commit.sequence < _MOST_COMMITS and commit.slot == slot else None
