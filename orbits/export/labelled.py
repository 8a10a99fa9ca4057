"""Named arrays with units and named axes, and their conversion to astropy, pandas and xarray."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import MissingPackageError

if TYPE_CHECKING:
    import pandas
    import xarray
    from astropy.table import QTable
    from astropy.time import Time

COMPONENTS = ("x", "y", "z")
QUATERNION = ("a", "b", "c", "d")
J2000, J2000_JD = np.datetime64("2000-01-01T12:00", "us"), 2451545.0
MOST_DAYS = 290_000 * 365.25
TDB = "tdb"
COLUMNS = {
    "q": COMPONENTS,
    "v": ("vx", "vy", "vz"),
    "attitude": tuple(f"attitude_{part}" for part in QUATERNION),
    "spin": tuple(f"spin_{axis}" for axis in COMPONENTS),
}
"""Names of the components of a vector, or a quaternion, in tables, where each has a column of its own."""


@dataclass(frozen=True)
class Variable:
    """One quantity of all bodies.

    values : float64, with axes `dims`: those of ("time", "body", "component", "quaternion") that it has, in this order
    unit : their unit
    """

    values: NDArray[np.float64]
    unit: u.UnitBase
    dims: tuple[str, ...]


@dataclass(frozen=True)
class Labelled:
    """Quantities of the same bodies, at one time or at several.

    names : the bodies
    times : (n,) since the epoch, a quantity, or None for a single state
    variables : by name
    attributes : further information, as strings and numbers, which every file format can hold
    epoch : of t = 0, a Time, or None; with an epoch, pandas and xarray have dates (`dates`) beside the times
    """

    names: tuple[str, ...]
    times: u.Quantity | None
    variables: Mapping[str, Variable]
    attributes: Mapping[str, str | float] = field(default_factory=dict)
    epoch: Time | None = None

    @property
    def dates(self) -> NDArray[np.datetime64] | None:
        """The times as datetime64[us], TDB, (n,); None without an epoch, and beyond the 290,000 years of that type.

        TDB has no leap seconds: every day has 86,400 seconds.
        """
        if self.times is None or self.epoch is None:
            return None
        days = self.times.to_value(u.day)
        if not np.all(np.abs(days) < MOST_DAYS):
            return None
        # Whole days and the rest separately: a float of days since J2000 resolves microseconds for some decades only.
        whole = np.floor(days)
        noon = np.floor(self.epoch.jd1 - J2000_JD) + whole
        rest = np.round((days - whole + (self.epoch.jd1 - J2000_JD) % 1.0 + self.epoch.jd2) * 86400e6)
        dates: NDArray[np.datetime64] = J2000 + noon.astype("m8[D]") + rest.astype("m8[us]")
        return dates

    def table(self) -> QTable:
        """Return a QTable with a row for each body, or for each time and body, by time; its meta has `attributes`."""
        from astropy.table import QTable

        columns = {
            name: values if unit is None else u.Quantity(values, unit, copy=False)
            for name, (values, unit) in self._columns().items()
        }
        return QTable(columns, meta=dict(self.attributes), copy=False)

    def pandas(self) -> pandas.DataFrame:
        """Return the rows of `table` as a DataFrame, indexed by body or by (time, body).

        Units are in `.attrs["units"]`. A run with an epoch has a column `date`.
        """
        package: Any = imported("pandas", "to_pandas")
        columns = self._columns()
        index = [name for name in ("time", "body") if name in columns]
        values = {name: values for name, (values, _) in columns.items()}
        known: dict[str, Any] = {"units": {name: str(unit) for name, (_, unit) in columns.items() if unit is not None}}
        dates = self.dates
        if dates is not None:
            values["date"], known["time_scale"] = np.repeat(dates, len(self.names)), TDB
        frame: pandas.DataFrame = package.DataFrame(values).set_index(index)
        frame.attrs = {**known, **self.attributes}
        return frame

    def xarray(self) -> xarray.Dataset:
        """Return a Dataset with the axes time, body and component, and quaternion for attitudes of rigid bodies.

        Units are in each variable's `.attrs["units"]`. With an epoch there is a coordinate `date` along time.
        """
        package: Any = imported("xarray", "to_xarray")
        coordinates: dict[str, Any] = {}
        if self.times is not None:
            coordinates["time"] = ("time", self.times.value, {"units": str(self.times.unit)})
        dates = self.dates
        if dates is not None:
            coordinates["date"] = ("time", dates, {"time_scale": TDB})
        coordinates["body"] = ("body", np.array(self.names, dtype=object))
        if any("component" in variable.dims for variable in self.variables.values()):
            coordinates["component"] = ("component", np.array(COMPONENTS, dtype=object))
        if any("quaternion" in variable.dims for variable in self.variables.values()):
            coordinates["quaternion"] = ("quaternion", np.array(QUATERNION, dtype=object))
        variables = {
            name: (variable.dims, variable.values, {"units": str(variable.unit)})
            for name, variable in self.variables.items()
        }
        dataset: xarray.Dataset = package.Dataset(variables, coordinates, dict(self.attributes))
        return dataset

    def _columns(self) -> dict[str, tuple[NDArray[Any], u.UnitBase | None]]:
        """Return the columns, flattened; for a run only those that depend on time."""
        names = np.array(self.names)
        columns: dict[str, tuple[NDArray[Any], u.UnitBase | None]] = {}
        if self.times is None:
            columns["body"] = (names, None)
        else:
            columns["time"] = (np.repeat(self.times.value, len(names)), self.times.unit)
            columns["body"] = (np.tile(names, len(self.times)), None)
        for name, variable in self.variables.items():
            if (self.times is not None) != ("time" in variable.dims):
                continue
            if {"component", "quaternion"} & set(variable.dims):
                for k, column in enumerate(COLUMNS[name]):
                    columns[column] = (variable.values[..., k].ravel(), variable.unit)
            else:
                columns[name] = (variable.values.ravel(), variable.unit)
        return columns


def imported(name: str, caller: str) -> ModuleType:
    """Return an optional package, for the method `caller`. Raises MissingPackageError if it cannot be imported."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingPackageError(
            f"{caller}() needs the package {name}, which cannot be imported ({error}). Install it with "
            "pip install 'orbits[tables]', or use to_table(), which works without it."
        ) from error
