"""Pictures for `system.plot()` and `run.plot()`, and parts from which scenarios build their own.

matplotlib is loaded when the first picture is made.
"""

from orbits.plotting import style
from orbits.plotting.errors_over_time import plot_energy, plot_error
from orbits.plotting.kinds import KINDS, plot_run
from orbits.plotting.over_time import plot_elements, plot_phase
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
from orbits.plotting.resonances import plot_resonance
from orbits.plotting.rotation import plot_rotation
from orbits.plotting.style import below, colour, figure, halo, look, save
from orbits.plotting.words import fitting_time, in_fitting_time, method_words, short

__all__ = [
    "KINDS",
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
    "plot_elements",
    "plot_energy",
    "plot_error",
    "plot_phase",
    "plot_resonance",
    "plot_rotation",
    "plot_run",
    "plot_system",
    "plot_trajectory",
    "relative_change",
    "save",
    "short",
    "style",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
