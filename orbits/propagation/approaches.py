"""The closest approaches of a run, and those among them that its step could not resolve."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import StepWarning
from orbits.kernels.encounters import DISTANCE2, PARTNER, SPEED2, TIME
from orbits.propagation.binding import bound
from orbits.propagation.guidance import ALWAYS, UNRESOLVED, bold_angle, passage_error, percent
from orbits.system.checks import index_of
from orbits.system.presenting import attributes, chosen
from orbits.tables import MOST_ROWS, headed, html_table, text_table

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.integrators.base import Integrator
    from orbits.system import System
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-7
"""An error of the velocity, as a share of itself, that is not worth a word."""

SHOWN = 10


@dataclass(frozen=True)
class Approach:
    """One closest approach: of a body to another, at a distance and a relative speed, at a time since the epoch.

    error : what the step got wrong of the turn of the relative velocity, between 0 and 1, where it was asked for
    """

    body: str
    other: str
    distance: u.Quantity
    time: u.Quantity
    speed: u.Quantity
    error: float | None = None

    def __str__(self) -> str:
        text = f"{self.body} to {self.other}: {self.distance:.4g} at t = {self.time:.6g}, {self.speed:.3g}"
        return text if self.error is None else f"{text}; the step got {percent(self.error)} of the turn wrong"


class Approaches:
    """The closest approaches of a run: of each body to the one that dominates the system, and to any other.

    names : of the bodies; distance, time, speed : (bodies, 2) with units, infinite where there was none
    partner : (bodies, 2) indices; column 0 is the dominant body (unused where no body has 90 % of the mass), column 1
        the closest other. For a massless particle, passages beyond three Hill radii of a planet (or 5 % of the planet's
        distance) are not recorded, and the closest is the smallest share of that.

    Distances between two steps are those of a cubic polynomial. approaches["Ceres"] gives the passages of one body.
    Iterating gives the closest passage of every body that is not by the dominant one, and the dominant body's own, each
    pair once, closest first; these are what len(approaches) counts, `to_table` holds, and print and notebooks begin.
    """

    def __init__(self, system: System, record: Array) -> None:
        self.names = system.names
        self._system = system
        self._distance, self._time, self._speed = record[DISTANCE2], record[TIME], record[SPEED2]
        self.partner = record[PARTNER].astype(int)

    @property
    def distance(self) -> u.Quantity:
        """Distances, (bodies, 2)."""
        return u.Quantity(self._distance, self._system.units.length)

    @property
    def time(self) -> u.Quantity:
        """Times since the epoch, (bodies, 2)."""
        return u.Quantity(self._time, self._system.units.time)

    @property
    def speed(self) -> u.Quantity:
        """Relative speeds, (bodies, 2)."""
        return u.Quantity(self._speed, self._system.units.speed)

    def __getitem__(self, name: str) -> list[Approach]:
        """Return the recorded passages of a body: by the dominant body, then by the closest other."""
        row = index_of(name, self.names, "body")
        return [self.one(row, column) for column in (0, 1) if math.isfinite(self._distance[row, column])]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def __len__(self) -> int:
        """Return how many passages iterating gives."""
        return len(self._closest)

    def __iter__(self) -> Iterator[Approach]:
        """Yield each body's passage by the closest other than the dominant body, each pair once, closest first."""
        return (self.one(int(row), 1) for row in self._closest)

    def to_table(self, bodies: Sequence[str] | None = None) -> QTable:
        """Return an astropy QTable of body, other, distance, time (since the epoch) and speed, closest first.

        A row for each passage that iterating gives; `body` is the lighter one. The meta has the epoch (TDB) and what
        else is known.

        bodies : names; only passages of one of them, all by default. UnknownNameError for one that is not there.
        """
        from astropy.table import QTable

        rows, light, heavy = self._closest, *self._pairs
        wanted = np.zeros(len(self.names), dtype=bool)
        wanted[chosen(self.names, bodies)] = True
        pick = wanted[light] | wanted[heavy]
        names = np.array(self.names)
        columns = {"body": names[light[pick]], "other": names[heavy[pick]]}
        columns |= {key: getattr(self, key)[rows[pick], 1] for key in ("distance", "time", "speed")}
        return QTable(columns, meta=attributes(self._system))

    @cached_property
    def _closest(self) -> NDArray[np.intp]:
        """The rows of the passages that iterating gives, in their order."""
        rows = np.argsort(self._distance[:, 1], kind="stable")
        rows = rows[np.isfinite(self._distance[rows, 1])]
        pairs = np.sort(np.column_stack([rows, self.partner[rows, 1]]), axis=1)
        _, first = np.unique(pairs, axis=0, return_index=True)
        closest: NDArray[np.intp] = rows[np.sort(first)]
        return closest

    @property
    def _pairs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The lighter and the heavier body of each passage that iterating gives."""
        rows = self._closest
        partner = self.partner[rows, 1]
        first = self._system.values.gm[rows] <= self._system.values.gm[partner]
        return np.where(first, rows, partner), np.where(first, partner, rows)

    def one(self, row: int, column: int, error: float | None = None) -> Approach:
        """Return one entry as an `Approach`."""
        pair = (row, int(self.partner[row, column]))
        lighter, heavier = sorted(pair, key=lambda body: self._system.values.gm[body])
        return Approach(
            self.names[lighter],
            self.names[heavier],
            u.Quantity(self._distance[row, column], self._system.units.length),
            u.Quantity(self._time[row, column], self._system.units.time),
            u.Quantity(self._speed[row, column], self._system.units.speed),
            error,
        )

    def __str__(self) -> str:
        return text_table(repr(self), *self._shown(), words=2)

    def _repr_html_(self) -> str:
        return html_table(repr(self), *self._shown(), words=2)

    def __repr__(self) -> str:
        bodies = f"Approaches({len(self.names)} bod{'y' if len(self.names) == 1 else 'ies'}"
        if not len(self):
            return f"{bodies}, none{' but by the dominant one' * bool(np.isfinite(self._distance).any())})"
        return f"{bodies}, {len(self):,} passage{'s' * (len(self) > 1)}, closest {next(iter(self))})"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        """Return the head of a table, its rows, those of the closest, and how many more there are."""
        units = self._system.units
        figures = {"distance": units.length, "time": units.time, "speed": units.speed}
        head = ["body", "passes", *(headed(key, unit) for key, unit in figures.items())]
        rows = [
            [a.body, a.other, *(f"{getattr(a, key).value:.6g}" for key in figures)] for a in islice(self, MOST_ROWS)
        ]
        return head, rows, len(self) - len(rows)


def in_units(record: Array, system: System, h: float) -> Array:
    """Return a marcher's record as (4, bodies, 2) in the order of the system: distances, times, speeds, partners."""
    massive = system.massive
    order = np.concatenate([np.flatnonzero(massive), np.flatnonzero(~massive)])
    out = np.empty((4, len(system), 2))
    out[:, order] = record[:, :, : len(system)].transpose(0, 2, 1)
    out[DISTANCE2], out[SPEED2] = np.sqrt(out[DISTANCE2]), np.sqrt(out[SPEED2])
    out[TIME] *= h
    out[PARTNER] = order[out[PARTNER].astype(int)]
    return out


