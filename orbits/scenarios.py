"""Scenarios: numerical experiments with options, checks and pictures, in one file each.

    orbits.scenarios.load("kepler")  # a bundled one, or a file of your own

A file that makes a `Scenario` or a `Study` is run by `orbits run FILE`, or as a program.
"""

from __future__ import annotations

from orbits.scenario import Check, Option, Scenario, Study, StudyResult, Table, bundled, load

__all__ = [
    "Check",
    "Option",
    "Scenario",
    "Study",
    "StudyResult",
    "Table",
    "bundled",
    "load",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
