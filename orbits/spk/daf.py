"""SPK files: a DAF with segments of type 2, Chebyshev polynomials of positions in records of equal length.

Source: NAIF's "DAF Required Reading" and "SPK Required Reading".
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

RECORD = 1024
COMMENT = 1000
"""Characters of comment in a record. Lines end in NUL, the comment in EOT."""

J2000_FRAME = 1
TYPE_2 = 2
FTP_TEST = b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP"


@dataclass(frozen=True)
class Segment:
    """The positions of one body relative to a centre.

    name : up to 40 characters;  target, centre : NAIF's numbers
    start, end : the interval covered, TDB seconds past J2000
    initial, length : start of the first record and length of each record, seconds
    coefficients : (records, degree + 1, 3), km
    """

    name: str
    target: int
    centre: int
    start: float
    end: float
    initial: float
    length: float
    coefficients: NDArray[np.float64]

    def words(self) -> NDArray[np.float64]:
        """Return the segment as stored in the file: records of MID, RADIUS, x, y, z, then four numbers about them."""
        count, terms, _ = self.coefficients.shape
        size = 2 + 3 * terms
        records = np.empty((count, size))
        records[:, 0] = self.initial + self.length * (np.arange(count) + 0.5)
        records[:, 1] = self.length / 2.0
        records[:, 2:] = self.coefficients.transpose(0, 2, 1).reshape(count, 3 * terms)
        return np.append(records, [self.initial, self.length, size, count])


def write(file: BinaryIO, title: str, comments: Sequence[str], segments: Sequence[Segment]) -> None:
    """Write a whole SPK file into an empty file opened for writing and reading."""
    from jplephem.daf import DAF

    text = "\0".join(plain(line) for line in comments).encode("ascii") + b"\0\4"
    comment_records = -(-len(text) // COMMENT)
    first = 2 + comment_records  # of the summaries; records count from 1
    header = struct.pack(
        "<8sII60sIII8s603s28s297s",
        b"DAF/SPK ", 2, 6, plain(title).encode("ascii")[:60].ljust(60), first, first, (first + 1) * RECORD // 8 + 1,
        b"LTL-IEEE", b"", FTP_TEST, b"",
    )  # fmt: skip
    file.write(header)
    for k in range(comment_records):
        file.write(text[k * COMMENT : (k + 1) * COMMENT].ljust(RECORD, b"\0"))
    file.write(bytes(RECORD) + b" " * RECORD)  # no summaries yet, and their names
    daf = DAF(file)
    for s in segments:
        values = (s.start, s.end, s.target, s.centre, J2000_FRAME, TYPE_2)
        daf.add_array(plain(s.name).encode("ascii")[:40], values, s.words())
    file.seek(0, 2)
    file.write(bytes(-file.tell() % RECORD))  # CSPICE reads whole records


def plain(text: str) -> str:
    """Return text in printable ASCII, with "?" for every other character."""
    return "".join(c if " " <= c <= "~" else "?" for c in text)
