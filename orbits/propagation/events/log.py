"""The list of the events found in a run, as rows of numbers that archives hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError
from orbits.trajectory.events import COLUMNS, MOST_EVENTS, TIME, is_possible, rows_in

Array = NDArray[np.float64]


class Log:
    """The rows of the events found so far, in the order of the run; see `orbits.trajectory.events` for their columns.

    direction : of the run in time, 1 or -1
    firm : the number of rows that lie within the steps of the march; those behind are of the part of a step at the end
        of the run, and are found again if the run is extended
    """

    def __init__(self, direction: float) -> None:
        self._direction = direction
        self._rows: Array = np.empty((64, COLUMNS))
        self._count = self.firm = 0
        self._last = -np.inf

    @property
    def rows(self) -> Array:
        """The rows, (n, columns)."""
        return self._rows[: self._count]

    @property
    def known(self) -> bool:
        """Whether there are events that may be found again: before a resume, or before one that acted."""
        return self._last > -np.inf

    @property
    def full(self) -> bool:
        """Whether there is no room for another row."""
        return self._count == MOST_EVENTS

    def pass_by(self, time: float) -> None:
        """Take all events up to a time as known: they are in the list, and what acts has acted."""
        self._last = time * self._direction

    def is_new(self, time: float, apart: float) -> bool:
        """Return whether an event lies behind those that are known, by more than a time `apart`."""
        return time * self._direction > self._last + apart

    def add(self, row: Array, firm: bool) -> None:
        """Add a row, for which there must be room."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1
        if firm:
            self.firm = self._count

    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return the rows as arrays of a fixed shape."""
        padded = np.zeros((MOST_EVENTS, COLUMNS))
        padded[: self._count] = self.rows
        return {"events": padded, "event_counts": np.array([self._count, self.firm], dtype=np.int64)}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], functions: int, bodies: int, path: Any) -> None:
        """Restore a checkpoint, for a march that goes on. Raises ArchiveError for an impossible one."""
        rows = rows_in(checkpoint)
        firm = int(checkpoint["event_counts"][1]) if rows is not None else -1
        if rows is None or not 0 <= firm <= len(rows) or not is_possible(rows, functions, bodies):
            raise ArchiveError(f"{path} is damaged: the list of events in its checkpoint is impossible.")
        for row in rows[:firm]:
            self.add(row, True)
        if firm:
            self.pass_by(float(rows[firm - 1, TIME]))
