"""One look for every picture: fonts, colours that colour-blind readers tell apart, and how figures are made and saved.

Figures are made without pyplot: nothing global is touched, no window opens, and a notebook shows what is returned.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

# Okabe & Ito (2008).
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, "#222222", "#8A8A00")
INK, GREY, FAINT = "#222222", "#707070", "#D8D8D8"

BODY_COLOURS: Mapping[str, str] = {
    "Sun": "#E69F00",
    "Mercury": "#8C8C8C",
    "Venus": "#C8963E",
    "Earth-Moon barycenter": "#0072B2",
    "Earth": "#0072B2",
    "Moon": "#707070",
    "Mars": "#D55E00",
    "Jupiter": "#A0522D",
    "Saturn": "#B8A14A",
    "Uranus": "#56B4E9",
    "Neptune": "#3B4CC0",
    "Pluto": "#7B5EA7",
}
SHORT_NAMES: Mapping[str, str] = {"Earth-Moon barycenter": "Earth–Moon"}

MARK = "orbits"
"""What a picture's metadata says of who made it."""

_SETTINGS: Any = {
    "font.size": 15,
    "axes.titlesize": 17,
    "axes.titlelocation": "left",
    "axes.labelsize": 15,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.9,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 14,
    "lines.linewidth": 1.8,
    "text.color": INK,
    "axes.labelcolor": INK,
}


@contextmanager
def look() -> Iterator[None]:
    """Draw in the look of this package: fonts, spines, legends."""
    from matplotlib import rc_context

    with rc_context(_SETTINGS):
        yield


def figure(width: float = 16.0, height: float = 10.0) -> Figure:
    """Return an empty figure of width x height inches at 120 dots per inch."""
    from orbits.plotting.notebook import Picture

    return Picture(figsize=(width, height), dpi=120, layout="constrained", facecolor="white")


def save(made: Figure, path: Path) -> None:
    """Write a figure as PNG that says it comes from this package."""
    with look():
        made.savefig(path, metadata={"Software": MARK})


def halo(text: Text) -> None:
    """Set a text off from the lines behind it by a white rim."""
    from matplotlib.patheffects import withStroke

    text.set_path_effects([withStroke(linewidth=3.0, foreground="white")])


def colour(name: str, index: int) -> str:
    """Return the colour of a body: its own where it has one, otherwise by its place in the list."""
    return BODY_COLOURS.get(name, PALETTE[index % len(PALETTE)])


def short(name: str) -> str:
    """Return a name short enough for a label."""
    return SHORT_NAMES.get(name, name)
