"""Target planes and places of entry: a run, its encounter with a planet, and how an uncertain orbit spreads there."""

from __future__ import annotations

from typing import Any

import numpy as np
from astropy import units as u

from orbits.body_names import index_of, place_of
from orbits.checks import finite_number, positive_number
from orbits.elements.target_plane import OnPlane, on_target_plane
from orbits.ephemeris import AU_KM
from orbits.errors import InputError, shown
from orbits.integrators.forms import Array
from orbits.observing.earth import turning
from orbits.observing.stations import EARTH_RADIUS
from orbits.propagation.run import propagate
from orbits.propagation.variations.deviations import Uncertain, spread, the_body, turns
from orbits.results.entry import Entry, height_and_vertical
from orbits.results.target_plane import TargetPlane
from orbits.system import System
from orbits.time_grid import times_since
from orbits.trajectory import Trajectory
from orbits.units import written

STEP = 1e-5
"""Of central differences, relative to distance and speed."""

FREE, WITHIN = 1e-6, 1e-3
"""The least share of the kinetic energy that is left at infinity on a hyperbola that has a target plane: beside the
Earth, 11 m/s. And the largest part of it by which a displaced state may differ."""

POINTS, BEFORE, FINE, NODES = 33, 0.25, 0.01, 6
"""A crossing is sought between so many states, in the last days before the closest approach and, if it was earlier, in
ever more of them, until the states are within so many days, and then by a polynomial through these states."""

RADII = {
    "Sun": 695700.0,
    "Mercury": 2440.53,
    "Venus": 6051.8,
    "Earth": EARTH_RADIUS,
    "Moon": 1737.4,
    "Mars": 3396.19,
    "Jupiter": 71492.0,
    "Saturn": 60268.0,
    "Uranus": 25559.0,
    "Neptune": 24764.0,
    "Pluto": 1188.3,
}
"""Of the equators, km. Source: Archinal et al. (2018), Celest. Mech. Dyn. Astron. 130, 22; of the Earth, WGS84."""

ASIDE = 1e-4
"""Days over which coordinates change by tides, for their rates."""


def target_plane(
    orbit: Any,
    planet: str,
    *,
    covariance: Any = None,
    body: str | None = None,
    until: Any = None,
    near: Any = None,
    radius: Any = None,
) -> TargetPlane:
    """Return where a body passes a planet on its target plane (b-plane), with the ellipse of its uncertainty.

        plane = orbits.target_plane(fit, "Earth", until="2029-05-01")
        print(plane), plane.ellipse(), plane.impact_probability, plane.plot()
        orbits.target_plane(run, "Earth", covariance=C)  # (6, 6), of the state at the start of the run

    orbit : a fit, which is propagated until a date, or a run that looked for closest approaches
    covariance : a fit, its `covariance()`, or a matrix of the state at the start, in the units and axes of the system.
        That of a fit is taken by itself; of a run without one there is no ellipse
    body : its name; by default that of the fit, or the only massless one
    near : a date: the approach nearest to it, instead of the closest one
    radius : of the planet; by default that of the system, or of the equator

    The covariance is carried along by the state transition, to first order, to the closest approach, or to the surface
    of a planet that is hit. Coordinates are those of the osculating hyperbola there.
    Raises InputError for a run without such an approach, an orbit that is neither, a planet without a radius, and as
    `orbits.state_transition`.
    """
    run, given, body, other = _subject(orbit, planet, covariance, body, until)
    system, planet = run.system, run.names[other]
    if other == int(np.argmax(system.values.gm)):
        raise InputError(
            f"{planet} is the heaviest body of this system; expected a planet that moves about it, as zeta is along "
            f"that motion. Distances and times are in run.closest_approaches()[{body!r}]."
        )
    size = _radius(run, body, planet, radius)
    about = None if near is None else finite_number(times_since(system, near, "near"), "near")
    time = _closest(run, body, planet, about)
    if time is None:
        raise InputError(f"{body} does not come near {planet} in this run; expected a longer one, or another planet.")
    least, velocity, _ = (x[0] for x in _relative(run, body, planet, np.array([time])))
    hits = bool(np.linalg.norm(least) < size)
    if not (hits or turns(run, time, least, velocity)):
        raise InputError(_no_approach(run, body, planet, float(least @ velocity)))
    if hits:
        time = _crossing(run, body, planet, time, lambda t, x: np.linalg.norm(x, axis=-1) - size)
    aside = u.Quantity(ASIDE, u.day).to_value(system.units.time)
    before = time - np.array([0.0, aside, 2.0 * aside]) * run.clock.direction
    q, v, moving = _relative(run, body, planet, before)
    gm = float(system.values.gm[other] + system.values.gm[system.names.index(body)])
    free = 1.0 - 2.0 * gm / float(np.linalg.norm(q[0]) * (v[0] @ v[0]))
    bound = free < FREE
    steps = (STEP if bound else min(STEP, WITHIN * free)) * np.repeat([np.linalg.norm(q[0]), np.linalg.norm(v[0])], 3)
    moved = np.concatenate([q[0], v[0]]) + np.concatenate([np.diag(steps), -np.diag(steps)])
    on = on_target_plane(
        np.concatenate([q, moved[:, :3]]),
        np.concatenate([v, moved[:, 3:]]),
        gm,
        np.concatenate([moving, np.repeat(moving[:1], 12, axis=0)]),
        modified=bound,
    )
    km = u.Quantity(1.0, system.units.length).to_value(u.km)
    speed = u.Quantity(1.0, system.units.speed).to(u.km / u.s)
    matrix = None
    if given is not None:
        by = _by_state(on, steps, aside * run.clock.direction, _delay(q[0], v[0], gm, hits))
        by *= np.array([km, km, km, u.Quantity(1.0, system.units.time).to_value(u.s)])[:, None]
        matrix = by @ spread(run, given, np.array([time]), [planet])[0] @ by.T
    return TargetPlane(
        body,
        planet,
        written((system.epoch + u.Quantity(time, system.units.time)).copy(format="iso")),
        u.Quantity(on.xi[0] * km, u.km),
        u.Quantity(on.zeta[0] * km, u.km),
        u.Quantity(on.pericentre[0] * km, u.km),
        np.linalg.norm(v[0]) * speed,
        None if bound else np.sqrt(on.speed2[0]) * speed,
        u.Quantity(size * km, u.km),
        matrix,
        on.axes[0],
    )


