"""The scenario that a run was made by, with the values of its options, as text in the header of an archive."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from orbits.errors import ArchiveError, shown


@dataclass(frozen=True)
class Origin:
    """The scenario that a run was made by.

    scenario : its name; options : the values of all of its options, by name
    """

    scenario: str
    options: Mapping[str, bool | int | float | str]

    def __str__(self) -> str:
        return ", ".join([self.scenario, *([options_text(self.options)] if self.options else [])])

    def to_json(self) -> str:
        """Return it as text."""
        return json.dumps(asdict(self), allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Origin:
        """Return that of a text. Raises ArchiveError for one that `to_json` does not write."""
        try:
            found: Any = json.loads(text)
            origin = cls(**found)
            known = isinstance(origin.scenario, str) and all(
                isinstance(value, bool | int | float | str) for value in dict(origin.options).values()
            )
        except (ValueError, TypeError, RecursionError):
            known = False
        if not known:
            raise ArchiveError(f"its scenario is {shown(text)}; expected the name and the values of the options.")
        return origin


def option_text(value: Any) -> str:
    """Return the value of an option as it is typed after `--set NAME=`."""
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def options_text(values: Mapping[str, Any]) -> str:
    """Return the values of options as they are typed, with commas: "planets=all, count=500"."""
    return ", ".join(f"{name}={option_text(value)}" for name, value in values.items())
