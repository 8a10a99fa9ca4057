"""The common style of all pictures: fonts, colours for colour-blind readers, and how figures are made and saved.

Figures are made without pyplot: no global state is changed, no window opens, and notebooks display the returned figure.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

Array = NDArray[np.float64]

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
MARK = "orbits"
"""The software named in a picture's metadata."""

MOST_COLUMNS = 10
"""The most columns of a legend."""

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
    """Draw in the style of this package: fonts, spines, legends."""
    from matplotlib import rc_context

    with rc_context(_SETTINGS):
        yield


def figure(width: float = 16.0, height: float = 10.0, dpi: int = 120) -> Figure:
    """Return an empty figure of width x height inches."""
    from orbits.plotting.notebook import Picture

    return Picture(look=look, figsize=(width, height), dpi=dpi, layout="constrained", facecolor="white")


def save(made: Figure, path: Path) -> None:
    """Write a figure, by default as PNG, with metadata that name this package: as a whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        with look():
            made.savefig(partial, format=path.suffix[1:] or "png", metadata={"Software": MARK})
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def halo(text: Text) -> None:
    """Separate a text from the lines behind it by a white outline."""
    from matplotlib.patheffects import withStroke

    text.set_path_effects([withStroke(linewidth=3.0, foreground="white")])


def line(axes: Axes, x: Array, y: Array, **looks: Any) -> Line2D:
    """Draw a line, with a dot where a point has no neighbour: of a single sample, or where those beside it are NaN."""
    seen = np.concatenate([[False], np.isfinite(x + y), [False]])
    alone = np.flatnonzero(seen[1:-1] & ~seen[:-2] & ~seen[2:])
    (drawn,) = axes.plot(x, y, **looks)
    if len(alone):
        drawn.set(marker="o", markersize=5.0, markevery=alone.tolist())
    return drawn


def outline(line: Line2D) -> None:
    """Separate a line from many others behind it by a white outline."""
    from matplotlib.patheffects import Normal, Stroke

    line.set_path_effects([Stroke(linewidth=line.get_linewidth() + 2.4, foreground="white"), Normal()])


def below(made: Figure, handles: Sequence[Any], labels: Sequence[str], caption: str = "", size: float = 13) -> None:
    """Put a legend beneath all panels and, below it, a small grey caption that explains lines and marks.

    The legend has as many columns as fit.
    """
    from textwrap import fill

    width, height = made.get_size_inches()
    text = fill(caption, int(width * 72 / (0.53 * size)))
    room = (len(text.splitlines()) * 1.35 * size + 6) / 72 / height if text else 0.0
    if text:
        made.text(0.008, 5 / 72 / height, text, ha="left", va="bottom", fontsize=size, color=GREY)
    for columns in range(min(len(labels), MOST_COLUMNS), 0, -1):
        even = -(-len(labels) // -(-len(labels) // columns))  # as many, all rows alike
        legend = made.legend(
            handles, labels, loc="lower center", ncols=even, fontsize=size, borderaxespad=0.2,
            bbox_to_anchor=(0.5, room),
        )  # fmt: skip
        legend.set_in_layout(False)
        seen = legend.get_window_extent()
        if seen.width <= made.bbox.width or even == 1:
            room += seen.height / made.bbox.height + 4 / 72 / height
            break
        legend.remove()
    engine: Any = made.get_layout_engine()
    engine.set(rect=(0.0, room, 1.0, 1.0 - room))


def colour(name: str, index: int) -> str:
    """Return the colour of a body: its own if it has one, otherwise by its index."""
    return BODY_COLOURS.get(name, PALETTE[index % len(PALETTE)])


def colours(names: Sequence[str]) -> list[str]:
    """Return a different colour for each body: from the palette or, for many, shades from dark to light."""
    own = [name for name in names if name not in BODY_COLOURS]
    taken = {BODY_COLOURS[name] for name in names if name in BODY_COLOURS}
    palette = [each for each in PALETTE if each not in taken]
    if len(own) <= len(palette):
        free = iter(palette)
        return [BODY_COLOURS[name] if name in BODY_COLOURS else next(free) for name in names]
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    shades = iter(to_hex(colormaps["viridis"](x)) for x in np.linspace(0.0, 0.92, len(own)))
    return [BODY_COLOURS[name] if name in BODY_COLOURS else next(shades) for name in names]
