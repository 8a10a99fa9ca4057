"""`orbits.fit`: from observations to an orbit with its covariance."""

from __future__ import annotations

from typing import Any, Unpack, overload

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.checks import checked_flag
from orbits.elements.two_body import any_two_body
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import InputError, counted, shown
from orbits.fitting.arc import Arc
from orbits.fitting.correction import Problem, Solution, corrected, covariance, with_outliers_rejected
from orbits.fitting.initial import Root, first_solution, normalized_rms, orbits_in_doubt
from orbits.fitting.observations import Observations
from orbits.fitting.planets import OfPlanets, PlanetOptions, fit_planets, of_planets
from orbits.fitting.record import OPTICAL
from orbits.fitting.result import Fit
from orbits.fitting.sight import Sight
from orbits.lagrangians.terms.in_ephemeris import InEphemeris
from orbits.results.planet_fit import PlanetFit
from orbits.system import System
from orbits.units import GM_SUN

Array = NDArray[np.float64]

FEWEST = 3


@overload
def fit(
    observations: Observations,
    system: System | None = None,
    *,
    sigma: Any = None,
    reject: bool = True,
    **others: Unpack[NoOthers],
) -> Fit: ...


@overload
def fit(observations: OfPlanets, system: System, **options: Unpack[PlanetOptions]) -> PlanetFit: ...


def fit(
    observations: Any, system: System | None = None, *, sigma: Any = None, reject: bool = True, **others: Any
) -> Fit | PlanetFit:
    """Return the orbit of a small body from its observations, with its covariance.

        observations = orbits.Observations.read("99942.dat")
        fit = orbits.fit(observations)
        print(fit, fit.rejected)
        run = orbits.propagate(fit.system, until="2029-05-01")

    observations : optical ones of one body
    system : `System.in_ephemeris(...)`, whose epoch is that of the orbit. If it has the body, or one massless body, the
        fit begins from its orbit; otherwise, as without a system, from those that Gauss's method finds through three of
        the observations, fitted to ever longer arcs: the one with the least chi-squared, and of equal ones the one
        with the smallest eccentricity, those within 0.05 au of the observer last. An OrbitsWarning lists the orbits
        that fit a short arc as well. Without a system the epoch is the midnight (TDB) nearest to the
        second of these three, in DE440
    sigma : uncertainties, an angle for all, or (m,), or (m, 2) for right ascension times cos(dec) and declination; by
        default those of `observations.sigma`
    reject : whether outliers are rejected, after Carpino, Milani & Chesley (2003): those whose chi-squared is above 8,
        which are taken back below 7; of fewer than 20 without a start, only if chi-squared of all is more than that of
        the rest and 8 for each of them. `fit.rejected` has them

    Or the planets of a star from the times of their transits and its radial velocities, `orbits.TransitTimes` and
    `orbits.RadialVelocities`, with other options: see `orbits.fitting.planets.fit_planets`.

        fit = orbits.fit([times, velocities], system)

    The model is that of the system: its forces act, too. Places are astrometric, with light time and the bending of
    light by the Sun relative to that of the stars. The known errors of star catalogues before Gaia are not taken off.

    Raises InputError for fewer than three observations, those of several bodies, radar, and a system that is not in an
    ephemeris; ConvergenceError if no orbit is found, or if the observations do not determine one; EpochError outside
    the ephemeris; and an IntegrationError where the orbit cannot be followed.
    """
    if of_planets(observations) and sigma is None:
        return fit_planets(observations, system, **others)
    for name in others:
        raise unknown_argument(fit, name)
    rejects = checked_flag(reject, "reject")
    _check(observations)
    given = _sigma(observations, sigma)
    times = observations.time
    correlation = np.array([one.correlation for one in observations.records])
    if system is not None:
        _check_system(system)
        massless = [name for name, massive in zip(system.names, system.massive, strict=True) if not massive]
        own = _own_name(observations, massless)
        if own is not None:
            arc = Arc(_alone(system, massless, own), own)
            problem = Problem(arc, Sight(observations.records, times, system.epoch), given, correlation)
            return _fitted(observations, problem, _start_of(system, own), (), system, own, rejects)
    name = observations.bodies[0]
    middle = Time(np.floor(np.median(times.jd)) + 0.5, format="jd", scale="tdb")
    sight = Sight(observations.records, times, middle)

    def prepared(root: Root) -> tuple[Problem, Array]:
        day = float(np.round(root.day))
        epoch = middle + day * u.day
        around = System.in_ephemeris(epoch=epoch) if system is None else _at(system, epoch)
        q, v = any_two_body(root.state[:3], root.state[3:], GM_SUN, day - root.day)
        start = np.concatenate([q, v]) + _start_of(around, "Sun")
        arc = Arc(_with_body(around, name, start), name)
        return Problem(arc, sight.since(day), given, correlation), start

    problem, found, roots, undecided = first_solution(sight, prepared)
    if undecided:
        orbits_in_doubt(name, undecided).warn()
    rejects = rejects and not found.used.all()  # the search has weighed what to reject
    around = problem.arc.system
    epoch = around.epoch if system is None else system.epoch
    assert epoch is not None  # a system in an ephemeris has one
    later = float((epoch - around.epoch).to_value(u.day))
    if system is None or later == 0.0:
        return _fitted(observations, problem, found.start, roots, around, name, rejects)
    q, v = problem.arc.states(found.start, np.array([later]))
    start = np.concatenate([q[0], v[0]])
    around = _with_body(system, name, start)
    problem = Problem(Arc(around, name), Sight(observations.records, times, system.epoch), given, correlation)
    return _fitted(observations, problem, start, roots, around, name, rejects)


