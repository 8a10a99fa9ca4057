"""What a fit answers with: the orbit, its covariance, the residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.astrometry.observations import Observations
from orbits.astrometry.record import DELAY, DOPPLER, OPTICAL
from orbits.checks import finite_number
from orbits.errors import counted
from orbits.export import Valued
from orbits.finding import Finding
from orbits.fitting.correction import Problem, Solution
from orbits.fitting.initial import Root, normalized_rms
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


KINDS = {OPTICAL: "place", DELAY: "delay", DOPPLER: "Doppler shift"}

MEASURED = (
    *(("ra", OPTICAL, 0, u.arcsec), ("dec", OPTICAL, 1, u.arcsec)),
    *(("delay", DELAY, 0, u.us), ("doppler", DOPPLER, 0, u.Hz)),
)
"""Residuals by name, with the kind of the observation, which of its two they are, and the unit."""

MANY = 0.1
"""The part of the places whose rejection is told; that of radar always is."""


class Fitted(NamedTuple):
    """The value of a parameter, and its standard deviation."""

    value: u.Quantity
    sigma: u.Quantity


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Valued):
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
        and declination, (2,); NaN if there are none.
        """
        return u.Quantity(self._rms(OPTICAL), u.arcsec)

    def _rms(self, kind: str) -> Array:
        rows = self.used & (self.observations.kind == kind)
        return np.sqrt(np.mean(self._found.residuals[rows] ** 2, axis=0)) if rows.any() else np.full(2, np.nan)

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
        if at is not None and finite_number(times_since(system, at, "at"), "at") != 0.0:
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

        return of_residuals(self.residuals, "\n".join([f"{self.name}: observed less computed", *self._kinds()]))

    def _kinds(self) -> list[str]:
        """Return what there is of each kind of observation: how many, rejected ones, RMS of the others."""
        out = []
        for kind, what in KINDS.items():
            here = self.observations.kind == kind
            rms = [f"{self._rms(kind)[k]:.3g} {unit}" for _, of, k, unit in MEASURED if of == kind]
            left = f"{(here & ~self.used).sum():,} rejected, RMS {' and '.join(rms)}"
            out += [f"{counted(int(here.sum()), what)}, {left}"] * bool(here.any())
        return out

    def _caption(self) -> str:
        return (
            f"orbit of {self.name} at {self.epoch.iso[:16]} TDB from {'; '.join(self._kinds())}; normalized RMS "
            f"{self.normalized_rms:.3g}; relative to the Sun, ecliptic of J2000"
        )

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        kepler, comet = self.covariance("keplerian").rows(), self.covariance("cometary").rows()
        return ["", "unit", "value", "sigma"], [*kepler[:6], *comet[1:3], *kepler[6:]], 0


def telling_rejections(fit: Fit) -> Finding | None:
    """Return what is told of observations that are rejected if they may show what the model lacks, otherwise None."""
    rows = []
    for _, kind, k, unit in MEASURED:
        here = fit.observations.kind == kind
        left = here & ~fit.used
        if k == 0 and left.sum() > (MANY * here.sum() if kind == OPTICAL else 0):
            off = np.linalg.norm(fit._found.residuals[left], axis=1).max()
            most = f"by up to {off:.3g} {unit} (chi-squared {fit._found.chi2[left].max():.3g})"
            rows.append(f"{left.sum():,} of {counted(int(here.sum()), KINDS[kind])}, {most}")
    if not rows:
        return None
    return Finding(
        f"observations of {fit.name} are rejected that may show what the model lacks:",
        kind="observations rejected",
        rows=rows,
        remedy='Does it lack a force, such as parameters=["A2"]? Each is in fit.rejected.',
    )
