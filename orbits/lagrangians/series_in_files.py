"""The Chebyshev series of bodies in one or two SPK files, as compiled code reads them: the files are mapped into
memory, so that a run reads those pages that it needs.

Source: NAIF's "SPK Required Reading", types 2 and 3.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EpochError, InputError
from orbits.kernels.ephemeris import chebyshev
from orbits.kernels.ephemeris.chebyshev import BEFORE_COEFFICIENTS, COLUMNS, Given

Array = NDArray[np.float64]

DAY, J2000 = 86400, 2451545
KM_PER_AU = 149597870.7
BARYCENTRE, ICRF = 0, 1
"""NAIF's numbers of the origin and of the axes, which NAIF calls J2000."""

PARTS = {2: 3, 3: 6}
"""The types of segments that are read, with the number of series in a record; of type 3, the velocities are left out,
as those of the positions are the same."""

FTP_BYTES = b"LTL-IEEE"
LINE = 8
"""Bytes of a number."""


class Series(NamedTuple):
    """What files say of some bodies.

    given : for compiled code; start, end : the days since the epoch that are covered; digest : of the records at the
        epoch, which tells other data under the same name
    """

    given: Given
    start: float
    end: float
    digest: str


class _Segment(NamedTuple):
    """A segment; start, end, initial and length in seconds, past J2000."""

    file: int
    target: int
    centre: int
    frame: int
    kind: int
    start: float
    end: float
    first_word: int
    initial: float
    length: float
    size: int
    records: int


def series_of(files: tuple[str, ...], targets: tuple[int, ...], jd1: float, jd2: float) -> Series:
    """Return the series of bodies relative to the Solar System barycentre, au and days.

    files : the paths of one or two SPK files; targets : NAIF's numbers, in the order of the bodies
    jd1 + jd2 : the epoch, TDB

    Raises InputError for a file that cannot be read, or lacks a body, naming it; EpochError if the epoch is not
    covered.
    """
    return _series_of(files, tuple(_stamp(path) for path in files), targets, jd1, jd2)


def _stamp(path: str) -> tuple[int, ...]:
    """Return what is another when a file is replaced or written again."""
    now = os.stat(path)
    return now.st_dev, now.st_ino, now.st_size, now.st_mtime_ns


@lru_cache(maxsize=8)
def _series_of(
    files: tuple[str, ...], stamps: tuple[tuple[int, ...], ...], targets: tuple[int, ...], jd1: float, jd2: float
) -> Series:
    """Return what `series_of` does, once for files that stay as they are."""
    words = [_mapped(path) for path in files]
    found: dict[int, list[_Segment]] = {}
    for file, path in enumerate(files):
        for segment in _segments(file, path):
            found.setdefault(segment.target, []).append(segment)
    rows, start, end, digest = [], -np.inf, np.inf, hashlib.sha256()
    for body, target in enumerate(targets):
        chain, base = [], -1
        centre = target
        while centre != BARYCENTRE:
            if centre in targets[:body]:
                base = targets.index(centre)
                break
            segment = _covering(found, centre, files, jd1, jd2)
            chain.append(segment)
            centre = segment.centre
        for k, segment in enumerate(reversed(chain)):
            row, (begins, ends) = _row(segment, jd1, jd2)
            row[chebyshev.ROW], row[chebyshev.BASE], row[chebyshev.ADDS] = body, base, float(k > 0)
            rows.append(row)
            start, end = max(start, begins), min(end, ends)
            at = int(row[chebyshev.WORDS]) + int(row[chebyshev.FIRST]) * segment.size
            digest.update(words[segment.file][at : at + segment.size].tobytes())
    more = words[1] if len(words) > 1 else np.zeros(1)
    return Series(Given(np.array(rows), words[0], more), start, end, digest.hexdigest()[:16])


