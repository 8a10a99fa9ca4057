"""A report as a picture: errors against time, method by method, with the round-off floor marked.

Heavy lines are the largest error so far, so that a line ends where the table's number is; the faint line behind is the
error itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.report.values import Report, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

# Okabe & Ito (2008): told apart by colour-blind readers, on paper and on a projector.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#B8A800")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_ROUND_OFF = 2.0**-53
_GREY = "#666666"


def draw(report: Report, path: Path) -> None:
    """Save the picture: position error large, energy and angular momentum beside it; 16 x 10 inches at 100 dpi."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16, 10), dpi=100, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplot_mosaic([["position", "energy"], ["position", "momentum"]], width_ratios=[1.25, 1])
    rows = [row for row in report.rows if row.series is not None]
    unit = f" [{report.length_unit}]" if report.length_unit else ""
    has_yardstick = report.yardstick is not None
    headline = f"position error{unit}, {report.followed}" if has_yardstick else "position error (no yardstick)"
    _panel(axes["position"], report, rows, "position", headline)
    _panel(axes["energy"], report, rows, "energy", "energy error |ΔE/E|")
    _panel(axes["momentum"], report, rows, "angular_momentum", "angular momentum error |ΔL/L|")
    for name in ("energy", "momentum"):
        _floor(axes[name], _ROUND_OFF, "round-off, 2⁻⁵³")
    if report.yardstick is not None and report.yardstick.error > 0:
        _floor(axes["position"], report.yardstick.error, "the yardstick's own error")
    for axis in (axes["position"], axes["momentum"]):
        axis.set_xlabel("time since the start" + (f" [{report.time_unit}]" if report.time_unit else ""), fontsize=17)
    handles, labels = axes["energy"].get_legend_handles_labels()
    if handles:
        columns = min(4, len(handles))
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=16, frameon=False)
    figure.suptitle(str(report.settings.get("title") or "Comparison"), fontsize=22, fontweight="bold")
    figure.savefig(path, metadata={"Software": "orbits"})


def _panel(axis: Axes, report: Report, rows: list[Row], quantity: str, title: str) -> None:
    axis.set_title(title, fontsize=18, loc="left")
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.tick_params(labelsize=15)
    axis.grid(True, which="major", color="#DDDDDD", linewidth=0.8)
    axis.spines[["top", "right"]].set_visible(False)
    times = np.abs(report.times)
    after_start = times > 0
    for i, row in enumerate(rows):
        values: Array = getattr(row.series, quantity)[after_start]
        if not np.any(values > 0):  # also where nothing was measured; a log axis has no place for zero
            continue
        colour, so_far = _COLOURS[i % len(_COLOURS)], np.maximum.accumulate(values)
        axis.plot(times[after_start], np.where(values > 0, values, np.nan), color=colour, linewidth=1.0, alpha=0.25)
        axis.plot(
            times[after_start], np.where(so_far > 0, so_far, np.nan), label=row.method.removesuffix("()"), color=colour,
            linewidth=2.6 if row.kind == "ours" else 1.6, linestyle="-" if row.kind == "ours" else (0, (4, 1.5)),
            marker=_MARKERS[i % len(_MARKERS)], markevery=0.12, markersize=8 if row.kind == "ours" else 6,
            zorder=3 if row.kind == "ours" else 2,
        )  # fmt: skip


def _floor(axis: Axes, level: float, label: str) -> None:
    bottom, top = axis.get_ylim() if axis.lines else (level, level)
    room = max(1.0, 0.15 * np.log10(max(top / level, 1.0)))  # decades beneath the line, for its label
    axis.set_ylim(bottom=min(bottom, level / 10**room))
    axis.axhline(level, color=_GREY, linewidth=1.4, linestyle=":", zorder=1)
    axis.annotate(
        label, (0.01, level), xycoords=("axes fraction", "data"), xytext=(0, -5), textcoords="offset points",
        ha="left", va="top", fontsize=13, color=_GREY,
    )  # fmt: skip
