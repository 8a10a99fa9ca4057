"""The tolerances of a comparison for our methods: validated before the runs, and judged afterwards."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from orbits.body_names import place_of
from orbits.checks import number_not_below_zero
from orbits.errors import InputError, UnknownNameError, shown
from orbits.units import UnitSystem

_SCALARS = {"energy": "max |dE/E|", "angular_momentum": "max |dL/L|"}
_POSITIONS = ("position_km", "position")
_GROUPS = ("massive", "particles")
KEYS = (*_SCALARS, *_POSITIONS)


@dataclass(frozen=True)
class Bounds:
    """The tolerances of one method.

    scalars : bounds by key, "energy" and "angular_momentum"
    positions : bounds by body, in the unit of reported positions
    """

    scalars: Mapping[str, float] = field(default_factory=dict)
    positions: Mapping[str, float] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.scalars or self.positions)

    def failures(
        self,
        reached: Mapping[str, float],
        positions: Mapping[str, float],
        reference_errors: Mapping[str, float],
        unit: str,
    ) -> tuple[str, ...]:
        """Return every exceeded bound, in words. Values that were not measured (NaN, or absent) exceed any bound."""
        found = [
            f"{_SCALARS[key]} = {reached.get(key, math.nan):.2e} exceeds {bound:.2e}"
            for key, bound in self.scalars.items()
            if not reached.get(key, math.nan) <= bound
        ]
        for body, bound in self.positions.items():
            if reference_errors.get(body, 0.0) > bound:
                own = reference_errors[body]
                its = f"the reference solution's own error {own:.2e}{unit}"
                found.append(f"position of {body}: {its} exceeds {bound:.2e}{unit}")
            elif not positions.get(body, math.nan) <= bound:
                found.append(f"position of {body}: {positions.get(body, math.nan):.2e}{unit} exceeds {bound:.2e}{unit}")
        return tuple(found)


def parse(
    tolerances: Mapping[str, Any] | None,
    *,
    methods: Sequence[tuple[str, str]],
    names: Sequence[str],
    massive: Sequence[str],
    units: UnitSystem,
    unit_of_report: float,
) -> list[Bounds]:
    """Return the bounds of each of our methods, in their order.

    tolerances : by key, for all methods: "energy" and "angular_momentum" (largest relative errors), "position_km"
        (kilometres) or "position" (a length; a plain number is in the system's unit). A position bound is one length
        for all bodies, or a mapping from body, "massive" or "particles" to lengths; of two bounds on one body the
        smaller one holds. The name or label of a method as a key has such a mapping for this method, which takes
        precedence.
    methods : (name, label) of each of our methods
    unit_of_report : the system's unit of length in the unit of reported positions
    Raises InputError or UnknownNameError, with the problem and the valid names.
    """
    if tolerances is None:
        tolerances = {}
    if not isinstance(tolerances, Mapping):
        raise InputError(f"tolerances must be a mapping such as {{'energy': 1e-12}}; got {type(tolerances).__name__}.")
    general: dict[str, Any] = {}
    special: dict[str, Mapping[str, Any]] = {}
    callable_by = {key.lower(): key for pair in methods for key in pair}
    for key, value in tolerances.items():
        if key in KEYS:
            general[key] = value
        elif isinstance(key, str) and key.lower() in callable_by:
            if not isinstance(value, Mapping):
                raise InputError(f"tolerances[{key!r}] must be a mapping from {', '.join(KEYS)}; got {shown(value)}.")
            for inner in value:
                if inner not in KEYS:
                    raise _unknown(f"tolerances[{key!r}]", inner, KEYS)
            special[callable_by[key.lower()]] = value
        else:
            raise _unknown("tolerances", key, (*KEYS, *sorted(callable_by.values())))
    out = []
    for name, label in methods:
        wanted = dict(general)
        for own in (special.get(name, {}), special.get(label, {})):
            replaced = _POSITIONS if own.keys() & set(_POSITIONS) else ()
            wanted = {key: value for key, value in wanted.items() if key not in replaced} | dict(own)
        scalars = {key: _bound(key, wanted[key]) for key in _SCALARS if key in wanted}
        positions: dict[str, float] = {}
        for key in _POSITIONS:
            if key in wanted:
                convert = _converter(key, units, unit_of_report)
                for body, bound in _positions(key, wanted[key], convert, names, massive).items():
                    positions[body] = min(bound, positions.get(body, math.inf))
        out.append(Bounds(scalars, positions))
    return out


def _converter(key: str, units: UnitSystem, unit_of_report: float) -> Any:
    from astropy import units as u

    physical = units.length.is_equivalent(u.km)
    if key == "position_km" and not physical:
        raise InputError(
            "tolerances['position_km'] is in km, but this system's lengths are pure numbers; use 'position'."
        )

    def convert(value: Any) -> float:
        if key == "position_km" and not isinstance(value, u.Quantity):
            return _bound(key, value)
        return _bound(key, float(units.length_value(value, what=f"tolerances[{key!r}]")) * unit_of_report)

    return convert


def _positions(key: str, value: Any, convert: Any, names: Sequence[str], massive: Sequence[str]) -> dict[str, float]:
    if not isinstance(value, Mapping):
        bound = convert(value)
        return dict.fromkeys(names, bound)
    attracting = set(massive)
    groups = {"massive": list(massive), "particles": [name for name in names if name not in attracting]}
    out: dict[str, float] = {}
    places = {body: place_of(body, names) for body in value}
    for body, place in places.items():
        if place is None and body not in _GROUPS:
            raise _unknown(f"tolerances[{key!r}]", body, (*_GROUPS, *names))
    for body, bound in sorted(value.items(), key=lambda item: places[item[0]] is not None):  # bodies override groups
        place = places[body]
        if place is None:
            out.update(dict.fromkeys(groups[body], convert(bound)))
        else:
            out[names[place]] = convert(bound)
    return out


def _bound(key: str, value: Any) -> float:
    return number_not_below_zero(value, f"tolerances[{key!r}]")


def _unknown(where: str, key: Any, known: Sequence[str]) -> UnknownNameError:
    near = get_close_matches(str(key), known, n=1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    listed = ", ".join(known[:20]) + (", ..." if len(known) > 20 else "")
    return UnknownNameError(f"{where} has no key {key!r}; there are {listed}.{hint}")
