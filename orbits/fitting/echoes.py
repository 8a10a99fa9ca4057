"""What radar should have found of a body: delays of echoes, and shifts of their frequency."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from astropy.time import Time
from numpy.typing import NDArray

from orbits.astrometry.record import DELAY, Record
from orbits.finding import Finding
from orbits.observing.light import C
from orbits.observing.radar import SECOND, antennas, echo
from orbits.observing.stations import stations

Array = NDArray[np.float64]


class Found(NamedTuple):
    """What should be found of a body.

    delay : of the light from the body to the receiver, days, (m,)
    value : computed microseconds, or Hz, (m,); by_state : its derivatives by the state of the body when the signal
        reaches it, (m, 6)
    """

    delay: Array
    value: Array
    by_state: Array


class Echoes:
    """Radar at m times, an Instrument.

    days : of the receptions since the epoch, (m,); radius : of the body, au, for measurements to its surface

    Raises EpochError for times outside DE440.
    """

    def __init__(self, records: tuple[Record, ...], times: Time, epoch: Time, radius: float) -> None:
        self.days = (times.jd1 - epoch.jd1) + (times.jd2 - epoch.jd2)
        self._times = times
        self._delays = np.array([one.kind == DELAY for one in records])
        self._units = np.array([1e6 if one.kind == DELAY else one.frequency * 1e6 for one in records])
        self._measured = np.array([one.value * (1e6 if one.kind == DELAY else 1.0) for one in records])
        self._less = np.array([2.0 * radius / (C * SECOND) if one.surface else 0.0 for one in records])
        table = stations()
        places = np.array([[table[code].x for code in (one.station, one.transmitter)] for one in records])
        self._received, self._transmitters = antennas(places[:, 0], times), places[:, 1]

    def seen(self, q: Array, v: Array, delay: Array) -> Found:
        """As an Instrument."""
        found = echo(self._received, self._transmitters, self._times, q, v, delay)
        value = np.where(self._delays, found.delay - self._less, found.shift)
        delays = self._delays[:, None]
        by_q = np.where(delays, found.delay_by_q, found.shift_by_q)
        by_v = np.where(delays, 0.0, -SECOND * found.delay_by_q)
        by_state = self._units[:, None] * np.concatenate([by_q, by_v], axis=1)
        return Found(found.down.days, self._units * value, by_state)

    def residuals(self, seen: Found) -> Array:
        """As an Instrument: microseconds or Hz, and 0."""
        return np.stack([self._measured - seen.value, np.zeros(len(self.days))], axis=1)

    def derivatives(self, seen: Found, of_state: Array) -> Array:
        """As an Instrument."""
        first = np.einsum("mi,mij->mj", seen.by_state, of_state)
        return np.stack([first, np.zeros_like(first)], axis=1)


def without_radius(body: str) -> Finding:
    """Return what is told of delays to a surface whose distance from the centre is not known."""
    return Finding(
        f"delays of {body} were measured to its surface, whose radius is not given: they are taken to its centre, two "
        "radii less the speed of light too long, 1 microsecond for 150 m.",
        remedy=f'system.add("{body}", ..., radius=...), or leave these observations out.',
    )
