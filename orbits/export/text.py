"""Small tables as text, for `print` and the prompt, with the same rows as `html_table`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def headed(name: str, unit: Any) -> str:
    """Return the head of a column: its name, followed by its unit if it has one."""
    return f"{name} [{unit}]" if str(unit) else name


def text_table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], more: int = 0, words: int = 1) -> str:
    """Return a table as lines of text; the first `words` columns are text, the others numbers.

    more : how many rows were left out, for a last line that says so
    """
    lines = [head, *rows] if rows else []
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    sides = ["<"] * words + [">"] * (len(head) - words)
    layout = "  ".join(f"{{:{side}{width}}}" for side, width in zip(sides, widths, strict=False))
    last = [f"... and {more:,} more"] if more else []
    return "\n".join([caption, *(layout.format(*line) for line in lines), *last])
