"""The scenario that a run was made by, with the values of its options, as text in the header of an archive."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from orbits.errors import ArchiveError, InputError, shown
from orbits.option_values import OPTION_NAME, is_option_value, options_text


@dataclass(frozen=True)
class Origin:
    """The scenario that a run was made by.

    scenario : its name; options : the values of all of its options, by name

    Raises InputError for names and values that are none.
    """

    scenario: str
    options: Mapping[str, bool | int | float | str]

    def __post_init__(self) -> None:
        named = isinstance(self.scenario, str) and self.scenario.isprintable() and self.scenario.strip()
        known = isinstance(self.options, Mapping) and all(
            isinstance(name, str) and OPTION_NAME.fullmatch(name) and is_option_value(value)
            for name, value in self.options.items()
        )
        if not (named and known and self.options):
            raise InputError("expected the name of a scenario and the values of its options")

    def __str__(self) -> str:
        return f"{self.scenario}, {options_text(self.options)}"

    def to_json(self) -> str:
        """Return it as text."""
        return json.dumps(asdict(self), allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Origin:
        """Return that of a text. Raises ArchiveError for one that `to_json` does not write."""
        try:
            return cls(**json.loads(text, parse_constant=_no_number))
        except (InputError, ValueError, TypeError, RecursionError):
            raise ArchiveError(
                f"its scenario is {shown(text)}; expected the name and the values of the options."
            ) from None


def _no_number(text: str) -> Any:
    raise ValueError(f"{text} is no number")
