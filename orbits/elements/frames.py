"""The frames of elements: the ecliptic of J2000, the ICRF, the axes of the system itself, and the plane of the sky.

Ephemerides use the ICRF; orbital elements in the Solar System are published in the ecliptic of J2000, those elsewhere
in the plane of the sky, or in axes that each paper defines. Ecliptic and ICRF share the x axis (the vernal equinox)
and differ by a rotation about it through the obliquity of 84381.448 arcseconds, the IAU 1976 value, which JPL's
Horizons and Small-Body Database use as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from orbits.body_names import place_of
from orbits.elements.kepler_equation import Floats
from orbits.elements.refusals import shaped
from orbits.errors import UnknownNameError, shown
from orbits.units import UnitSystem

OBLIQUITY = math.radians(84381.448 / 3600.0)
"""The obliquity of the ecliptic at J2000, radians."""

FRAMES: Mapping[str, str] = {
    "ecliptic": "ecliptic of J2000",
    "icrf": "ICRF",
    "system": "axes of the system",
    "sky": "plane of the sky",
}
"""The names of the frames, and what they are called. A system with the Sun has the axes of the ICRF, so that "icrf" and
"system" are the same there; of other systems "icrf" says that they have, and "sky" that they are those of the sky: x to
the north, y to the east, and z towards the observer. Nodes are where bodies come through the sky towards the observer.
Planets then pass in front of their star at omega + f = 90 degrees, and the star recedes by K (cos(omega + f) + e cos
omega), omega of the orbit of the planet: the convention of transits and of radial velocities.
"""


def default_frame(units: UnitSystem, names: Sequence[str]) -> str:
    """Return the frame of a system's elements, pictures and planes: "ecliptic" with the Sun, in physical units, and
    otherwise "system".
    """
    return "ecliptic" if units.is_physical and place_of("Sun", names) is not None else "system"


def ecliptic_to_icrf(x: ArrayLike) -> Floats:
    """Transform vectors from the ecliptic of J2000 to the ICRF, shape (..., 3), any unit."""
    return _rotated_about_x(x, math.cos(OBLIQUITY), math.sin(OBLIQUITY))


def icrf_to_ecliptic(x: ArrayLike) -> Floats:
    """Transform vectors from the ICRF to the ecliptic of J2000, shape (..., 3), any unit."""
    return _rotated_about_x(x, math.cos(OBLIQUITY), -math.sin(OBLIQUITY))


def to_frame(x: ArrayLike, frame: str) -> Floats:
    """Transform vectors from the axes of a system to `frame`, shape (..., 3).

    Raises UnknownNameError for any other frame.
    """
    return icrf_to_ecliptic(x) if checked_frame(frame) == "ecliptic" else shaped("a vector", x)


def from_frame(x: ArrayLike, frame: str) -> Floats:
    """Transform vectors from `frame` to the axes of a system, shape (..., 3).

    Raises UnknownNameError for any other frame.
    """
    return ecliptic_to_icrf(x) if checked_frame(frame) == "ecliptic" else shaped("a vector", x)


def checked_frame(frame: str) -> str:
    """Return `frame` in lower case. Raises UnknownNameError if there is no such frame."""
    if isinstance(frame, str) and frame.lower() in FRAMES:
        return frame.lower()
    raise UnknownNameError(
        f"there is no frame {shown(frame)}; expected one of {', '.join(map(repr, FRAMES))}: 'ecliptic' is the ecliptic "
        "and equinox of J2000, 'icrf' the axes of the ephemerides, 'system' those of the system itself, 'sky' the same "
        "where x and y are in the plane of the sky"
    )


def _rotated_about_x(x: ArrayLike, cosine: float, sine: float) -> Floats:
    x = shaped("a vector", x)
    y, z = x[..., 1], x[..., 2]
    return np.stack([x[..., 0], cosine * y - sine * z, sine * y + cosine * z], axis=-1)
