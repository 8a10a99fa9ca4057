"""Unit systems as text and back, exactly, whoever made them."""

from __future__ import annotations

import json
from typing import Any

from orbits.errors import ArchiveError
from orbits.units import DIMENSIONLESS, SOLAR, UnitSystem

_KINDS = ("length", "time", "mass")


def unit_system_to_text(units: UnitSystem) -> str:
    """Return a unit system as JSON: each unit by its name, and by its factor and powers of base units.

    Raises ArchiveError for a unit that is not made of astropy's base units.
    """
    definition: dict[str, Any] = {"name": units.name, "G": units.G}
    for kind in _KINDS:
        definition[kind] = _unit_to_dict(getattr(units, kind))
    return json.dumps(definition, sort_keys=True)


def unit_system_from_text(text: str) -> UnitSystem:
    """Return the unit system that `unit_system_to_text` wrote: the package's own ones themselves."""
    for known in (SOLAR, DIMENSIONLESS):
        if unit_system_to_text(known) == text:
            return known
    definition = json.loads(text)
    units = {kind: _unit_from_dict(definition[kind]) for kind in _KINDS}
    return UnitSystem(definition["name"], **units, G=definition["G"])


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
    bases = [[base.name, float(power)] for base, power in zip(whole.bases, whole.powers, strict=True)]
    return {"name": str(unit), "scale": float(whole.scale), "bases": bases}


def _unit_from_dict(stored: dict[str, Any]) -> Any:
    from astropy import units as u

    try:
        unit = u.Unit(stored["name"])
    except ValueError:
        unit = None
    if unit is not None and _unit_to_dict(unit) == stored:
        return unit
    # A unit of the user's own, or one that another edition of astropy defines otherwise: as it was then.
    bases = [u.Unit(name) for name, _ in stored["bases"]]
    definition = u.CompositeUnit(stored["scale"], bases, [power for _, power in stored["bases"]])
    if str(stored["name"]).isidentifier():
        return u.def_unit(stored["name"], definition)
    return definition
