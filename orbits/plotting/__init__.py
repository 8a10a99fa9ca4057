"""Pictures. `system.plot()` and `run.plot()` lead here; scenarios build their own from the parts.

matplotlib loads when the first picture is made.
"""

from orbits.plotting import style
from orbits.plotting.pictures import (
    conserved,
    flatness,
    in_plane,
    osculating_ellipse,
    paths,
    plot_system,
    plot_trajectory,
    relative_change,
)
from orbits.plotting.style import colour, figure, halo, look, save, short

__all__ = [
    "colour",
    "conserved",
    "figure",
    "flatness",
    "halo",
    "in_plane",
    "look",
    "osculating_ellipse",
    "paths",
    "plot_system",
    "plot_trajectory",
    "relative_change",
    "save",
    "short",
    "style",
]
