"""The picture of a fit of planets: O - C of their transits, and radial velocities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from astropy import units as u

from orbits.plotting import style
from orbits.plotting.words import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@style.look()
def of_fit(fit: Any) -> Figure:
    """Return a Figure with a panel for each planet, O - C in minutes, and one for radial velocities, in m/s; dashes are
    what is computed. fit : a `PlanetFit`
    """
    transits, velocities = fit.transit_residuals(), fit.velocity_residuals()
    planets = [] if fit.transits is None else list(fit.transits.planets)
    count = len(planets) + (fit.velocities is not None)
    figure = style.figure(height=3.0 + 2.4 * count)
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for panel, name in zip(panels, planets, strict=False):
        rows = transits[transits["planet"] == name]
        _panel(panel, rows, rows["o_minus_c"], u.min)
        panel.set_ylabel(f"{short(name)} [min]")
    if fit.velocities is not None:
        _panel(panels[-1], velocities, velocities["velocity"], u.m / u.s)
        panels[-1].set_ylabel("radial velocity [m/s]")
    star = short(fit.system.names[0])
    words = f"chi-squared {fit.chi2:.1f} with {fit.degrees_of_freedom:,} degrees of freedom"
    panels[0].set_title(f"{star}: measured less a linear ephemeris; {words}" if planets else words)
    panels[-1].set_xlabel("year")
    return figure


def _panel(panel: Axes, rows: Any, measured: Any, unit: u.UnitBase) -> None:
    years = rows["date"].jyear
    panel.axhline(0.0, color=style.GREY, lw=0.9)
    y, bars, computed = (x.to_value(unit) for x in (measured, rows["sigma"], rows["computed"]))
    panel.errorbar(years, y, bars, fmt=".", ms=5, lw=0.5, color=style.BLUE)
    panel.plot(years, computed, "_", ms=12, mew=1.5, color=style.VERMILION, zorder=0)
