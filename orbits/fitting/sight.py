"""What optical observers should have seen of a body: its direction, and its derivatives by the start of the body.

Measured places are relative to the stars about the body. The stellar aberration of both is the same; light from the
body is bent by the Sun as it is from its distance, light from stars as from infinity, and their catalogue is of
directions without it. The difference, up to some milliarcseconds far from the Sun, is in the direction here.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import erfa
import numpy as np
from astropy.time import Time
from numpy.typing import NDArray

from orbits import ephemeris
from orbits.astrometry.record import Record
from orbits.observing.clocks import carried
from orbits.observing.light import C, deflected, unit
from orbits.observing.stations import stations

Array = NDArray[np.float64]

ARCSECONDS = np.rad2deg(1.0) * 3600.0


class Seen(NamedTuple):
    """What should be seen of a body by m observers.

    delay : of the light, days, (m,); direction : towards the body, in the ICRF, (m, 3); distance : au, (m,)
    velocity : of the body when the light left it, au/d, (m, 3)
    """

    delay: Array
    direction: Array
    distance: Array
    velocity: Array


class Sight:
    """Optical observers at m times.

    days : of the observations since the epoch, (m,); here : places of the observers, sun : of the Sun then, au, (m, 3)
    measured : directions, (m, 3), with the axes towards east and north there

    Raises EpochError for times outside DE440.
    """

    def __init__(self, records: tuple[Record, ...], times: Time, epoch: Time) -> None:
        self.days = (times.jd1 - epoch.jd1) + (times.jd2 - epoch.jd2)
        tracks, _ = ephemeris.tracks(["Earth", "Sun"], times.jd1, times.jd2)
        self.here, self.sun = tracks[:, 0] + _from_geocentre(records, times), tracks[:, 1]
        ra, dec = np.deg2rad([(one.ra, one.dec) for one in records]).T
        self.measured = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=1)
        self.east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=1)
        self.north = np.cross(self.measured, self.east)

    def some(self, rows: NDArray[np.intp]) -> Self:
        """Return those of some of the observations."""
        copy = object.__new__(type(self))
        copy.__dict__.update({name: x[rows] for name, x in vars(self).items()})
        return copy

    def since(self, day: float) -> Self:
        """Return the same observers, with their days from a later epoch."""
        copy = object.__new__(type(self))
        copy.__dict__.update(vars(self), days=self.days - day)
        return copy

    def seen(self, q: Array, v: Array, delay: Array) -> Seen:
        """Return what is seen of a body that is at q, v so many days before each observation, about the light time: the
        motion in the rest of it is straight.
        """
        way = q - self.here
        distance = np.linalg.norm(way, axis=1)
        rest = (distance - C * delay) / (C + (way * v).sum(axis=1) / distance)
        way = way - rest[:, None] * v
        direction = unit(way)
        bent = deflected(direction, self.here + way, self.here, self.sun)
        towards = self.here - self.sun
        far = np.linalg.norm(towards, axis=1)
        of_star = unit(erfa.ldsun(direction, unit(towards), far))
        return Seen(delay + rest, unit(direction + bent - of_star), np.linalg.norm(way, axis=1), v)

    def residuals(self, seen: Seen) -> Array:
        """Return measured less computed right ascension times cos(dec), and declination, arcseconds, (m, 2).

        They are coordinates in the plane of the sky about the measured place, which differ from angles by the third
        power of their size.
        """
        depth = (seen.direction * self.measured).sum(axis=1)
        across = [-(seen.direction * axis).sum(axis=1) for axis in (self.east, self.north)]
        return np.asarray(np.stack([np.arctan2(x, depth) for x in across], axis=1) * ARCSECONDS)

    def derivatives(self, seen: Seen, of_state: Array) -> Array:
        """Return the derivatives of the computed right ascension times cos(dec), and declination, arcseconds,
        (m, 2, n), by what states of the body depend on, (m, 6, n).
        """
        of_position = of_state[:, :3]
        along = np.einsum("mi,mij->mj", seen.direction, of_position)
        later = along / (C + (seen.direction * seen.velocity).sum(axis=1))[:, None]
        change = of_position - seen.velocity[:, :, None] * later[:, None]
        turned = change - seen.direction[:, :, None] * np.einsum("mi,mij->mj", seen.direction, change)[:, None]
        turned /= seen.distance[:, None, None]
        depth, deeper = self._along(self.measured, seen, turned)
        out = []
        for axis in (self.east, self.north):
            across, further = self._along(axis, seen, turned)
            out.append((depth * further - across * deeper) / (depth**2 + across**2))
        return np.asarray(np.stack(out, axis=1) * ARCSECONDS)

    def _along(self, axis: Array, seen: Seen, turned: Array) -> tuple[Array, Array]:
        """Return the component of the directions along an axis, (m, 1), and that of their derivatives, (m, n)."""
        return (seen.direction * axis).sum(axis=1)[:, None], np.asarray(np.einsum("mi,mij->mj", axis, turned))


def _from_geocentre(records: tuple[Record, ...], times: Time) -> Array:
    """Return the places of observers relative to the geocentre, in the axes of the ICRF, au, (m, 3)."""
    table = stations()  # the readers refuse records without a place
    x = np.array([table[one.station].x if one.place is None else one.place[:3] for one in records])
    turns = np.array([one.place is None or one.place.turns for one in records]) & x.any(axis=1)
    jd, part = np.array([(one.jd, one.part) for one in records]).T
    x[turns] = carried(x[turns], times[turns], jd[turns], part[turns])
    return x
