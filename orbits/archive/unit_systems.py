"""Exact conversion of unit systems, including those of users, to text and back."""

from __future__ import annotations

import json
import math
from typing import Any

from orbits.errors import ArchiveError, shown
from orbits.units import DIMENSIONLESS, SOLAR, UnitSystem

_LONGEST = 1000  # characters: astropy is slow for longer texts
_KINDS = ("length", "time", "mass")


def unit_system_to_text(units: UnitSystem) -> str:
    """Return a unit system as JSON: each unit by its name, and by its factor and powers of base units.

    Raises ArchiveError for a unit that does not consist of astropy's base units.
    """
    definition: dict[str, Any] = {"name": units.name, "G": units.G}
    for kind in _KINDS:
        definition[kind] = _unit_to_dict(getattr(units, kind))
    return json.dumps(definition, sort_keys=True)


def unit_system_from_text(text: str) -> UnitSystem:
    """Return the unit system of a text of `unit_system_to_text`; for those of the package, the same objects.

    Raises ArchiveError for any other text.
    """
    for known in (SOLAR, DIMENSIONLESS):
        if unit_system_to_text(known) == text:
            return known
    try:
        definition = json.loads(text)
        units = {kind: _unit_from_dict(definition[kind]) for kind in _KINDS}
        G = float(definition["G"])
        if not math.isfinite(G):
            raise ValueError(f"G is {G}")
        return UnitSystem(str(definition["name"]), **units, G=G)
    # For arbitrary texts, astropy raises nearly every kind of exception.
    except Exception as error:
        raise ArchiveError(
            f"the units are {shown(text)}, which define no unit system ({type(error).__name__}: {str(error)[:200]})."
        ) from error


def _unit_to_dict(unit: Any) -> dict[str, Any]:
    from astropy import units as u

    whole = unit.decompose()
    for base in whole.bases:
        try:
            known = u.Unit(base.name) is base
        except ValueError:
            known = False
        if not known:
            raise ArchiveError(
                f"the unit {unit} is made of {base}, which only this session knows; an archive needs units that "
                "convert to astropy's base units. Give it a definition: u.def_unit(name, 2.5 * u.km)."
            )
    return {"name": str(unit), "written": _parts(unit), "base units": _parts(whole)}


def _parts(unit: Any) -> list[Any]:
    """Return [factor, [[unit, power], ...]]."""
    powers = [[base.name, float(power)] for base, power in zip(unit.bases, unit.powers, strict=True)]
    return [float(unit.scale), powers]


def _unit_from_dict(stored: dict[str, Any]) -> Any:
    from astropy import units as u

    name, (factor, powers) = stored["name"], stored["written"]
    if len(name) > _LONGEST or len(powers) > _LONGEST:
        raise ValueError(f"a unit with a name of {len(name)} characters and {len(powers)} parts")
    for read, arguments in ((u.Unit, [name]), (_product, [factor, powers])):
        try:
            unit: Any = read(*arguments)
        except ValueError:
            continue
        if _unit_to_dict(unit) == stored:
            return unit
    # A unit of the user, or one that another version of astropy defines differently: restored as it was.
    definition = _product(*stored["base units"])
    return u.def_unit(name, definition) if name.isidentifier() else definition


def _product(factor: float, powers: list[tuple[str, float]]) -> Any:
    from astropy import units as u

    return u.CompositeUnit(factor, [u.Unit(name) for name, _ in powers], [power for _, power in powers])
