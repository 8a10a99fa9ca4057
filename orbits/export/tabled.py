"""Values that are printed as a table, and are one in notebooks."""

from __future__ import annotations

from collections.abc import Sequence

from orbits.export.html import html_table
from orbits.export.text import text_table


class Tabled:
    """A value that is printed as a table; `_text_columns` : how many of its first columns are text."""

    __slots__ = ()

    @property
    def _text_columns(self) -> int:
        return 1

    def _caption(self) -> str:
        raise NotImplementedError

    def _shown(self) -> tuple[list[str], Sequence[Sequence[str]], int]:
        """Return the head, the rows, and the number of others."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return text_table(self._caption(), *self._shown(), words=self._text_columns)

    def _repr_html_(self) -> str:
        return html_table(self._caption(), *self._shown(), words=self._text_columns)


class Valued(Tabled):
    """A value that is printed as a table of figures with their units, and their sigmas if they have any."""

    __slots__ = ()

    @property
    def _text_columns(self) -> int:
        return 2
