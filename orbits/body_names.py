"""Names of bodies: which are valid, how one is looked up, and which bodies a selection of names means."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, UnknownNameError, shown

LONGEST_NAME = 128

EARTH_AND_MOON = ("earth", "moon")
BOTH = "Earth-Moon barycenter"

WITH_ARTICLE = re.compile(r"sun|earth|moon|(.+ )?barycent(er|re)", re.IGNORECASE)
"""Names that take an article in a sentence."""


class Named:
    """A value with `names`, in which `name in value` is whether `value[name]` finds something."""

    __slots__ = ()

    def __contains__(self, item: object) -> bool:
        """Whether there is a body of this name; for anything but a name, whether one of the items is equal to it: none
        is where items have names, but no numbers.
        """
        this: Any = self
        if isinstance(item, str):
            return place_of(item, this.names) is not None
        with suppress(UnknownNameError):
            return any(each == item for each in this)
        return False


def checked_names(names: Any) -> tuple[str, ...]:
    """Return names as a tuple of str. Raises InputError for an invalid name, for names that occur twice, and for a set,
    which has no order.
    """
    try:
        given = None if isinstance(names, str | set | frozenset) else list(names)
    except TypeError:
        given = None
    if given is None:
        raise InputError(
            f"names is {shown(names)}; expected a sequence of strings, one for each body, such as ['Sun']."
        )
    result = []
    for i, name in enumerate(given):
        if not isinstance(name, str):
            raise InputError(f"the name of body {i} is {shown(name)}; expected a string.")
        if not name or len(name) > LONGEST_NAME or name != name.strip() or not name.isprintable():
            raise InputError(
                f"the name of body {i} is {shown(name)}; expected 1 to {LONGEST_NAME} printable characters without "
                "blanks at the ends."
            )
        result.append(str(name))
    if len(set(result)) < len(result):
        first: dict[str, int] = {}
        again = next(i for i, name in enumerate(result) if first.setdefault(name, i) != i)
        raise InputError(
            f"bodies {first[result[again]]} and {again} are both called {shown(result[again])}; expected each body "
            "once, with a name of its own."
        )
    return tuple(result)


def index_of(name: str, names: Sequence[str], what: str = "body", *, of: str = "", role: str = "") -> int:
    """Return the index of `name` in `names`, ignoring case where that is unambiguous.

    what : what has a name; of, role : in what it is named, and for which argument, for messages
    Raises UnknownNameError, suggesting similar names, or those that differ only in case.
    """
    place = place_of(name, names)
    if place is not None:
        return place
    of, role = of and f"{of}: ", role and f" for {role}"
    given = shown(name).strip("'\"").lower()
    alike = [n for n in names if n.lower() == given]
    if alike:
        raise UnknownNameError(
            f"{of}{what} {shown(name)}{role} could be {' or '.join(map(repr, alike))}; write it exactly as one of them."
        )
    close = difflib.get_close_matches(given, {n.lower(): None for n in names}, n=3, cutoff=0.6)
    part = re.compile(rf"\b{re.escape(given)}\b") if given else None
    meant = [n for n in names if n.lower() in close or (part and part.search(n.lower()))]
    hint = f" Did you mean {' or '.join(map(repr, meant[:3]))}?" if meant else ""
    if given in EARTH_AND_MOON and BOTH in meant:
        hint = f" {BOTH!r} stands for both; System.solar_system(bodies=[..., 'Earth', 'Moon']) has them as two bodies."
    expected = f"expected one of {few(names)}" if names else "there are none at all"
    raise UnknownNameError(f"{of}there is no {what} {shown(name)}{role}; {expected}.{hint}")


def indices_of(wanted: Sequence[str], names: Sequence[str], *, of: str = "") -> list[int]:
    """Return the index of each wanted name, as `index_of` does, in the time of one pass: there may be 100,000."""
    places = {name: k for k, name in enumerate(names)}
    known = (places.get(name) if isinstance(name, str) else None for name in wanted)
    return [index_of(name, names, of=of) if k is None else k for name, k in zip(wanted, known, strict=True)]


def place_of(name: object, names: Sequence[str]) -> int | None:
    """Return the index of `name` in `names`, or of the only name that differs just in case; else None."""
    if not isinstance(name, str):
        return None
    if name in names:
        return names.index(name)
    alike = [i for i, other in enumerate(names) if other.lower() == name.lower()]
    return alike[0] if len(alike) == 1 else None


def with_article(name: str) -> str:
    """Return a name as in a sentence: "the Sun", "the Earth-Moon barycenter", "Jupiter"."""
    return f"the {name}" if WITH_ARTICLE.fullmatch(name) else name


def few(names: Sequence[str], most: int = 12) -> str:
    """Return names joined by commas, cut short if there are many."""
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most:,} more"


def orbited(names: Sequence[str], gm: NDArray[np.float64], body: str, about: str | None) -> tuple[int, int]:
    """Return the numbers of a body and of the one that it orbits, by default the heaviest of the others.

    Raises InputError if there is no other one.
    """
    i = index_of(body, names)
    if len(gm) == 1:
        raise InputError(
            f"{names[i]!r} is alone, and has no orbit, from which obliquity and libration could be counted; "
            "run.rotation.euler_angles(body) are those in the axes of the system."
        )
    if about is None:
        return i, int(np.argmax(np.where(np.arange(len(gm)) == i, -1.0, gm)))
    j = index_of(about, names, role="about")
    if i == j:
        raise InputError(f"about is {shown(about)}, the body itself; expected another one.")
    return i, j


def chosen(names: Sequence[str], bodies: Sequence[str] | None) -> slice | NDArray[np.intp]:
    """Return the index of these bodies along an axis of all. Raises UnknownNameError, and InputError for duplicates."""
    if bodies is None:
        return slice(None)
    wanted = checked_names([bodies] if isinstance(bodies, str) else bodies)
    places = indices_of(wanted, names)
    checked_names([names[i] for i in places])  # "Sun" and "sun" are the same body
    return np.array(places, dtype=np.intp)
