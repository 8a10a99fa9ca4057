"""The many forms of the name of an asteroid or comet."""

from __future__ import annotations

import re
from collections.abc import Sequence

Parts = tuple[int, str, str]

# "1P/Halley" and "73P-C/Schwassmann-Wachmann 3-C" also begin with digits, but these are not numbers of asteroids.
FULL_NAME = re.compile(r"(?:(\d{1,9})(?=\s|$))?\s*(.*?)\s*(?:\(([^()]*)\))?")


def parts(full: str) -> Parts:
    """Return (number, name, designation) of "1 Ceres (A801 AA)", "36922 (2000 SN209)", "(1927 LA)", "1P/Halley"."""
    match = FULL_NAME.fullmatch(full.strip())
    number, name, designation = match.groups(default="") if match else ("", full.strip(), "")
    return int(number or 0), name or designation or number, designation


def is_comet(name: str) -> bool:
    """Return whether a name belongs to a comet, "1P/Halley", "C/1995 O1", or an interstellar object, "1I/'Oumuamua"."""
    prefix, slash, _ = name.partition("/")
    return bool(slash) and prefix.partition("-")[0].lstrip("0123456789") in ("C", "P", "D", "X", "I", "A")


def plain(name: str) -> str:
    """Return a name without parentheses, in lower case."""
    return " ".join(name.replace("(", " ").replace(")", " ").lower().split())


def rows_by_name(full_names: Sequence[str], known: Sequence[Parts]) -> dict[str, int]:
    """Return the row of every form of a body's name, as returned by `plain`.

    For Ceres these are "ceres", "1 ceres", "1", "a801 aa" and "1 ceres a801 aa".
    """
    rows: dict[str, int] = {}
    # Names last: if a designation ever equals another asteroid's name, the name wins.
    ways: list[tuple[str, ...]] = list(zip(full_names, (d for _, _, d in known), strict=True))
    ways += [(str(number), f"{number} {name}", name) if number else (name,) for number, name, _ in known]
    for i, called in enumerate(ways):
        rows.update((plain(way), i % len(known)) for way in called if way)
    return rows
