"""The target plane of an encounter: where a body on its incoming asymptote would pass a planet that did not attract it.

The plane is through the planet, perpendicular to the incoming velocity at infinity, the direction eta; zeta is opposite
to the projection of the planet's velocity on it, xi completes a right-handed system. So zeta changes with the time at
which the body comes, and xi is the least distance of the orbits, nearly. Where the body is bound to the planet there is
no asymptote: the modified target plane is perpendicular to the velocity at the pericentre, the point there is that of
the pericentre.

Sources: Valsecchi, Milani, Gronchi & Chesley (2003), A&A 408, 1179, sec. 2; Farnocchia, Eggl, Chodas, Giorgini &
Chesley (2019), Celest. Mech. Dyn. Astron. 131, 36; Milani & Valsecchi (1999), Icarus 140, 408, for the modified plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orbits.elements.kepler_equation import Floats


class OnPlane(NamedTuple):
    """Points on target planes, n of them.

    xi, zeta : coordinates; pericentre : distance from the planet, (n,)
    speed2 : the square of the velocity at infinity, negative for bodies bound to the planet, (n,)
    axes : (n, 3, 3), rows xi, eta, zeta
    """

    xi: Floats
    zeta: Floats
    pericentre: Floats
    speed2: Floats
    axes: Floats


def on_target_plane(q: Floats, v: Floats, gm: float, moving: Floats, *, modified: bool) -> OnPlane:
    """Return where bodies pass a planet, from states anywhere on their orbits about it.

    q, v : (n, 3), relative to the planet; gm : of both; moving : (n, 3), the velocity of the planet about the Sun
    modified : whether the plane is the modified one. Otherwise all bodies must be on hyperbolas
    """
    r = np.linalg.norm(q, axis=1)
    speed2 = _dot(v, v) - 2.0 * gm / r
    h = np.cross(q, v)
    ahead = np.cross(v, h) / gm - q / r[:, None]  # the eccentricity vector, to the pericentre
    e = np.linalg.norm(ahead, axis=1)
    pericentre = _dot(h, h) / (gm * (1.0 + e))
    infinity = np.sqrt(np.maximum(speed2, 0.0))[:, None]
    # The direction at infinity, written so that it stays exact for a body that falls towards the centre.
    eta = np.cross(h, ahead) if modified else ahead + infinity / gm * np.cross(h, ahead)
    eta /= np.linalg.norm(eta, axis=1)[:, None]
    point = ahead * (pericentre / e)[:, None] if modified else np.cross(eta, h) / infinity
    zeta = _dot(eta, moving)[:, None] * eta - moving
    zeta /= np.linalg.norm(zeta, axis=1)[:, None]
    xi = np.cross(eta, zeta)
    return OnPlane(_dot(point, xi), _dot(point, zeta), pericentre, speed2, np.stack([xi, eta, zeta], axis=1))


def _dot(a: Floats, b: Floats) -> Floats:
    product: Floats = (a * b).sum(axis=1)
    return product
