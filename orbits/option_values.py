"""Values of the options of scenarios: what may be one, and how it is typed. Imports nothing that takes time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

OPTION_NAME = re.compile(r"[a-z][a-z0-9_]*")

LARGEST = 2**63
"""The largest absolute value of a whole number."""


def is_option_value(value: Any) -> bool:
    """Return whether a value of Python's own can be that of an option, and be typed."""
    if isinstance(value, bool):
        return True
    if isinstance(value, str):
        return value.isprintable() and value == value.strip()
    if isinstance(value, int):
        return abs(value) <= LARGEST
    return isinstance(value, float) and math.isfinite(value)


def option_text(value: Any) -> str:
    """Return the value of an option as it is typed after `--set NAME=`."""
    return ("yes" if value else "no") if isinstance(value, bool) else str(value)


def options_text(values: Mapping[str, Any]) -> str:
    """Return the values of options with commas: "planets=all, count=500"."""
    return ", ".join(f"{name}={option_text(value)}" for name, value in values.items())
