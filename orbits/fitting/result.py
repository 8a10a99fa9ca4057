"""What a fit answers with: the orbit, its covariance, the residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.errors import counted
from orbits.export import text_table
from orbits.fitting.correction import Problem, Solution
from orbits.fitting.initial import Root, normalized_rms
from orbits.fitting.observations import Observations
from orbits.fitting.record import DELAY, DOPPLER, OPTICAL
from orbits.fitting.valley import Variation
from orbits.propagation import propagate
from orbits.propagation.variations.deviations import Uncertain, spread
from orbits.results.covariance import Covariance, in_form
from orbits.system import System
from orbits.time_grid import times_since

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


MEASURED = (
    *(("ra", OPTICAL, 0, u.arcsec), ("dec", OPTICAL, 1, u.arcsec)),
    *(("delay", DELAY, 0, u.us), ("doppler", DOPPLER, 0, u.Hz)),
)
"""Residuals by name, with the kind of the observation, which of its two they are, and the unit."""


class Fitted(NamedTuple):
    """The value of a parameter, and its standard deviation."""

    value: u.Quantity
    sigma: u.Quantity


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """An orbit that was fitted to observations.

    system : at the epoch of the orbit, with the body; a run from it is the fitted orbit
    name : of the body; observations : all of them, also those that were rejected
    roots : those of Gauss's equation that were tried, or none if the fit began from a given orbit
    range : orbits from one end to the other of all that fit, where that is a wide range; see
        `orbits.fitting.valley.Variation`. Empty where the covariance tells it
    sigma : the uncertainties of optical ones that were used, (m, 2); used : which observations count, (m,)
    """

    system: System
    name: str
    observations: Observations
    roots: tuple[Root, ...]
    sigma: u.Quantity
    range: tuple[Variation, ...]
    _problem: Problem
    _found: Solution
    _matrix: Array

    @property
    def epoch(self) -> Time:
        """The date of the orbit, TDB."""
        return self.system.epoch

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which observations count, (m,)."""
        return self._found.used

    @property
    def rms(self) -> u.Quantity:
        """The root mean square of the residuals of optical observations that count, in right ascension times cos(dec)
        and declination, (2,).
        """
        rows = self.used & (self.observations.kind == OPTICAL)
        return u.Quantity(np.sqrt(np.mean(self._found.residuals[rows] ** 2, axis=0)), u.arcsec)

    @property
    def normalized_rms(self) -> float:
        """The root mean square of the residuals in units of their uncertainties: about 1 if these are right."""
        return normalized_rms(self._problem, self._found)

    @property
    def parameters(self) -> dict[str, Fitted]:
        """The parameters that were fitted, by name, such as "99942.A2": each with `value` and `sigma`, quantities."""
        rows = zip(self._problem.arc.parameters, self._found.start[6:], np.diag(self._matrix)[6:], strict=True)
        return {one.name: Fitted(value * one.unit, np.sqrt(square) * one.unit) for one, value, square in rows}

    def covariance(self, form: str = "cartesian", at: Any = None) -> Covariance:
        """Return the orbit with its covariance: that of the observations as they are weighted, not scaled by their RMS.

        form : "cartesian", relative to the barycentre, in the axes of the ICRF, au and au/d; "keplerian" (a, e, inc,
            Omega, omega, M) or "cometary" (e, q, T, Omega, omega, inc, as JPL's), relative to the Sun, in the ecliptic
            of J2000, au and degrees; T in days since the epoch, or since `at`. Parameters follow
        at : another date, to which the state alone is carried with its covariance, to first order
        Raises UnknownNameError for another form, InputError as `orbits.state_transition`.
        """
        system, start, matrix, parameters = self.system, self._found.start, self._matrix, self._problem.arc.parameters
        if at is not None and times_since(system, at, "at") != 0.0:
            run = propagate(system, until=at, samples=2)
            system, matrix, parameters = run[-1], spread(run, Uncertain.of(system, self), run.times[-1:])[0], ()
            start = np.concatenate([x[system.names.index(self.name)] for x in system.values[1:3]])
        sun = np.concatenate([x[system.names.index("Sun")] for x in system.values[1:3]])
        gm = float(system.values.gm[system.names.index("Sun")])
        return in_form(form, start, matrix, sun, gm, parameters, body=self.name, epoch=system.epoch)

    @property
    def residuals(self) -> QTable:
        """A table with a row for each observation: line, date (TDB), station, the residuals, observed less computed,
        with their uncertainties (NaN for those of other kinds), chi-squared relative to what is expected after the fit,
        and whether it counts.
        """
        table = self.observations.to_table()["line", "date", "kind", "station", "catalogue", "mode"]
        sigma = self._problem.sigma
        for name, kind, k, unit in MEASURED:
            here = self.observations.kind == kind
            if kind == OPTICAL or here.any():
                table[f"residual_{name}"] = u.Quantity(np.where(here, self._found.residuals[:, k], np.nan), unit)
                table[f"sigma_{name}"] = u.Quantity(np.where(here, sigma[:, k], np.nan), unit)
        table["chi2"] = self._found.chi2
        table["used"] = self.used
        return table

    @property
    def rejected(self) -> QTable:
        """Those rows of `residuals` that do not count, with the reason."""
        table = self.residuals[~self.used]
        off = np.linalg.norm(self._found.residuals[~self.used], axis=1)
        units = {kind: unit for _, kind, _, unit in MEASURED}
        table["reason"] = [
            f"{x * units[kind]:.3g} off, chi-squared {chi2:.3g}"
            for x, kind, chi2 in zip(off, table["kind"], table["chi2"], strict=True)
        ]
        return table

    def plot(self) -> Figure:
        """Return a picture of the residuals over time, a matplotlib Figure; rejected ones are crosses."""
        from orbits.plotting.residuals import of_residuals

        east, north = self.rms.value
        title = f"{self.name}: observed less computed, RMS {east:.2f}″ and {north:.2f}″"
        return of_residuals(self.residuals, title)

    def __repr__(self) -> str:
        east, north = self.rms.to_value(u.arcsec)
        left = int((~self.used).sum())
        caption = (
            f"orbit of {self.name} at {self.epoch.iso[:16]} TDB from {counted(len(self.used), 'observation')}, "
            f'{left:,} of them rejected; RMS {east:.3g}" in right ascension, {north:.3g}" in declination, normalized '
            f"{self.normalized_rms:.3g}; relative to the Sun, ecliptic of J2000"
        )
        return text_table(caption, ["", "unit", "value", "sigma"], self._rows(), words=2)

    def _rows(self) -> list[list[str]]:
        kepler, comet = self.covariance("keplerian").rows(), self.covariance("cometary").rows()
        return [*kepler[:6], *comet[1:3], *kepler[6:]]

    def _repr_html_(self) -> Any:
        from orbits.export import html_table

        caption, *_ = repr(self).split("\n", 1)
        return html_table(caption, ["", "unit", "value", "sigma"], self._rows(), words=2)
