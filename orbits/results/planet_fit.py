"""What the fit of a planetary system answers with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import counted
from orbits.export import Valued
from orbits.observing.measured import RadialVelocities, TransitTimes
from orbits.results.covariance import Covariance
from orbits.system import System
from orbits.units import date_text

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class PlanetFit(Valued):
    """A planetary system that was fitted to times of transits and radial velocities.

    system : at its epoch; a run from it is the fitted motion. Its terms and radii are those of the start: a star alone
        gives planets without radii, which fit.system.replaced(radii=...) adds
    transits, velocities : the measurements, None without them
    parameters : names, units, values, sigma, matrix (the covariance) and correlation of what was fitted: that of the
        measurements as they are weighted, not scaled by chi-squared. Mass ratios are those to the star; P, t0 (after
        the epoch) and e cos and e sin omega those of osculating orbits about the centre of mass of the bodies before,
        where t0 is the transit nearest to the epoch
    """

    system: System
    transits: TransitTimes | None
    velocities: RadialVelocities | None
    parameters: Covariance
    _off: Array
    _sigma: Array
    _offsets: Array

    @property
    def chi2(self) -> float:
        """The sum of the squared residuals in units of their sigmas."""
        return float(((self._off / self._sigma) ** 2).sum())

    @property
    def degrees_of_freedom(self) -> int:
        """The number of measurements less that of parameters."""
        return len(self._off) - len(self.parameters.values)

    @property
    def _count(self) -> int:
        return 0 if self.transits is None else len(self.transits)

    def transit_residuals(self) -> QTable:
        """Return a table with a row for each transit: planet, number, date, o_minus_c and its sigma, the measured time
        less that of the linear ephemeris with the least squares, computed, the same of the fit, and residual.
        """
        from astropy.table import QTable

        if self.transits is None:
            return QTable()
        linear = np.zeros(self._count)
        for name in self.transits.planets:
            rows = self.transits.planet == name
            linear[rows] = self.transits.linear(name).at(self.transits.number[rows])
        time = self.system.units.time
        off = u.Quantity(self._off[: self._count], time).to(u.min)
        o_minus_c = ((self.transits.time.jd1 - linear) + self.transits.time.jd2) * u.day.to(u.min) * u.min
        columns = {"planet": self.transits.planet, "number": self.transits.number, "date": self.transits.time}
        columns |= {"o_minus_c": o_minus_c, "sigma": self.transits.sigma.to(u.min)}
        return QTable(columns | {"computed": o_minus_c - off, "residual": off})

    def velocity_residuals(self) -> QTable:
        """Return a table with a row for each radial velocity: instrument, date, velocity, less the offset of its
        instrument, sigma, with the jitter, computed, and residual.
        """
        from astropy.table import QTable

        if self.velocities is None:
            return QTable()
        unit = u.m / u.s
        off, sigma, offset = (u.Quantity(x[self._count :], unit) for x in (self._off, self._sigma, self._offsets))
        velocity = self.velocities.velocity - offset
        columns = {"instrument": self.velocities.instrument, "date": self.velocities.time, "velocity": velocity}
        return QTable(columns | {"sigma": sigma, "computed": velocity - off, "residual": off})

    @property
    def jitter(self) -> dict[str, u.Quantity]:
        """What is to be added in quadrature to the sigmas of each instrument, so that its chi-squared is as expected of
        so many measurements less their share of the parameters; zero if it is less already.
        """
        if self.velocities is None:
            return {}
        off, sigma = self._off[self._count :], self.velocities.sigma.value
        share = self.degrees_of_freedom / len(self._off)
        out = {}
        for name in self.velocities.instruments:
            rows = self.velocities.instrument == name
            r, s, expected = off[rows] ** 2, sigma[rows] ** 2, rows.sum() * share
            low, high = 0.0, float(r.max() / share)
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if (r / (s + middle)).sum() > expected else (low, middle)
            out[name] = u.Quantity(np.sqrt(low), u.m / u.s)
        return out

    def plot(self) -> Figure:
        """Return a picture, a matplotlib Figure: O - C of each planet, and radial velocities, with what is computed."""
        from orbits.plotting.planets import of_fit

        return of_fit(self)

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        known = self.parameters.rows()
        rows = [[name, f"{unit} after the epoch" if name.endswith(".t0") else unit, *x] for name, unit, *x in known]
        return ["", "unit", "value", "sigma"], rows, 0

    def _caption(self) -> str:
        known = [] if self.transits is None else [counted(len(self.transits), "transit")]
        known += [] if self.velocities is None else [f"{len(self.velocities):,} radial velocities"]
        epoch: Any = self.system.epoch
        planets = f"{counted(len(self.system) - 1, 'planet')} of {self.system.names[0]}"
        return (
            f"{planets} at {date_text(epoch, 19)} TDB (JD {float(epoch.tdb.jd)!r}) from {' and '.join(known)}; "
            f"chi-squared {self.chi2:.6g}, {self.degrees_of_freedom:,} degrees of freedom"
        )
