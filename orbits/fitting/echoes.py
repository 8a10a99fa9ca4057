"""What radar should have found of a body: how long the echo took, and by how much its frequency was shifted.

The signal leaves the transmitter, is thrown back where the body is then, and reaches the receiver; the field of the Sun
delays both ways. Times are those of clocks at rest on the Earth. The shift is the rate of the delay, without a
difference. Left out are the troposphere, 5 m of both ways at the zenith (0.015 microseconds, 0.05 Hz at 8.6 GHz near
the horizon), the plasma between the planets, and the places of stations, which the MPC's table has to some metres.
Sources: Yeomans et al. (1992), AJ 103, 303; Moyer (2003), Formulation for Observed and Computed Values of Deep Space
Network Data Types, sec. 8.3.1 and 13.3.
"""

from __future__ import annotations

from typing import NamedTuple

import erfa
import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits import ephemeris
from orbits.ephemeris import AU_KM
from orbits.finding import Finding
from orbits.fitting.record import DELAY, Record
from orbits.observing import earth
from orbits.observing.light import C
from orbits.observing.stations import stations
from orbits.units import GM_SUN

Array = NDArray[np.float64]

SECOND = 1.0 / 86400.0
BY_SUN = 2.0 * GM_SUN / C**3
"""Days; times the logarithm of places, the delay of a way by the field of the Sun."""

ROUNDS = 3
"""Of the way from the transmitter, which moves by 1e-4 of it meanwhile: the last round leaves nothing."""


class Echo(NamedTuple):
    """What should be found of a body.

    delay : of the light from the body to the receiver, days, (m,)
    value : computed microseconds, or Hz, (m,); by_state : its derivatives by the state of the body when the signal
        reaches it, (m, 6)
    """

    delay: Array
    value: Array
    by_state: Array


class Way(NamedTuple):
    """A way between an antenna and a body, (m,) or (m, 3).

    towards : unit vector towards the body; length : au; days : of the light, with the field of the Sun
    rate : of what that field adds; w : velocity of the body relative to the antenna
    """

    towards: Array
    length: Array
    days: Array
    rate: Array
    w: Array


class Antenna(NamedTuple):
    """Antennas at m times.

    q, v, sun, sun_v : places and velocities, relative to the barycentre, and those of the Sun
    clock : TDB less the time of a clock there, seconds; clock_rate : its rate
    """

    q: Array
    v: Array
    sun: Array
    sun_v: Array
    clock: Array
    clock_rate: Array

    def way_to(self, q: Array, v: Array) -> Way:
        """Return the way to a body at q, v."""
        way, w = q - self.q, v - self.v
        length = np.linalg.norm(way, axis=1)
        n = way / length[:, None]
        ends, change = np.zeros((2, len(q)))
        for place, speed in ((q, v), (self.q, self.v)):
            from_sun = place - self.sun
            r = np.linalg.norm(from_sun, axis=1)
            ends, change = ends + r, change + (from_sun * (speed - self.sun_v)).sum(axis=1) / r
        along = (n * w).sum(axis=1)
        more = BY_SUN * np.log((ends + length) / (ends - length))
        rate = BY_SUN * ((change + along) / (ends + length) - (change - along) / (ends - length))
        return Way(n, length, length / C + more, rate, w)


