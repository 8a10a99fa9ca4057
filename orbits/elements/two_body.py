"""The exact two-body flow by universal variables: one formula for ellipses, parabolas and hyperbolas.

With beta = gm/a and the universal anomaly s (ds = dt/r), Kepler's equation in difference form is

    dt = r0 G1(s) + (q.v) G2(s) + gm G3(s),     G_k(s) = s^k c_k(beta s^2),   c_k Stumpff's functions

and q(dt) = f q + g v with f - 1 = -gm G2/r0, g = r0 G1 + (q.v) G2. No pericentre and no anomaly enters but in the starting
value, so circular orbits, small dt and eccentricities around 1 lose nothing.
Sources: Stumpff (1959), Himmelsmechanik I; Battin (1999), 4.5-4.6; Danby (1992), Fundamentals of Celestial Mechanics,
6.9.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from orbits.elements.checks import NO_DISTANCE, NO_MASS, RECTILINEAR, broadcast, finite, label, refuse, vectors
from orbits.elements.kepler import (
    SERIES_BELOW,
    SERIES_TERMS,
    TWO_PI,
    Floats,
    cubic_and_beyond,
    eccentric_anomaly,
    sinh_anomaly,
)
from orbits.elements.osculating import INDISTINCT, anomalies
from orbits.errors import ConvergenceError

MAX_ROUNDS = 50
# |r/a| below which the anomalies measured from pericentre of an ellipse or hyperbola are a worse start than a parabola.
NEARLY_PARABOLIC = 1e-12


def two_body(
    q: ArrayLike, v: ArrayLike, gm: ArrayLike, dt: ArrayLike, *, names: Sequence[str] | None = None
) -> tuple[Floats, Floats]:
    """Return position and velocity after the time dt, of bodies that feel one attracting body alone.

    q, v : (..., 3), relative to the attracting body
    gm : (...), G times the mass of both bodies together, consistent units, > 0
    dt : (...), either sign; many periods are reduced to less than one
    names : names of the bodies, for error messages
    All broadcast: one state and an array of dt give an orbit. dt = 0 returns the state itself.

    Raises InputError for non-finite input, gm <= 0, q = 0, and for rectilinear motion, which ends in a collision.
    """
    q, v = vectors("position", q, names), vectors("velocity", v, names)
    gm, dt = finite("gm", gm, names), finite("dt", dt, names)
    first, second, gm, dt = broadcast(names, q=q[..., 0], v=v[..., 0], gm=gm, dt=dt)
    q, v = np.broadcast_to(q, (*first.shape, 3)), np.broadcast_to(v, (*second.shape, 3))
    refuse(gm <= 0.0, NO_MASS, names, gm=gm)
    r0, v2, qv = np.sqrt(np.sum(q * q, axis=-1)), np.sum(v * v, axis=-1), np.sum(q * v, axis=-1)
    refuse(r0 == 0.0, NO_DISTANCE, names)
    h = np.linalg.norm(np.cross(q, v), axis=-1)
    refuse(h <= INDISTINCT * r0 * np.sqrt(v2), RECTILINEAR, names, h=h)

    beta = 2.0 * gm / r0 - v2
    tau = _within_one_period(dt, beta, gm)
    s = _universal_anomaly(r0, qv, h * h, beta, gm, tau, names)
    c0, c1, c2, _ = stumpff(beta * s * s)
    G1, G2 = s * c1, s * s * c2
    r = r0 * c0 + qv * G1 + gm * G2
    f_less_1, g = -gm * G2 / r0, r0 * G1 + qv * G2
    df, dg_less_1 = -gm * G1 / (r * r0), -gm * G2 / r
    return (
        q + (f_less_1[..., None] * q + g[..., None] * v),
        v + (df[..., None] * q + dg_less_1[..., None] * v),
    )


def stumpff(z: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return Stumpff's c0, c1, c2, c3 of z, any sign: c_k(z) = 1/k! - z/(k+2)! + z^2/(k+4)! - ..."""
    small = np.abs(z) < SERIES_BELOW**2
    w = np.where(small, z, 0.0)
    c2_small = np.ones_like(z)
    for k in range(SERIES_TERMS, 0, -1):
        c2_small = 1.0 - w / ((2 * k + 1) * (2 * k + 2)) * c2_small
    x = np.sqrt(np.where(small, 1.0, np.abs(z)))
    X = np.where(z > 0.0, 0.0, x)
    x = np.where(z > 0.0, x, 1.0)
    half, half_open = np.sin(0.5 * x), np.sinh(0.5 * X)
    size = np.where(small, 1.0, np.abs(z))
    c2_large = 2.0 * np.where(z > 0.0, half * half, half_open * half_open) / size
    c3_large = np.where(z > 0.0, x - np.sin(x), np.sinh(X) - X) / (size * np.sqrt(size))
    c2 = np.where(small, 0.5 * c2_small, c2_large)
    c3 = np.where(small, cubic_and_beyond(w), c3_large)
    return 1.0 - z * c2, 1.0 - z * c3, c2, c3


