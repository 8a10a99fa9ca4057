"""The Kepler flow with units: the border between quantities and `two_body`."""

from __future__ import annotations

from typing import Any

from astropy import units as u

from orbits.elements.refusals import numbers
from orbits.elements.two_body import any_two_body
from orbits.errors import InputError
from orbits.units import DIMENSIONLESS, UnitSystem


def kepler_flow(q: Any, v: Any, gm: Any, dt: Any) -> tuple[Any, Any]:
    """Return position and velocity after the time dt of bodies that each feel one attracting body alone: (q, v).

    q, v : (..., 3), position and velocity relative to the attracting body
    gm : (...), G times the mass of both bodies together, >= 0
    dt : (...), time, either sign, any number of periods
    All broadcast: one state and an array of dt give an orbit. Plain numbers are in any consistent units and plain
    arrays come back; quantities, all four of them, give quantities in the units of q and v.

    Every conic, to a few times what rounding the input would do (see `orbits.kernels.kepler`); dt = 0 returns the state
    to the bit. With gm = 0 motion is straight. Motion along a line through the centre is the limit of ever narrower
    orbits: it comes back out of a collision the way it went in.

    Raises InputError for values that are not finite, shapes that do not fit, gm < 0, q = 0, units that do not fit, and
    for a result beyond what floats can hold.
    Source: Battin (1999), 4.5-4.6; Danby (1992), 6.9 (universal variables).
    """
    given = {"q": q, "v": v, "gm": gm, "dt": dt}
    units = {name: _unit_of(value) for name, value in given.items()}
    known = [name for name, unit in units.items() if unit is not None]
    if known and len(known) < len(given):
        bare = next(name for name, unit in units.items() if unit is None)
        raise InputError(
            f"{bare} is without a unit, but {known[0]} is in {units[known[0]] or 'units'}; expected units for all of "
            "q, v, gm and dt, or for none."
        )
    if not known:
        q, v = (numbers(name, given[name], "numbers or a quantity, of shape (..., 3)") for name in "qv")
        gm, dt = (numbers(name, given[name], "numbers or a quantity") for name in ("gm", "dt"))
        return any_two_body(q, v, gm, dt)
    system = DIMENSIONLESS
    if any(unit != u.dimensionless_unscaled for unit in units.values()):
        for name, kind, example in (("q", "length", u.au), ("dt", "time", u.day)):
            if not units[name].is_equivalent(example):
                raise InputError(f"{name} is in {units[name] or 'no unit'}; expected {kind}, such as u.{example.name}.")
        system = UnitSystem("the units of q and dt", length=units["q"], time=units["dt"], mass=u.kg)
    new_q, new_v = any_two_body(
        system.length_value(q, "q"), system.speed_value(v, "v"), system.gm_value(gm, "gm"), system.time_value(dt, "dt")
    )
    return new_q * units["q"], (new_v * system.speed).to(units["v"])


def _unit_of(x: Any) -> Any:
    """Return the unit of a quantity, or of the first of a list of quantities; None where there is none."""
    while isinstance(x, list | tuple) and len(x) > 0:
        x = x[0]
    return x.unit if isinstance(x, u.Quantity) else None
