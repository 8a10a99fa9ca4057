"""The report of a comparison: rows, a table, JSON, a picture, and a verdict.

A `Report` is a value made by `orbits.compare`. It has numbers and names only, not the code that computed them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.json_text import json_text, plain
from orbits.regression.summary import summarize

if TYPE_CHECKING:
    from rich.console import RenderableType

Array = NDArray[np.float64]

_WIDTH = 100


@dataclass(frozen=True, eq=False)
class Series:
    """Errors as functions of time, (samples,) float64 each: the largest over the bodies named by `Report.followed`."""

    energy: Array
    angular_momentum: Array
    position: Array


@dataclass(frozen=True)
class Row:
    """The results of one method. None means that a value could not be measured; `note` says why.

    kind : "ours" or "peer"
    verdict : "ok", "FAIL", "not judged" (no tolerance was given) for ours; "peer" or "n/a" for the others
    steps, wall_s, compile_s : steps taken, seconds of integration alone, seconds of compiling and first use
    energy, angular_momentum : largest |dE/E| and |dL/L| over the samples, relative to the initial value
    position : largest distance to the reference solution over samples and bodies, in the report's length unit
    worst_body : the body it belongs to; positions : the same for each body by name
    failures : which tolerances were exceeded, in words
    """

    method: str
    kind: str
    verdict: str
    steps: int | None = None
    wall_s: float | None = None
    compile_s: float | None = None
    energy: float | None = None
    angular_momentum: float | None = None
    position: float | None = None
    worst_body: str | None = None
    positions: Mapping[str, float] = field(default_factory=dict, repr=False)
    failures: tuple[str, ...] = ()
    note: str = ""
    series: Series | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class ReferenceNote:
    """The reference solution for positions, and its largest error for each body, in the report's unit of length."""

    kind: str
    description: str
    errors: Mapping[str, float] = field(repr=False)

    @property
    def error(self) -> float:
        """The largest of the errors."""
        return max(self.errors.values(), default=math.nan)


@dataclass(frozen=True, repr=False)
class Report:
    """The outcome of `orbits.compare`.

    rows : one for each method, ours first
    times : (samples,) since the epoch, in `time_unit`
    length_unit : unit of all positions: "km", or "" if the system has no physical units
    names, massive : all bodies, and those that attract
    followed : the bodies whose position errors are in the series and the picture
    settings : step, duration, samples, tolerances and so on, for JSON
    notes : remarks for readers, one sentence each

    `print(report)` shows the table; `rich` prints it in colour.
    """

    rows: tuple[Row, ...]
    times: Array
    time_unit: str
    length_unit: str
    names: tuple[str, ...]
    massive: tuple[str, ...]
    followed: str
    reference: ReferenceNote | None
    settings: Mapping[str, Any]
    notes: tuple[str, ...] = ()

    def __getattr__(self, name: str) -> Any:
        """Raise AttributeError, with the new name of an attribute that was renamed."""
        hint = "; it is called reference now." if name == "yardstick" else ""
        raise AttributeError(f"a Report has no {name!r}{hint}")

    @property
    def ok(self) -> bool:
        """Whether every one of our methods ran and kept all its tolerances."""
        return all(row.verdict != "FAIL" for row in self.rows)

    @property
    def failures(self) -> tuple[str, ...]:
        """Every exceeded tolerance, in words, with the method's name."""
        return tuple(f"{row.method}: {failure}" for row in self.rows for failure in row.failures)

    @property
    def table(self) -> str:
        """The whole report as plain text, at most 100 columns wide."""
        from rich.console import Console

        out = StringIO()
        Console(file=out, width=_WIDTH, color_system=None, legacy_windows=False).print(self)
        return "\n".join(line.rstrip() for line in out.getvalue().splitlines())

    def __str__(self) -> str:
        return self.table

    def __repr__(self) -> str:
        methods = ", ".join(row.method for row in self.rows)
        return f"Report({self.settings.get('title') or 'comparison'}; {methods}; {'ok' if self.ok else 'FAIL'})"

    def _repr_html_(self) -> str:
        from orbits.regression.report_tables import html

        return html(self)

    def __rich__(self) -> RenderableType:
        from orbits.regression.report_tables import render

        return render(self)

    def to_json(self, path: str | Path | None = None) -> str:
        """Return the report as JSON text, and write it to `path` if given.

        Numbers that are not finite become null. Raises InputError if `path` cannot be written.
        """
        record = {
            "format": "orbits-report",
            "version": 2,
            "ok": self.ok,
            "failures": self.failures,
            "settings": self.settings,
            "length_unit": self.length_unit,
            "time_unit": self.time_unit,
            "massive": self.massive,
            "reference": None
            if self.reference is None
            else {
                "kind": self.reference.kind,
                "description": self.reference.description,
                "error": self.reference.error,
                "errors": self.reference.errors,
            },
            "notes": self.notes,
            "rows": [self._row_record(row) for row in self.rows],
            "times": self.times.tolist(),
        }
        text = json_text(plain(record, "reports"), ensure_ascii=False, allow_nan=False)
        if path is not None:
            _writable(path, lambda: Path(path).write_text(text + "\n", encoding="utf-8"))
        return text

    def _row_record(self, row: Row) -> dict[str, Any]:
        record = {name: getattr(row, name) for name in row.__dataclass_fields__ if name != "series"}
        particles = [name for name in self.names if name not in set(self.massive)]
        if row.positions and particles:
            record["particles"] = summarize(row.positions, particles)
        if row.series is not None:
            record["series"] = {name: getattr(row.series, name).tolist() for name in row.series.__dataclass_fields__}
        return record

    def plot(self, path: str | Path) -> Path:
        """Draw the errors of every method against time, and save the picture (1600 x 1000 pixels for a PNG).

        Raises InputError if `path` cannot be written.
        """
        from orbits.regression.report_picture import draw

        target = Path(path)
        _writable(path, lambda: draw(self, target))
        return target


def _writable(path: str | Path, write: Callable[[], object]) -> None:
    try:
        write()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot write {str(path)!r}: {reason}. Choose another path or make the folder.") from error
