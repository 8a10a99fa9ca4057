"""The motion from one sample to the next: where points of an arc lie, a cubic, and by how much the motion turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ARC_POINTS = 721
"""The most points from one sample to the next."""
MOST_POINTS = 400_000
"""The most points of all arcs of a body."""


class Orbit(NamedTuple):
    """Relative motion about a centre: q and v (..., 3), and the total GM of both."""

    q: Array
    v: Array
    gm: float

    @property
    def binding(self) -> Array:
        """GM/a, > 0 for ellipses, (...)."""
        r = np.linalg.norm(self.q, axis=-1)
        return np.asarray(2.0 * self.gm / r - (self.v**2).sum(axis=-1))

    @property
    def period(self) -> Array:
        """The period of ellipses, inf for other orbits, (...)."""
        binding = np.maximum(self.binding, 0.0)
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * np.pi * self.gm / binding**1.5)


def nodes(orbit: Orbit, times: Array, k: NDArray[np.intp]) -> Array:
    """Return times since the samples k, (len(k), n), equally spaced in eccentric anomaly."""
    step = np.diff(times)[k]
    start, e = _anomaly(orbit, k)
    end, _ = _anomaly(orbit, k + 1)
    bound = (orbit.binding[k] > 0.0) & (orbit.binding[k + 1] > 0.0)
    mean_motion = np.abs(orbit.binding[k]) ** 1.5 / orbit.gm
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        turns = np.where(bound, np.round((mean_motion * step - (end - start)) / (2 * np.pi)), 0.0)
        sweep = end + 2 * np.pi * turns - start
        finest = np.radians(0.5) * np.sqrt(np.clip(np.abs(1.0 - e * e), 0.02, 1.0))
        wanted = float(np.nanmax(np.abs(sweep) / finest, initial=16.0))
        count = int(np.clip(min(wanted, MOST_POINTS / len(k)), 16, ARC_POINTS - 1))
        even = np.linspace(0.0, 1.0, count + 1)
        anomaly = start[:, None] + sweep[:, None] * even
        e = e[:, None]
        mean = np.where(bound[:, None], anomaly - e * np.sin(anomaly), e * np.sinh(anomaly) - anomaly)
        done = (mean - mean[:, :1]) / (mean[:, -1:] - mean[:, :1])
        spread = np.isfinite(done).all(axis=1) & (np.diff(done, axis=1) >= 0.0).all(axis=1)
    return np.asarray(np.where(spread[:, None], done, even) * step[:, None])


def _anomaly(orbit: Orbit, k: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the eccentric anomaly, hyperbolic for hyperbolas, and the eccentricity."""
    q, v, binding = orbit.q[k], orbit.v[k], orbit.binding[k]
    rv = (q * v).sum(axis=-1)
    root = rv * np.sqrt(np.abs(binding)) / orbit.gm  # e sin E, e sinh F
    cosine = 1.0 - np.linalg.norm(q, axis=-1) * binding / orbit.gm  # e cos E, e cosh F
    e = np.sqrt(np.abs(cosine**2 + np.where(binding > 0.0, 1.0, -1.0) * root**2))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(binding > 0.0, np.arctan2(root, cosine), np.arcsinh(root / e)), e


def cubic(q: Array, v: Array, k: NDArray[np.intp], times: Array, length: Array) -> Array:
    """Return the cubic with the positions and velocities of samples k and k + 1 at its ends."""
    s = (times / length)[..., None]
    h = length[..., None]
    q0, q1, v0, v1 = q[k][:, None], q[k + 1][:, None], v[k][:, None], v[k + 1][:, None]
    rest = s * s * (3.0 - 2.0 * s)
    return np.asarray(q0 + rest * (q1 - q0) + s * (1 - s) ** 2 * h * v0 - s * s * (1 - s) * h * v1)


def turn(q: Array, v: Array, times: Array) -> Array:
    """Return the angle by which the motion turns from each sample to the next, radians, (n - 1,); inf for whole orbits.

    It is the larger of the angles between the velocities at both ends and the line between them.
    """
    step = np.diff(times)[:, None]
    way, start, end = np.diff(q, axis=0), v[:-1] * step, v[1:] * step
    turn = np.maximum(_angle(way, start), _angle(way, end))
    went = (np.linalg.norm(start, axis=1) + np.linalg.norm(end, axis=1)) / 2.0
    there = np.linalg.norm(way, axis=1)
    return np.asarray(np.where(np.abs(there - went) <= 0.15 * went, turn, np.inf))


def _angle(x: Array, y: Array) -> Array:
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(x, y), axis=1), (x * y).sum(axis=1)))
