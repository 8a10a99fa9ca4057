"""The constants that DE440 was integrated with, besides GM of Sun and planets, as floats.

Source: the comment area of de440.bsp; Park, Folkner, Williams & Boggs (2021), AJ 161, 105.
"""

from __future__ import annotations

import json
import math
from functools import cache
from typing import Any

from orbits.ephemeris import AU_KM
from orbits.resources import data_path

SUN_POLE = (286.13, 63.87)
"""The pole of the Sun, right ascension and declination in the ICRF, degrees: Archinal et al. (2018), CMDA 130, 22."""

MOON_POLE = (269.9949, 66.5392)
"""The mean pole of the Moon, as above: that of the ecliptic, about which its own moves at 1.5 degrees in 18.6 years."""

J2000 = 2451545.0
JULIAN_YEAR = 365.25

GENERAL_PRECESSION = 2004.1903, 2306.083227
"""theta_A and half of zeta_A + z_A, arcseconds per Julian century: the pole of the Earth moves by the first towards the
equinox; IAU 2006, linear parts: Capitaine, Wallace & Chapront (2003), A&A 412, 567."""


@cache
def _file() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(data_path("de440_constants.json").read_text(encoding="utf-8"))
    return found


def constant(name: str) -> float:
    """Return a constant by its name in DE440, such as "J2SUN": radii in km, the Sun's spin in rad/d."""
    return float(_file()["constants"][name])


def ring() -> list[float]:
    """Return GM of the bodies of the ring, au^3/d^2."""
    return [float(gm) for gm in _file()["ring"]]


def solar_spin() -> float:
    """Return the angular momentum of the Sun by its mass, au^2/d: moment of inertia and rotation of DE440."""
    radius = constant("ASUN") / AU_KM
    return constant("MOISUN") * radius * radius * constant("OMGSUN")


def solar_gm(gm: float, day: float) -> float:
    """Return GM of the Sun at a Julian date, TDB, from that at J2000."""
    return gm * (1.0 + constant("GMSDOT") * (day - J2000) / JULIAN_YEAR)


def earth_pole(day: float) -> tuple[float, float, float]:
    """Return the mean pole of the Earth at a Julian date, TDB, as a unit vector in the ICRF.

    Without the frame bias; good to 1" from 1900 to 2100.
    """
    century = (day - J2000) / (100.0 * JULIAN_YEAR)
    theta, zeta = (math.radians(rate * century / 3600.0) for rate in GENERAL_PRECESSION)
    # The pole of date in the axes of J2000: tilted by theta towards the right ascension -zeta.
    return math.sin(theta) * math.cos(zeta), -math.sin(theta) * math.sin(zeta), math.cos(theta)
