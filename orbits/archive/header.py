"""The header of an archive, its description of the run, as plain items: a name such as "system/gm" or "system@epoch",
and a value.

A name with "@" is an attribute, one without is a dataset. One checksum covers all items: a file in which any of them
was changed is refused.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.archive.origin import Origin
from orbits.archive.unit_systems import unit_system_from_text, unit_system_to_text
from orbits.errors import ArchiveError, InputError, shown
from orbits.integrators.maps.encounters import as_written_before
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.clocks.transformed import TimeTransformed
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.system.model_text import from_json, to_json
from orbits.time_grid import MOST_STEPS, TimeGrid
from orbits.units import FARTHEST_DATE, date_text

if TYPE_CHECKING:
    from orbits.system import System

Item = str | float | list[str] | NDArray[np.float64]

_CLOCKS: dict[str, tuple[Any, str]] = {
    "adaptive": (Adaptive, "tolerance"),
    "transformed time": (TimeTransformed, "step"),
}
"""The clocks of steps that differ in length, by the names that archives have for them, each with its parameter."""

_KINDS = {str: "a text", float: "a number", list: "a list of names", np.ndarray: "an array of numbers"}


@dataclass(frozen=True)
class Header:
    """The description of a run before its first step.

    system : the System at the start of the run
    integrator : {"name": ..., "parameters": {...}}
    grid : the step and the times of the samples, in the system's unit of time
    provenance : versions and processor, as text
    certificate : the certificate of the integrator on this system, measured before the run, as JSON; "" without one
    events : what was sought in the run, as JSON; "" without events
    steps : for how many states at the beginnings of steps there is room, for dense output; 0 for none
    origin : the scenario with options that the run was made by; None for any other run
    approaches : whether closest approaches are recorded, as in all archives that do not say so
    energy_bound : the relative energy error that ends the run; infinite without one

    Raises ArchiveError for values that no run has.
    """

    system: System
    integrator: Mapping[str, Any]
    grid: TimeGrid
    provenance: Mapping[str, str]
    certificate: str = ""
    events: str = ""
    steps: int = 0
    origin: Origin | None = None
    approaches: bool = True
    energy_bound: float = math.inf

    def __post_init__(self) -> None:
        _check_integrator(self.integrator)
        if self.certificate and not isinstance(_from_json(self.certificate, "the certificate"), dict):
            raise ArchiveError(f"the certificate is {shown(self.certificate)}; expected a JSON object.")
        if self.events and not isinstance(_from_json(self.events, "the description of events"), list):
            raise ArchiveError(f"the description of events is {shown(self.events)}; expected a JSON array.")


def to_items(header: Header) -> dict[str, Item]:
    """Return the header as items for HDF5. Raises ArchiveError, naming them, for texts that HDF5 cannot store."""
    system, units = header.system, header.system.units
    values = system.values
    try:
        integrator = json.dumps(dict(header.integrator), sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ArchiveError(
            f"integrator is {shown(header.integrator)}, which JSON cannot hold ({error}); expected its name and "
            "parameters, as orbits.integrators.describe gives them."
        ) from error
    items: dict[str, Item] = {
        "times": np.array(header.grid.times),
        "times@unit": _unit_text(units.time),
        "@dt": header.grid.h,
        "@dt_unit": _unit_text(units.time),
        "@integrator": integrator,
        "integrator@name": str(header.integrator.get("name", "")),
        "system/names": list(system.names),
        "system/gm": values.gm,
        "system/gm@unit": _unit_text(units.gm),
        "system/q": values.q,
        "system/q@unit": _unit_text(units.length),
        "system/v": values.v,
        "system/v@unit": _unit_text(units.speed),
        "system@softening": float(values.softening),
        "@approaches": float(header.approaches),
        "units@name": units.name,
        "units@length": _unit_text(units.length),
        "units@time": _unit_text(units.time),
        "units@mass": _unit_text(units.mass),
        "units@G": float(units.G),
        "units@definition": unit_system_to_text(units),
    }
    for name, value in dict(header.integrator.get("parameters", {})).items():
        items[f"integrator/parameters@{name}"] = json.dumps(value, sort_keys=True)
    for kind, (clock, _) in _CLOCKS.items():
        if isinstance(header.grid.clock, clock):
            items["@clock"] = json.dumps({"kind": kind, **asdict(header.grid.clock)}, sort_keys=True)
    if header.grid.goes_on:
        items["@end"] = header.grid.end
    if system.radii is not None:
        items["system/radii"] = np.asarray(units.length_value(system.radii, "radii"))
        items["system/radii@unit"] = _unit_text(units.length)
    if system.terms or system.forces:
        items["system@model"] = to_json(system)
    if system.epoch is not None:
        epoch = system.epoch.copy(format="isot")
        epoch.out_subfmt = "date_hms"
        items["system@epoch"] = date_text(epoch) + " TDB"
        items["system@epoch_jd1"] = float(system.epoch.jd1)
        items["system@epoch_jd2"] = float(system.epoch.jd2)
    if header.certificate:
        items["@certificate"] = header.certificate
    if header.events:
        items["@events"] = header.events
    if header.origin is not None:
        items["@scenario"] = header.origin.to_json()
    if header.steps:
        items["steps@room"] = float(header.steps)
    if header.energy_bound < math.inf:
        items["@energy_bound"] = float(header.energy_bound)
    for name, text in header.provenance.items():
        items[f"provenance@{name}"] = str(text)
    for name, item in items.items():
        for text in [name, *([item] if isinstance(item, str) else item if isinstance(item, list) else [])]:
            _check_text(text, name)
    return items


def from_items(items: Mapping[str, Any]) -> Header:
    """Return the exact header of `to_items`. Raises ArchiveError, naming the item, for items that no run writes."""
    from astropy.time import Time

    from orbits.system import System

    units = unit_system_from_text(_item(items, "units@definition", str))
    epoch = None
    if "system@epoch_jd1" in items:
        days = [_item(items, f"system@epoch_jd{part}", float) for part in (1, 2)]
        if not all(abs(day) < FARTHEST_DATE for day in days):
            raise ArchiveError(f"system@epoch_jd1 and system@epoch_jd2 are {days}; expected a Julian date.")
        epoch = Time(*days, format="jd", scale="tdb")
        epoch.format = "iso"
    try:
        system = System(
            _item(items, "system/names", list),
            _item(items, "system/gm", np.ndarray),
            _item(items, "system/q", np.ndarray),
            _item(items, "system/v", np.ndarray),
            epoch=epoch,
            units=units,
            radii=_item(items, "system/radii", np.ndarray) if "system/radii" in items else None,
            softening=_item(items, "system@softening", float),
        )
        if "system@model" in items:
            system = from_json(system, _item(items, "system@model", str))
    except InputError as error:
        raise error if isinstance(error, ArchiveError) else ArchiveError(f"its system cannot be: {error}") from error
    try:
        clock = ConstantSteps(_item(items, "@dt", float)) if "@clock" not in items else _clock(items)
        end = _item(items, "@end", float) if "@end" in items else math.nan
        grid = TimeGrid(clock, _item(items, "times", np.ndarray), end)
    except InputError as error:
        raise error if isinstance(error, ArchiveError) else ArchiveError(str(error)) from error
    return Header(
        system,
        _integrator(items),
        grid,
        {name.partition("@")[2]: _item(items, name, str) for name in items if name.startswith("provenance@")},
        _item(items, "@certificate", str) if "@certificate" in items else "",
        _item(items, "@events", str) if "@events" in items else "",
        _room(items) if "steps@room" in items else 0,
        Origin.from_json(_item(items, "@scenario", str)) if "@scenario" in items else None,
        _approaches(items) if "@approaches" in items else True,
        _energy_bound(items) if "@energy_bound" in items else math.inf,
    )


def _integrator(items: Mapping[str, Any]) -> Any:
    """Return the method as `orbits.integrators.describe` gives it, of older archives too."""
    known = _from_json(_item(items, "@integrator", str), "@integrator")
    if isinstance(known, dict) and isinstance(known.get("parameters"), dict):
        known["parameters"] = as_written_before(known["parameters"])
    return known


def _approaches(items: Mapping[str, Any]) -> bool:
    """Return whether closest approaches are recorded. Raises ArchiveError for anything but 0 and 1."""
    recorded = _item(items, "@approaches", float)
    if recorded not in (0.0, 1.0):
        raise ArchiveError(f"@approaches is {recorded}; expected 1 if closest approaches are recorded, 0 if not.")
    return bool(recorded)


def _energy_bound(items: Mapping[str, Any]) -> float:
    """Return the energy error that ends the run. Raises ArchiveError for a number that no run has."""
    bound: float = _item(items, "@energy_bound", float)
    if not 0.0 < bound < math.inf:
        raise ArchiveError(f"@energy_bound is {bound}; expected a positive number.")
    return bound


def _room(items: Mapping[str, Any]) -> int:
    """Return for how many steps there is room. Raises ArchiveError for a number that no run has."""
    room = _item(items, "steps@room", float)
    if not (room.is_integer() and 0 < room <= MOST_STEPS):
        raise ArchiveError(f"steps@room is {room}; expected a number of steps.")
    return int(room)


def _clock(items: Mapping[str, Any]) -> ChangingSteps:
    """Return the clock of steps that differ in length. Raises ArchiveError for one that no run has."""
    known = _from_json(_item(items, "@clock", str), "@clock")
    kind = known.pop("kind", None) if isinstance(known, dict) else None
    clock, parameter = _CLOCKS.get(kind, (None, "")) if isinstance(kind, str) else (None, "")
    if clock is None or known.keys() != {parameter, "direction"}:
        raise ArchiveError(f"@clock is {shown(items['@clock'])}; expected a clock of adaptive or transformed steps.")
    if known["direction"] not in (1.0, -1.0):
        raise ArchiveError(f"the direction of its clock is {shown(known['direction'])}; expected 1 or -1.")
    made: ChangingSteps = clock(known[parameter]).towards(known["direction"])
    return made


def checksum(items: Mapping[str, Item]) -> str:
    """Return the SHA-256 of all items, names and values, in the order of their names."""
    digest = hashlib.sha256()
    for name in sorted(items):
        item = items[name]
        if isinstance(item, np.ndarray):
            array = np.ascontiguousarray(item, dtype="<f8")
            kind, data = f"f8 {array.shape}", array.tobytes()
        elif isinstance(item, float):
            kind, data = "float", np.float64(item).astype("<f8").tobytes()
        else:
            kind, data = type(item).__name__, json.dumps(item).encode()
        digest.update(json.dumps([name, kind, len(data)]).encode() + data)
    return digest.hexdigest()


def _item(items: Mapping[str, Any], name: str, kind: type) -> Any:
    """Return an item of type `kind`."""
    if name not in items:
        raise ArchiveError(f"its header has no {name}.")
    if not isinstance(items[name], kind):
        raise ArchiveError(f"{name} is {shown(items[name])}; expected {_KINDS[kind]}.")
    return items[name]


def _from_json(text: str, what: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArchiveError(f"{what} is {shown(text)}, which is no JSON ({str(error)[:200]}).") from error


def _check_integrator(integrator: Any) -> None:
    """Refuse an integrator that is not a result of `orbits.integrators.describe`."""
    named = isinstance(integrator, Mapping) and isinstance(integrator.get("name"), str)
    parameters = integrator.get("parameters", {}) if named else None
    if not isinstance(parameters, Mapping) or not all(isinstance(name, str) for name in parameters):
        raise ArchiveError(
            f"integrator is {shown(integrator)}; expected a name and parameters, as orbits.integrators.describe gives "
            "them."
        )


def _unit_text(unit: Any) -> str:
    return str(unit) or "1"


def _check_text(text: str, item: str) -> None:
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ArchiveError(
            f"{item} holds {shown(text)}, which is not valid Unicode; expected text. Rename it."
        ) from error
    if "\0" in text:
        raise ArchiveError(f"{item} holds {shown(text)}; HDF5 cannot hold a text with a NUL character. Rename it.")
