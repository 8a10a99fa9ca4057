"""The closest approaches of a run, and those among them that its step could not resolve."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import StepWarning
from orbits.kernels.encounters import DISTANCE2, PARTNER, SPEED2, TIME
from orbits.propagation.binding import bound
from orbits.propagation.guidance import ALWAYS, UNRESOLVED, bold_angle, passage_error, percent
from orbits.system.checks import index_of

if TYPE_CHECKING:
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

    Distances between two steps are those of a cubic polynomial. approaches["Ceres"] gives the passages of one body;
    iterating gives all passages that are not by the dominant body, closest first.
    """

    def __init__(self, system: System, record: Array) -> None:
        self.names = system.names
        self._units, self._gm = system.units, system.values.gm
        self._distance, self._time, self._speed = record[DISTANCE2], record[TIME], record[SPEED2]
        self.partner = record[PARTNER].astype(int)

    @property
    def distance(self) -> u.Quantity:
        """Distances, (bodies, 2)."""
        return u.Quantity(self._distance, self._units.length)

    @property
    def time(self) -> u.Quantity:
        """Times since the epoch, (bodies, 2)."""
        return u.Quantity(self._time, self._units.time)

    @property
    def speed(self) -> u.Quantity:
        """Relative speeds, (bodies, 2)."""
        return u.Quantity(self._speed, self._units.speed)

    def __getitem__(self, name: str) -> list[Approach]:
        """Return the recorded passages of a body: by the dominant body, then by the closest other."""
        row = index_of(name, self.names, "body")
        return [self.one(row, column) for column in (0, 1) if math.isfinite(self._distance[row, column])]

    def __iter__(self) -> Iterator[Approach]:
        """Yield the passages that are not by the dominant body, each pair once, closest first."""
        seen = set()
        for row in np.argsort(self._distance[:, 1], kind="stable"):
            pair = frozenset((int(row), int(self.partner[row, 1])))
            if math.isfinite(self._distance[row, 1]) and pair not in seen:
                seen.add(pair)
                yield self.one(int(row), 1)

    def one(self, row: int, column: int, error: float | None = None) -> Approach:
        """Return one entry as an `Approach`."""
        pair = (row, int(self.partner[row, column]))
        lighter, heavier = sorted(pair, key=lambda body: self._gm[body])
        return Approach(
            self.names[lighter],
            self.names[heavier],
            u.Quantity(self._distance[row, column], self._units.length),
            u.Quantity(self._time[row, column], self._units.time),
            u.Quantity(self._speed[row, column], self._units.speed),
            error,
        )

    def __str__(self) -> str:
        rows = [f"{'body':24}{'passes':24}{'distance':>14}{'time':>14}{'speed':>14}"]
        for _, a in zip(range(SHOWN), self, strict=False):
            rows.append(f"{a.body:24}{a.other:24}{a.distance:14.6g}{a.time:14.6g}{a.speed:14.4g}")
        return "\n".join(rows)

    def __repr__(self) -> str:
        return f"Approaches({len(self.names)} bodies, closest {next(iter(self), None)})"


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
    ways2 = h * h * record[SPEED2]
    return bool((ways2 > ALWAYS**2 * record[DISTANCE2]).any()) and bool(
        (ways2 > bold_angle(integrator) ** 2 * record[DISTANCE2]).any()
    )


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
