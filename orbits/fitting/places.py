"""Places of observers that have no code: from latitude and longitude."""

from __future__ import annotations

import erfa
import numpy as np

from orbits.ephemeris import AU_KM
from orbits.fitting.record import Place

WGS84 = 1


def on_the_ellipsoid(longitude: float, latitude: float, height: float) -> Place:
    """Return a place on the Earth: degrees east, degrees north, metres above the ellipsoid of WGS84."""
    x, y, z = erfa.gd2gc(WGS84, np.deg2rad(longitude), np.deg2rad(latitude), height) / (1e3 * AU_KM)
    return Place(float(x), float(y), float(z), True)