def recorded(trajectory: Trajectory) -> Array:
    """Return what the run in an archive recorded, from its last checkpoint."""
    from orbits.archive import Archive

    assert trajectory.path is not None
    with Archive.open(trajectory.path) as archive:
        checkpoint = archive.checkpoint()
    marcher = bound(trajectory.system, trajectory.integrator, trajectory.step, threads=1)
    marcher.restore(checkpoint)
    return marcher.approaches()


def hasty(integrator: Integrator, h: float, record: Array) -> bool:
    """Return whether some passage of a marcher's record is so fast for steps of h that it may be unresolved."""
    ways, distances = abs(h) * np.sqrt(record[SPEED2]), np.sqrt(record[DISTANCE2])
    return bool((ways > ALWAYS * distances).any()) and bool((ways > bold_angle(integrator) * distances).any())


def unresolved(system: System, integrator: Integrator, h: float, record: Array) -> list[Approach]:
    """Return the passages whose turn of the velocity a step of h got wrong by more than `UNRESOLVED`, worst first.

    record : (4, bodies, 2), as `in_units` gives it
    """
    distance, speed, partner = record[DISTANCE2], record[SPEED2], record[PARTNER].astype(int)
    gm, softening = system.values.gm, system.values.softening
    with np.errstate(all="ignore"):
        mu = gm[:, None] + gm[partner]
        effective = np.sqrt(distance**2 + softening**2)
        angle = np.minimum(abs(h) * speed / effective, 1e6)
        eccentricity = np.maximum(effective * speed**2 / mu - 1.0, 0.0)
        worth = np.isfinite(distance) & (angle > ALWAYS) & (2.0 / np.maximum(eccentricity, 1.0) > NEGLIGIBLE)
    if worth.any():
        worth &= angle > bold_angle(integrator)
    approaches = Approaches(system, record)
    found, seen = [], set()
    for row, column in np.argwhere(worth):
        pair = frozenset((int(row), int(partner[row, column])))
        if pair in seen:
            continue
        seen.add(pair)
        error, turn = passage_error(integrator, float(eccentricity[row, column]), float(angle[row, column]))
        if error > UNRESOLVED and error * turn > NEGLIGIBLE:
            found.append((error * turn, approaches.one(int(row), int(column), error)))
    return [approach for _, approach in sorted(found, key=lambda pair: -pair[0])]


def warn(found: list[Approach], integrator: Integrator, h: float, unit: Any) -> None:
    """Warn, with `StepWarning`, of passages that were not resolved."""
    if found:
        more = f"\n  and {len(found) - SHOWN} more, in run.unresolved()" if len(found) > SHOWN else ""
        dt = f"{abs(h):.6g} {unit}".rstrip()
        warnings.warn(
            f"{integrator.label} with dt = {dt} did not resolve {len(found)} close passage"
            f"{'s' * (len(found) > 1)}; what comes after is not to be trusted for these bodies:\n  "
            + "\n  ".join(str(a) for a in found[:SHOWN])
            + more,
            StepWarning,
            stacklevel=4,
        )
