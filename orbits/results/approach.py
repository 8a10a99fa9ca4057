"""One closest approach, with names, units and a date."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u

from orbits.errors import with_unit
from orbits.units import date_text, written

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.marching.clocks.clock import Clock
    from orbits.results.passages import Passage
    from orbits.system import System

LUNAR_DISTANCE = 384_400 * u.km
"""The mean distance of the Moon, the unit of close approaches to the Earth."""

NEAR = 0.05 * u.au
"""Distances below this are also given in kilometres."""

MILLIMETRE, ROUND_OFF = 1e-6 * u.km, 1e-15 * u.dimensionless_unscaled
"""Errors below this are shown as "less than" it."""

READABLE = 100.0, 1e10
"""Numbers between these are written out: 1,600,000."""


@dataclass(frozen=True)
class Approach:
    """One closest approach of two bodies: distance, relative speed, and time since the epoch.

    error : the position error at the end of the run that the passage causes with this method and step, in km (or in the
        system's unit of length, if it has no physical units); None if it is unknown
    v_infinity : the relative speed without the attraction of the two, sqrt(speed^2 - 2 GM / distance); None if they are
        bound to each other
    estimated : whether distance, time and speed are only those of the two-body orbit within the step, as recorded on
        the way (to about 1e-3), as the motion there could not be computed again
    epoch : of the system, if it has one: from it follows `date`, the time as a `Time` (TDB)
    distance_sigma, time_sigma : standard deviations by a covariance at the start of the run, to first order; None
        without one, and that of the time also at an end of the run, where the distance is no minimum
    """

    body: str
    other: str
    distance: u.Quantity
    time: u.Quantity
    speed: u.Quantity
    error: u.Quantity | None = None
    v_infinity: u.Quantity | None = None
    estimated: bool = False
    epoch: Time | None = field(default=None, repr=False)
    distance_sigma: u.Quantity | None = None
    time_sigma: u.Quantity | None = None

    @classmethod
    def of(
        cls,
        system: System,
        clock: Clock,
        passage: Passage,
        error: float | None,
        estimated: bool = False,
        sigma: tuple[float, float | None] | None = None,
    ) -> Approach:
        """Return a passage of a run with this clock, with names and units; sigma : of distance and time."""
        names, gm, units = system.names, system.values.gm, system.units
        lighter, heavier = sorted((passage.body, passage.other), key=lambda body: gm[body])
        free = passage.speed**2 - 2.0 * (gm[lighter] + gm[heavier]) / passage.distance if passage.distance else -1.0
        return cls(
            names[lighter],
            names[heavier],
            u.Quantity(passage.distance, units.length),
            u.Quantity(clock.time(passage.steps), units.time),
            u.Quantity(passage.speed, units.speed),
            None if error is None else as_error(system, error),
            u.Quantity(math.sqrt(free), units.speed) if free >= 0.0 else None,
            estimated,
            system.epoch,
            None if sigma is None else u.Quantity(sigma[0], units.length),
            None if sigma is None or sigma[1] is None else u.Quantity(sigma[1], units.time),
        )

    @cached_property
    def date(self) -> Time | None:
        """The time as a `Time` (TDB), if the system has an epoch."""
        return None if self.epoch is None else written((self.epoch + self.time).copy(format="iso"))

    def __str__(self) -> str:
        distance = f"{self.distance:.6g}"
        if self.distance.unit.is_equivalent(u.km) and self.distance.unit != u.km and self.distance < NEAR:
            distance += f" = {self.distance.to(u.km):,.0f}"
        when = f"t = {self.time:.6g}" if self.date is None else f"{date_text(self.date, 16)} TDB (t = {self.time:.6g})"
        speed = self.speed.to(u.km / u.s) if self.speed.unit.is_equivalent(u.km / u.s) else self.speed
        named = "" if str(speed.unit) else "speed "  # a number alone would say nothing
        text = f"{self.body} to {self.other}: {distance} at {when}, {named}{speed:.3g}"
        known = [x for x in (self.distance_sigma, self.time_sigma) if x is not None]
        if known:
            each = [x.to(y) if x.unit.is_equivalent(y) else x for x, y in zip(known, (u.km, u.s), strict=False)]
            text += f", with {'sigmas' if len(each) > 1 else 'a sigma'} of {' and '.join(f'{x:.3g}' for x in each)}"
        text += ", estimated from the two-body orbit within the step" * self.estimated
        if self.error is None:
            return text
        if not np.isfinite(self.error):
            return f"{text}; what that does to the rest of the run cannot be told"
        return f"{text}; puts it {about(self.error)} off by the end of the run"


def unit_of_errors(system: System) -> u.UnitBase:
    """Return km, or the unit of length of a system without physical units."""
    length: u.UnitBase = system.units.length
    return u.km if length.is_equivalent(u.km) else length


def as_error(system: System, length: float) -> u.Quantity:
    """Return a length in the unit of errors."""
    return u.Quantity(length, system.units.length).to(unit_of_errors(system))


def said(error: u.Quantity) -> str:
    """Return an error in words, with two digits, or "less than" a millimetre, or round-off without units."""
    if not np.isfinite(error):
        return "beyond all bounds"
    least = MILLIMETRE if error.unit.is_equivalent(u.km) else ROUND_OFF
    return f"less than {least:g}".rstrip() if error < least else with_unit(two_digits(error.value), error.unit)


def about(error: u.Quantity) -> str:
    """Return the same where the error is an estimate: "about 1,600 km"."""
    text = said(error)
    return text if text.startswith("less") else f"about {text}"


def at_least(error: u.Quantity) -> str:
    """Return the same where the error is a lower bound, rounded down to one digit: "at least 20 km"."""
    least = MILLIMETRE if error.unit.is_equivalent(u.km) else ROUND_OFF
    if not np.isfinite(error) or error < least:
        return said(error)
    size = 10.0 ** math.floor(math.log10(error.value))
    return f"at least {with_unit(two_digits(math.floor(error.value / size) * size), error.unit)}"


def two_digits(x: float) -> str:
    """Return a number to two digits, without a power of ten as long as it is readable."""
    rounded = float(f"{x:.2g}")
    return f"{rounded:,.0f}" if READABLE[0] <= abs(rounded) < READABLE[1] else f"{rounded:g}"