def _mapped(path: str) -> Array:
    """Return the numbers of a file, mapped into memory; they can be written, as kernels expect, but not to the file."""
    if os.path.getsize(path) < 1024:
        raise InputError(f"{path} is not an SPK file; expected one such as de440.bsp.")
    return np.asarray(np.memmap(path, dtype="<f8", mode="c", shape=(os.path.getsize(path) // LINE,)).view(np.ndarray))


def _segments(file: int, path: str) -> list[_Segment]:
    """Return the segments of a file."""
    from jplephem.spk import SPK

    try:
        kernel = SPK.open(path)
    except ValueError as error:
        raise InputError(f"{path} is not an SPK file ({error}); expected one such as de440.bsp.") from error
    out = []
    with kernel:
        if kernel.daf.locfmt != FTP_BYTES:
            raise InputError(f"{path} has big-endian numbers; expected a little-endian SPK file, as from JPL today.")
        for each in kernel.segments:
            directory: Any = kernel.daf.read_array(each.end_i - 3, each.end_i)
            initial, length, size, records = directory.tolist() if each.data_type in PARTS else (0.0, 1.0, 0, 0)
            what = (file, each.target, each.center, each.frame, each.data_type)
            where = (each.start_second, each.end_second, each.start_i - 1)
            out.append(_Segment(*what, *where, initial, length, int(size), int(records)))
    return out


def _covering(
    found: dict[int, list[_Segment]], target: int, files: Sequence[str], jd1: float, jd2: float
) -> _Segment:
    """Return the segment of a body that counts at the epoch, with the time about it in which it does: as in SPICE, of
    several in a file the last one. Of two files the first one counts.
    """
    names = " and ".join(os.path.basename(path) for path in files)
    if target not in found:
        raise InputError(
            f"{names} {'have' if len(files) > 1 else 'has'} no body with NAIF's number {target}; expected a kernel "
            "with all bodies asked for."
        )
    spans = [(s, *_span(s, jd1, jd2)) for s in found[target]]
    there = [s for s, start, end in spans if start <= 0.0 <= end]
    if not there:
        covered = ", ".join(f"JD {J2000 + s.start / DAY:.1f} to {J2000 + s.end / DAY:.1f}" for s in found[target])
        raise EpochError(
            f"the epoch, JD {jd1 + jd2:.1f} TDB, is outside {names}, which {'have' if len(files) > 1 else 'has'} body "
            f"{target} for {covered}. Choose an epoch in that range, or another kernel."
        )
    counts = [s for s in there if s.file == there[0].file][-1]
    if counts.kind not in PARTS or counts.frame != ICRF:
        raise InputError(
            f"{names}: the series of body {target} is of type {counts.kind}, in NAIF's frame {counts.frame}; "
            "expected type 2 or 3, Chebyshev series, in frame 1, J2000, as in JPL's ephemerides and sb441-n16."
        )
    over = [x for x in spans[found[target].index(counts) + 1 :] if x[0].file == counts.file]
    return counts._replace(
        start=max([counts.start, *(s.end for s, _, end in over if end < 0.0)]),
        end=min([counts.end, *(s.start for s, start, _ in over if start > 0.0)]),
    )


def _days(second: Fraction | float, jd1: float, jd2: float) -> Fraction:
    """Return when a second past J2000 is, in days since the epoch."""
    return Fraction(second) / DAY + J2000 - Fraction(jd1) - Fraction(jd2)


def _span(segment: _Segment, jd1: float, jd2: float) -> tuple[float, float]:
    """Return the days since the epoch that a segment covers, and as much as its ends may be rounded."""
    rounding = 4.0 * np.spacing(max(abs(segment.start), abs(segment.end))) / DAY
    start, end = (float(_days(x, jd1, jd2)) for x in (segment.start, segment.end))
    return start - rounding, end + rounding


def _row(segment: _Segment, jd1: float, jd2: float) -> tuple[Array, tuple[float, float]]:
    """Return the row of the table for a segment, without the body, and the days since the epoch that it covers."""
    initial, length = Fraction(segment.initial), Fraction(segment.length)
    first = min(max(math.floor(-_days(initial, jd1, jd2) * DAY / length), 0), segment.records - 1)
    start = _days(initial + first * length, jd1, jd2)
    high = float(start)
    row = np.zeros(COLUMNS)
    row[chebyshev.FILE], row[chebyshev.WORDS], row[chebyshev.SIZE] = segment.file, segment.first_word, segment.size
    row[chebyshev.COUNT] = (segment.size - BEFORE_COEFFICIENTS) // PARTS[segment.kind]
    row[chebyshev.RECORDS], row[chebyshev.FIRST], row[chebyshev.SPAN] = segment.records, first, segment.length / DAY
    row[chebyshev.START_HI], row[chebyshev.START_LO] = high, float(start - Fraction(high))
    row[chebyshev.SCALE] = KM_PER_AU
    return row, _span(segment, jd1, jd2)