class Echoes:
    """Radar at m times.

    days : of the receptions since the epoch, (m,); radius : of the body, au, for measurements to its surface

    Raises EpochError for times outside DE440.
    """

    def __init__(self, records: tuple[Record, ...], times: Time, epoch: Time, radius: float) -> None:
        self.days = (times.jd1 - epoch.jd1) + (times.jd2 - epoch.jd2)
        self.times = times
        self.measured = np.array([one.value * (1e6 if one.kind == DELAY else 1.0) for one in records])
        self.is_delay = np.array([one.kind == DELAY for one in records])
        self.hertz = np.array([one.frequency * 1e6 for one in records])
        self.before = np.array([2.0 * radius / C if one.surface else 0.0 for one in records])
        table = stations()
        receiver, self.transmitter = (
            np.array([table[code].x for code in codes])
            for codes in ([one.station for one in records], [one.transmitter for one in records])
        )
        self.received = antennas(receiver, times)

    def seen(self, q: Array, v: Array, delay: Array) -> Echo:
        """Return what is found of a body that is at q, v so many days before each reception, about the light time: the
        motion in the rest of it is straight.
        """
        down = self.received.way_to(q, v)
        rest = (down.days - delay) / (1.0 + (down.towards * v).sum(axis=1) / C)
        q = q - rest[:, None] * v
        down = self.received.way_to(q, v)
        up, sent = down, self.received
        for _ in range(ROUNDS):
            sent = antennas(self.transmitter, self.times - (down.days + up.days) * u.day)
            up = sent.way_to(q, v)
        n = down.towards + up.towards
        took = (down.days + up.days) / SECOND - (self.received.clock - sent.clock)
        late = np.where(self.is_delay, (took - self.before / SECOND) * 1e6, self._shift(down, up, sent, v))
        by_q = np.where(self.is_delay[:, None], n * (1e6 / SECOND / C), -self.hertz[:, None] / C * _turning(down, up))
        by_v = np.where(self.is_delay[:, None], 0.0, -self.hertz[:, None] / C * n)
        return Echo(down.days, late, np.concatenate([by_q, by_v], axis=1))

    def _shift(self, down: Way, up: Way, sent: Antenna, v: Array) -> Array:
        """Return the shift in Hz: the rates of the times of bounce and of transmission by that of the reception."""
        of_receiver, out = ((down.towards * x).sum(axis=1) / C for x in (self.received.v, v))
        of_transmitter, back = ((up.towards * x).sum(axis=1) / C for x in (sent.v, v))
        bounce = (1.0 + of_receiver - down.rate) / (1.0 + out)
        transmission = (bounce * (1.0 - back) - up.rate) / (1.0 - of_transmitter)
        clocks = (1.0 - sent.clock_rate) / (1.0 - self.received.clock_rate)
        return np.asarray(self.hertz * (transmission * clocks - 1.0))

    def residuals(self, seen: Echo) -> Array:
        """Return measured less computed, microseconds or Hz, and 0, (m, 2)."""
        return np.stack([self.measured - seen.value, np.zeros(len(self.days))], axis=1)

    def derivatives(self, seen: Echo, of_state: Array) -> Array:
        """Return the derivatives of what is computed, and 0, (m, 2, n), by what states of the body depend on,
        (m, 6, n): to 1e-4, as the times of bounce and transmission are held.
        """
        first = np.einsum("mi,mij->mj", seen.by_state, of_state)
        return np.stack([first, np.zeros_like(first)], axis=1)


def _turning(down: Way, up: Way) -> Array:
    """Return the derivative of the rates of both lengths by the place of the body, per day, (m, 3)."""
    across = [one.w - one.towards * (one.towards * one.w).sum(axis=1)[:, None] for one in (down, up)]
    return np.asarray(across[0] / down.length[:, None] + across[1] / up.length[:, None])


def antennas(x: Array, times: Time) -> Antenna:
    """Return antennas at places in the axes of the Earth, au, (m, 3), at m times in TDB."""
    places, moving = ephemeris.tracks(["Earth", "Sun"], times.jd1, times.jd2)
    ut1, pole = earth.rotation(times)
    q, v = earth.turned_by(times, ut1, pole).carries(x)
    east, from_axis, north = np.arctan2(x[:, 1], x[:, 0]), np.hypot(x[:, 0], x[:, 1]) * AU_KM, x[:, 2] * AU_KM
    before, clock, after = (
        erfa.dtdb(times.jd1, times.jd2 + later, (ut1[0] - 0.5 + ut1[1] + later) % 1.0, east, from_axis, north)
        for later in (-60.0 * SECOND, 0.0, 60.0 * SECOND)
    )
    return Antenna(places[:, 0] + q, moving[:, 0] + v, places[:, 1], moving[:, 1], clock, (after - before) / 120.0)


def bounced_nowhere(body: str) -> Finding:
    """Return what is told of delays to a surface whose distance from the centre is not known."""
    return Finding(
        f"delays of {body} were measured to its surface, whose radius is not given: they are taken to its centre, two "
        "radii less the speed of light too long, 1 microsecond for 150 m.",
        remedy=f'system.add("{body}", ..., radius=...), or leave these observations out.',
    )
