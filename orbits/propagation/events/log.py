"""The list of the events found in a run, as rows of numbers that archives hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError
from orbits.integrators.forms import Array
from orbits.trajectory.events import BROKEN, COLUMNS, MOST_EVENTS, NUMBER, OTHER, TIME, is_possible, rows_in

EVENTS, PARTICLE_EVENTS = ("events", "event_counts"), ("particle_events", "particle_event_counts")
"""The arrays of a checkpoint with the events on the motion of the bodies with mass, and with those of massless ones."""


class Log:
    """The rows of the events found so far, in the order of the run; see `orbits.trajectory.events` for their columns.

    direction : of the run in time, 1 or -1
    firm : the number of rows that lie within the steps of the march; those behind are of the part of a step at the end
        of the run, and are found again if the run is extended
    last : the time up to which events are known, in the direction of the run
    broken : whether the search failed, so that there may be more events before the state of the march
    """

    def __init__(self, direction: float) -> None:
        self._direction = direction
        self._rows: Array = np.empty((0, COLUMNS))
        self._count = self.firm = 0
        self.last = -np.inf
        self.broken = False

    @property
    def rows(self) -> Array:
        """The rows, (n, columns)."""
        return self._rows[: self._count]

    @property
    def full(self) -> bool:
        """Whether there is no room for another row."""
        return self._count == MOST_EVENTS

    def pass_by(self, time: float) -> None:
        """Take all events up to a time as known: they are in the list, and what acts has acted."""
        self.last = time * self._direction

    def are_new(self, times: Array, apart: float) -> NDArray[np.bool_]:
        """Return which events lie behind those that are known, by more than a time `apart`: others, before a resume or
        before one that acted, are found again.
        """
        return times * self._direction > self.last + apart

    def forget(self) -> None:
        """Take no events as known: none are found again."""
        self.last = -np.inf

    def has(self, row: Array, apart: float) -> bool:
        """Return whether an event is listed that differs from another by no more than a time `apart`, and figures."""
        same = (self.rows[:, NUMBER : OTHER + 1] == row[NUMBER : OTHER + 1]).all(axis=1)
        return bool((same & (np.abs(self.rows[:, TIME] - row[TIME]) <= apart)).any())

    def add(self, row: Array, firm: bool) -> None:
        """Add a row, for which there must be room, in the order of time."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty((max(64, self._count), COLUMNS))])
        place = self._count
        while place and (self._rows[place - 1, TIME] - row[TIME]) * self._direction > 0.0:
            place -= 1
        self._rows[place + 1 : self._count + 1] = self._rows[place : self._count].copy()
        self._rows[place] = row
        self._count += 1
        if firm:
            self.firm = self._count

    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return the rows as arrays of a fixed shape."""
        firm = BROKEN if self.broken else self.firm
        return dict(zip(EVENTS, padded_rows(self.rows, firm), strict=True))

    def take(self, rows: Array) -> None:
        """Begin with rows that are known."""
        for row in rows:
            self.add(row, True)
        if len(rows):
            self.pass_by(float(rows[-1, TIME]))

    def settle(self) -> None:
        """Take all rows as firm."""
        self.firm = self._count

    def drop_from(self, time: float) -> None:
        """Take the rows from a time on out of the list: what acts there has not acted."""
        self._count = int(((self.rows[:, TIME] - time) * self._direction < 0.0).sum())
        self.firm = min(self.firm, self._count)
        self.last = float(self.rows[-1, TIME]) * self._direction if self._count else -np.inf

    def drop_after(self, time: float) -> None:
        """Take the rows after a time out of the list."""
        kept = self.rows[(self.rows[:, TIME] - time) * self._direction <= 0.0]
        self._count = len(kept)
        self._rows[: self._count] = kept
        self.firm = min(self.firm, self._count)


def padded_rows(rows: Array, firm: int) -> tuple[Array, NDArray[np.int64]]:
    """Return rows in an array of a fixed shape, and two numbers: of all, and of those that are firm."""
    padded = np.zeros((MOST_EVENTS, COLUMNS))
    padded[: len(rows)] = rows
    return padded, np.array([len(rows), firm], dtype=np.int64)


def firm_rows(
    checkpoint: Mapping[str, NDArray[Any]], names: tuple[str, str], functions: int, bodies: int, path: Any
) -> Array:
    """Return the firm rows in two arrays of a checkpoint. Raises ArchiveError for an impossible list."""
    rows = rows_in(checkpoint, *names)
    firm = 0 if rows is None else int(checkpoint[names[1]][1])
    if firm == BROKEN:
        raise ArchiveError(
            f"{path} cannot be resumed: the search for its events failed, so that more of them may lie before its end. "
            "Run it again with events that can be sought, or go on from its last sample: "
            "orbits.propagate(orbits.Trajectory.open(path)[-1], ...)."
        )
    if rows is None or not 0 <= firm <= len(rows) or not is_possible(rows, functions, bodies):
        raise ArchiveError(f"{path} is damaged: the list of events in its checkpoint is impossible.")
    return rows[:firm]
