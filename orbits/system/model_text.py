"""The terms and forces of a system as text, as archives hold them, and made again from it: by their names."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.errors import ArchiveError, InputError, shown
from orbits.system.rigid_body import RIGID

if TYPE_CHECKING:
    from orbits.system.system import System


def to_json(system: System) -> str:
    """Return terms and forces as JSON, with numbers in the units of the system."""
    return json.dumps({"terms": [_plain(x) for x in system.terms], "forces": [_plain(x) for x in system.forces]})


def from_json(system: System, text: str) -> System:
    """Return a system with the terms and forces of `to_json`. Raises ArchiveError for text that is not of `to_json`."""
    known_terms, known_forces = _known()
    try:
        given = json.loads(text)
        terms = [_made(x, known_terms) for x in given["terms"]]
        forces = [_made(x, known_forces) for x in given["forces"]]
        return system.replaced(terms=terms, forces=forces)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ArchiveError(f"its terms and forces are {shown(text)}, which no run writes ({error}).") from error


def require_known(system: System, what: str) -> None:
    """Raise InputError if a term or force is not one of the package, by whose names `from_json` finds them.

    what : that which needs them, for the message
    """
    if not (system.terms or system.forces):
        return
    terms, forces = _known()
    for given, known, folder in (
        (system.terms, terms, "orbits/lagrangians/terms/"),
        (system.forces, forces, "orbits/forces/"),
    ):
        for item in given:
            if known.get(item.kind) is not type(item):
                name = type(item).__name__
                raise InputError(
                    f"{what} finds terms and forces by name among those of the package, where {name} "
                    f"({item.kind!r}) is not. Leave it out, which keeps the run in memory, or put the file of {name} "
                    f"into {folder}."
                )


def _known() -> tuple[Mapping[str, type], Mapping[str, type]]:
    """Return the terms and the forces of the package, by their names."""
    from orbits import forces as force_registry
    from orbits.lagrangians import terms as term_registry
    from orbits.system.rigid_bodies import RigidBodies

    return term_registry.registry(), {**force_registry.registry(), RIGID: RigidBodies}


def _plain(item: Any) -> dict[str, Any]:
    return {"kind": item.kind, **{field.name: _number(getattr(item, field.name)) for field in fields(item)}}


def _number(value: Any) -> Any:
    if isinstance(value, u.Quantity):
        return float(value.value) if value.isscalar else value.value.tolist()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_number(x) for x in value] if isinstance(value, tuple) else value


def _made(plain: Mapping[str, Any], registry: Mapping[str, Any]) -> Any:
    if plain["kind"] not in registry:
        raise ValueError(f"{plain['kind']!r} is not known to this version of orbits")
    given = {name: tuple(x) if isinstance(x, list) else x for name, x in plain.items() if name != "kind"}
    return registry[plain["kind"]](**given)
