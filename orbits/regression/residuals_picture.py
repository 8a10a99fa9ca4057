"""Residuals as a picture: their lengths against time, each body a line with its name at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.plotting import colour, figure, look, short, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.regression.of_ephemeris import Residuals

MOST_NAMED = 14
"""Up to this many bodies have a name and a colour each; of more, the largest residuals have."""


@look()
def picture(residuals: Residuals) -> Figure:
    """Return the picture of the residuals of one run."""
    made = figure(13, 8.5, dpi=100)
    axes = made.subplots()
    panel(axes, residuals)
    axes.set_title(f"{residuals.title}: distance from {residuals.kernel}", fontweight="bold")
    told = "heliocentric, the Moon from the Earth; heavy lines: the largest so far"
    made.text(0.008, 0.004, told, fontsize=13, color=style.GREY)
    engine: Any = made.get_layout_engine()
    engine.set(rect=(0.0, 0.03, 1.0, 0.97))
    return made


def panel(axes: Axes, residuals: Residuals, least: float | None = None) -> None:
    """Draw residuals [km] against time; least : the bottom of the axis."""
    order = np.argsort(np.abs(residuals.years), kind="stable")  # samples may be in any order
    years, distances = np.abs(residuals.years[order]), {name: x[order] for name, x in residuals.distances.items()}
    ends = {name: float(np.nanmax(x, initial=0.0)) for name, x in distances.items()}
    named = sorted(ends, key=lambda name: -ends[name])[:MOST_NAMED]
    bottom = min((x for x in ends.values() if x > 0.0), default=1.0) / 300.0 if least is None else least
    for i, (name, x) in enumerate(distances.items()):
        known = name in named
        line = colour(name, i) if known else style.FAINT
        shown = np.maximum(x, bottom)
        axes.plot(years, shown, color=line, lw=0.8, alpha=0.3 if known else 0.2)
        style.line(axes, years, np.maximum.accumulate(shown), color=line, lw=2.0 if known else 0.6, label=name)
    when = "before" if residuals.years[order[-1]] < 0.0 else "since"
    axes.set(yscale="log", xlabel=f"years {when} the start", ylabel="km", xlim=(0.0, years.max() or 1.0))
    axes.set_ylim(bottom, 3.0 * max(bottom, *ends.values()))
    axes.grid(axis="y", color=style.FAINT, lw=0.6)
    _name_ends(axes, {name: max(ends[name], bottom) for name in named}, list(distances))


def _name_ends(axes: Axes, ends: dict[str, float], order: list[str]) -> None:
    """Write the names of the bodies at the ends of their lines, moved apart where they would overlap."""
    low, high = (np.log10(x) for x in axes.get_ylim())
    gap = 0.042 * (high - low)
    places: list[tuple[str, float]] = []
    for name in sorted(ends, key=lambda name: ends[name]):
        at = float(np.log10(ends[name]))
        places.append((name, max(at, places[-1][1] + gap) if places else at))
    excess = max(0.0, places[-1][1] - high)
    for name, at in places:
        text = axes.annotate(
            short(name), (1.0, 10.0 ** (at - excess)), xycoords=("axes fraction", "data"), xytext=(6, 0),
            textcoords="offset points", va="center", fontsize=14, color=colour(name, order.index(name)),
        )  # fmt: skip
        style.halo(text)
