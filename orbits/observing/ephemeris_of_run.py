"""The ephemeris of bodies of a run, as an observer sees them: from states to angles."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.body_names import chosen
from orbits.catalogue.bundled import LARGEST_ASTEROID
from orbits.checks import check_physical
from orbits.errors import InputError
from orbits.observing import earth
from orbits.observing.brightness import magnitude, slopes
from orbits.observing.light import FAR, C, aberrated, angle, deflected, emission, unit
from orbits.observing.observers import SUN, Observer, known, observer_of
from orbits.observing.placing import Placing, placed
from orbits.observing.table import COLUMNS, Ephemeris, Head
from orbits.time_grid import times_since
from orbits.units import GM_SUN

if TYPE_CHECKING:
    from orbits.protocols import Run

Array = NDArray[np.float64]

MOST_STATES = 1 << 21
"""The most states of bodies that are computed at once."""


def ephemeris_of(
    run: Run,
    bodies: str | Sequence[str] | None,
    observer: Any,
    times: Any,
    *,
    H: Any,
    G: Any,
    attributes: Mapping[str, str | float],
) -> Ephemeris:
    """Return the ephemeris of bodies; see `Trajectory.ephemeris`. attributes : of the system, for exports."""
    system = run.system
    check_physical(system.units, "run.ephemeris")
    if system.epoch is None:
        raise InputError("run.ephemeris needs the date of t = 0, but the system has no epoch; use System(epoch=...).")
    where = observer_of(observer, run.names)
    since = run.times if times is None else times_since(system, times, "times")
    if since.ndim > 1:
        raise InputError(f"times has shape {since.shape}; expected one time, or several in a row.")
    t = np.atleast_1d(since)
    track = Track(run)
    targets = _targets(run.names, bodies, where)
    sight = Sight.of(track, t, where)
    lit = [i for i in targets if sight.placing.sun is not None and known(run.names[i]) != SUN]
    largest = LARGEST_ASTEROID * GM_SUN / track.gm_unit
    small = [run.names[i] for i in lit if system.values.gm[i] <= largest or H is not None]
    known_slopes = slopes(small, H, G)
    columns = {name: np.full((len(t), len(targets)), np.nan) for name in COLUMNS}
    for k, seen in sight.each(track, targets):
        body = run.names[targets[k]]
        if body in known_slopes:
            seen["V"] = magnitude(*known_slopes[body], seen["sun_distance"], seen["distance"], seen["phase"])
        for name, values in seen.items():
            columns[name][:, k] = values
    names = tuple(run.names[i] for i in targets)
    notes = [*sight.placing.notes, sight.frame()]
    notes += [f"V of {name}: H = {pair[0]:g}, G = {pair[1]:g}" for name, pair in known_slopes.items()]
    head = Head(str(where), run.made_by, tuple(notes), isinstance(times, Time) and times.scale == "utc")
    return Ephemeris.of(system, attributes, names, t, columns, head, single=isinstance(bodies, str))


def _targets(names: Sequence[str], bodies: str | Sequence[str] | None, where: Observer) -> list[int]:
    """Return the numbers of the bodies that are looked at. Raises InputError for the observer's own."""
    own = where.body if where.site is None else None
    if bodies is None:
        return [i for i, name in enumerate(names) if name != own]
    targets: list[int] = np.arange(len(names))[chosen(names, bodies)].tolist()
    if any(names[i] == own for i in targets):
        raise InputError(f"{own!r} is where the observer is; expected other bodies, or another observer.")
    return targets


class Track:
    """States of a run in au and days, at times in its own unit, also somewhat before its start.

    gm_unit : of GM, in au^3/d^2
    """

    def __init__(self, run: Run) -> None:
        units = run.system.units
        self.run = run
        self._length, self.day = float((1 * units.length).to_value(u.au)), float((1 * units.time).to_value(u.day))
        self.gm_unit = self._length**3 / self.day**2
        self._first = run._earliest

    def states(self, times: Array) -> tuple[Array, Array]:
        """Return q and v, (m, bodies, 3), au and au/d."""
        q, v = np.empty((2, len(times), len(self.run.names), 3))
        early = times < self._first
        for rows, at in ((early, self.run._before), (~early, self._at)):
            if rows.any():
                q[rows], v[rows] = at(times[rows])
        return q * self._length, v * (self._length / self.day)

    def observed(self, times: Array) -> tuple[Array, Array]:
        """Return q and v at the times of an observation. Raises InputError for those outside the run."""
        q, v = self._at(times)
        return q * self._length, v * (self._length / self.day)

    def _at(self, times: Array) -> tuple[Array, Array]:
        found = self.run.at(times)
        return found.q.value, found.v.value


