"""The selection of bodies from a catalogue that is read piece by piece."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.catalogue.catalogue import (
    checked_classes,
    checked_count,
    checked_magnitude,
    checked_numbers,
    checked_strings,
)
from orbits.catalogue.names import plain
from orbits.errors import UnknownNameError

Ways = tuple[str, ...]
"""All forms of a body's name, as returned by `plain`."""


class Selection:
    """The checked arguments of a reader, and which of the requested names and numbers have been found so far."""

    def __init__(self, count: Any, names: Any, numbers: Any, classes: Any, brighter_than: Any) -> None:
        self.count = checked_count(count)
        self.names = checked_strings(names, "names")
        self.numbers = checked_numbers(numbers)
        self._classes = checked_classes(classes)
        self._limit = checked_magnitude(brighter_than)
        self.is_by_name = names is not None or numbers is not None
        self._names_left = {plain(name): name for name in self.names}
        self._wanted = set(self._names_left)
        self._numbers_left = set(self.numbers)

    @property
    def is_complete(self) -> bool:
        """Whether names or numbers were requested and all of them have been found."""
        return self.is_by_name and not self._names_left and not self._numbers_left

    def rows(self, values: dict[str, Any], called: Sequence[Ways]) -> NDArray[np.int64]:
        """Return the selected rows of a piece; the order of names and `count` are applied at the end.

        values : "numbers", "classes" and "H"
        called : the forms of each body's name, needed if names were requested
        """
        numbers: NDArray[np.int64] = values["numbers"]
        keep = np.ones(len(numbers), dtype=bool)
        if self.is_by_name:
            keep = np.isin(numbers, self.numbers) & (numbers > 0)
            self._numbers_left -= set(numbers[keep].tolist())
            for row, ways in enumerate(called if self.names else ()):
                found = self._wanted.intersection(ways)
                keep[row] |= bool(found)
                for way in found:
                    self._names_left.pop(way, None)
        if self._classes is not None:
            keep &= np.fromiter((code in self._classes for code in values["classes"]), dtype=bool, count=len(keep))
        if self._limit is not None:
            keep &= values["H"] < self._limit
        return np.flatnonzero(keep)

    def ordered(self, numbers: NDArray[np.int64], called: Sequence[Ways]) -> list[int]:
        """Return the rows in the requested order: names first, then numbers; else as they are."""
        if not self.is_by_name:
            return list(range(len(numbers)))
        by_number = {number: row for row, number in reversed(list(enumerate(numbers.tolist()))) if number}
        by_name = {way: row for row, ways in reversed(list(enumerate(called))) for way in ways} if self.names else {}
        rows = [by_name.get(plain(name)) for name in self.names] + [by_number.get(number) for number in self.numbers]
        return list(dict.fromkeys(row for row in rows if row is not None))

    def check_found(self, where: str) -> None:
        """Raise UnknownNameError if a requested name or number was not found."""
        missing = [repr(name) for name in self._names_left.values()] + [str(n) for n in sorted(self._numbers_left)]
        if missing:
            shown = ", ".join(missing[:5]) + (f" and {len(missing) - 5} more" if len(missing) > 5 else "")
            raise UnknownNameError(
                f"{shown}: not among {where}; expected names, numbers or designations of these. A body is listed by "
                "its name once it has one, and by its provisional designation until then"
            )
