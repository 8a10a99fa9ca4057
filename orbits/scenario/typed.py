"""Quantities as typed on a command line, and the command itself."""

from __future__ import annotations

import ast
import shlex
import sys
from pathlib import Path
from shutil import which
from typing import Any

from orbits.errors import InputError, shown


def quantity(text: str, option: str, others: str = "") -> Any:
    """Return "6 d" as a Quantity and "6" as a number, meaning the system's unit of time.

    others : what else may be typed for the option, in words
    Raises InputError, naming the option, for anything else.
    """
    value = number_or_text(text)
    if isinstance(value, float):
        return value
    from orbits.units import quantity_from_text

    expected = "a number in the system's unit of time, or a time with its unit: '6 d', '1000 yr'" + others
    return quantity_from_text(value, option, expected)


CLOCKS = {
    "adaptive": 'adaptive, adaptive:1e-8 or "adaptive(tolerance=1e-8)"',
    "transformed": 'transformed, transformed:0.3 or "transformed(step=0.3)"',
}
"""The words for steps that differ in length, and what may be typed."""


def step_or_clock(text: str, option: str) -> Any:
    """Return "adaptive", "adaptive:1e-8" and "adaptive(tolerance=1e-8)" as `orbits.Adaptive(...)`, "transformed" with
    a step as `orbits.TimeTransformed(...)`, "P/20" as it is, which systems give a meaning, anything else as `quantity`
    does.

    Raises InputError, naming the option, for anything that cannot be read.
    """
    typed = text.strip().lower()
    word = next((word for word in CLOCKS if typed.startswith(word)), None)
    if word is None:
        from orbits.time_grid.step_length import FRACTION

        others = "; or a fraction of the shortest period, P/20; or adaptive"
        return text if FRACTION.fullmatch(text) else quantity(text, option, others)
    from orbits.marching.clocks.adaptive import Adaptive
    from orbits.marching.clocks.transformed import TimeTransformed

    clock, meant = None, {"adaptive": Adaptive, "transformed": TimeTransformed}[word]
    try:
        head, colon, number = typed.partition(":")
        if colon and head.strip() == word:
            return meant(float(number))
        read = ast.parse(text.strip(), mode="eval").body
        if isinstance(read, ast.Name) and read.id.lower() == word:
            clock = meant()
        if isinstance(read, ast.Call) and isinstance(read.func, ast.Name) and read.func.id.lower() == word:
            given = [ast.literal_eval(value) for value in read.args]
            named = {str(key.arg): ast.literal_eval(key.value) for key in read.keywords}
            clock = meant(*given, **named)
    except InputError:
        raise
    except (SyntaxError, ValueError, TypeError, MemoryError, RecursionError):
        pass
    if clock is None:
        raise InputError(f"{option} = {shown(text)} cannot be read; write {CLOCKS[word]}.")
    return clock


def number_or_text(text: str) -> float | str:
    """Return "6" as a number, meaning the system's unit of time, and any other text unchanged."""
    try:
        return float(text)
    except ValueError:
        return text


def this_command() -> str:
    """Return the command that this process runs."""
    program, *words = sys.argv
    name = Path(program).name
    if name == "__main__.py":
        known = "python -m orbits"
    elif name.endswith(".py"):
        known = f"python {shlex.quote(program)}"
    else:
        known = name if which(name) == program else shlex.quote(program)
    return " ".join([known, *map(shlex.quote, words)])
