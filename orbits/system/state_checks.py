"""Checks of a system's values: every message names the body, the value and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.errors import InputError, shown, with_unit
from orbits.point_masses import PointMasses
from orbits.units import UnitSystem

Floats = NDArray[np.float64]


def checked_values(names: Sequence[str], gm: Any, q: Any, v: Any, softening: Any, units: UnitSystem) -> PointMasses:
    """Return the floats of a system in `units`, read-only and C-contiguous.

    Raises InputError, naming the body and the value, for anything that cannot be a system.
    """
    values = PointMasses(
        gm=checked_array("gm", units.gm_value(gm, "gm"), names, None, units.gm),
        q=checked_array("q", units.length_value(q, "q"), names, 3, units.length),
        v=checked_array("v", units.speed_value(v, "v"), names, 3, units.speed),
        softening=scalar(units.length_value(softening, "softening"), "softening", units.length),
    )
    check_not_negative("gm", values.gm, names, units.gm)
    check_some_mass(values.gm, names)
    if values.softening < 0.0:
        raise InputError(f"softening is {with_unit(shown(values.softening), units.length)}; expected a length >= 0.")
    if values.softening == 0.0:
        check_apart(values.gm, values.q, names, units.length)
    return values


def checked_radii(names: Sequence[str], radii: Any, units: UnitSystem) -> Floats | None:
    """Return radii as floats in `units`, or None. Raises InputError, naming the body, for a negative radius."""
    if radii is None:
        return None
    values = checked_array("radii", units.length_value(radii, "radii"), names, None, units.length)
    check_not_negative("radii", values, names, units.length)
    return values


def checked_units(units: Any) -> UnitSystem:
    """Return a unit system unchanged. Raises InputError for anything else."""
    if isinstance(units, UnitSystem):
        return units
    raise InputError(f"units is {shown(units)}; expected orbits.SOLAR, orbits.DIMENSIONLESS or a UnitSystem.")


def scalar(value: Floats, what: str, unit: Any) -> float:
    """Return a single finite float. Raises InputError for an array, or a number that is not finite."""
    if value.shape != () or not np.isfinite(value):
        raise InputError(f"{what} is {with_unit(value.tolist(), unit)}; expected one finite number.")
    return float(value)


def checked_array(what: str, values: Floats, names: Sequence[str], width: int | None, unit: Any) -> Floats:
    """Return a read-only C-contiguous copy, (n,) or (n, width). Raises InputError for other shapes and nan or inf."""
    n = len(names)
    shape = (n,) if width is None else (n, width)
    if values.shape != shape:
        rows = "one value" if width is None else "one row x, y, z"
        raise InputError(
            f"{what} has shape {values.shape}; expected {shape}: {rows} for each of the {n} names ({few(names)})."
        )
    copy = np.array(values, dtype=np.float64, order="C")
    wrong = ~np.isfinite(copy) if width is None else ~np.isfinite(copy).all(axis=1)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise InputError(f"{what} of {names[i]!r} is {with_unit(copy[i].tolist(), unit)}; expected finite numbers.")
    return read_only(copy)


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array, which cannot be written to any more."""
    array.flags.writeable = False
    return array


def check_not_negative(what: str, values: Floats, names: Sequence[str], unit: Any) -> None:
    """Raise InputError, naming the body, if a value is negative."""
    if (values < 0.0).any():
        i = int(np.argmax(values < 0.0))
        remedy = " A body without mass has gm = 0." if what == "gm" else ""
        raise InputError(f"{what} of {names[i]!r} is {with_unit(values[i].item(), unit)}; expected >= 0.{remedy}")


def check_some_mass(gm: Floats, names: Sequence[str]) -> None:
    """Raise InputError if there are no bodies, or none with mass."""
    if not len(names):
        raise InputError("the system has no bodies; expected at least one with gm > 0.")
    if not (gm > 0.0).any():
        raise InputError(f"gm of {few(names)} is 0; expected at least one body with gm > 0, to attract the others.")


def check_apart(gm: Floats, q: Floats, names: Sequence[str], unit: Any) -> None:
    """Raise InputError, naming both, if two bodies, one of them massive, are at the same position."""
    order = np.lexsort(q.T)
    same = (q[order[1:]] == q[order[:-1]]).all(axis=1)
    if not same.any():
        return
    # Bodies at the same position are neighbours in the sorted order: number the positions, and look for shared ones
    # with a massive body.
    place = np.concatenate([[0], np.cumsum(~same)])
    company, mass = np.bincount(place), np.bincount(place, weights=gm[order] > 0.0)
    wrong = np.flatnonzero((company > 1) & (mass > 0))
    if len(wrong):
        bodies = np.sort(order[place == wrong[0]])
        heavy = bodies[gm[bodies] > 0.0][0]
        other = next(i for i in bodies if i != heavy)
        raise InputError(
            f"{names[min(heavy, other)]!r} and {names[max(heavy, other)]!r} are both at "
            f"{with_unit(q[heavy].tolist(), unit)}; expected different positions: at zero distance the attraction is "
            "infinite. Move one, or set a softening."
        )
