"""Runs of DE440's bodies whose states, at the epoch, are those of DE440, and angles in milliarcseconds."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from astropy import units as u
from astropy.coordinates import EarthLocation

import orbits

ALL = ("Sun", "Mercury", "Venus", "Earth", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")

PACHON = EarthLocation.from_geodetic(-70.7366 * u.deg, -30.2407 * u.deg, 2663 * u.m)

C = 299792.458 * u.km / u.s


@cache
def begun(epoch: str, bodies: tuple[str, ...] | None = ALL, origin: str = "ssb") -> orbits.Trajectory:
    """Return a run of a minute: at its start it is DE440, and light comes from before it."""
    system = orbits.System.solar_system(epoch, bodies=bodies, origin=origin)
    return orbits.propagate(system, duration=1 * u.min, samples=2)


def mas(one: Any, other: Any) -> float:
    """Return the largest difference of two angles, in milliarcseconds."""
    full = 360 * 3600e3
    apart = np.asarray(u.Quantity(one).to_value(u.mas) - u.Quantity(other).to_value(u.mas))
    return float(np.abs((apart + full / 2) % full - full / 2).max())
