"""The table of the events of a run: times, kinds, bodies, distances and speeds."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.checks import place_in
from orbits.errors import ArchiveError
from orbits.export import MOST_ROWS, Tabled, headed
from orbits.export.labelled import imported
from orbits.system.presenting import attributes
from orbits.units import date_text, written

if TYPE_CHECKING:
    import pandas
    from astropy.table import QTable
    from astropy.time import Time

    from orbits.archive import Archive
    from orbits.system import System

Array = NDArray[np.float64]

TIME, NUMBER, RISING, BODY, OTHER, DISTANCE, SPEED, ANGLE = range(8)
"""The columns of a row: the time; the number of the function whose zero it is, among those of all events; 1 if the
function rises in time, 0 if it falls; the numbers of the bodies, -1 for none; and distance, speed and angle (radians),
NaN where there is none.
"""

SHOWN_KINDS = 4
"""The most kinds of events that never happened that are named above a table."""

COLUMNS = 8

MOST_EVENTS = 1 << 15
"""The most events of a run: room for as many is kept in each of the two checkpoints of an archive."""


BROKEN = -1
"""Stands in a checkpoint for the number of rows that are firm, if the search for events failed."""


@dataclass(frozen=True)
class FoundEvent:
    """One event of a run.

    time : since the epoch, with unit; date : as a Time (TDB), None without an epoch
    kind : in words
    body, other : names, None without them
    distance, speed : of the two bodies relative to each other, None without them
    angle : between the two bodies as seen from a third one, for events that are seen; else None
    """

    time: u.Quantity
    date: Time | None
    kind: str
    body: str | None
    other: str | None
    distance: u.Quantity | None
    speed: u.Quantity | None
    angle: u.Quantity | None

    def __str__(self) -> str:
        when = f"t = {self.time:.10g}" if self.date is None else f"{date_text(self.date, 19)} TDB, t = {self.time:.10g}"
        bodies = " and ".join(name for name in (self.body, self.other) if name is not None)
        known = {"distance": self.distance, "speed": self.speed, "angle": self.angle}
        figures = [
            f"{x:.6g}" if str(x.unit) else f"{name} {x:.6g}"  # a number alone would say nothing
            for name, x in known.items()
            if x is not None
        ]
        return ", ".join([f"{when}: {self.kind}" + f" of {bodies}" * bool(bodies), *figures])


class Events(Tabled, Sequence[FoundEvent]):
    """The events of a run in the order in which it met them: `run.events`.

    By index one `FoundEvent`, by slice or by the name of a body several `Events`. `to_table` and `to_pandas` have one
    row for each; `.time`, `.date`, `.kind`, `.distance`, `.speed` and `.angle` are its columns.

    system : at the start of the run
    words : for each function whose zeros were sought, what they are called where it falls and where it rises
    rows : (n, 8), see `TIME`
    views : for each function the number of its event, the observer, None without one, and whether it is apparent
    """

    def __init__(
        self,
        system: System | None = None,
        words: Sequence[Sequence[str | None]] = (),
        rows: Any = (),
        views: Sequence[tuple[int, Any, bool]] = (),
    ) -> None:
        self._system, self._words, self._views = system, [tuple(pair) for pair in words], views
        self._rows: Array = np.array(rows, dtype=np.float64).reshape(-1, COLUMNS)
        self._rows.flags.writeable = False
        self._whole = True

    def __len__(self) -> int:
        return len(self._rows)

    def between(self, times: Array) -> Events:
        """Return those between the first and the last of these times; none without any."""
        if not len(times) or self._system is None:
            return Events()
        when = self._rows[:, TIME]
        return self._some((when >= times.min()) & (when <= times.max()))

    def _some(self, which: Any) -> Events:
        part = Events(self._system, self._words, self._rows[which], self._views)
        part._whole = self._whole and len(part) == len(self)
        return part

    def by_event(self) -> list[tuple[Any, bool, Events]]:
        """Return for each event of which any was found its observer, whether it is apparent, and those found."""
        own = np.array([view[0] for view in self._views], dtype=int)[self._rows[:, NUMBER].astype(int)]
        of = {number: (observer, apparent) for number, observer, apparent in self._views}
        return [(*of[number], self._some(own == number)) for number in sorted(set(own.tolist()))]

    @overload
    def __getitem__(self, key: int) -> FoundEvent: ...

    @overload
    def __getitem__(self, key: slice | str) -> Events: ...

    def __getitem__(self, key: int | slice | str) -> FoundEvent | Events:
        """Return one event by index, or several by a slice, or by the name of a body. Raises UnknownNameError,
        OutOfRangeError.
        """
        if isinstance(key, str):
            row = index_of(key, self._names)
            return self._some((self._rows[:, [BODY, OTHER]] == row).any(axis=1))
        if isinstance(key, slice):
            return self._some(key)
        expected = 'an index, run.events[-1], a slice, run.events[:10], or the name of a body, run.events["Moon"]'
        return self._one(self._rows[place_in(len(self), key, "run.events", "events", expected)])

    def _one(self, row: Array) -> FoundEvent:
        time = u.Quantity(row[TIME], self._units.time)
        body, other = (None if row[k] < 0 else self._names[int(row[k])] for k in (BODY, OTHER))
        distance, speed, angle = (
            None if np.isnan(row[k]) else u.Quantity(row[k], unit)
            for k, unit in ((DISTANCE, self._units.length), (SPEED, self._units.speed), (ANGLE, u.rad))
        )
        angle = None if angle is None else angle.to(u.deg)
        return FoundEvent(time, self._date(time), self._kind(row), body, other, distance, speed, angle)

    def _kind(self, row: Array) -> str:
        return self._words[int(row[NUMBER])][int(row[RISING])] or ""

    def _date(self, time: u.Quantity) -> Time | None:
        epoch = None if self._system is None else self._system.epoch
        return None if epoch is None else written((epoch + time).copy(format="iso"))

    @property
    def _names(self) -> tuple[str, ...]:
        return () if self._system is None else self._system.names

    @property
    def _units(self) -> Any:
        assert self._system is not None
        return self._system.units

    @property
    def time(self) -> u.Quantity:
        """Times since the epoch, (n,)."""
        return self._column(TIME, "time")

    @property
    def date(self) -> Time | None:
        """Times as a Time (TDB), (n,); None without an epoch."""
        return self._date(self.time)

    @property
    def kind(self) -> NDArray[np.str_]:
        """The kinds in words, (n,)."""
        return np.array([self._kind(row) for row in self._rows], dtype=str)

    @property
    def distance(self) -> u.Quantity:
        """Distances of the two bodies, (n,); NaN without them."""
        return self._column(DISTANCE, "length")

    @property
    def speed(self) -> u.Quantity:
        """Relative speeds of the two bodies, (n,); NaN without them."""
        return self._column(SPEED, "speed")

    @property
    def angle(self) -> u.Quantity:
        """Angles between the two bodies as seen from a third one, (n,), in degrees; NaN for other events."""
        return u.Quantity(self._rows[:, ANGLE], u.rad).to(u.deg)

    def _column(self, column: int, unit: str) -> u.Quantity:
        return u.Quantity(self._rows[:, column], u.one if self._system is None else getattr(self._units, unit))

    def _bodies(self, column: int) -> NDArray[np.str_]:
        return np.array(["" if row < 0 else self._names[int(row)] for row in self._rows[:, column]], dtype=str)

    def to_table(self) -> QTable:
        """Return an astropy QTable with the columns date (TDB, if there is an epoch), time, kind, body, other,
        distance, speed, and angle if any event is seen from a body. Its meta has the epoch and further information.
        """
        from astropy.table import QTable

        columns: dict[str, Any] = {} if self.date is None else {"date": self.date}
        columns |= {"time": self.time, "kind": self.kind}
        columns |= {"body": self._bodies(BODY), "other": self._bodies(OTHER)}
        columns |= {"distance": self.distance, "speed": self.speed}
        if np.isfinite(self._rows[:, ANGLE]).any():
            columns["angle"] = self.angle
        return QTable(columns, meta={} if self._system is None else attributes(self._system))

    def to_records(self) -> list[dict[str, Any]]:
        """Return records for JSON, in the units of the system; angles in degrees."""
        return [
            {
                "kind": event.kind,
                "body": event.body,
                "other": event.other,
                "time": float(event.time.value),
                "date": None if event.date is None else date_text(event.date, between="T"),
                **{
                    name: None if figure is None else float(figure.value)
                    for name, figure in (("distance", event.distance), ("speed", event.speed), ("angle", event.angle))
                },
            }
            for event in self
        ]

    def to_pandas(self) -> pandas.DataFrame:
        """Return a pandas DataFrame with the columns of `to_table`; dates are datetime64[us] in TDB.

        Units are strings in `frame.attrs["units"]`. Raises MissingPackageError without pandas.
        """
        module, table = imported("pandas", "to_pandas"), self.to_table()
        columns: dict[str, Any] = {}
        known: dict[str, str] = {}
        for name in table.colnames:
            column = table[name]
            if name == "date":
                columns[name] = np.array(column.datetime64, dtype="datetime64[us]")
            elif isinstance(column, u.Quantity):
                columns[name], known[name] = column.value, str(column.unit)
            else:
                columns[name] = np.array(column)
        frame: pandas.DataFrame = module.DataFrame(columns)
        frame.attrs = {"units": known, **table.meta}
        return frame

    @property
    def _text_columns(self) -> int:
        return 3 + (self._system is not None and self._system.epoch is not None)

    def _caption(self) -> str:
        count = "no events" if not len(self) else f"{len(self):,} event{'s' * (len(self) > 1)}"
        met = {self._kind(row) for row in self._rows}
        sought = dict.fromkeys(word for pair in self._words for word in pair if word)
        missing = [word for word in sought if word not in met]
        if not missing or not self._whole:
            return count
        more = f" and {len(missing) - SHOWN_KINDS} other kinds" if len(missing) > SHOWN_KINDS else ""
        return f"{count}; never: {', '.join(missing[:SHOWN_KINDS])}{more}"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        if not len(self):
            return [], [], 0
        dated = self._system is not None and self._system.epoch is not None
        seen = bool(np.isfinite(self._rows[:, ANGLE]).any())
        units = [("time", self._units.time), ("distance", self._units.length), ("speed", self._units.speed)]
        head = [*["date (TDB)"] * dated, "kind", "body", "other", *(headed(*pair) for pair in units)]
        head += ["angle [deg]"] * seen
        rows = []
        for event in self[:MOST_ROWS]:
            date = [] if event.date is None else [date_text(event.date, 19)]
            figures = [event.time, event.distance, event.speed, *[event.angle] * seen]
            texts = ["" if x is None else f"{x.value:.10g}" if x is event.time else f"{x.value:.6g}" for x in figures]
            rows.append([*date, event.kind, event.body or "", event.other or "", *texts])
        return head, rows, len(self) - len(rows)


def rows_in(
    checkpoint: Mapping[str, NDArray[Any]], name: str = "events", numbers: str = "event_counts"
) -> Array | None:
    """Return the rows of the events in a checkpoint, or None if it has none or their number is impossible.

    name, numbers : of the arrays with the rows and with their number
    """
    rows, counts = checkpoint.get(name), checkpoint.get(numbers)
    if rows is None or counts is None or rows.shape != (MOST_EVENTS, COLUMNS) or counts.shape != (2,):
        return None
    return np.array(rows[: int(counts[0])]) if 0 <= int(counts[0]) <= MOST_EVENTS else None


def events_of(archive: Archive) -> Events:
    """Return the events in the last checkpoint of an archive. Raises ArchiveError for an impossible list."""
    text = archive.events_text
    if not text:
        return Events(archive.system)
    checkpoint = archive.checkpoint()
    rows = rows_in(checkpoint)
    if rows is not None and "particle_events" in checkpoint:
        of_particles = rows_in(checkpoint, "particle_events", "particle_event_counts")
        rows = None if of_particles is None else in_order([rows, of_particles], archive.grid.clock.direction)
    try:
        known = json.loads(text)
        words = [pair for event in known for pair in event["words"]]
        given = [(k, event["given"] or {}) for k, event in enumerate(known) for _ in event["words"]]
        views = [(k, of.get("observer"), bool(of.get("apparent"))) for k, of in given]
    except (TypeError, KeyError, ValueError):
        rows = None
    if rows is None or not is_possible(rows, len(words), len(archive.system)):
        raise ArchiveError(f"{archive.path} is damaged: its list of events is impossible. Restore it from a copy.")
    return Events(archive.system, words, rows, views)


def in_order(parts: Sequence[Array], direction: float) -> Array:
    """Return the rows of several lists in the order of a run, which is that of time or against it."""
    rows = np.concatenate(parts)
    return np.asarray(rows[np.lexsort((rows[:, NUMBER], rows[:, TIME] * direction))])


def is_possible(rows: Array, functions: int, bodies: int) -> bool:
    """Return whether rows are of events of so many functions and bodies."""
    numbers, pairs = rows[:, [NUMBER, RISING]], rows[:, [BODY, OTHER]]
    whole = bool((numbers == np.floor(numbers)).all() and (pairs == np.floor(pairs)).all())
    inside = bool(((numbers >= 0) & (numbers < [functions, 2])).all() and ((pairs >= -1) & (pairs < bodies)).all())
    return whole and inside and bool(np.isfinite(rows[:, TIME]).all())


def described(events: Iterable[Mapping[str, Any]]) -> str:
    """Return the description of events for an archive, as JSON; "" without events."""
    listed = list(events)
    return json.dumps(listed, sort_keys=True) if listed else ""
