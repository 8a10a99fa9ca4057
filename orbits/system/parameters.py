"""Parameters of what acts in a system, by name: "Apophis.A2", "Ceres.gm", "Earth.J2".

A force or a term declares which of its fields are such numbers: `per_body`, of the bodies that a force acts on, and
`of_body`, of the body that it comes from. GM of every massive body is one, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.body_names import index_of
from orbits.errors import InputError, UnknownNameError, counted, shown
from orbits.system.model import given_bodies

if TYPE_CHECKING:
    from orbits.system.system import System

GM = "gm"


@dataclass(frozen=True)
class Parameter:
    """A number of what acts in a system.

    name : of body and field, "Apophis.A2"; body, field : both apart
    value : in the unit of the system; unit : this unit
    of : "gm", "forces" or "terms"; place : its number among these
    """

    name: str
    body: str
    field: str
    value: float
    unit: u.UnitBase
    of: str
    place: int


def parameters_of(system: System, names: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters of these names, "Apophis.A2" or "Ceres.gm".

    Raises UnknownNameError for one that the system does not have, and InputError for one that two forces have, and for
    names that occur twice.
    """
    require_list(names)
    if not names:
        return ()
    known = list(_known(system))
    found = tuple(_named(name, known) for name in names)
    for k, parameter in enumerate(found):
        if parameter in found[:k]:
            raise InputError(f"parameters names {parameter.name!r} twice; expected each once.")
    return found


def require_list(names: Any) -> None:
    """Raise InputError unless these are names in a list or a tuple."""
    if not isinstance(names, list | tuple):
        raise InputError(f'parameters is {shown(names)}; expected a list of names, such as ["Ceres.gm"].')


def with_values(system: System, parameters: Sequence[Parameter], values: Sequence[float]) -> System:
    """Return a system whose parameters have these values, in the units of the system.

    Raises InputError for values that a force, a term or a mass cannot have.
    """
    if len(parameters) != len(values):
        raise InputError(f"got {counted(len(values), 'value')} of {counted(len(parameters), 'parameter')}.")
    gm = system.values.gm.copy()
    acting: dict[str, list[Any]] = {"forces": list(system.forces), "terms": list(system.terms)}
    for parameter, value in zip(parameters, values, strict=True):
        if parameter.of == GM:
            if not value > 0.0:
                raise InputError(f"{parameter.name} would be {float(value):g}; expected a mass > 0.")
            gm[parameter.place] = value
        else:
            items = acting[parameter.of]
            items[parameter.place] = _changed(system, items[parameter.place], parameter, float(value))
    return system.replaced(gm=gm, **acting)


def _named(name: Any, known: Sequence[Parameter]) -> Parameter:
    names = list(dict.fromkeys(parameter.name for parameter in known))
    try:
        wanted = names[index_of(name, names, "parameter")]
    except UnknownNameError as error:
        raise UnknownNameError(
            f"{error} A force has to act before it has a parameter: system.with_forces(...), such as "
            "orbits.terms.NonGravitational.yarkovsky(A2, bodies=[...])."
        ) from None
    meant = [parameter for parameter in known if parameter.name == wanted]
    if len(meant) > 1:
        raise InputError(
            f"{meant[0].name!r} is a number of {counted(len(meant), 'force')} of {meant[0].body!r}; expected one. Make "
            "one of them act: system.replaced(forces=[...])."
        )
    return meant[0]


def _known(system: System) -> Iterator[Parameter]:
    """Yield all parameters of a system, those of forces first."""
    for of, items in (("forces", system.forces), ("terms", system.terms)):
        for place, item in enumerate(items):
            for body, field, value in _fields(system, item):
                unit = value.unit if isinstance(value, u.Quantity) else u.dimensionless_unscaled
                number = float(value.value) if isinstance(value, u.Quantity) else float(value)
                yield Parameter(f"{body}.{field}", body, field, number, unit, of, place)
    for place in np.flatnonzero(system.massive).tolist():
        body = system.names[place]
        yield Parameter(f"{body}.{GM}", body, GM, float(system.values.gm[place]), system.units.gm, GM, place)


def _fields(system: System, item: Any) -> Iterator[tuple[str, str, Any]]:
    """Yield the body, the field and the value of each parameter of a force or a term."""
    for field in item.of_body:
        yield item.owner, field, getattr(item, field)
    fields = getattr(item, "per_body", ())  # terms have none
    bodies = acted_on(system, item) if fields else ()
    for field in fields:
        value = getattr(item, field)
        if value is not None:
            yield from zip(bodies, [field] * len(bodies), _each(value, len(bodies)), strict=True)


def _each(value: Any, count: int) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,) * count


def acted_on(system: System, force: Any) -> tuple[str, ...]:
    """Return the names of the bodies that a force acts on and whose motion is not given."""
    if force.bodies is not None:
        return tuple(force.bodies)
    out = {force.owner, *given_bodies(system)}
    return tuple(name for name in system.names if name not in out)


def _changed(system: System, item: Any, parameter: Parameter, value: float) -> Any:
    """Return a force or a term with another value of a parameter."""
    new = value * parameter.unit
    if parameter.field in item.of_body:
        return replace(item, **{parameter.field: new})
    bodies = acted_on(system, item)
    values = {f: _each(getattr(item, f), len(bodies)) for f in item.per_body if getattr(item, f) is not None}
    own = list(values[parameter.field])
    own[bodies.index(parameter.body)] = new
    return replace(item, bodies=bodies, **{**values, parameter.field: tuple(own)})
