"""Small tables as text, for print and the prompt, with the rows that `html_table` shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def headed(name: str, unit: Any) -> str:
    """Return the head of a column: its name, with the unit behind it where there is one."""
    return f"{name} [{unit}]" if str(unit) else name


def text_table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], more: int = 0, words: int = 1) -> str:
    """Return a table as lines; the first `words` columns are text, the others are figures.

    more : how many rows were left out, which a last line says
    """
    lines = [head, *rows] if rows else []
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    sides = ["<"] * words + [">"] * (len(head) - words)
    layout = "  ".join(f"{{:{side}{width}}}" for side, width in zip(sides, widths, strict=False))
    last = [f"... and {more:,} more"] if more else []
    return "\n".join([caption, *(layout.format(*line) for line in lines), *last])
