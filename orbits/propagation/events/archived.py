"""The events of a run as an archive holds them, and made again from it to go on with them."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.errors import ArchiveError, InputError
from orbits.propagation.collisions.merge_and_bounce import Bounce, Merge, OfTwo
from orbits.propagation.control import stop_conditions
from orbits.propagation.events.base import RECORD, STOP, Action, Sought
from orbits.propagation.events.functions import description
from orbits.propagation.events.kinds import collision, from_observer, of_pairs, orbital, own, planes
from orbits.propagation.events.seeking import Seeking
from orbits.trajectory.events import described

if TYPE_CHECKING:
    from orbits.archive import Archive

MODULES = collision, of_pairs, orbital, own, planes, from_observer, stop_conditions
"""The files of all kinds of events."""


def description_of(seeking: Seeking) -> str:
    """Return the events that are sought in a run as a text."""
    asked = seeking.asked
    return described(
        {
            "kind": type(event).__name__,
            **_given(event),
            "words": [bound.words for one, bound in zip(asked.of, asked.bounds, strict=True) if one is event],
        }
        for event in asked.events
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


def _again(text: str) -> str | OfTwo:
    """Return what an archive holds of `then`. Raises InputError for what it cannot hold."""
    bounce = re.fullmatch(r"Bounce\(restitution=([0-9.e+-]+)\)", text)
    if bounce:
        return Bounce(float(bounce[1]))
    if text == repr(Merge()):
        return Merge()
    if text in (RECORD, STOP):
        return text
    raise InputError(f"an archive cannot hold what is done then: {text}")


def _is_held(event: dict[str, Any]) -> bool:
    """Return whether an archive holds all of an event, by its description there."""
    try:
        _again(event["then"])
    except InputError:
        return False
    return event["given"] is not None


def _but_functions(known: Any) -> Any:
    """Return the description of events without names and digests of functions."""
    if isinstance(known, list):
        return [_but_functions(x) for x in known]
    if not isinstance(known, dict) or known.keys() == {"name", "code"}:
        return None if isinstance(known, dict) else known
    return {k: _but_functions(x) for k, x in known.items()}


def _functions(known: Any) -> set[tuple[str, str]]:
    """Return the names of all functions in the description of events, and their digests."""
    if isinstance(known, dict) and known.keys() == {"name", "code"}:
        return {(known["name"], known["code"])}
    parts = known.values() if isinstance(known, dict) else known if isinstance(known, list) else ()
    return {found for part in parts for found in _functions(part)}


def sought_again(
    archive: Archive, events: Sought | Sequence[Sought], path: str | PathLike[str], same_code: bool = True
) -> Seeking:
    """Return the events of the run in an archive, to go on with them.

    events : those of the run, if the archive does not hold all that is needed
    same_code : whether their functions must have the code of those of the run
    Raises InputError for others, and if they are needed.
    """
    direction = archive.grid.clock.direction
    if not archive.events_text:
        if isinstance(events, Sought) or events:
            raise InputError(f"the run in {path} sought no events, and cannot begin to; leave out events=...")
        return Seeking(archive.system, [], direction)
    known = json.loads(archive.events_text)
    if isinstance(events, Sought) or events:
        seeking = Seeking(archive.system, events, direction)
        given = json.loads(description_of(seeking))
        if _but_functions(given) != _but_functions(known):
            raise InputError(f"events are not those of the run in {path}: {', '.join(e['kind'] for e in known)}.")
        if same_code and given != known:
            names = sorted(_functions(known) - _functions(given))
            raise InputError(
                f"{' and '.join(name for name, _ in names)} of events=... is not as in the run in {path}: the function "
                "given now has other code, or the version of Python is another one. Resume with same_bits=False to go "
                "on with the one given now."
            )
        return seeking
    missing = [event["kind"] for event in known if not _is_held(event)]
    if missing:
        raise InputError(
            f"the run in {path} sought {', '.join(missing)}, with a function or an action that a file cannot hold; "
            "give the same events again: orbits.resume(path, events=[...])."
        )
    classes = {name: value for module in MODULES for name, value in vars(module).items() if isinstance(value, type)}
    try:
        made = [classes[event["kind"]](**event["given"], then=_again(event["then"])) for event in known]
        return Seeking(archive.system, made, direction)
    except (KeyError, TypeError, InputError) as error:
        raise ArchiveError(f"{path}: its events cannot be sought here ({error}); is it of a later version?") from error
