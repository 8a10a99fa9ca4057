"""The picture of residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u

from orbits.plotting import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.fitting.result import Fit

MARGIN = 1.3
"""The height of the picture, relative to the largest residual that counts; larger ones are at its edges."""


@style.look()
def of_residuals(fit: Fit) -> Figure:
    """Return a Figure with the residuals over time, right ascension above, declination below; crosses are rejected."""
    table = fit.residuals
    years, used = table["date"].jyear, np.asarray(table["used"])
    off = np.stack([table[f"residual_{name}"].to_value(u.arcsec) for name in ("ra", "dec")], axis=1)
    bars = np.stack([table[f"sigma_{name}"].to_value(u.arcsec) for name in ("ra", "dec")], axis=1)
    limit = MARGIN * float(np.abs(off[used]).max(initial=0.01))
    figure = style.figure(height=9.0)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    for k, (panel, words) in enumerate(zip(panels, ("right ascension × cos δ", "declination"), strict=True)):
        panel.axhline(0.0, color=style.GREY, lw=0.9)
        panel.errorbar(years[used], off[used, k], bars[used, k], fmt=".", ms=5, lw=0.5, color=style.BLUE)
        if not used.all():
            shown = np.clip(off[~used, k], -limit, limit)
            panel.plot(years[~used], shown, "x", ms=7, color=style.VERMILION, clip_on=False)
        panel.set_ylabel(f"{words} [arcsec]")
    panels[0].set_ylim(-limit, limit)
    panels[0].set_title(f"{fit.name}: observed less computed, RMS {fit.rms[0].value:.2f}″ and {fit.rms[1].value:.2f}″")
    panels[1].set_xlabel("year")
    return figure
