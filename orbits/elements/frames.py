"""The two frames of axes that the package knows by name: ICRF and the ecliptic of J2000.

Ephemerides come in the ICRF; orbital elements are published in the ecliptic of J2000. The two share the x axis (the
vernal equinox) and differ by a rotation about it through the obliquity of 84381.448 arcseconds, the IAU 1976 value,
which JPL's Horizons and Small-Body Database use too.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from orbits.elements.kepler_equation import Floats
from orbits.elements.refusals import shaped
from orbits.errors import UnknownNameError, shown
from orbits.units import UnitSystem

OBLIQUITY = math.radians(84381.448 / 3600.0)
"""The obliquity of the ecliptic at J2000, radians."""

FRAMES = ("icrf", "ecliptic")
"""The frames by name; "icrf" stands for the axes that states are given in, whatever they are."""


def default_frame(units: UnitSystem) -> str:
    """Return the frame that elements refer to where none is named: the ecliptic, if there is a sky to have one."""
    return "ecliptic" if units.is_physical else "icrf"


def ecliptic_to_icrf(x: ArrayLike) -> Floats:
    """Return vectors given in the ecliptic of J2000 in the axes of the ICRF, shape (..., 3), any unit."""
    return _rotated_about_x(x, math.cos(OBLIQUITY), math.sin(OBLIQUITY))


def icrf_to_ecliptic(x: ArrayLike) -> Floats:
    """Return vectors given in the axes of the ICRF in the ecliptic of J2000, shape (..., 3), any unit."""
    return _rotated_about_x(x, math.cos(OBLIQUITY), -math.sin(OBLIQUITY))


def to_frame(x: ArrayLike, frame: str) -> Floats:
    """Return vectors given in the ICRF in the axes of `frame`, "icrf" or "ecliptic", shape (..., 3).

    Raises UnknownNameError for any other frame.
    """
    return icrf_to_ecliptic(x) if checked_frame(frame) == "ecliptic" else shaped("a vector", x)


def from_frame(x: ArrayLike, frame: str) -> Floats:
    """Return vectors given in the axes of `frame`, "icrf" or "ecliptic", in the ICRF, shape (..., 3).

    Raises UnknownNameError for any other frame.
    """
    return ecliptic_to_icrf(x) if checked_frame(frame) == "ecliptic" else shaped("a vector", x)


def checked_frame(frame: str) -> str:
    """Return `frame` in lower case; raise UnknownNameError when there is no such frame."""
    if isinstance(frame, str) and frame.lower() in FRAMES:
        return frame.lower()
    raise UnknownNameError(
        f"there is no frame {shown(frame)}; expected one of {', '.join(map(repr, FRAMES))}: 'ecliptic' is the ecliptic "
        "and equinox of J2000, 'icrf' the axes of the ephemerides (and of the system itself)"
    )


def _rotated_about_x(x: ArrayLike, cosine: float, sine: float) -> Floats:
    x = shaped("a vector", x)
    y, z = x[..., 1], x[..., 2]
    return np.stack([x[..., 0], cosine * y - sine * z, sine * y + cosine * z], axis=-1)
