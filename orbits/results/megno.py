"""MEGNO and Lyapunov exponents of a run, as values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.errors import InputError
from orbits.export import MOST_ROWS, Tabled, headed

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.system import System

Array = NDArray[np.float64]


REGULAR = 3.0
"""The largest MEGNO that is near 2: of that of regular orbits, which comes to 2 as oscillations die down. On a chaotic
orbit it is about half the time in units of the Lyapunov time, of which a smaller one tells nothing."""


@dataclass(frozen=True, repr=False)
class TangentGrowth:
    """The growth of tangent vectors along one orbit, (n,) each, at samples of a run.

    name : of the massless particle, or "all massive bodies"
    t : times since the epoch
    megno : the mean over all tangent vectors, eight by default; NaN at the start
    spread : their standard deviation; NaN for a single one
    lyapunov : ln(|x(t)| / |x(0)|) / t, their mean, 1 / time: it tends to the largest Lyapunov exponent on a chaotic
        orbit, and to 0, as ln(t) / t, on a regular one
    passage : of a particle in a map on Kepler orbits, the time of its first passage that the map cannot follow, near a
        planet or at a pericentre that the step does not resolve; None for none
    """

    name: str
    t: u.Quantity
    megno: Array
    spread: Array
    lyapunov: u.Quantity
    passage: u.Quantity | None = None

    def until(self, gone: NDArray[np.bool_]) -> TangentGrowth:
        """Return it with NaN at the samples at which the particle is gone, (n,)."""
        megno, spread, rate = (np.where(gone, np.nan, x) for x in (self.megno, self.spread, self.lyapunov))
        return replace(self, megno=megno, spread=spread, lyapunov=u.Quantity(rate))

    def _lyapunov_time(self) -> str:
        """Return the Lyapunov time at the last sample as it is printed, without its unit: "–" where MEGNO is near 2."""
        chaotic = self.megno[-1] > REGULAR and self.lyapunov[-1] > 0.0
        return f"{1.0 / self.lyapunov[-1].value:.3g}" if chaotic else "–"

    def __repr__(self) -> str:
        last = f", MEGNO {self.megno[-1]:.4g} at t = {self.t[-1]:g}" if len(self.t) else ""
        return f"TangentGrowth({self.name}, {len(self.t)} samples{last})"


class Megno(Tabled):
    """MEGNO and Lyapunov exponents along a run.

    massive : the `TangentGrowth` of all massive bodies together; None for bodies that are read from an ephemeris, whose
        motion depends on no start
    m["Ceres"] : that of a massless particle; m.particles : all of these, in the order of the system
    t : times since the epoch, (n,); made_by : method and steps, in words

    Each value is that after the last whole step before the sample.
    """

    def __init__(
        self, system: System, massive: TangentGrowth | None, particles: tuple[TangentGrowth, ...], made_by: str
    ) -> None:
        self.system, self.massive, self.particles, self.made_by = system, massive, particles, made_by

    def until(self, gone: NDArray[np.bool_]) -> Megno:
        """Return it with NaN at the samples at which massless particles are gone; gone : (n, bodies)."""
        rows = zip(self.particles, gone.T[~self.system.massive], strict=True)
        return Megno(self.system, self.massive, tuple(one.until(row) for one, row in rows), self.made_by)

    @property
    def t(self) -> u.Quantity:
        """Times since the epoch, (n,)."""
        return self._rows[0].t

    @property
    def _rows(self) -> tuple[TangentGrowth, ...]:
        return self.particles if self.massive is None else (self.massive, *self.particles)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the massless particles."""
        return tuple(particle.name for particle in self.particles)

    def __getitem__(self, name: str) -> TangentGrowth:
        """Return the growth along the orbit of a massless particle.

        Raises UnknownNameError for unknown names, InputError for massive bodies, which have only a common one.
        """
        index = index_of(name, self.system.names, "body") if isinstance(name, str) else -1
        if index >= 0 and self.system.massive[index] and self.massive is None:
            raise InputError(f"{self.system.names[index]!r} is read from an ephemeris, and depends on no start.")
        if index >= 0 and self.system.massive[index]:
            raise InputError(
                f"{self.system.names[index]!r} has mass, and the massive bodies move together: m.massive is the MEGNO "
                "of all of them. Massless particles have one each."
            )
        return self.particles[index_of(name, self.names, "massless particle")]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def to_table(self) -> QTable:
        """Return an astropy QTable with a row for each orbit at the last sample: body, megno, spread, lyapunov."""
        from astropy.table import QTable

        rows = self._rows
        columns = {
            "body": np.array([row.name for row in rows], dtype=str),
            "megno": np.array([row.megno[-1] for row in rows]),
            "spread": np.array([row.spread[-1] for row in rows]),
            "lyapunov": u.Quantity([row.lyapunov[-1] for row in rows]),
        }
        return QTable(columns, meta={"made_by": self.made_by})

    def _caption(self) -> str:
        meaning = "near 2: regular, without a Lyapunov time; growing with time: chaotic"
        return f"MEGNO at t = {self.t[-1]:g}, {self.made_by} ({meaning})"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        unit = self.system.units.time
        head = ["orbit", "MEGNO", "spread", headed("Lyapunov time", unit)]
        rows = [
            [row.name, f"{row.megno[-1]:.4g}", f"{row.spread[-1]:.2g}", row._lyapunov_time()]
            for row in self._rows[:MOST_ROWS]
        ]
        return head, rows, len(self._rows) - len(rows)
