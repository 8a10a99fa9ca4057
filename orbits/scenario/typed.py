"""Quantities as typed on a command line."""

from __future__ import annotations

from typing import Any


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


def number_or_text(text: str) -> float | str:
    """Return "6" as a number, meaning the system's unit of time, and any other text unchanged."""
    try:
        return float(text)
    except ValueError:
        return text
