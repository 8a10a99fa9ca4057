"""JSON that people can look through: indented, with every list of plain numbers on a line of its own."""

from __future__ import annotations

import json
import re
from typing import Any

NUMBERS = re.compile(r'\[\n([^][{}"]*)\]')
"""A list without lists, mappings and text in it; text itself holds no line breaks, so none is mistaken for a list."""


def json_text(record: Any, *, ensure_ascii: bool = True, allow_nan: bool = True) -> str:
    """Return values that JSON can hold as text; the options are those of `json.dumps`."""
    text = json.dumps(record, indent=1, ensure_ascii=ensure_ascii, allow_nan=allow_nan)
    return NUMBERS.sub(lambda numbers: f"[{' '.join(numbers[1].split())}]", text)
