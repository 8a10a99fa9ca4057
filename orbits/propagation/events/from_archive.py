"""The events of a run in an archive, made again to go on with them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from orbits.errors import ArchiveError, InputError
from orbits.propagation.collisions.merge_and_bounce import again, is_held
from orbits.propagation.control import stop_conditions
from orbits.propagation.events.base import Sought
from orbits.propagation.events.kinds import collision, from_observer, of_pairs, orbital, own, planes
from orbits.propagation.events.seeking import Seeking

if TYPE_CHECKING:
    from orbits.archive import Archive

MODULES = collision, of_pairs, orbital, own, planes, from_observer, stop_conditions
"""The files of all kinds of events."""


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
        given = json.loads(seeking.described())
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
    missing = [event["kind"] for event in known if event["given"] is None or not is_held(event["then"])]
    if missing:
        raise InputError(
            f"the run in {path} sought {', '.join(missing)}, with a function or an action that a file cannot hold; "
            "give the same events again: orbits.resume(path, events=[...])."
        )
    classes = {name: value for module in MODULES for name, value in vars(module).items() if isinstance(value, type)}
    try:
        made = [classes[event["kind"]](**event["given"], then=again(event["then"])) for event in known]
        return Seeking(archive.system, made, direction)
    except (KeyError, TypeError, InputError) as error:
        raise ArchiveError(f"{path}: its events cannot be sought here ({error}); is it of a later version?") from error
