"""Pictures. `system.plot()` and `run.plot()` lead here; scenarios build their own from the parts.

matplotlib loads when the first picture is made.
"""

from orbits.plotting.pictures import conserved, in_plane, paths, plot_system, plot_trajectory, relative_change
from orbits.plotting.style import caption, colour, figure, panels, save, short

__all__ = [
    "caption",
    "colour",
    "conserved",
    "figure",
    "in_plane",
    "panels",
    "paths",
    "plot_system",
    "plot_trajectory",
    "relative_change",
    "save",
    "short",
]
