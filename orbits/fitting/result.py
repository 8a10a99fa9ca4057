"""What a fit answers with: the orbit, its covariance, the residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.errors import counted
from orbits.export import text_table
from orbits.fitting.correction import Solution
from orbits.fitting.initial import Root
from orbits.fitting.observations import Observations
from orbits.fitting.uncertainty import Covariance, in_form
from orbits.system import System

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """An orbit that was fitted to observations.

    system : at the epoch of the orbit, with the body; a run from it is the fitted orbit
    name : of the body; observations : all of them, also those that were rejected
    roots : those of Gauss's equation that were tried, or none if the fit began from a given orbit
    sigma : the uncertainties that were used, (m, 2); used : which observations count, (m,)
    """

    system: System
    name: str
    observations: Observations
    roots: tuple[Root, ...]
    sigma: u.Quantity
    _found: Solution
    _matrix: Array
    _normalized: float

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
        """The root mean square of the residuals of the observations that count, in right ascension times cos(dec) and
        declination, (2,).
        """
        return u.Quantity(np.sqrt(np.mean(self._found.residuals[self.used] ** 2, axis=0)), u.arcsec)

    @property
    def normalized_rms(self) -> float:
        """The root mean square of the residuals in units of their uncertainties: about 1 if these are right."""
        return self._normalized

    def covariance(self, form: str = "cartesian") -> Covariance:
        """Return the orbit with its covariance: that of the observations as they are weighted, not scaled by their RMS.

        form : "cartesian", relative to the barycentre, in the axes of the ICRF, au and au/d; "keplerian" (a, e, inc,
            Omega, omega, M) or "cometary" (e, q, T, Omega, omega, inc, as JPL's), relative to the Sun, in the ecliptic
            of J2000, au and degrees; T in days since the epoch
        Raises UnknownNameError for another form.
        """
        gm, q, v, _ = self.system.values
        sun, body = self.system.names.index("Sun"), self.system.names.index(self.name)
        states = np.concatenate([q, v], axis=1)
        return in_form(form, states[body], self._matrix, states[sun], float(gm[sun]))

    @property
    def residuals(self) -> QTable:
        """A table with a row for each observation: line, date (TDB), station, the residuals, observed less computed,
        with their uncertainties, chi-squared relative to what is expected after the fit, and whether it counts.
        """
        table = self.observations.to_table()["line", "date", "station", "catalogue", "mode"]
        for k, name in enumerate(("ra", "dec")):
            table[f"residual_{name}"] = u.Quantity(self._found.residuals[:, k], u.arcsec)
            table[f"sigma_{name}"] = self.sigma[:, k]
        table["chi2"] = self._found.chi2
        table["used"] = self.used
        return table

    @property
    def rejected(self) -> QTable:
        """Those rows of `residuals` that do not count, with the reason."""
        table = self.residuals[~self.used]
        off = np.hypot(table["residual_ra"], table["residual_dec"])
        table["reason"] = [
            f"{x:.3g} off, chi-squared {chi2:.3g}" for x, chi2 in zip(off, table["chi2"], strict=True)
        ]
        return table

    def plot(self) -> Figure:
        """Return a picture of the residuals over time, a matplotlib Figure; rejected ones are crosses."""
        from orbits.fitting.picture import of_residuals

        return of_residuals(self)

    def __repr__(self) -> str:
        east, north = self.rms.to_value(u.arcsec)
        left = int((~self.used).sum())
        caption = (
            f"orbit of {self.name} at {self.epoch.iso[:16]} TDB from {counted(len(self.used), 'observation')}, "
            f"{left:,} of them rejected; RMS {east:.3g}\" in right ascension, {north:.3g}\" in declination, normalized "
            f"{self.normalized_rms:.3g}; relative to the Sun, ecliptic of J2000"
        )
        return text_table(caption, ["", "unit", "value", "sigma"], self._rows(), words=2)

    def _rows(self) -> list[list[str]]:
        kepler, comet = self.covariance("keplerian").rows(), self.covariance("cometary").rows()
        return [*kepler, *comet[1:3]]

    def _repr_html_(self) -> Any:
        from orbits.export import html_table

        caption, *_ = repr(self).split("\n", 1)
        return html_table(caption, ["", "unit", "value", "sigma"], self._rows(), words=2)
