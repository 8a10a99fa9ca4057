"""The Kepler flow with units: where quantities become the floats of `two_body`."""

from __future__ import annotations

from typing import Any

from astropy import units as u

from orbits.elements.refusals import numbers
from orbits.elements.two_body import any_two_body
from orbits.errors import InputError
from orbits.units import DIMENSIONLESS, UnitSystem


def kepler_flow(q: Any, v: Any, gm: Any, dt: Any) -> tuple[Any, Any]:
    """Return position and velocity (q, v) after the time dt, for bodies that each move about one attracting body.

    q, v : (..., 3), position and velocity relative to the attracting body
    gm : (...), G times the total mass of both bodies, >= 0
    dt : (...), time, of either sign, any number of periods
    All arguments broadcast: one state and an array of dt give an orbit. They are either plain numbers in consistent
    units, and plain arrays are returned, or four quantities, and quantities in the units of q and v are returned.

    Valid for every conic, with an error of a few times the effect of rounding the input (see
    `orbits.kernels.kepler.flow`). dt = 0 returns the state exactly. With gm = 0 the motion is straight. Motion along a
    line through the centre is the limit of ever narrower orbits: after a collision it returns the way it came.

    Raises InputError for values that are not finite, shapes or units that do not fit, gm < 0, q = 0, and results beyond
    the range of floats.
    Source: Battin (1999), 4.5-4.6; Danby (1992), 6.9 (universal variables).
    """
    given = {"q": q, "v": v, "gm": gm, "dt": dt}
    units = {name: _unit_of(value) for name, value in given.items()}
    known = [name for name, unit in units.items() if unit is not None]
    if known and len(known) < len(given):
        bare = next(name for name, unit in units.items() if unit is None)
        raise InputError(
            f"{bare} has no unit, but {known[0]} is in {units[known[0]] or 'units'}; expected units for all of "
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
    """Return the unit of a quantity, or of the first quantity in a list; None for plain numbers."""
    while isinstance(x, list | tuple) and len(x) > 0:
        x = x[0]
    unit = getattr(x, "unit", None)  # of a column of a table, too
    return unit if isinstance(unit, u.UnitBase) else None
