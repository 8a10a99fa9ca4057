"""The excursions of a run from a Wisdom–Holman map: when all bodies left it for encounters, and when they returned."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.checks import place_in
from orbits.errors import ArchiveError
from orbits.export import MOST_ROWS, Tabled, headed
from orbits.marching.legs.excursions.chosen_steps import (
    BODY,
    COUNTS,
    EXCURSIONS,
    LEFT,
    NOT_YET,
    OTHER_BODY,
    RETURNED,
    ROOM,
)
from orbits.marching.legs.excursions.planet_encounters import NOBODY

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.marching.clocks.clock import Clock
    from orbits.system import System
    from orbits.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Excursion:
    """A part of a run in which all bodies took steps chosen one by one, because of two of them.

    bodies : the names of the two whose encounter began it; empty where the map could not take a step
    left, returned : when all left the map and entered it again, since the epoch; `returned` is None if the run ended
        before. After a change of the bodies within a step, all take chosen steps for the rest of it; if an encounter
        begins before they have entered the map again, `left` is the beginning of the map's step in which that is
    steps : the numbers of steps of the map before both
    """

    bodies: tuple[str, ...]
    left: u.Quantity
    returned: u.Quantity | None
    steps: tuple[int, int | None]

    def __str__(self) -> str:
        end = "the end of the run" if self.returned is None else f"{self.returned:.10g}"
        return f"{self.what}: t = {self.left.value:.10g} to {end}"

    @property
    def what(self) -> str:
        """What began it, in words."""
        return " and ".join(self.bodies) or "a step that the map cannot take"


class Excursions(Tabled, Sequence[Excursion]):
    """The excursions of a run, in its order; the first 4,096 of them, if there were more.

    total : how many there were
    """

    def __init__(self, excursions: Iterable[Excursion], count: int, unit: u.UnitBase) -> None:
        self._excursions, self._unit = tuple(excursions), unit
        self.total = count

    @classmethod
    def of(cls, system: System, clock: Clock, rows: NDArray[np.int64], count: int) -> Excursions:
        """Return excursions from rows as `PlanetExcursions.excursions` has them, and their number."""
        unit, found = system.units.time, []
        for row in rows.tolist():
            names = tuple(system.names[k] for k in (row[BODY], row[OTHER_BODY]) if k != NOBODY)
            begun, end = row[LEFT], None if row[RETURNED] == NOT_YET else row[RETURNED]
            left, returned = (None if k is None else u.Quantity(clock.time(k), unit) for k in (begun, end))
            assert left is not None
            found.append(Excursion(names, left, returned, (begun, end)))
        return cls(found, count, unit)

    @classmethod
    def in_archive(cls, run: Trajectory) -> Excursions:
        """Return those of a run in an archive, as listed in its last checkpoint."""
        checkpoint = {} if run.archive is None else run.archive.checkpoint()
        if COUNTS not in checkpoint:
            return cls((), 0, run.system.units.time)
        rows, count = np.asarray(checkpoint[EXCURSIONS]), int(checkpoint[COUNTS][1])
        rows = rows[: min(max(count, 0), ROOM)]
        bodies = rows[:, [BODY, OTHER_BODY]]
        if (bodies < NOBODY).any() or (bodies >= len(run.names)).any():
            raise ArchiveError("the excursions from the map in its checkpoint are not those of a run.")
        return cls.of(run.system, run.clock, rows, count)

    def include(self, reading: float) -> bool:
        """Return whether all bodies took chosen steps at a reading of the clock, in steps."""
        k = bisect_right(self._excursions, reading, key=lambda one: one.steps[0]) - 1
        end = self._excursions[k].steps[1] if k >= 0 else 0
        return end is None or reading < end

    def __len__(self) -> int:
        return len(self._excursions)

    @overload
    def __getitem__(self, key: int) -> Excursion: ...

    @overload
    def __getitem__(self, key: slice) -> Excursions: ...

    def __getitem__(self, key: int | slice) -> Excursion | Excursions:
        if not isinstance(key, slice):
            expected = "an index, run.excursions[-1], or a slice, run.excursions[:10]"
            return self._excursions[place_in(len(self), key, "run.excursions", "excursions", expected)]
        some = self._excursions[key]
        return Excursions(some, len(some), self._unit)

    def to_table(self) -> QTable:
        """Return an astropy QTable of bodies, left and returned (times since the epoch, NaN for one not over)."""
        from astropy.table import QTable

        begun = [one.left.to_value(self._unit) for one in self]
        ends = [np.nan if one.returned is None else one.returned.to_value(self._unit) for one in self]
        return QTable(
            {
                "bodies": np.array([" and ".join(one.bodies) for one in self], dtype=str),
                "left": u.Quantity(np.array(begun), self._unit),
                "returned": u.Quantity(np.array(ends), self._unit),
            }
        )

    def to_records(self) -> list[dict[str, Any]]:
        """Return records for JSON, with times in the unit of the system."""
        return [
            {
                "bodies": list(one.bodies),
                "left": float(one.left.value),
                "returned": None if one.returned is None else float(one.returned.value),
                "steps": list(one.steps),
            }
            for one in self
        ]

    def _caption(self) -> str:
        if not self.total:
            return "no excursions from the map"
        several = f"{self.total:,} excursion{'s' * (self.total > 1)}"
        return f"{several} from the map, by steps chosen one by one; not reversible"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        if not len(self):
            return [], [], 0
        head = ["encounter", headed("left", self._unit), headed("returned", self._unit)]
        rows = [
            [one.what, f"{one.left.value:.10g}", "" if one.returned is None else f"{one.returned.value:.10g}"]
            for one in self._excursions[:MOST_ROWS]
        ]
        return head, rows, self.total - len(rows)
