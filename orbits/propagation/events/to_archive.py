"""The events of a run as an archive holds them; `from_archive` makes them again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from astropy import units as u

from orbits.propagation.collisions.merge_and_bounce import OfTwo
from orbits.propagation.events.base import Action, Bound, Sought
from orbits.propagation.events.functions import description
from orbits.trajectory.events import described


def description_of(events: Sequence[Sought], of: Sequence[Sought], bounds: Sequence[Bound]) -> str:
    """Return events as a text; of : the event to which each of the functions `bounds` belongs."""
    return described(
        {
            "kind": type(event).__name__,
            **_given(event),
            "words": [bound.words for one, bound in zip(of, bounds, strict=True) if one is event],
        }
        for event in events
    )


def _given(event: Sought) -> dict[str, Any]:
    """Return what an event was given, as an archive holds it: `given` is None if functions are only described."""
    known: dict[str, Any] = {"given": None, "then": event.then}
    if event.stored:
        known["given"] = {name: _plain(value) for name, value in event.given().items()}
    else:
        known["of"] = {name: _told(value) for name, value in event.given().items()}
    if isinstance(event.then, OfTwo):
        known["then"] = repr(event.then)
    elif isinstance(event.then, Action):
        known |= {"then": "a function", "does": description(getattr(event.then, "function", event.then))}
    return known


def _told(value: Any) -> Any:
    return description(value) if callable(value) or hasattr(value, "free_symbols") else _plain(value)


def _plain(value: Any) -> Any:
    """Return a field as JSON can hold it: quantities as texts, with all their digits."""
    if isinstance(value, u.Quantity):
        return f"{float(value.value)!r} {value.unit}" if value.isscalar else [_plain(x) for x in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(x) for x in value] if isinstance(value, list | tuple) else value
