"""A report as rich tables, readable at 80 columns."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.table import Table
from rich.text import Text

from orbits.export import html_table
from orbits.regression.summary import summarize

if TYPE_CHECKING:
    from orbits.regression.report import Report, Row

BODIES_IN_FULL = 12
"""Up to this many bodies have a line each."""

COLUMNS = 8
"""The most methods side by side in a table of bodies; others have one below, as narrower columns cannot be read."""

LEAST_OF_METHOD, LEAST_OF_VERDICT = 15, 6
"""The least width of a column of methods, that of `Gauss(stages=8)`, and of verdicts, of which "not judged" has two
lines: so the table of methods fits into 80 columns."""

COMFORTABLE = 92
"""The width of a console below which columns stand closer together."""

_STYLE = {"ok": "green", "FAIL": "bold red", "n/a": "dim"}


def render(report: Report) -> RenderableType:
    """Return tables of the methods and of the bodies (with a summary of massless particles), and the remarks."""
    parts: list[RenderableType] = [_methods(report)]
    if any(row.positions for row in report.rows):
        detailed = report.names if len(report.names) <= BODIES_IN_FULL else report.massive
        if 1 < len(detailed) <= BODIES_IN_FULL:
            parts += _bodies(report, detailed)
        if len(report.names) > BODIES_IN_FULL and len(report.massive) < len(report.names):
            parts.append(_particles(report))
    parts += [Text(line) for line in _footer(report)]
    parts += [Text(f"FAIL  {failure}", style="bold red") for failure in report.failures]
    return Group(*parts)


def html(report: Report) -> str:
    """Return the table of methods as HTML for a notebook, with the footer and all failures below."""
    unit = f" [{report.length_unit}]" if report.length_unit else ""
    head = ("method", "steps", "wall [s]", "max |ΔE/E|", "max |ΔL/L|", f"max |Δq|{unit}", "of body", "verdict")
    rows = [
        (
            row.method.removesuffix("()"),
            "n/a" if row.steps is None else f"{row.steps:,}",
            *(short(x) for x in (row.wall_s, row.energy, row.angular_momentum, row.position)),
            row.worst_body or "",
            row.verdict,
        )
        for row in report.rows
    ]
    below = [*_footer(report), *(f"FAIL {failure}" for failure in report.failures)]
    lines = "".join(f"<p>{escape(line)}</p>" for line in below)
    return html_table(str(report.settings.get("title") or "Comparison"), head, rows) + lines


def _methods(report: Report) -> Table:
    table = _table(str(report.settings.get("title") or "Comparison"))
    table.add_column("\nmethod", overflow="fold", min_width=LEAST_OF_METHOD)
    position = f"max |Δq|\n{report.length_unit}" if report.length_unit else "max\n|Δq|"
    for head in ("\nsteps", "wall\ns", "compile\ns", "max\n|ΔE/E|", "max\n|ΔL/L|", position):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("of\nbody", overflow="fold", max_width=12)
    table.add_column("\nverdict", min_width=LEAST_OF_VERDICT)
    for row in report.rows:
        measured = (row.wall_s, row.compile_s, row.energy, row.angular_momentum, row.position)
        table.add_row(
            Text(row.method.removesuffix("()")),
            "n/a" if row.steps is None else f"{row.steps:,}",
            *("" if x is None and row.verdict != "n/a" else short(x) for x in measured),
            Text(row.worst_body or ""),
            Text(row.verdict, style=_STYLE.get(row.verdict, "")),
        )
    return table


def _bodies(report: Report, bodies: Sequence[str]) -> list[Table]:
    columns = [(_stacked(row.method), row.positions) for row in report.rows if row.positions]
    if report.reference is not None:
        columns.append(("reference\nitself", report.reference.errors))
    count = math.ceil(len(columns) / COLUMNS)
    tables = []
    for k in range(count):
        table = _table(f"Largest position error{_in(report)} over all samples")
        table.add_column("body", overflow="fold")
        part = columns[k * len(columns) // count : (k + 1) * len(columns) // count]
        for head, _ in part:
            table.add_column(head, justify="right", overflow="fold", min_width=8)
        for body in bodies:
            table.add_row(Text(body), *(short(errors.get(body)) for _, errors in part))
        tables.append(table)
    return tables


def _particles(report: Report) -> Table:
    attracting = set(report.massive)
    particles = [name for name in report.names if name not in attracting]
    table = _table(f"Largest position error{_in(report)} of the {len(particles):,} massless particles")
    table.add_column("method", overflow="fold")
    for head in ("median", "99th percentile", "worst"):
        table.add_column(head, justify="right")
    table.add_column("worst particle", overflow="fold")
    for row in report.rows:
        if row.positions:
            summary = summarize(row.positions, particles)
            table.add_row(
                Text(row.method.removesuffix("()")),
                *(short(summary[key]) for key in ("median", "p99", "worst")),
                Text(summary["name"]),
            )
    return table


def _footer(report: Report) -> list[str]:
    lines = []
    if report.reference is not None:
        unit = f" {report.length_unit}" if report.length_unit else ""
        own = f"its own error {short(report.reference.error)}{unit}"
        lines.append(f"Reference solution: {report.reference.description}; {own}.")
    return [*lines, *report.notes, *(_note(row) for row in report.rows if row.note)]


def _note(row: Row) -> str:
    return row.note if row.method in row.note else f"{row.method}: {row.note}"


def _stacked(method: str) -> str:
    """Return a method's label in lines short enough for the head of a column."""
    words = method.removesuffix("()").replace(" ", "\n").replace("(", "\n(")
    return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[-:=])|(?<=,)(?!\n)", "\n", words)


def _in(report: Report) -> str:
    return f" in {report.length_unit}" if report.length_unit else ""


class _Table(Table):
    """A table whose columns stand closer together on a narrow console."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        if options.max_width < COMFORTABLE:
            self.padding = (0, 0, 0, 0)
        yield from super().__rich_console__(console, options)


def _table(title: str) -> Table:
    return _Table(title=Text(title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))


def short(x: float | None) -> str:
    """Return a number with two significant digits: 0.072, 13, 1.4e+05, 3.1e-15; "n/a" for None and NaN."""
    if x is None or math.isnan(x):
        return "n/a"
    if x == 0:
        return "0"
    if 0.01 <= abs(x) < 1000:
        return f"{x:.{max(0, 1 - math.floor(math.log10(abs(x))))}f}"
    return f"{x:.1e}"
