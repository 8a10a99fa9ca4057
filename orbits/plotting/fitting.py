"""Titles broken into lines where they would run into the next panel or leave the picture; offsets of axes in words."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from matplotlib.ticker import ScalarFormatter
from matplotlib.transforms import Bbox

from orbits.plotting.words import power_of_ten

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

MOST_LINES = 3
"""The most lines of a title; one that needs more is set in a smaller size."""

SMALLER, SMALLEST = 0.9, 9.0
"""The factor of each smaller size of a title, and the last one, in points."""

GAP = 8.0
"""Points between a title and the next panel, or the edge of the picture."""


ROW = "row"
"""The group of labels that name the row of a panel, not what its axis measures."""

_LABEL = re.compile(r"(.*?)(?: \[(.*)\])?", re.DOTALL)
"""The label of an axis: what it is, and its unit."""


class Figures(ScalarFormatter):
    """Figures of an axis whose label tells their common power of ten and offset: a − 0.2864788976 [10⁻¹³ au].

    An axis without a label, or with one that names its row, has them at its end: "×10⁻¹³ + 0.2864788976".
    """

    _own, _made, _any = "", "", False

    def set_locs(self, locs: Any) -> None:
        """Find the power and the offset for these figures, and tell them in the label."""
        super().set_locs(locs)
        self._any = len(locs) > 0
        label = getattr(self.axis, "label", None)
        if label is None or label.get_gid() == ROW:
            return
        if label.get_text() != self._made:
            self._own = label.get_text()
        self._made = self._in_label(*self._common()) if self._own else ""
        label.set_text(self._made)

    def get_offset(self) -> str:
        """Return the power and the offset of an axis without a label; "" for none."""
        power, offset = self._common()
        if self._made:
            return ""
        told = [f"×{power_of_ten(power)}"] * bool(power) + [_signed(offset)] * bool(offset)
        return " ".join(told)

    def _common(self) -> tuple[int, float]:
        known = vars(self)  # matplotlib 3.11 has renamed the power, and warns of its old name
        power = known.get("_orderOfMagnitude", known.get("orderOfMagnitude", 0))
        return (int(power), float(self.offset)) if self._any else (0, 0.0)

    def _in_label(self, power: int, offset: float) -> str:
        if not (power or offset):
            return self._own
        found = _LABEL.fullmatch(self._own)
        assert found is not None
        unit = " ".join(filter(None, (power_of_ten(power), found[2])))
        return found[1] + f"\n{_signed(-offset)}" * bool(offset) + f" [{unit}]" * bool(unit)


def _signed(figure: float) -> str:
    return f"{'−' if figure < 0.0 else '+'} {abs(figure):.15g}"


def set_figures(figure: Figure) -> None:
    """Give the axes that have matplotlib's figures those above."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(Figures())


def fit_titles(figure: Figure, renderer: Any) -> None:
    """Break the titles of a figure and of its panels that are wider than their room."""
    titles = [(axes, text) for axes in figure.axes for text in _titles(axes) if text.get_text()]
    if any(_width(text, renderer) > 0.9 * axes.get_position().width * figure.bbox.width for axes, text in titles):
        engine = figure.get_layout_engine()
        if engine is not None:
            for _, text in titles:  # so that panels have the widths that they have without them
                text.set_visible(False)
            engine.execute(figure)
        for axes, text in titles:
            text.set_visible(True)
            _fit(text, _room(figure, axes, text, renderer), renderer)
    head: Text | None = figure._suptitle  # type: ignore[attr-defined]
    if head is not None:
        _fit(head, figure.bbox.width - 2.0 * _pixels(figure, GAP), renderer)


def _titles(axes: Any) -> tuple[Text, Text, Text]:
    return axes._left_title, axes.title, axes._right_title


def _width(text: Text, renderer: Any) -> float:
    return float(text.get_window_extent(renderer).width)


def _pixels(figure: Figure, points: float) -> float:
    return points * figure.dpi / 72.0


def _room(figure: Figure, axes: Any, text: Text, renderer: Any) -> float:
    """Return the width that a title may have, in pixels: up to the figures of the next panels of its row, or the edges
    of the picture.
    """
    own = axes.get_window_extent()
    beside = [_with_figures(each, renderer) for each in figure.axes if each is not axes]
    beside = [box for box in beside if box.y0 < own.y1 and box.y1 > own.y0]
    gap = _pixels(figure, GAP)
    right = min([box.x0 for box in beside if box.x0 >= own.x1], default=figure.bbox.x1) - gap
    left = max([box.x1 for box in beside if box.x1 <= own.x0], default=figure.bbox.x0) + gap
    if text is axes._left_title:
        return float(right - own.x0)
    if text is axes._right_title:
        return float(own.x1 - left)
    middle = 0.5 * (own.x0 + own.x1)
    return float(2.0 * min(right - middle, middle - left))


def _with_figures(axes: Any, renderer: Any) -> Any:
    """Return the box of a panel and of the figures of its upright axis."""
    own, figures = axes.get_window_extent(), axes.yaxis.get_tightbbox(renderer)
    return own if figures is None else Bbox.union([own, figures])


def _fit(text: Text, room: float, renderer: Any) -> None:
    """Break the lines of a text that are wider than its room, in a smaller size if there would be too many."""
    whole, size = text.get_text(), float(text.get_fontsize())
    if _width(text, renderer) <= room:
        return
    while True:
        lines = [part for line in whole.split("\n") for part in _broken(text, line, room, renderer)]
        text.set_text("\n".join(lines))
        if (len(lines) <= MOST_LINES and _width(text, renderer) <= room) or size < SMALLEST:
            return
        size *= SMALLER
        text.set_fontsize(size)


def _broken(text: Text, line: str, room: float, renderer: Any) -> list[str]:
    """Return a line broken between words, as late as there is room."""
    lines: list[str] = []
    for word in line.split(" "):
        text.set_text(f"{lines[-1]} {word}" if lines else word)
        if lines and _width(text, renderer) <= room:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
