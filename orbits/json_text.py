"""JSON that people can read: indented, with every list of plain numbers on one line."""

from __future__ import annotations

import json
import re
from typing import Any

NUMBERS = re.compile(r'\[\n([^][{}"]*)\]')
"""A list without lists, mappings or text inside. JSON text has no line breaks, so it is never mistaken for a list."""


def json_text(record: Any, *, ensure_ascii: bool = True, allow_nan: bool = True) -> str:
    """Return a record as JSON text, with the options of `json.dumps`."""
    text = json.dumps(record, indent=1, ensure_ascii=ensure_ascii, allow_nan=allow_nan)
    return NUMBERS.sub(lambda numbers: f"[{' '.join(numbers[1].split())}]", text)
