"""A figure that a notebook shows by itself."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from io import BytesIO
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DOTS_IN_A_NOTEBOOK = 60
"""Dots per inch that a notebook is asked to show; the picture has more, for sharp screens."""


class Picture(Figure):
    """A matplotlib Figure made without pyplot.

    A notebook knows how to show figures only once pyplot was imported there; in a fresh kernel all that would be seen
    of one is "<Figure size 1320x1200 with 1 Axes>".

    look : makes the context in which it is drawn
    """

    def __init__(self, *, look: Callable[[], AbstractContextManager[None]], **options: Any) -> None:
        super().__init__(**options)
        self._look = look
        FigureCanvasAgg(self)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        memory = BytesIO()
        with self._look():
            self.savefig(memory, format="png")
        width, height = (round(DOTS_IN_A_NOTEBOOK * inches) for inches in self.get_size_inches())
        return memory.getvalue(), {"width": width, "height": height}
