"""The fit of a planetary system to times of transits and radial velocities.

The model is that of the system: Newton's attraction of all bodies and its terms, without light time. Its derivatives
are differences, in steps that change the residuals by a hundredth of their sigmas.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, TypedDict, Unpack

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.checks import checked_flag
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import ConvergenceError, InputError, IntegrationError, SystemsError, UnknownNameError, shown
from orbits.fitting.least_squares import Fitted, Linear, least_squares
from orbits.observing.measured import RadialVelocities, TransitTimes
from orbits.propagation.planetary import ELEMENTS, MOST_E, Model, checked_start, elements_of, with_planets
from orbits.results.covariance import Covariance
from orbits.results.planet_fit import PlanetFit
from orbits.time_grid import times_since
from orbits.units import SMALLEST_PLAIN_JULIAN_DATE

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

USUAL = ELEMENTS[:5]

OfPlanets = TransitTimes | RadialVelocities | Sequence[TransitTimes | RadialVelocities]
"""What is measured of a star and its planets."""

LEAST_MASS = 1e-12
"""The least mass ratio: a planet of which the measurements tell nothing does not converge."""

RELATIVE = np.array([True, True, True, False, False, False, False])
FIRST_STEPS = (1e-2, 1e-7, 1e-6, 1e-5, 1e-5, 1e-4, 1e-4)
"""The first steps of differences: of the mass ratio relative to it, of P and t0 relative to P, of others as such."""

STEP, MOST_LARGER = 0.01, 100.0
"""By how much later ones change the residuals, in sigmas, for derivatives within a per cent, a tenth as a rule; and how
many times the first ones they are at most.
"""

CONVERGED = 1e-2
"""A step of so many of its own sigmas, in each parameter, is the last one."""

SINGULAR = 1e-5
"""Directions whose derivatives are smaller than this, relative to the largest, are not determined: so well are
differences known.
"""

WIDEST = (1.0, 1.0, 1.0, 1.0, 1.0, np.pi, np.pi)
"""The sigmas of parameters that are not determined: all that they can be, P and t0 relative to P."""

DAMPING = 1e-3
"""Of the first step: the start may be far off."""


@dataclass
class Problem:
    """What is fitted: some elements of the planets, and a zero of each instrument.

    start : elements, (planets, 7); free : which of them are fitted; measured, sigma : (m,); zeros : (m, instruments), 1
    where an instrument measured; steps : of the differences, (parameters,), those of the last derivatives,
    and largest, at most; widest : sigmas of what is not determined; labels : the names of the parameters
    """

    model: Model
    start: Array
    free: NDArray[np.bool_]
    measured: Array
    sigma: Array
    zeros: Array
    steps: Array
    largest: Array
    widest: Array
    labels: Sequence[str]

    @property
    def count(self) -> int:
        """The number of elements that are fitted."""
        return int(self.free.sum())

    def elements(self, x: Array) -> Array:
        """Return the elements of all planets for parameters."""
        out = self.start.copy()
        out[self.free] = x[: self.count]
        return out

    def folded(self, x: Array) -> Array:
        """Return parameters of the same motion, with each t0 the transit nearest to the epoch."""
        now = self.elements(x)
        now[:, 2] -= now[:, 1] * np.rint(now[:, 2] / now[:, 1])
        return np.append(now[self.free], x[self.count :])

    def check_sigmas(self, now: Fitted) -> None:
        """Raise ConvergenceError if a parameter may be anything, by the derivatives."""
        share = np.sqrt(np.diag(Linear.of(now.derivatives).covariance()))[: self.count] / self.widest
        if share.max(initial=0.0) > 1.0:
            raise ConvergenceError(self.failure(now, int(share.argmax())))

    def failure(self, last: Fitted, weak: int | None) -> str:
        """Return what is told of a fit that does not converge, or of a parameter that is not determined."""
        if weak is None:
            self.check_sigmas(last)
            return "the fit of the planets does not converge; begin nearer to it, or fit fewer parameters."
        weakest = self.labels[weak]
        return f"the measurements do not determine all parameters, least {weakest}; fit fewer: elements=[...]."

    def residuals(self, x: Array, known: None = None) -> tuple[Array, None]:
        """Return measured less computed, in sigmas; infinite where there is no such motion."""
        now, nothing = self.elements(x), np.full(len(self.sigma), np.inf)
        mass, P, _, k, h, inc, _ = now.T
        if not ((np.hypot(k, h) <= MOST_E) & (mass >= LEAST_MASS) & (P > 0.0) & (abs(inc / np.pi - 0.5) <= 0.5)).all():
            return nothing, None
        try:
            off = (self.measured - self.model.computed([now])[0] - self.zeros @ x[self.count :]) / self.sigma
        except (IntegrationError, SystemsError):
            return nothing, None
        return off if np.isfinite(off).all() else nothing, None

    def derivatives(self, x: Array, known: None = None) -> Array:
        """Return the derivatives of what is computed, in sigmas, (m, parameters); their error is about a thousandth."""
        shifts = np.zeros((self.count + 1, len(x)))
        shifts[1:, : self.count] = np.diag(self.steps)
        here, *moved = self.model.computed([self.elements(x + shift) for shift in shifts])
        by_elements = (np.array(moved) - here).T / self.steps / self.sigma[:, None]
        if not np.isfinite(by_elements).all():
            raise ConvergenceError("the fit comes to where a planet does not transit; begin nearer, or fit less.")
        size = np.linalg.norm(by_elements, axis=0)
        self.steps = np.minimum(STEP / np.maximum(size, 1e-300), self.largest)
        return np.concatenate([by_elements, self.zeros / self.sigma[:, None]], axis=1)

    def solved(self) -> Fitted:
        """Return the parameters, the residuals in sigmas, and their derivatives. Raises ConvergenceError."""
        first = self.measured - self.model.computed([self.start])[0]
        x = np.append(self.start[self.free], np.linalg.lstsq(self.zeros, first, rcond=None)[0])
        start, limits = Fitted(x, *self.residuals(x), self.derivatives(x)), {"enough": CONVERGED, "singular": SINGULAR}
        found = least_squares(self.residuals, self.derivatives, start, self.failure, damping=DAMPING, **limits)
        x = self.folded(found.x)
        if not np.array_equal(x, found.x):
            found = found._replace(x=x, derivatives=self.derivatives(x))
        self.check_sigmas(found)
        return found


class PlanetOptions(TypedDict, total=False):
    """The options of `fit_planets`."""

    elements: Sequence[str]
    jitter: Any
    interacting: bool


def of_planets(observations: Any) -> bool:
    """Return whether these are measurements of a star and its planets."""
    several = observations if isinstance(observations, list | tuple) else [observations]
    return len(several) > 0 and all(isinstance(one, TransitTimes | RadialVelocities) for one in several)


def fit_planets(
    observations: OfPlanets,
    system: Any,
    *,
    elements: Sequence[str] = USUAL,
    jitter: Any = None,
    interacting: bool = True,
    **others: Unpack[NoOthers],
) -> PlanetFit:
    """Return the planetary system that fits the times of transits and radial velocities; what `orbits.fit` calls.

    observations : `orbits.TransitTimes`, `orbits.RadialVelocities`, or a list of these
    system : the star, which is the first body, and its planets about where they are, at the epoch of the elements that
        are fitted: seen along z, as given with frame="sky"; or for transits the star alone, from which a fit begins
        with circular orbits that have their periods. Its mass is that of the star, which is not fitted
    elements : which are fitted of each planet: of "mass_ratio" (to the star), "P", "t0" (the transit nearest to the
        epoch, on the orbit at the epoch), "ecosw", "esinw" (e cos and e sin omega), the default, "inc" and "Omega"; of
        one planet "b.inc". Others stay as in the system. Each instrument has an offset besides
    jitter : what is added in quadrature to the sigmas of radial velocities, a speed, or one by instrument
    interacting : False lets each planet move alone with the star, on Kepler's orbit, and adds what they do to it

    Raises InputError for other systems, if planets do not pass near the times of transits, and if they go round more
    or less often between them than their numbers say; UnknownNameError for an unknown planet, element or instrument;
    ConvergenceError if the fit does not converge, or if the measurements do not determine its parameters.
    """
    for name in others:
        raise unknown_argument(fit_planets, name)
    checked_flag(interacting, "interacting")
    several: Any = observations if isinstance(observations, list | tuple) else [observations]
    transits: TransitTimes | None = _together(one for one in several if isinstance(one, TransitTimes))
    velocities: RadialVelocities | None = _together(one for one in several if isinstance(one, RadialVelocities))
    for one in several:
        if len(one) and one.time.jd.min() < SMALLEST_PLAIN_JULIAN_DATE:
            raise InputError(
                f"the times of {one} begin at JD {one.time.jd.min():.9g}, before 1976 BC; expected Julian dates. If "
                "days count from another date, add it, or read the file with it: zero=2400000.5 of modified dates."
            )
    system = checked_start(with_planets(system, transits))
    planets = system.names[1:]
    free = _free(elements, planets)
    none = np.zeros(0)
    since = none if transits is None else times_since(system, transits.time, "times")
    at = none if velocities is None else times_since(system, velocities.time, "times")
    names = () if transits is None else transits.planet.tolist()
    planet = np.array([index_of(name, planets, "planet") + 1 for name in names], dtype=np.int64)
    numbers = np.arange(1, len(planets) + 1)
    model = Model(system, since, planet, at, (numbers,) if interacting else tuple(numbers[:, None]))

    sigma = none if transits is None else system.units.time_value(transits.sigma)
    measured, instruments = since, np.zeros(0, dtype=str)
    zeros = np.zeros((len(since), 0))
    if velocities is not None:
        instruments = np.array(velocities.instruments)
        measured = np.concatenate([since, velocities.velocity.value])
        sigma = np.concatenate([sigma, np.hypot(velocities.sigma.value, velocities.each(jitter, "jitter"))])
        own = (velocities.instrument[:, None] == instruments).astype(np.float64)
        zeros = np.concatenate([np.zeros((len(since), len(instruments))), own])
    elif jitter is not None:
        raise InputError(f"jitter is {shown(jitter)}, but there are no radial velocities.")
    labels = [f"{planets[i]}.{ELEMENTS[k]}" for i, k in np.argwhere(free)]
    labels += [f"{name}.offset" for name in instruments]
    if not 0 < len(labels) <= len(sigma):
        raise InputError(
            f"{len(sigma)} measurements do not determine {len(labels)} parameters; expected one parameter at "
            'least, and no more than there are measurements. Choose them, such as by elements=["P", "t0"].'
        )
    start = elements_of(system)
    steps = (np.array(FIRST_STEPS) * np.where(RELATIVE, start[:, [0, 1, 1, 3, 4, 5, 6]], 1.0))[free]
    widest = (np.array(WIDEST) * np.where([False, True, True, False, False, False, False], start[:, 1:2], 1.0))[free]
    problem = Problem(model, start, free, measured, sigma, zeros, steps, MOST_LARGER * steps, widest, labels)
    missed = np.isnan(model.computed([start])[0])
    if transits is not None and missed.any():
        k = int(np.flatnonzero(missed)[0])
        raise InputError(
            f"planet {transits.planet[k]} of the start does not pass in front of the star near {transits.time[k].iso} "
            "TDB; expected periods and transits as orbits.TransitTimes.linear has them, inc=90 * u.deg, frame='sky'."
        )
    x, off, _, white = problem.solved()
    if transits is not None:
        P = u.Quantity(problem.elements(x)[:, 1], system.units.time).to_value(u.day)
        for name in transits.planets:
            transits.check_orbits(name, P[index_of(name, planets)])
    of = {"P": system.units.time, "t0": system.units.time, "inc": u.rad, "Omega": u.rad, "offset": u.m / u.s}
    units = tuple(of.get(label.rsplit(".", 1)[1], u.one) for label in labels)
    best = Covariance("planetary", tuple(labels), units, x, Linear.of(white).covariance())
    offsets = zeros @ x[int(free.sum()) :]
    return PlanetFit(model.made(problem.elements(x)), transits, velocities, best, off * sigma, sigma, offsets)


def _together(measured: Iterable[Any]) -> Any:
    """Return several sets of measurements as one, None without any."""
    sets = list(measured)
    return reduce(add, sets) if sets else None


def _free(elements: Sequence[str], planets: Sequence[str]) -> NDArray[np.bool_]:
    """Return which elements are fitted, (planets, 7). Raises InputError and UnknownNameError."""
    if not np.iterable(elements):
        raise InputError(f'elements is {shown(elements)}; expected a list of names, such as ["P", "t0", "b.inc"].')
    free = np.zeros((len(planets), len(ELEMENTS)), dtype=bool)
    for given in [elements] if isinstance(elements, str) else elements:
        *planet, element = str(given).rsplit(".", 1)
        if element not in ELEMENTS or (planet and planet[0] not in planets):
            raise UnknownNameError(
                f"there is no element {shown(given)}; expected {', '.join(ELEMENTS)}, or with the name of a planet, "
                f"{planets[0]}.inc."
            )
        free[[planets.index(planet[0])] if planet else slice(None), ELEMENTS.index(element)] = True
    return free
