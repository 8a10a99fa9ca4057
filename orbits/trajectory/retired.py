"""Retired massless particles of a run: names, times, last states and reasons; and systems without them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import Named, index_of
from orbits.checks import place_in
from orbits.export import MOST_ROWS, Tabled, headed
from orbits.units import date_text, written

if TYPE_CHECKING:
    from astropy.table import QTable
    from astropy.time import Time

    from orbits.marching.clocks.clock import Clock
    from orbits.system import System
    from orbits.trajectory.changes import Changes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RetiredParticle:
    """A massless particle that could not be integrated any further.

    name : of the body; reason : in words
    step : number of steps of the run that it took; time : after these steps, since the epoch; in a run without dt,
        after the steps of its own that it took beyond; of one that merged, the time of the impact
    date : the time as a Time (TDB), or None without an epoch
    q, v : its last state, (3,), at that time
    """

    name: str
    reason: str
    step: int
    time: u.Quantity
    date: Time | None
    q: u.Quantity
    v: u.Quantity

    def __str__(self) -> str:
        when = f"t = {self.time:.10g}" if self.date is None else f"{date_text(self.date, 16)} TDB, t = {self.time:.10g}"
        return f"{self.name}: {when}, step {self.step + 1:,}: {self.reason}"


class RetiredParticles(Named, Tabled, Sequence[RetiredParticle]):
    """The retired particles of a run, in the order of its bodies, by index or name. Empty for most runs."""

    def __init__(self, particles: Iterable[RetiredParticle] = ()) -> None:
        self._particles = tuple(particles)

    @classmethod
    def of(
        cls,
        system: System,
        clock: Clock,
        rows: Iterable[tuple[int, int, float, str, Array, Array]],
        changes: Changes | None,
    ) -> RetiredParticles:
        """Return particles from rows of (body, step, reading, reason, q, v), in the units of the system, by the run's
        clock.

        changes : of the bodies of the run, which have the times of mergers
        """
        rows = list(rows)
        units, epoch = system.units, system.epoch if rows else None
        vanished = {} if changes is None else changes.vanished()
        particles = []
        for body, step, reading, reason, q, v in rows:
            time = u.Quantity(vanished.get(body, clock.time(reading)) + 0.0, units.time)  # not -0
            date = None if epoch is None else written(epoch + time)
            place, speed = u.Quantity(q, units.length), u.Quantity(v, units.speed)
            particles.append(RetiredParticle(system.names[body], reason, step, time, date, place, speed))
        return cls(particles)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the bodies."""
        return tuple(particle.name for particle in self._particles)

    def __len__(self) -> int:
        return len(self._particles)

    @overload
    def __getitem__(self, key: int | str) -> RetiredParticle: ...

    @overload
    def __getitem__(self, key: slice) -> RetiredParticles: ...

    def __getitem__(self, key: int | str | slice) -> RetiredParticle | RetiredParticles:
        """Return one by index or name, or several by a slice. Raises UnknownNameError for one that is not retired, and
        OutOfRangeError.
        """
        if isinstance(key, slice):
            return RetiredParticles(self._particles[key])
        if isinstance(key, str):
            return self._particles[index_of(key, self.names, "retired particle")]
        expected = 'an index, run.retired[-1], a slice, run.retired[:10], or a name, run.retired["Ceres"]'
        return self._particles[place_in(len(self), key, "run.retired", "retired particles", expected)]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def to_table(self) -> QTable:
        """Return an astropy QTable of body, date (TDB, if there is an epoch), time, step, q, v and reason."""
        from astropy.table import QTable

        columns: dict[str, Any] = {"body": np.array(self.names, dtype=str)}
        if not len(self):
            return QTable(columns)
        if self[0].date is not None:
            columns["date"] = written(self[0].date - self[0].time + u.Quantity([p.time for p in self]))
        columns["time"] = u.Quantity([p.time for p in self])
        columns["step"] = np.array([p.step for p in self], dtype=np.int64)
        columns["q"], columns["v"] = u.Quantity([p.q for p in self]), u.Quantity([p.v for p in self])
        columns["reason"] = np.array([p.reason for p in self], dtype=str)
        return QTable(columns)

    def to_records(self) -> list[dict[str, Any]]:
        """Return records for JSON, with times, positions and velocities in the units of the system."""
        return [
            {
                "body": p.name,
                "time": float(p.time.value),
                "date": None if p.date is None else date_text(p.date, between="T"),
                "step": p.step,
                "reason": p.reason,
                "q": p.q.value.tolist(),
                "v": p.v.value.tolist(),
            }
            for p in self
        ]

    @property
    def _text_columns(self) -> int:
        return 2 + (len(self) > 0 and self[0].date is not None)

    def _caption(self) -> str:
        return "no retired particles" if not len(self) else f"{len(self):,} retired particle{'s' * (len(self) > 1)}"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        if not len(self):
            return [], [], 0
        dated, one = self[0].date is not None, self[0]
        head = ["body", "reason", *["date (TDB)"] * dated, headed("time", one.time.unit), "steps"]
        head += [headed(name, one.q.unit) for name in "xyz"]
        rows = []
        for p in self._particles[:MOST_ROWS]:
            date = [] if p.date is None else [date_text(p.date, 16)]
            place = (f"{x:.6g}" for x in p.q.value)
            rows.append([p.name, p.reason, *date, f"{p.time.value:.10g}", f"{p.step:,}", *place])
        return head, rows, len(self) - len(rows)


def absent(q: Array, v: Array, massive: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which bodies are massless and all NaN, (bodies,), as particles are after their retirement."""
    nothing = np.isnan(q).all(axis=-1) & np.isnan(v).all(axis=-1)
    return np.asarray(nothing & ~massive)


def moved(system: System, q: Array, v: Array, time: float, gone: NDArray[np.bool_]) -> System:
    """Return a system with a new state, a time later, without the bodies that are `gone`, (bodies,) bool."""
    later = u.Quantity(time, system.units.time)
    begun = system.epoch
    epoch = None if begun is None else begun + later
    if system.terms or system.forces:
        terms, forces = [term.later(later) for term in system.terms], [force.later(later) for force in system.forces]
        system = system.replaced(terms=terms, forces=forces)
    if not gone.any():
        return system.replaced(q=q, v=v, epoch=epoch)
    names = {system.names[i] for i in np.flatnonzero(gone)}
    return system.remove(*names).replaced(q=q[~gone], v=v[~gone], epoch=epoch)
