"""Pictures for `system.plot()` and `run.plot()`, and parts from which scenarios build their own.

matplotlib is loaded when the first picture is made.
"""

from orbits.plotting import style
from orbits.plotting.pictures import (
    conserved,
    flatness,
    in_plane,
    map_axes,
    osculating_ellipse,
    paths,
    plot_system,
    plot_trajectory,
    relative_change,
)
from orbits.plotting.style import below, colour, figure, halo, look, save
from orbits.plotting.words import fitting_time, in_fitting_time, method_words, short

__all__ = [
    "below",
    "colour",
    "conserved",
    "figure",
    "fitting_time",
    "flatness",
    "halo",
    "in_fitting_time",
    "in_plane",
    "look",
    "map_axes",
    "method_words",
    "osculating_ellipse",
    "paths",
    "plot_system",
    "plot_trajectory",
    "relative_change",
    "save",
    "short",
    "style",
]