def entry(
    orbit: Any,
    *,
    altitude: Any = 100.0 * u.km,
    covariance: Any = None,
    body: str | None = None,
    until: Any = None,
) -> Entry:
    """Return where and when a body that hits the Earth comes down to an altitude, with the ellipse of the place.

        print(orbits.entry(fit, until="2008-10-08"))  # at 100 km
        orbits.entry(run, altitude=50 * u.km, covariance=C)

    orbit, covariance, body, until : as in `orbits.target_plane`
    altitude : above the ellipsoid WGS84. There is no atmosphere in the motion
    Raises InputError for a body that does not come so low.
    """
    run, given, body, other = _subject(orbit, "Earth", covariance, body, until)
    system, planet = run.system, run.names[other]
    try:
        low = finite_number(u.Quantity(altitude).to_value(u.km), "altitude")
    except (u.UnitConversionError, TypeError) as error:
        raise InputError(f"altitude is {shown(altitude)}; expected a length, such as 100 * u.km.") from error
    scale = u.Quantity(1.0, system.units.length).to_value(u.km)

    def dates(t: Array) -> Any:
        return system.epoch + u.Quantity(t, system.units.time)

    def above(t: Array, q: Array) -> Array:
        fixed = np.einsum("mij,mj->mi", turning(dates(t)).matrix, q * scale)
        return height_and_vertical(fixed)[0] - low

    time = _closest(run, body, planet)
    stays = f"{body} does not come down to {low:g} km above the Earth:"
    if time is None:
        raise InputError(f"{stays} in this run it is not near it.")
    least, velocity, _ = _relative(run, body, planet, np.array([time]))
    if above(np.array([time]), least)[0] > 0.0:
        if not turns(run, time, least[0], velocity[0]):
            raise InputError(_no_approach(run, body, planet, float(least[0] @ velocity[0])))
        raise InputError(f"{stays} at its closest it is {np.linalg.norm(least) * scale:,.0f} km from its centre.")
    time = _crossing(run, body, planet, time, above)
    at = np.array([time])
    q, v, _ = _relative(run, body, planet, at)
    au, day = scale / AU_KM, u.Quantity(1.0, system.units.time).to_value(u.day)
    matrix = None
    if given is not None:
        each = np.repeat([au, au / day], 3)
        matrix = spread(run, given, at, [planet])[0] * np.outer(each, each)
    return Entry.of(body, dates(at), low, q[0] * au, v[0] * au / day, matrix)


def _subject(
    orbit: Any, planet: str, covariance: Any, body: str | None, until: Any
) -> tuple[Trajectory, Uncertain | None, str, int]:
    """Return a run, the uncertain body or None, the body's name, and the number of the planet."""
    if isinstance(orbit, Trajectory):
        run = orbit
        if until is not None:
            raise InputError("until is the end of the run of a fit; this run has its own.")
    elif isinstance(getattr(orbit, "system", None), System) and hasattr(orbit, "covariance"):
        if until is None:
            raise InputError('a fit is propagated until a date; expected until="2029-05-01", after the encounter.')
        run = propagate(orbit.system, until=until, samples=2)
        covariance = orbit if covariance is None else covariance
    else:
        raise InputError(f"orbit is {shown(orbit)}; expected a fit, or a run of orbits.propagate.")
    if run.system.epoch is None:
        raise InputError("the system has no epoch; expected one with dates: System(..., epoch=...).")
    other = index_of(planet, run.names, "body")
    given = None if covariance is None else Uncertain.of(run.system, covariance, body)
    own = given.body if given is not None else the_body(run.system, body)
    if own == run.names[other]:
        raise InputError(f"body and planet are both {own!r}; expected two bodies.")
    return run, given, own, other


