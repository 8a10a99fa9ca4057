"""One problem as floats, and what a method made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbits.point_masses import PointMasses
from orbits.regression.conserved_quantities import Invariants
from orbits.regression.report import Row, Series
from orbits.system import System
from orbits.system.model import require_newtonian

Array = NDArray[np.float64]

_YEARS_FROM_DAYS = 700.0  # a run at least this long is drawn in years


@dataclass(frozen=True)
class Problem:
    """The start as floats in the system's units, and the units in which results are reported.

    start : gm (bodies,), q and v (bodies, 3), softening
    length : the system's length unit in `length_unit`, which is "km", or "" for pure numbers
    followed : (bodies,) bool, whose position error the series follow: the massive bodies, or all where one is alone
    """

    names: tuple[str, ...]
    start: PointMasses
    length: float
    length_unit: str

    @classmethod
    def of(cls, system: System) -> Problem:
        """The problem that `system` poses."""
        from astropy import units as u

        require_newtonian(system, "the comparison with REBOUND")
        physical = system.units.length.is_equivalent(u.km)
        return cls(
            names=tuple(system.names),
            start=system.values,
            length=float(system.units.length.to(u.km)) if physical else 1.0,
            length_unit="km" if physical else "",
        )

    @property
    def massive(self) -> NDArray[np.bool_]:
        """Which bodies attract, (bodies,)."""
        return self.start.massive

    @property
    def followed(self) -> NDArray[np.bool_]:
        """Which bodies count in a series of position errors."""
        return self.massive if np.count_nonzero(self.massive) > 1 else np.ones_like(self.massive)

    @property
    def massive_names(self) -> tuple[str, ...]:
        """Names of the bodies that attract."""
        return tuple(name for name, attracts in zip(self.names, self.massive, strict=True) if attracts)

    def distances(self, q: Array, reference: Array) -> Array:
        """Distance of each body to its reference, (samples, bodies), in the unit of reports."""
        return np.asarray(np.linalg.norm(q - reference, axis=-1) * self.length)


@dataclass(frozen=True)
class Sampled:
    """What a method made of the problem: its samples, or why there are none.

    q, v : (samples, bodies, 3) in the system's units, None where the method failed or could not start
    """

    method: str
    kind: str
    q: Array | None = None
    v: Array | None = None
    steps: int | None = None
    wall_s: float | None = None
    compile_s: float | None = None
    note: str = ""

    def measured(self, problem: Problem, invariants: Invariants, reference: Array | None) -> Row:
        """The row of the report, not yet judged: errors of energy, angular momentum and position."""
        if self.q is None or self.v is None:
            return Row(self.method, self.kind, "n/a", compile_s=self.compile_s, note=self.note)
        energy, momentum = invariants.errors(self.q, self.v)
        position = np.full(len(self.q), np.nan)
        positions: dict[str, float] = {}
        worst = None
        if reference is not None:
            distances = problem.distances(self.q, reference)
            largest = distances.max(axis=0)
            positions = dict(zip(problem.names, largest.tolist(), strict=True))
            worst = problem.names[int(np.argmax(largest))]
            position = distances[:, problem.followed].max(axis=1)
        return Row(
            self.method,
            self.kind,
            "peer",
            steps=self.steps,
            wall_s=self.wall_s,
            compile_s=self.compile_s,
            energy=_largest(energy),
            angular_momentum=_largest(momentum),
            position=positions[worst] if worst is not None else None,
            worst_body=worst,
            positions=positions,
            note=self.note,
            series=Series(energy, momentum, position),
        )


def time_axis(times: Array, in_days: float | None) -> tuple[Array, str]:
    """Times and their unit for tables and pictures: days or years where the unit of time is `in_days` days."""
    if in_days is None:
        return times, ""
    days = times * in_days
    return (days / 365.25, "yr") if np.abs(days).max() > _YEARS_FROM_DAYS else (days, "d")


def _largest(series: Array) -> float | None:
    largest = float(series.max())  # NaN when any sample is: an error that cannot be had is no small error
    return None if np.all(np.isnan(series)) else largest
