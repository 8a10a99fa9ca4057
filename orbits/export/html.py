"""Small HTML tables for notebooks. All text is escaped, as names come from users and files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

MOST_ROWS = 20
"""The most rows that are shown."""


def html_table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], more: int = 0, words: int = 1) -> str:
    """Return a table as HTML; the first `words` columns are text, the others numbers.

    more : how many rows were left out, for a last line that says so
    """
    cells = "".join(f'<th style="text-align:{_align(k < words)}">{escape(text)}</th>' for k, text in enumerate(head))
    lines = [f"<tr>{cells}</tr>"]
    lines += ["<tr>" + "".join(_cell(k < words, text) for k, text in enumerate(row)) + "</tr>" for row in rows]
    if more:
        lines.append(f'<tr><td colspan="{len(head)}" style="text-align:left">... and {more:,} more</td></tr>')
    return _table(caption, lines)


def html_pairs(caption: str, pairs: Iterable[tuple[str, str]]) -> str:
    """Return a table of names and their values as HTML."""
    return _table(
        caption,
        [f'<tr><th style="text-align:left">{escape(name)}</th>{_cell(True, text)}</tr>' for name, text in pairs],
    )


def _table(caption: str, lines: Sequence[str]) -> str:
    head = f'<caption style="caption-side:top;text-align:left">{escape(caption)}</caption>'
    return f"<table>{head}<tbody>{''.join(lines)}</tbody></table>"


def _cell(is_text: bool, text: str) -> str:
    return f'<td style="text-align:{_align(is_text)}">{escape(text)}</td>'


def _align(is_text: bool) -> str:
    return "left" if is_text else "right"
