"""A figure that notebooks display without pyplot, and whose titles and axes are fitted when it is drawn."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from io import BytesIO
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orbits.plotting.fitting import fit_titles, set_figures

DOTS_IN_A_NOTEBOOK = 60
"""Dots per inch of the displayed size; the picture has more, for high-resolution screens."""


class Picture(Figure):
    """A matplotlib Figure made without pyplot.

    Notebooks can display plain figures only after pyplot was imported; in a fresh kernel they would show just
    "<Figure size 1320x1200 with 1 Axes>".

    look : returns the context in which it is drawn
    """

    def __init__(self, *, look: Callable[[], AbstractContextManager[None]], **options: Any) -> None:
        super().__init__(**options)
        self._look = look
        FigureCanvasAgg(self)

    def draw(self, renderer: Any) -> None:
        """Draw the figure: titles fit their panels, and offsets of axes can be read."""
        set_figures(self)
        fit_titles(self, renderer)
        super().draw(renderer)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        memory = BytesIO()
        with self._look():
            self.savefig(memory, format="png")
        width, height = (round(DOTS_IN_A_NOTEBOOK * inches) for inches in self.get_size_inches())
        return memory.getvalue(), {"width": width, "height": height}
