"""The orbit beside the spins, as a table of flows that is computed once: the eccentric anomaly is the variable.

With dM = (1 - e cos E) dE the Lagrangian of a spin is separable at each E, whose change belongs to the drift:

    L dM = [theta_E^2 / (2 (1 - e cos E)) + alpha^2 cos 2(theta - f) / (4 (1 - e cos E)^2)] dE

A drift by dE moves the angle by the rate times the change of M = E - e sin E, exactly; a kick is taken at the E that is
reached. So every scheme of kicks and drifts has its order, each step is a variational integrator, and none has to solve
Kepler's equation. Steps that are equal in E are short at the pericentre, where the torque is large.

Source: Hairer, Lubich & Wanner (2006), sec. II.4, VIII.2; Hut (1981), A&A 99, 126, for the means of tides.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from orbits.tableaux.compositions import scheme

Array = NDArray[np.float64]

SCHEMES = {4: "blanes-moan", 6: "blanes-moan-11", 8: "kahan-li"}
"""Kicks and drifts by their order."""

WITH_TIDES = {4: "suzuki", 6: "kahan-li", 8: "kahan-li"}
"""The same with tides: kicks that depend on the rate do not commute as those that the schemes above are made for."""


@lru_cache(maxsize=16)
def kicks_and_drifts(order: int, tides: bool) -> tuple[Array, Array]:
    """Return the parts of a step, (s + 1,) and (s,); each sums up to 1."""
    if order == 2:
        return np.array([0.5, 0.5]), np.array([1.0])
    found = scheme(2, order, (WITH_TIDES if tides else SCHEMES)[order], splittings=not tides)
    return tuple(np.array([float(x) for x in values]) for values in (found.kicks, found.drifts))  # type: ignore[return-value]


def place(e: float, E: Array) -> tuple[Array, Array]:
    """Return the distance over a and the true anomaly at eccentric anomalies; the latter within (-pi, pi]."""
    half = 0.5 * E
    r = (1.0 - e) + 2.0 * e * np.sin(half) ** 2
    return r, 2.0 * np.arctan2(np.sqrt(1.0 + e) * np.sin(half), np.sqrt(1.0 - e) * np.cos(half))


def means_of_tides(e: float) -> tuple[float, float]:
    """Return the means of (a/r)^6 and of (a/r)^6 f' over a revolution."""
    e2 = e * e
    drag = (1.0 + e2 * (3.0 + 0.375 * e2)) / (1.0 - e2) ** 4.5
    return drag, (1.0 + e2 * (7.5 + e2 * (5.625 + 0.3125 * e2))) / (1.0 - e2) ** 6


def error_of_tides(e: float, order: int, steps: int) -> float:
    """Return by what part of themselves the means above are wrong if they are sums over the kicks of a revolution."""
    kicks, _, places = _flows(order, True, steps)
    r, _ = place(e, 2.0 * np.pi / steps * places)
    drag, drive = means_of_tides(e)
    seen = np.array([np.sum(kicks * r**-5) / drag, np.sum(kicks * r**-7) * np.sqrt(1.0 - e * e) / drive])
    return float(np.abs(seen / steps - 1.0).max())


def _flows(order: int, tides: bool, count: int) -> tuple[Array, Array, Array]:
    """Return the kicks of some steps, the drifts before them, of which the first is 0, and where they are, in steps."""
    kick, drift = kicks_and_drifts(order, tides)
    each = len(drift)
    kicks, drifts, places = (np.zeros(each * count + 1) for _ in range(3))
    inside = np.cumsum(drift)
    for k in range(count):
        kicks[each * k : each * (k + 1) + 1] += kick
        drifts[each * k + 1 : each * (k + 1) + 1] = drift
        places[each * k + 1 : each * (k + 1) + 1] = k + inside
    return kicks, drifts, places


def orbit_table(e: float, alpha: float, tides: float, order: int, steps: int, intervals: int) -> Array:
    """Return the flows of a revolution for `orbits.kernels.rotation.planar_spins`, (intervals, flows, 5).

    steps : in a revolution, a multiple of `intervals`, after each of which the spins may be looked at
    """
    count = steps // intervals
    kicks, drifts, places = _flows(order, tides > 0.0, count)
    h = 2.0 * np.pi / steps
    E = h * (places + count * np.arange(intervals)[:, None])
    dE = h * drifts + 0.0 * E
    r, f = place(e, E)
    time = dE - 2.0 * e * np.cos(E - 0.5 * dE) * np.sin(0.5 * dE)
    friction = tides * h * kicks * r**-5
    lost = -np.expm1(-friction)
    # Of a torque that acts while the tides do.
    share = np.divide(lost, friction, out=np.ones_like(r), where=friction != 0.0)
    strength = 0.5 * alpha**2 * h * kicks * share / r**2
    return np.ascontiguousarray(np.stack([time / np.pi, f / np.pi, strength, lost, np.sqrt(1.0 - e * e) / r**2], -1))
