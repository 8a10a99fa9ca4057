"""Times of the clock on the wall: how they are given and written, and the limit that a run keeps."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING, Any

from astropy import units as u

from orbits.checks import positive_number
from orbits.errors import InputError, shown
from orbits.units import quantity_from_text

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory

_OF_BATCH_SYSTEMS = re.compile(r"(?:(\d+)-)?(\d+):([0-5]\d):([0-5]\d)")
"""12:00:00 and 2-12:00:00, as Slurm and PBS write limits."""


def seconds_of(value: Any, what: str) -> float:
    """Return a wall time in seconds: a quantity, a number of seconds, or a text such as "2 h" or "12:00:00".

    Raises InputError, naming it, for anything but one finite time above 0.
    """
    if isinstance(value, str) and (read := _OF_BATCH_SYSTEMS.fullmatch(value.strip())):
        days, hours, minutes, seconds = (int(part or 0) for part in read.groups())
        value = float(((days * 24 + hours) * 60 + minutes) * 60 + seconds)
    given, expected = value, "a time, such as 60 * u.s, '2 h' or '12:00:00', or a number of seconds"
    value = quantity_from_text(value, what, expected)
    try:
        return positive_number(u.Quantity(value, u.s).value.tolist(), what)
    except InputError:
        raise
    except (u.UnitConversionError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} is {shown(given)}; expected {expected}.") from error


def wall_time_text(seconds: float) -> str:
    """Return a wall time in words, with its two largest units: 45 s, 12 min, 2 h 10 min, 3 d 4 h."""
    if seconds < 1.0:
        return f"{seconds:.2g} s"
    whole = round(seconds)
    for size, name, smaller, its_name in ((86400, "d", 3600, "h"), (3600, "h", 60, "min"), (60, "min", 1, "s")):
        if whole >= size:
            large, rest = divmod(whole, size)
            small = rest // smaller
            return f"{large:,} {name}" + f" {small} {its_name}" * bool(small)
    return f"{whole} s"


class Deadline:
    """A limit of the wall time, counted from when it is made.

    limit : what `propagate` takes as `wall_time`

    Raises InputError for anything but one finite time above 0.
    """

    def __init__(self, limit: Any, what: str = "wall_time") -> None:
        self.seconds = seconds_of(limit, what)
        self._begun = time.perf_counter()

    @classmethod
    def of(cls, limit: Any) -> Deadline | None:
        """Return a deadline; one that has begun already, and None, as they are."""
        return limit if limit is None or isinstance(limit, cls) else cls(limit)

    @property
    def over(self) -> bool:
        """Whether the time is over."""
        return time.perf_counter() - self._begun > self.seconds

    @property
    def words(self) -> str:
        """Why a run ends that keeps it."""
        return f"the wall time of {wall_time_text(self.seconds)} is over"

    def ended(self, run: Trajectory) -> bool:
        """Whether it was this limit that ended a run."""
        return run._has_stopped and run.stopped is not None and run.stopped.reason.startswith(self.words)
