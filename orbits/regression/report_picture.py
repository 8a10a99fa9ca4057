"""A report as a picture: the errors of all methods against time, with the round-off floor.

Heavy lines are the largest error so far, so that a line ends at the number in the table; faint lines are the error
itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.plotting import below, figure, fitting_time, look, method_words, save, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.regression.report import Report, Row

Array = NDArray[np.float64]

_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_ROUND_OFF = 2.0**-53
_FLOOR: dict[str, Any] = {"color": style.GREY, "linewidth": 1.4, "zorder": 1}


def draw(report: Report, path: Path) -> None:
    """Save the picture of a report."""
    save(picture(report), path)


@look()
def picture(report: Report) -> Figure:
    """Return the picture: a large panel of position errors, with energy and angular momentum beside it."""
    made = figure(16, 10, dpi=100)
    axes = made.subplot_mosaic([["position", "energy"], ["position", "momentum"]], width_ratios=[1.25, 1])
    rows = [row for row in report.rows if row.series is not None]
    span = float(report.times[np.argmax(np.abs(report.times))]) if len(report.times) else 0.0
    factor, time_unit = fitting_time(span, report.time_unit)
    times = np.abs(report.times) * factor
    unit = f" [{report.length_unit}]" if report.length_unit else ""
    measured = f"position error{unit}, {report.followed}"
    headline = measured if report.reference else "position error (no reference solution)"
    which = "massive bodies" if len(report.massive) > 1 else "worst massless body"  # as `Invariants` measures
    of = "" if set(report.massive) == set(report.names) else f" of the {which}"
    _panel(axes["position"], times, rows, "position", headline)
    _panel(axes["energy"], times, rows, "energy", f"energy{of}, |ΔE/E|")
    _panel(axes["momentum"], times, rows, "angular_momentum", f"angular momentum{of}, |ΔL|/|L|")
    handles, labels = _named(axes.values())
    for name in ("energy", "momentum"):
        line = _floor(axes[name], _ROUND_OFF, ":")
    handles, labels = [*handles, line], [*labels, "round-off, 2⁻⁵³"]
    if report.reference is not None and report.reference.error > 0:
        handles.append(_floor(axes["position"], report.reference.error, "-."))
        labels.append("the reference solution's own error")
    when = f"time {'before' if span < 0 else 'since'} the start"
    for axis in (axes["position"], axes["momentum"]):
        axis.set_xlabel(when + (f" [{time_unit}]" if time_unit else ""))
    title = str(report.settings.get("title") or "Comparison")
    made.suptitle(title, fontsize=21, fontweight="bold", parse_math=False)
    told = "strong lines: the largest error so far; faint: the error itself"
    if any(row.kind == "peer" for row in rows):
        told += "; dashed: REBOUND"
    below(made, handles, labels, told, size=14)
    return made


def _panel(axis: Axes, times: Array, rows: list[Row], quantity: str, title: str) -> None:
    axis.set_title(title)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.grid(True, which="major", color=style.FAINT, linewidth=0.6)
    after_start = times > 0
    if times.max() >= 10.0 * times[after_start].min(initial=np.inf):  # else powers of ten may have no place on the axis
        axis.set_xlim(times[after_start].min(), times.max())
        axis.xaxis.set_minor_formatter("")
    for i, row in enumerate(rows):
        values: Array = getattr(row.series, quantity)[after_start]
        if not np.any(values > 0):  # also where nothing was measured; a log axis has no place for zero
            continue
        colour, so_far = style.PALETTE[i % len(style.PALETTE)], np.maximum.accumulate(values)
        apart = 0.12 if np.count_nonzero(so_far > 0) > 1 else None  # a single point has no way along which to be apart
        axis.plot(times[after_start], np.where(values > 0, values, np.nan), color=colour, linewidth=1.0, alpha=0.25)
        axis.plot(
            times[after_start], np.where(so_far > 0, so_far, np.nan), label=method_words(row.method), color=colour,
            linewidth=2.6 if row.kind == "ours" else 1.6, linestyle="-" if row.kind == "ours" else (0, (4, 1.5)),
            marker=_MARKERS[i % len(_MARKERS)], markevery=apart, markersize=8 if row.kind == "ours" else 6,
            zorder=3 if row.kind == "ours" else 2,
        )  # fmt: skip


def _floor(axis: Axes, level: float, dashes: str) -> Any:
    bottom, top = axis.get_ylim() if axis.lines else (level, level)
    axis.set_ylim(min(bottom, level / 2.0), max(top, level * 2.0))
    return axis.axhline(level, linestyle=dashes, **_FLOOR)


def _named(panels: Any) -> tuple[list[Any], list[str]]:
    """Return handles and labels of all methods in any of the panels, each once."""
    known: dict[str, Any] = {}
    for axis in panels:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    return list(known.values()), list(known)
