"""JSON that people can read: indented, with every list of plain numbers on one line."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from orbits.errors import InputError, shown

NUMBERS = re.compile(r'\[\n([^][{}"]*)\]')
"""A list without lists, mappings or text inside. JSON text has no line breaks, so it is never mistaken for a list."""


def json_text(record: Any, *, ensure_ascii: bool = True, allow_nan: bool = True) -> str:
    """Return a record as JSON text, with the options of `json.dumps`."""
    text = json.dumps(record, indent=1, ensure_ascii=ensure_ascii, allow_nan=allow_nan)
    return NUMBERS.sub(lambda numbers: f"[{' '.join(numbers[1].split())}]", text)


def plain(value: Any, what: str) -> Any:
    """Return values for JSON: NumPy's converted to Python's, null for numbers that are not finite.

    what : in words, what has them. Raises InputError for values that JSON cannot represent.
    """
    if hasattr(value, "tolist") and getattr(value, "unit", None) is None:
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item, what) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, what) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    raise InputError(f"{what} hold text, numbers, lists and mappings; got {shown(value)}.")
