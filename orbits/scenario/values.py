"""Quantities and files as they are typed on a command line."""

from __future__ import annotations

from typing import Any


def quantity(text: str, option: str) -> Any:
    """Return "6 d" as a Quantity and "6" as a number, which stands for the system's own unit of time.

    Raises InputError, naming the option, for anything else.
    """
    try:
        return float(text)
    except ValueError:
        pass
    from orbits.units import quantity_from_text

    expected = "a number in the system's unit of time, or a time with its unit: '6 d', '1000 yr'"
    return quantity_from_text(text, option, expected)