def _fitted(
    observations: Observations,
    problem: Problem,
    start: Array,
    roots: tuple[Root, ...],
    system: System,
    name: str,
    rejects: bool,
) -> Fit:
    solve = with_outliers_rejected if rejects else corrected
    found: Solution = solve(problem, start, np.ones(len(observations), dtype=bool))
    white = problem.white(found.derivatives)[found.used].reshape(-1, 6)
    q, v = system.values.q.copy(), system.values.v.copy()
    place = system.names.index(name)
    q[place], v[place] = found.start[:3], found.start[3:]
    sigma = u.Quantity(problem.sigma, u.arcsec)
    return Fit(
        system.replaced(q=q, v=v),
        name,
        observations,
        roots,
        sigma,
        found,
        covariance(white),
        normalized_rms(problem, found),
    )


def _check(observations: Any) -> None:
    if not isinstance(observations, Observations):
        raise InputError(
            f"observations is {shown(observations)}; expected orbits.Observations, such as those of "
            'orbits.Observations.read("99942.dat").'
        )
    if len(observations.bodies) > 1:
        raise InputError(
            f"these are observations of {few(observations.bodies)}; expected one body: "
            f"observations.of({observations.bodies[0]!r})."
        )
    radar = int((observations.kind != OPTICAL).sum())
    if radar:
        raise InputError(
            f"{radar} of the observations are of radar, which are read but not fitted; expected optical ones: "
            'observations[observations.kind == "optical"].'
        )
    if len(observations) < FEWEST:
        raise InputError(f"{len(observations)} observations do not determine an orbit; expected {FEWEST} at least.")
    times = len(np.unique(observations.time.jd))
    if times < FEWEST:
        raise InputError(
            f"the observations are of {counted(times, 'time')}, which do not determine an orbit; expected {FEWEST} "
            "times at least, of three nights as a rule."
        )


def _sigma(observations: Observations, sigma: Any) -> Array:
    """Return the uncertainties, arcseconds, (m, 2)."""
    if sigma is None:
        return np.asarray(observations.sigma.to_value(u.arcsec))
    try:
        given = u.Quantity(sigma).to_value(u.arcsec)
        values = np.array(np.broadcast_to(given[:, None] if given.ndim == 1 else given, (len(observations), 2)))
    except (u.UnitConversionError, TypeError, ValueError):
        values = np.zeros(0)
    if not (values.size and np.isfinite(values).all() and (values > 0.0).all()):
        raise InputError(
            f"sigma is {shown(sigma)}; expected angles above 0, one for all, ({len(observations)},) or "
            f"({len(observations)}, 2), such as 0.5 * u.arcsec."
        )
    return values


def _check_system(system: Any) -> None:
    if not isinstance(system, System) or not any(isinstance(term, InEphemeris) for term in system.terms):
        raise InputError(
            f"system is {shown(system)}; expected one in an ephemeris: orbits.System.in_ephemeris(epoch=...)."
        )


def _own_name(observations: Observations, massless: list[str]) -> str | None:
    """Return the name of the body that is fitted, None if the system has no massless one."""
    if observations.bodies[0] in massless:
        return observations.bodies[0]
    if len(massless) > 1:
        raise InputError(
            f"none of the massless bodies {few(massless)} of the system is called {observations.bodies[0]!r}, as in "
            "the observations; expected that name, or a single massless body."
        )
    return massless[0] if massless else None


def _alone(system: System, massless: list[str], name: str) -> System:
    others = [x for x in massless if x != name]
    return system.remove(*others) if others else system


def _start_of(system: System, name: str) -> Array:
    place = system.names.index(name)
    return np.concatenate([system.values.q[place], system.values.v[place]])


def _with_body(system: System, name: str, start: Array) -> System:
    if name in system.names:
        raise InputError(
            f"the body of the observations is called {name!r}, as one of the ephemeris; expected another name in their "
            "file, or a system with the body under another name."
        )
    return system.add(name, q=start[:3] * u.au, v=start[3:] * u.au / u.day)


def _at(system: System, epoch: Time) -> System:
    """Return a system in the same ephemeris at another epoch. Raises InputError for other bodies than the default."""
    (field,) = (term for term in system.terms if isinstance(term, InEphemeris))
    plain = System.in_ephemeris(field.kernel, epoch=epoch, asteroids=field.asteroids or 0)
    if plain.names != system.names:
        raise InputError(
            "an orbit in this ephemeris has to begin from a given one; expected the body in the system: "
            "system.add(name, q=..., v=...)."
        )
    return plain


