"""Warnings of many runs: those that differ in figures and in names of bodies alone are one, with a count."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TypeVar

T = TypeVar("T")

_FIGURE = re.compile(r"(?:at least )?-?\d[\d.,:+-]*(?:e[+-]?\d+)?(?: %)?|\ball\b")
"""A figure or a share in words; "all of the turn" stands for 100 %."""


def alike(found: Mapping[str, T], names: Iterable[str] = ()) -> list[dict[str, T]]:
    """Return texts, with what belongs to each, in groups of the same wording, in the order of their first ones.

    names : of the bodies, which the texts may have in place of each other
    """
    if len(found) < 2:
        return [dict(found)] if found else []
    heads = "\n".join(text.partition("\n")[0] for text in found)
    longest_first = sorted({name for name in names if name in heads}, key=len, reverse=True)
    body = re.compile(rf"(?<!\w)(?:{'|'.join(map(re.escape, longest_first))})(?!\w)") if longest_first else None
    groups: dict[str, dict[str, T]] = {}
    for text, own in found.items():
        groups.setdefault(_wording(text, body), {})[text] = own
    return list(groups.values())


def _wording(text: str, body: re.Pattern[str] | None) -> str:
    """Return the first line of a text, which says what the others list, without names, figures and plurals."""
    line = text.partition("\n")[0]
    line = line if body is None else body.sub("@", line)
    return re.sub(r"(?<=[a-z])s\b", "", _FIGURE.sub("#", line))