def _within_one_period(dt: Floats, beta: Floats, gm: Floats) -> Floats:
    """Return dt less a whole number of periods, in [-P/2, P/2]; dt itself for open orbits."""
    bound = beta > 0.0
    period = np.where(bound, 2.0 * np.pi * gm / np.where(bound, beta, 1.0) ** 1.5, 1.0)
    rest = np.fmod(dt, period)
    rest = rest - period * np.rint(rest / period)
    return np.where(bound, rest, dt)


def _universal_anomaly(
    r0: Floats, qv: Floats, h2: Floats, beta: Floats, gm: Floats, dt: Floats, names: Sequence[str] | None
) -> Floats:
    """Return s with dt = r0 G1 + qv G2 + gm G3, by Halley's iteration run to the round-off floor."""
    s = _start(r0, qv, h2, beta, gm, dt)
    last = np.full_like(s, np.inf)
    going = dt != 0.0
    for _ in range(MAX_ROUNDS):
        c0, c1, c2, c3 = stumpff(beta * s * s)
        G1, G2 = s * c1, s * s * c2
        value = r0 * G1 + qv * G2 + gm * s * s * s * c3 - dt
        r = r0 * c0 + qv * G1 + gm * G2
        change = value / (r - 0.5 * value * (qv * c0 + (gm - beta * r0) * G1) / r)
        s = np.where(going, s - change, s)
        size = np.abs(change)
        # At the floor the changes are rounding noise: they have stopped shrinking.
        going = going & (size > 2e-16 * np.abs(s)) & ((size < 0.5 * last) | (size > 1e-6 * np.abs(s)))
        last = size
        if not going.any():
            return s
    index = tuple(int(i) for i in np.argwhere(going)[0])
    raise ConvergenceError(
        f"{label(index, names)}Kepler's equation did not converge in {MAX_ROUNDS} rounds for dt = {dt[index]:g}, "
        f"r = {r0[index]:g}, gm = {gm[index]:g}; the orbit is too close to a straight line to be followed"
    )


def _start(r0: Floats, qv: Floats, h2: Floats, beta: Floats, gm: Floats, dt: Floats) -> Floats:
    """Return a starting value of s: from the eccentric anomalies, or from Barker's cubic for a near-parabola."""
    binding = beta * r0 / gm
    flat = np.abs(binding) <= NEARLY_PARABOLIC
    # The parabola's r0 s + qv s^2/2 + gm s^3/6 = dt, a cubic x^3 + 3 A x = 2 B in x = s + qv/gm.
    shift = qv / gm
    A = np.maximum(2.0 * r0 / gm - shift * shift, 0.0)
    B = 3.0 * dt / gm + shift * (3.0 * r0 / gm - shift * shift)
    z = np.cbrt(np.abs(B) + np.sqrt(B * B + A * A * A))
    z = np.where(z > 0.0, z, 1.0)
    parabola = 2.0 * B / (z * z + A + (A / z) ** 2) - shift

    a = r0 / np.where(flat, 1.0, binding)
    e, E, M, _ = anomalies(r0, qv, h2, a, np.where(flat, 1.0, binding), gm)
    root = np.sqrt(gm / np.abs(a))
    M = M + root / np.abs(a) * dt
    ellipse = a > 0.0
    s = np.empty_like(r0)
    reached = eccentric_anomaly(M[ellipse], e[ellipse])
    s[ellipse] = reached + TWO_PI * np.rint((M[ellipse] - reached) / TWO_PI)
    s[~ellipse] = np.arcsinh(sinh_anomaly(M[~ellipse], e[~ellipse]))
    return np.where(flat, parabola, (s - E) / root)