@dataclass(frozen=True)
class Sight:
    """An observer at m times: where it is, how it moves, and what else is needed to say what it sees.

    t : since the epoch, in the run's unit; q, v : (m, bodies, 3), of all bodies then, au and au/d, placed
    here, speed : of the observer, (m, 3), au and au/d
    equator : from the ICRF to the equator of date, (m, 3, 3), for an observer on the Earth; site : its place there
    """

    where: Observer
    t: Array
    q: Array
    v: Array
    placing: Placing
    here: Array
    speed: Array
    equator: Array | None
    site: earth.Site | None

    @classmethod
    def of(cls, track: Track, t: Array, where: Observer) -> Sight:
        """Return an observer at the times t of a run."""
        run = track.run
        q, v = track.observed(t)
        dates = run.system.epoch + u.Quantity(t, run.system.units.time)
        gm = run.system.values.gm
        placing = placed(run.names, gm, q, v, dates.jd1, dates.jd2, where)
        q, v = (x + shift[:, None] for x, shift in ((q, placing.shift.q), (v, placing.shift.v)))
        here, speed = placing.observer
        site = None if where.site is None else earth.site_at(where.site, dates)
        if site is not None:
            here, speed = here + site.q, speed + site.v
        equator = earth.equator_of_date(dates) if where.on_earth else None
        return cls(where, t, q, v, placing, here, speed, equator, site)

    def frame(self) -> str:
        """Return the frame of apparent places in words."""
        if self.equator is None:
            return "apparent places: ICRF, with aberration and the deflection of light by the Sun"
        return (
            "apparent places: true equator and equinox of date (IAU 2006/2000A), with aberration and the deflection of "
            "light by the Sun, no refraction"
        )

    def each(self, track: Track, targets: Sequence[int]) -> Iterator[tuple[int, dict[str, Array]]]:
        """Yield the number of each target among them, and what is seen of it: columns of the table, (m,)."""
        sun = [known(track.run.names[i]) == SUN for i in targets]
        count = len(self.t)
        most = max(1, MOST_STATES // max(1, count * len(track.run.names)))
        for first in range(0, len(targets) if count else 0, most):
            some = targets[first : first + most]
            q, v = (np.swapaxes(x[:, some], 0, 1).reshape(-1, 3) for x in (self.q, self.v))
            here = np.tile(self.here, (len(some), 1))
            found = emission(q, v, here, self._earlier(track, np.repeat(some, count)))
            for k, one in enumerate(zip(*(np.split(x, len(some)) for x in found), strict=True), start=first):
                yield k, self._seen(*one, is_sun=sun[k])

    def _earlier(self, track: Track, bodies: NDArray[np.intp]) -> Callable[[Array], tuple[Array, Array]]:
        """Return a function with the states of bodies, each so many days before one of the observations in turn."""
        count = len(bodies) // len(self.t)
        t, *shift = (np.concatenate([x] * count) for x in (self.t, *self.placing.shift))

        def at(delay: Array) -> tuple[Array, Array]:
            states = track.states(t - delay / track.day)
            q, v = (x[np.arange(len(bodies)), bodies] for x in states)
            return q + shift[0] - delay[:, None] * shift[1], v + shift[1]

        return at

    def _seen(self, delay: Array, q: Array, v: Array, *, is_sun: bool) -> dict[str, Array]:
        """Return the columns for one body, which light left at q with the velocity v."""
        way, distance = q - self.here, C * delay
        direction = unit(way)
        out = dict(zip(("ra", "dec"), _angles(direction), strict=True))
        relative = v - self.speed
        along, (east, north) = (relative * direction).sum(axis=1), _tangents(direction)
        # While the observer waits for dt, the light that it sees leaves the body over (1 - d tau/dt) dt.
        lengthening = along / (C + (v * direction).sum(axis=1))  # d tau/dt
        change = relative - lengthening[:, None] * v  # d way/dt
        out |= {"ra_rate": (change * east).sum(axis=1) / distance}
        out |= {"dec_rate": (change * north).sum(axis=1) / distance}
        apparent = self._apparent(direction, q, is_sun=is_sun)
        of_date = apparent if self.equator is None else np.einsum("mij,mj->mi", self.equator, apparent)
        out |= dict(zip(("apparent_ra", "apparent_dec"), _angles(of_date), strict=True))
        if self.site is not None:
            north_, east_, up = np.moveaxis(np.einsum("mij,mj->mi", self.site.horizon, apparent), 1, 0)
            out["azimuth"] = np.arctan2(east_, north_) % (2.0 * np.pi)
            out["elevation"] = np.arctan2(up, np.hypot(north_, east_))
        out |= {"distance": distance, "distance_rate": C * lengthening, "range_rate": along, "light_time": delay}
        return out if self.placing.sun is None else out | self._by_the_sun(delay, q, v, apparent, is_sun=is_sun)

    def _by_the_sun(self, delay: Array, q: Array, v: Array, apparent: Array, *, is_sun: bool) -> dict[str, Array]:
        """Return distances from the Sun, and angles between it and the body."""
        sun = self.placing.sun
        assert sun is not None
        out = {}
        if not is_sun:
            lit = q - self._sun_before(delay, q)
            towards = unit(lit)
            out["sun_distance"] = np.linalg.norm(lit, axis=1)
            out["sun_range_rate"] = ((v - sun.v) * towards).sum(axis=1)
            out["phase"] = angle(-towards, unit(self.here - q))
            # In the sky of the body, sunlight is aberrated by its motion.
            out["sto"] = angle(aberrated(-towards, v, FAR), -apparent)
        if self.where.at_sun:
            return out
        at_sun = emission(sun.q, sun.v, self.here, lambda d: (sun.q - d[:, None] * sun.v, sun.v))[1]
        of_sun = self._apparent(unit(at_sun - self.here), at_sun, is_sun=True)
        out["elongation"] = angle(of_sun, apparent)
        if self.equator is None:
            pole = np.cross(self.here - sun.q, self.speed - sun.v)
        else:
            pole = self.equator[:, 2]
        out["trails"] = np.sign((np.cross(of_sun, apparent) * pole).sum(axis=1)) * (not is_sun)
        return out

    def _sun_before(self, delay: Array, q: Array) -> Array:
        """Return where the Sun was when the light left it that a body at q reflected, so long before the observation.

        Its motion in these hours is straight to a hundred metres.
        """
        sun = self.placing.sun
        assert sun is not None
        there = sun.q - delay[:, None] * sun.v
        return emission(there, sun.v, q, lambda d: (there - d[:, None] * sun.v, sun.v))[1]

    def _apparent(self, direction: Array, q: Array, *, is_sun: bool) -> Array:
        """Return the directions in which light arrives at the moving observer, (m, 3), in the axes of the ICRF."""
        sun = self.placing.sun
        if sun is None or self.where.at_sun:
            return aberrated(direction, self.speed, FAR)
        bent = direction if is_sun else deflected(direction, q, self.here, sun.q)
        away = np.linalg.norm(self.here - sun.q, axis=1)
        return aberrated(bent, self.speed, np.where(away > 0.0, away, FAR))  # a run may have the Sun at its origin


def _angles(direction: Array) -> tuple[Array, Array]:
    """Return right ascension, 0 to 2 pi, and declination of directions, (m,) each, radians."""
    x, y, z = direction.T
    return np.arctan2(y, x) % (2.0 * np.pi), np.arctan2(z, np.hypot(x, y))


def _tangents(direction: Array) -> tuple[Array, Array]:
    """Return the directions towards the east and the north on the sky, (m, 3) each."""
    x, y = direction[:, 0], direction[:, 1]
    level = np.hypot(x, y)
    with np.errstate(invalid="ignore", divide="ignore"):
        east = np.stack([-y / level, x / level, np.zeros_like(x)], axis=1)
    return east, np.cross(direction, east)
