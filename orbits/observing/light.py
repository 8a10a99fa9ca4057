"""Light on its way to an observer: light time, deflection by the Sun, and aberration.

Positions are in au and relative to the barycentre of the Solar System, times in days, velocities in au/d.
Sources: Urban & Seidelmann (2013), Explanatory Supplement, sec. 7.3; ERFA's ld and ab (IAU SOFA).
"""

from __future__ import annotations

from collections.abc import Callable

import erfa
import numpy as np
from numpy.typing import NDArray

from orbits.ephemeris import AU_KM

Array = NDArray[np.float64]

C = 299792.458 * 86400.0 / AU_KM
"""The speed of light, au/d."""

ENOUGH = 1e-7
"""Days, 9 ms, from which the motion of a body is taken as straight: within half a millimetre at 10 m/s^2."""

MOST_ROUNDS = 20

FAR = 1e12
"""Stands for the distance of the Sun, au, where its potential at the observer is left out."""


def emission(
    q: Array, v: Array, observer: Array, at: Callable[[Array], tuple[Array, Array]]
) -> tuple[Array, Array, Array]:
    """Return the light times of a body, (m,), and its position and velocity when the light left it, (m, 3) each.

    q, v : (m, 3), of the body at the times of observation; observer : (m, 3), its positions
    at : returns positions and velocities of the body, so long before the times of observation

    The motion just before a time is straight enough for Newton's method, whose steps are tested by `at`.
    """
    delay = np.zeros(len(q))
    for _ in range(MOST_ROUNDS):
        change = _later(q, v, observer, delay)
        if not np.nanmax(np.abs(change), initial=0.0) > ENOUGH:
            break
        delay = delay + change
        q, v = at(np.where(np.isfinite(delay), delay, 0.0))
    else:
        change = np.where(np.abs(change) > ENOUGH, np.nan, change)
    return delay + change, q - change[:, None] * v, v


def _later(q: Array, v: Array, observer: Array, delay: Array) -> Array:
    """Return what is to be added to the delays, for straight motion from q."""
    way = q - observer
    distance = np.linalg.norm(way, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        towards = np.where(distance > 0.0, (way * v).sum(axis=1) / distance, 0.0)
    return np.asarray((distance - C * delay) / (C + towards))


def unit(x: Array) -> Array:
    """Return vectors of length 1, (m, 3); NaN for those of length 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(x / np.linalg.norm(x, axis=-1, keepdims=True))


def deflected(direction: Array, source: Array, observer: Array, sun: Array) -> Array:
    """Return the directions, (m, 3), in which a source is seen through the Sun's field.

    Where the observer or the source is the Sun, nothing is bent.

    source, observer, sun : positions, (m, 3)
    """
    from_sun, towards = source - sun, observer - sun
    distance = np.linalg.norm(towards, axis=1)
    bent = (np.linalg.norm(from_sun, axis=1) > 0.0) & (distance > 0.0)
    out = direction.copy()
    if bent.any():
        limit = 1e-6 / np.maximum(distance[bent] ** 2, 1.0)  # as in ERFA's ldsun
        found = erfa.ld(1.0, direction[bent], unit(from_sun[bent]), unit(towards[bent]), distance[bent], limit)
        out[bent] = unit(found)
    return out


def aberrated(direction: Array, velocity: Array, distance: Array | float) -> Array:
    """Return the directions, (m, 3), that a moving observer sees, by special relativity.

    velocity : (m, 3), au/d, relative to the barycentre; distance : of the Sun from the observer, au
    """
    beta = velocity / C
    slow = np.sqrt(1.0 - (beta * beta).sum(axis=1))
    return np.asarray(erfa.ab(direction, beta, np.broadcast_to(distance, slow.shape), slow))


def angle(a: Array, b: Array) -> Array:
    """Return the angles between directions, (m,), radians."""
    across = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(across, (a * b).sum(axis=1)))
