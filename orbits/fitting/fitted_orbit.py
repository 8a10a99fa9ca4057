"""`orbits.fit`: from observations to an orbit with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Unpack, overload

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.astrometry.observations import Observations
from orbits.astrometry.record import DELAY, OPTICAL
from orbits.body_names import few
from orbits.checks import checked_flag
from orbits.elements.two_body import any_two_body
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import InputError, UnknownNameError, counted, shown
from orbits.fitting.correction import Problem, Solution, corrected, with_outliers_rejected
from orbits.fitting.echoes import Echoes, without_radius
from orbits.fitting.initial import Root, first_solution, orbits_in_doubt
from orbits.fitting.instruments import Instrument, Together
from orbits.fitting.least_squares import Linear
from orbits.fitting.planets import OfPlanets, PlanetOptions, fit_planets, of_planets
from orbits.fitting.result import Fit, telling_rejections
from orbits.fitting.sight import Sight
from orbits.fitting.valley import WIDE, valley, wide_covariance, wide_range
from orbits.forces.non_gravitational import NonGravitational
from orbits.lagrangians.terms.in_ephemeris import InEphemeris
from orbits.propagation.variations.arc import Arc
from orbits.results.planet_fit import PlanetFit
from orbits.system import System
from orbits.system.parameters import acted_on, parameters_of, require_list, with_values
from orbits.units import GM_SUN

Array = NDArray[np.float64]

FEWEST = 3

OWN = ("A1", "A2", "A3")
"""Parameters that are named without the body, which is the one that is fitted."""


@overload
def fit(
    observations: Observations,
    system: System | None = None,
    *,
    parameters: Sequence[str] = (),
    sigma: Any = None,
    reject: bool = True,
    **others: Unpack[NoOthers],
) -> Fit: ...


@overload
def fit(observations: OfPlanets, system: System, **options: Unpack[PlanetOptions]) -> PlanetFit: ...


def fit(
    observations: Any,
    system: System | None = None,
    *,
    parameters: Sequence[str] = (),
    sigma: Any = None,
    reject: bool = True,
    **others: Any,
) -> Fit | PlanetFit:
    """Return the orbit of a small body from its observations, with its covariance.

        observations = orbits.Observations.read("99942.dat")
        fit = orbits.fit(observations)
        print(fit, fit.rejected)
        drifting = orbits.fit(observations, fit.system, parameters=["A2"])
        run = orbits.propagate(fit.system, until="2029-05-01")

    observations : of one body, optical and of radar. Delays to the surface, as at peak power, are less by two radii of
        the body in the system; if it has none there, by nothing, with an OrbitsWarning
    system : `System.in_ephemeris(...)`, whose epoch is that of the orbit. If it has the body, or one massless body, the
        fit begins from its orbit; otherwise, as without a system, from those that Gauss's method finds through three of
        the observations, fitted to ever longer arcs: the one with the least chi-squared, and of equal ones the one
        with the smallest eccentricity, those within 0.05 au of the observer last. An OrbitsWarning lists the orbits
        that fit a short arc as well. Without a system the epoch is the midnight (TDB) nearest to the
        second of these three, in DE440
    parameters : what is fitted besides the state: "A1", "A2", "A3" of the body, which begin at 0, as g = (1 au / r)^2
        (`NonGravitational.yarkovsky`), if no such force acts in the system; and others of it, "Ceres.gm", "Earth.J2"
    sigma : uncertainties of optical ones, an angle for all, or (m,), or (m, 2) for right ascension times cos(dec) and
        declination; by default those of `observations.sigma`. Correlations of both stay those given with the places
    reject : whether outliers are rejected, after Carpino, Milani & Chesley (2003): those whose chi-squared is above 8,
        which are taken back below 7; of fewer than 20 without a start, only if chi-squared of all is more than that of
        the rest and 8 for each of them. `fit.rejected` has them; of radar, or of more than a tenth, an OrbitsWarning
        tells

    Or the planets of a star from the times of their transits and its radial velocities, `orbits.TransitTimes` and
    `orbits.RadialVelocities`, with other options: see `orbits.fitting.planets.fit_planets`.

        fit = orbits.fit([times, velocities], system)

    The model is that of the system: its forces act, too. Places are astrometric, with light time and the bending of
    light by the Sun relative to that of the stars. The known errors of star catalogues before Gaia are not taken off.

    Raises InputError for fewer than three observations, those of several bodies, radar alone without a start, and a
    system that is not in an ephemeris; UnknownNameError for other parameters; ConvergenceError if no orbit is found, or
    if the observations do not determine one; EpochError outside the ephemeris; and an IntegrationError where the orbit
    cannot be followed.
    """
    if of_planets(observations):
        if len(parameters) or sigma is not None or reject is not True:
            raise InputError(
                "parameters, sigma and reject are for observations of small bodies; expected for transits and radial "
                "velocities: elements, jitter, interacting."
            )
        return fit_planets(observations, system, **others)
    for name in others:
        raise unknown_argument(fit, name)
    rejects = checked_flag(reject, "reject")
    require_list(parameters)
    _check(observations)
    given = _sigma(observations, sigma)
    if system is not None:
        _check_system(system)
        massless = [name for name, massive in zip(system.names, system.massive, strict=True) if not massive]
        own = _own_name(observations, massless)
        if own is not None:
            return _fitted(observations, given, _alone(system, massless, own), system, own, parameters, (), rejects)
    name, optical = observations.bodies[0], observations.kind == OPTICAL
    places = observations[optical]
    if len(places) < FEWEST:
        raise InputError(
            f"{len(places)} optical observations give no beginning; expected {FEWEST} at least, or the body in the "
            "system: orbits.fit(observations, system)."
        )
    middle = Time(np.floor(np.median(places.time.jd)) + 0.5, format="jd", scale="tdb")
    sight = Sight(places.records, places.time, middle)

    def prepared(root: Root) -> tuple[Problem, Sight, Array]:
        day = float(np.round(root.day))
        epoch = middle + day * u.day
        around = System.in_ephemeris(epoch=epoch) if system is None else _at(system, epoch)
        q, v = any_two_body(root.state[:3], root.state[3:], GM_SUN, day - root.day)
        start = np.concatenate([q, v]) + _start_of(around, "Sun")
        seen = sight.since(day)
        arc = Arc(_with_body(around, name, start), name)
        return Problem(arc, seen, given[optical], _correlations(places)), seen, start

    problem, found, roots, undecided = first_solution(sight, prepared)
    if undecided:
        orbits_in_doubt(name, undecided).warn()
    if optical.all() and not parameters:
        rejects = rejects and not found.used.all()  # the search has weighed what to reject
    around = problem.arc.system
    q, v = found.start[:3], found.start[3:]
    if system is not None:
        assert system.epoch is not None  # a system in an ephemeris has one
        later = float((system.epoch - around.epoch).to_value(u.day))
        (q,), (v,) = problem.arc.states(found.start, np.array([later]))
        around = system
    around = _moved(around, name, np.concatenate([q, v]))
    used = np.ones(len(observations), dtype=bool)
    used[optical] = found.used
    return _fitted(observations, given, around, around, name, parameters, roots, rejects, used)


def _fitted(
    observations: Observations,
    given: Array,
    alone: System,
    system: System,
    name: str,
    parameters: Sequence[str],
    roots: tuple[Root, ...],
    rejects: bool,
    used: NDArray[np.bool_] | None = None,
) -> Fit:
    """Return the fit that begins from the body in a system; alone : without other massless ones; used : what counts at
    first.
    """
    named = [f"{name}.{one}" if one in OWN else one for one in parameters]
    alone, system = (_with_force(one, name, named) for one in (alone, system))
    try:
        arc = Arc(alone, name, named)
    except UnknownNameError as error:
        raise UnknownNameError(f"{error} A fit has A1, A2 and A3 of {name} also without one.") from None
    start = np.concatenate([_start_of(alone, name), [one.value for one in arc.parameters]])
    sight = _instruments(observations, alone, name)
    problem = Problem(arc, sight, given, _correlations(observations))
    solve = with_outliers_rejected if rejects else corrected
    every = np.ones(len(observations), dtype=bool)
    found: Solution = solve(problem, start, every if used is None or not rejects else used)
    whole = with_values(system, parameters_of(system, named), found.start[6:].tolist())
    fit = Fit(
        _moved(whole, name, found.start),
        name,
        observations,
        roots,
        u.Quantity(np.where(observations.kind[:, None] == OPTICAL, given, np.nan), u.arcsec),
        (),
        problem,
        found,
        Linear.of(found.derivatives[found.used]).covariance(),
    )
    rejected = telling_rejections(fit)
    if rejected is not None:
        rejected.warn()
    comet = fit.covariance("cometary")  # of e and q first
    if max(comet.sigma[0], comet.sigma[1] / comet.values[1]) < WIDE:
        return fit
    if parameters:
        wide_covariance(name, comet.values[:2], comet.sigma[:2]).warn()
        return fit
    fit = replace(fit, range=valley(problem, found))
    wide_range(name, fit.range).warn()
    return fit


def _instruments(observations: Observations, system: System, name: str) -> Instrument:
    """Return what the observations are of."""
    optical, epoch = observations.kind == OPTICAL, system.epoch
    if optical.all():
        return Sight(observations.records, observations.time, epoch)
    radar, radii = observations[~optical], system.radii
    radius = 0.0 if radii is None else float(radii[system.names.index(name)].to_value(u.au))
    if radius == 0.0 and any(one.surface and one.kind == DELAY for one in radar.records):
        without_radius(name).warn()
    echoes = Echoes(radar.records, radar.time, epoch, radius)
    if not optical.any():
        return echoes
    places = observations[optical]
    rows = [np.flatnonzero(x) for x in (optical, ~optical)]
    return Together([Sight(places.records, places.time, epoch), echoes], rows)


def _with_force(system: System, name: str, parameters: Sequence[str]) -> System:
    """Return a system in which something has the parameters of the body that are asked for: a force of size 0 if none
    does.
    """
    known = any(isinstance(force, NonGravitational) and name in acted_on(system, force) for force in system.forces)
    if known or not any(one in parameters for one in (f"{name}.{own}" for own in OWN)):
        return system
    return system.with_forces(NonGravitational.yarkovsky(0.0 * u.au / u.day**2, bodies=[name]))


def _correlations(observations: Observations) -> Array:
    return np.array([one.correlation for one in observations.records])


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
    if len(observations) < FEWEST:
        raise InputError(f"{len(observations)} observations do not determine an orbit; expected {FEWEST} at least.")
    times = len(np.unique(observations.time.jd))
    if times < FEWEST:
        raise InputError(
            f"the observations are of {counted(times, 'time')}, which do not determine an orbit; expected {FEWEST} "
            "times at least, of three nights as a rule."
        )


def _sigma(observations: Observations, sigma: Any) -> Array:
    """Return the uncertainties, (m, 2): arcseconds, or that of radar, microseconds or Hz, and nothing more to know."""
    optical = observations.kind == OPTICAL
    out = np.full((len(observations), 2), np.inf)
    out[:, 0] = [one.sigma * (1e6 if one.kind == DELAY else 1.0) for one in observations.records]
    out[optical] = observations[optical].sigma.to_value(u.arcsec)
    if sigma is None:
        return out
    try:
        if isinstance(sigma, np.ndarray) and np.any(getattr(sigma, "mask", False)):
            raise ValueError("masked values are undefined")
        given = u.Quantity(sigma).to_value(u.arcsec)
        values = np.array(np.broadcast_to(given[:, None] if given.ndim == 1 else given, out.shape))
    except (u.UnitConversionError, TypeError, ValueError):
        values = np.zeros(0)
    if not (values.size and np.isfinite(values[optical]).all() and (values[optical] > 0.0).all()):
        raise InputError(
            f"sigma is {shown(sigma)}; expected angles above 0, one for all, ({len(observations)},) or "
            f"({len(observations)}, 2), such as 0.5 * u.arcsec."
        )
    return np.where(optical[:, None], values, out)


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


def _moved(system: System, name: str, start: Array) -> System:
    """Return a system with the body at a start, or with it added there."""
    if name not in system.names:
        return _with_body(system, name, start)
    q, v = system.values.q.copy(), system.values.v.copy()
    place = system.names.index(name)
    q[place], v[place] = start[:3], start[3:6]
    return system.replaced(q=q, v=v)


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
        more = few([name for name in system.names if name not in plain.names]) or "other bodies"
        raise InputError(
            f"the system has {more} among what attracts, so that an orbit has to begin from a given one; expected the "
            "body of the observations in it, without a mass: system.add(name, q=..., v=...)."
        )
    return plain