def _radius(run: Trajectory, body: str, planet: str, radius: Any) -> float:
    """Return the radius of a planet: that given, or of the system, or of its equator. Raises InputError without one."""
    system, unit = run.system, run.system.units.length
    apart = system.values.q[run.names.index(body)] - system.values.q[run.names.index(planet)]
    if radius is not None:
        size = positive_number(system.units.length_value(radius, "radius"), "radius", radius)
        start = np.linalg.norm(apart)
        if size >= start:
            raise InputError(
                f"radius is {size:.6g} {unit}, but {body} begins {start:.6g} {unit} from {planet}; expected less. A "
                "number without a unit is in that of the system: radius=6378 * u.km."
            )
        return size
    own = 0.0 if system.radii is None else float(system.radii[system.names.index(planet)].to_value(unit))
    known = place_of(planet, tuple(RADII))
    if own == 0.0 and known is not None:
        own = float(u.Quantity([*RADII.values()][known], u.km).to_value(unit))
    if own == 0.0:
        raise InputError(f"the radius of {planet} is not known; expected radius=..., such as radius=470 * u.km.")
    return own


def _no_approach(run: Trajectory, body: str, planet: str, approaching: float) -> str:
    """Return why the least distance is no closest approach: it is that at an end of the run."""
    if approaching * run.clock.direction < 0.0:
        return f"the run ends while {body} still comes nearer to {planet}; expected a longer one: until=... later."
    return f"the run begins as {body} parts from {planet}, and has no approach; expected one from before it."


def _closest(run: Trajectory, body: str, planet: str, near: float | None = None) -> float | None:
    """Return the time of the closest approach to a planet, or of the one nearest to a time; None without one."""
    passages = (x for x in run.closest_approaches()[body] if planet in (x.body, x.other))  # the closest one first
    if near is None:
        return next((float(x.time.value) for x in passages), None)
    return min((float(x.time.value) for x in passages), key=lambda time: abs(time - near), default=None)


def _relative(run: Trajectory, body: str, planet: str, times: Array) -> tuple[Array, Array, Array]:
    """Return position and velocity relative to a planet, and its velocity about the heaviest body, (m, 3) each."""
    states = run.at(times)
    q, v = states.q.value, states.v.value
    one, other, centre = run.names.index(body), run.names.index(planet), int(np.argmax(run.system.values.gm))
    if not np.isfinite([q[:, [one, other, centre]], v[:, [one, other, centre]]]).all():
        raise InputError(
            f"there are no states of {body} near its encounter with {planet}, as a body was lost or merged; expected a "
            "run in which both go on to the end, without radii and collisions."
        )
    return q[:, one] - q[:, other], v[:, one] - v[:, other], v[:, other] - v[:, centre]


def _crossing(run: Trajectory, body: str, planet: str, time: float, function: Any) -> float:
    """Return the last time before another one at which a function of times and relative positions comes down to 0."""
    day = float(u.Quantity(1.0, u.day).to_value(run.system.units.time))
    width = min(BEFORE * day, abs(time))
    last, first = time, time - width * run.clock.direction
    while True:
        times = np.linspace(first, last, POINTS)
        values = function(times, _relative(run, body, planet, times)[0])
        above = np.flatnonzero(values > 0.0)
        if len(above):
            k = int(above[-1])
            if abs(last - first) <= FINE * day:
                break
            first, last = times[k], times[k + 1]
        elif width < abs(time):
            width = min(2.0 * width, abs(time))
            first = time - width * run.clock.direction
        else:
            raise InputError(f"{body} is below at the start of the run; expected one that begins before the encounter.")
    use = slice(max(0, k - NODES // 2 + 1), max(0, k - NODES // 2 + 1) + NODES)
    x, y = times[use], values[use]
    same = np.eye(len(y), dtype=bool)
    gaps = np.where(same, 1.0, y[:, None] - y)
    weights = np.where(same, 1.0, -y / gaps).prod(axis=1)  # Lagrange's, at 0
    return float(x[0] + weights @ (x - x[0]))


def _delay(q: Array, v: Array, gm: float, hits: bool) -> Array:
    """Return the derivative of the time of the closest approach, or of reaching a distance, by the state, (6,)."""
    r = np.linalg.norm(q)
    if hits:
        return np.concatenate([-q / (q @ v), np.zeros(3)])
    return -np.concatenate([v, q]) / (v @ v - gm / r)


def _by_state(on: OnPlane, steps: Array, aside: float, delay: Array) -> Array:
    """Return the derivatives of xi, zeta, pericentre and time by the relative state, (4, 6).

    on : of the state, of two earlier ones, `aside` apart, and of those displaced by steps
    """
    columns = np.array([on.xi, on.zeta, on.pericentre])
    rates = (3.0 * columns[:, 0] - 4.0 * columns[:, 1] + columns[:, 2]) / (2.0 * aside)
    return np.vstack([(columns[:, 3:9] - columns[:, 9:]) / (2.0 * steps) + np.outer(rates, delay), delay])
