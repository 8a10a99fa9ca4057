"""Quantities as typed on a command line."""

from __future__ import annotations

import ast
from typing import Any

from orbits.errors import InputError, shown


def quantity(text: str, option: str) -> Any:
    """Return "6 d" as a Quantity and "6" as a number, meaning the system's unit of time.

    Raises InputError, naming the option, for anything else.
    """
    value = number_or_text(text)
    if isinstance(value, float):
        return value
    from orbits.units import quantity_from_text

    expected = "a number in the system's unit of time, or a time with its unit: '6 d', '1000 yr'"
    return quantity_from_text(value, option, expected)


def step_or_clock(text: str, option: str) -> Any:
    """Return "adaptive" and "adaptive(tolerance=1e-8)" as `orbits.Adaptive(...)`, anything else as `quantity` does.

    Raises InputError, naming the option, for anything that cannot be read.
    """
    if not text.strip().lower().startswith("adaptive"):
        return quantity(text, option)
    from orbits.marching.adaptive import Adaptive

    try:
        read = ast.parse(text.strip(), mode="eval").body
        if isinstance(read, ast.Name) and read.id.lower() == "adaptive":
            return Adaptive()
        if isinstance(read, ast.Call) and isinstance(read.func, ast.Name) and read.func.id.lower() == "adaptive":
            given = [ast.literal_eval(value) for value in read.args]
            return Adaptive(*given, **{str(key.arg): ast.literal_eval(key.value) for key in read.keywords})
    except InputError:
        raise
    except (SyntaxError, ValueError, TypeError, MemoryError, RecursionError):
        pass
    raise InputError(f'{option} = {shown(text)} cannot be read; write adaptive, or "adaptive(tolerance=1e-8)".')


def number_or_text(text: str) -> float | str:
    """Return "6" as a number, meaning the system's unit of time, and any other text unchanged."""
    try:
        return float(text)
    except ValueError:
        return text
