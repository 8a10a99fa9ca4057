"""The picture of the residuals of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARGIN = 1.3
"""The height of a panel, relative to the largest residual that counts; larger ones are at its edges."""

PANELS = (("ra", "right ascension × cos δ"), ("dec", "declination"), ("delay", "delay"), ("doppler", "Doppler shift"))


@style.look()
def of_residuals(table: Any, title: str) -> Figure:
    """Return a Figure with the residuals over time, a panel for each kind that has some; crosses are rejected.

    table : with date, whether used, and residual and sigma, quantities, of each kind
    """
    years, used = table["date"].jyear, np.asarray(table["used"])
    there = {name for name in table.colnames if name.startswith("residual_") and np.isfinite(table[name]).any()}
    shown = [(name, words) for name, words in PANELS if f"residual_{name}" in there]
    figure = style.figure(height=4.5 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for (name, words), panel in zip(shown, panels, strict=True):
        off, bars = table[f"residual_{name}"], table[f"sigma_{name}"]
        limit = MARGIN * float(np.nanmax(np.abs(off[used].value), initial=0.01))
        panel.axhline(0.0, color=style.GREY, lw=0.9)
        panel.errorbar(years[used], off[used].value, bars[used].value, fmt=".", ms=5, lw=0.5, color=style.BLUE)
        if not used.all():
            clipped = np.clip(off[~used].value, -limit, limit)
            panel.plot(years[~used], clipped, "x", ms=7, color=style.VERMILION, clip_on=False)
        panel.set_ylabel(f"{words} [{off.unit}]")
        panel.set_ylim(-limit, limit)
    panels[0].set_title(title)
    panels[-1].set_xlabel("year")
    return figure
