"""Radar: how long an echo of a body takes, and by how much its frequency is shifted.

The signal leaves the transmitter, is thrown back where the body is then, and reaches the receiver; the field of the Sun
delays both ways. Times are those of clocks at rest on the Earth. The shift is the rate of the delay, without a
difference. Left out are the troposphere, 5 m of both ways at the zenith (0.015 microseconds, 0.05 Hz at 8.6 GHz near
the horizon), the plasma between the planets, and how the axis of the Earth moves (0.05 mm/s of an antenna, 0.003 Hz);
the MPC's table has the places of antennas to some metres.
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
from orbits.observing import earth
from orbits.observing.light import C
from orbits.units import GM_SUN

Array = NDArray[np.float64]

SECOND = 1.0 / 86400.0
BY_SUN = 2.0 * GM_SUN / C**3
"""Days; times the logarithm of places, the delay of a way by the field of the Sun."""

ROUNDS = 3
"""Of the way from the transmitter, which moves by 1e-4 of it meanwhile: the last round leaves nothing."""


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


class Echo(NamedTuple):
    """The echoes of a body, (m,) or (m, 3).

    down, up : the ways from the body to the receiver, and from the transmitter to it; q, v : of the body then
    delay : between transmission and reception, by the clocks of the antennas, seconds; shift : of the frequency,
        relative to it
    """

    down: Way
    up: Way
    q: Array
    v: Array
    delay: Array
    shift: Array

    @property
    def delay_by_q(self) -> Array:
        """The derivatives of the delay by the place of the body, seconds per au, (m, 3); in days, those of the shift by
        its velocity are their negative. They are good to 1e-4, as the times of bounce and transmission are held.
        """
        return np.asarray((self.down.towards + self.up.towards) / (C * SECOND))

    @property
    def shift_by_q(self) -> Array:
        """The derivatives of the shift by the place of the body, per au, (m, 3), as good."""
        return _turning(self.down, self.up) / -C


def echo(received: Antenna, transmitter: Array, times: Time, q: Array, v: Array, delay: Array) -> Echo:
    """Return the echoes of a body that is at q, v so many days before each reception, about the light time: the motion
    in the rest of it is straight.

    transmitter : places in the axes of the Earth, au, (m, 3); times : of the receptions, TDB
    """
    down = received.way_to(q, v)
    rest = (down.days - delay) / (1.0 + (down.towards * v).sum(axis=1) / C)
    q = q - rest[:, None] * v
    down = received.way_to(q, v)
    up, sent = down, received
    for _ in range(ROUNDS):
        sent = antennas(transmitter, times - (down.days + up.days) * u.day)
        up = sent.way_to(q, v)
    took = (down.days + up.days) / SECOND - (received.clock - sent.clock)
    # The rates of the times of bounce and of transmission by that of the reception.
    of_receiver, out = ((down.towards * x).sum(axis=1) / C for x in (received.v, v))
    of_transmitter, back = ((up.towards * x).sum(axis=1) / C for x in (sent.v, v))
    bounce = (1.0 + of_receiver - down.rate) / (1.0 + out)
    transmission = (bounce * (1.0 - back) - up.rate) / (1.0 - of_transmitter)
    clocks = (1.0 - sent.clock_rate) / (1.0 - received.clock_rate)
    return Echo(down, up, q, v, took, np.asarray(transmission * clocks - 1.0))


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
