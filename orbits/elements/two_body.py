"""The exact two-body flow by universal variables: one formula for ellipses, parabolas and hyperbolas.

With beta = gm/a and the universal anomaly s (ds = dt/r), Kepler's equation in difference form is

    dt = r0 G1(s) + (q.v) G2(s) + gm G3(s),     G_k(s) = s^k c_k(beta s^2),   c_k Stumpff's functions

and q(dt) = f q + g v with f - 1 = -gm G2/r0, g = r0 G1 + (q.v) G2. No pericentre and no anomaly enters but in the
starting value, so circular orbits, small dt and eccentricities around 1 lose nothing.
Sources: Stumpff (1959), Himmelsmechanik I; Battin (1999), 4.5-4.6; Danby (1992), Fundamentals of Celestial Mechanics,
6.9.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.elements.checks import BEYOND, finite, label, refuse, vectors
from orbits.elements.invariants import Motion, measured, scaled
from orbits.elements.kepler import (
    SERIES_BELOW,
    SERIES_TERMS,
    TWO_PI,
    Floats,
    cubic_and_beyond,
    eccentric_anomaly,
    sinh_anomaly,
    sinh_minus_angle,
)
from orbits.elements.osculating import Shape
from orbits.errors import ConvergenceError

MAX_ROUNDS = 50


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
    motion, dt = measured(q, v, gm, dt, names)
    q, v, gm, r0, qv, dt = motion.q, motion.v, motion.gm, motion.r, motion.qv, scaled(dt, -motion.time)
    orbit = _orbit(motion)
    dt = _within_one_period(dt, orbit)
    s = _universal_anomaly(orbit, dt, names)
    _, r, _, (G1, G2, G3) = _kepler(orbit, s)
    f_less_1, df, dg_less_1 = -gm * G2 / r0, -gm * G1 / (r * r0), -gm * G2 / r
    # Two forms of g; far out on a hyperbola the terms of the first are large and cancel.
    first, second = r0 * G1 + qv * G2, dt - gm * G3
    g = np.where(np.abs(r0 * G1) + np.abs(qv * G2) <= np.abs(dt) + np.abs(gm * G3), first, second)
    state = (
        scaled(q + (f_less_1[..., None] * q + g[..., None] * v), motion.length[..., None]),
        scaled(v + (df[..., None] * q + dg_less_1[..., None] * v), motion.speed[..., None]),
    )
    for what, vector in zip(("position", "velocity"), state, strict=True):
        size = np.max(np.abs(vector), axis=-1)
        refuse(~np.isfinite(size), BEYOND, names, what="the " + what, value=size)
    return state


class _Orbit(NamedTuple):
    """What stays constant along the orbit, and where on it the motion starts; arrays of one shape."""

    r0: Floats
    qv: Floats
    beta: Floats  # gm/a
    gm: Floats
    parabolic: NDArray[np.bool_]
    a: Floats  # of no use for a parabola, like e, E and M
    e: Floats
    one_minus_e: Floats
    E: Floats  # at the start: F for a hyperbola
    M: Floats


def _orbit(motion: Motion) -> _Orbit:
    parabolic = motion.binding == 0.0
    shape = Shape.of(motion, parabolic)
    a, beta = np.where(parabolic, motion.r, shape.a), motion.binding / motion.r * motion.gm
    return _Orbit(motion.r, motion.qv, beta, motion.gm, parabolic, a, shape.e, shape.one_minus_e, shape.E, shape.M)


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


def _kepler(orbit: _Orbit, s: Floats) -> tuple[Floats, Floats, Floats, tuple[Floats, Floats, Floats]]:
    """Return the time since the start, r = dt/ds, dr/ds, and G1, G2, G3, at the universal anomaly s."""
    r0, qv, beta, gm, _, a, e, one_minus_e, F, _ = orbit
    c0, c1, c2, c3 = stumpff(beta * s * s)
    G1, G2, G3 = s * c1, s * s * c2, s * s * s * c3
    time = r0 * G1 + qv * G2 + gm * G3
    r = r0 * c0 + qv * G1 + gm * G2
    slope = qv * c0 + (gm - beta * r0) * G1
    # On the way in along a hyperbola those sums cancel as exp(F). Measured from pericentre, all terms have one sign:
    # n dt = 2 sinh(x/2) (e cosh(F + x/2) - 1) + (2 sinh(x/2) - x),  r = |a| (e cosh(F + x) - 1),  x = sqrt(-beta) s.
    far = beta * r0 < -0.1 * gm
    F, e, size = np.where(far, F, 0.0), np.where(far, e, 1.0), np.abs(a)
    e_less_1 = np.where(far, -one_minus_e, 0.0)
    w = np.sqrt(np.where(far, -beta, 0.0))
    half = 0.5 * w * s
    sinh = np.sinh(half)
    middle = e_less_1 + 2.0 * e * np.sinh(0.5 * (F + half)) ** 2
    time_far = 2.0 * (sinh * middle + sinh_minus_angle(half, sinh)) * np.sqrt(size / gm) * size
    r_far = size * (e_less_1 + 2.0 * e * np.sinh(0.5 * F + half) ** 2)
    return (
        np.where(far, time_far, time),
        np.where(far, r_far, r),
        np.where(far, size * w * e * np.sinh(F + 2.0 * half), slope),
        (G1, G2, G3),
    )


def _within_one_period(dt: Floats, orbit: _Orbit) -> Floats:
    """Return dt less a whole number of periods, in [-P/2, P/2]; dt itself for open orbits."""
    bound = orbit.beta > 0.0
    period = 2.0 * np.pi * orbit.gm / np.where(bound, orbit.beta, 1.0) ** 1.5
    rest = np.fmod(dt, period)
    return np.where(bound, rest - period * np.rint(rest / period), dt)


def _universal_anomaly(orbit: _Orbit, dt: Floats, names: Sequence[str] | None) -> Floats:
    """Return s at the time dt, by Halley's iteration run to the round-off floor."""
    going = dt != 0.0
    s = np.where(going, _start(orbit, dt), 0.0)
    last = np.full_like(s, np.inf)
    for _ in range(MAX_ROUNDS):
        time, r, slope, _ = _kepler(orbit, s)
        miss = time - dt
        change = np.where(going, miss / (r - 0.5 * miss * slope / r), 0.0)
        s = s - change
        size = np.abs(change)
        # At the floor the changes are rounding noise: they have stopped shrinking.
        going = going & (size > 2e-16 * np.abs(s)) & ((size < 0.5 * last) | (size > 1e-6 * np.abs(s)))
        last = size
        if not going.any():
            return s
    index = tuple(int(i) for i in np.argwhere(going)[0])
    raise ConvergenceError(
        f"{label(index, names)}Kepler's equation did not converge in {MAX_ROUNDS} rounds for dt = {dt[index]:g}, "
        f"r = {orbit.r0[index]:g}, gm = {orbit.gm[index]:g}; the orbit is too close to a straight line to be followed"
    )


def _start(orbit: _Orbit, dt: Floats) -> Floats:
    """Return a starting value of s: from the eccentric anomalies, or from Barker's cubic for a parabola."""
    r0, qv, _, gm, parabolic, a, e, one_minus_e, E, M = orbit
    # r0 s + qv s^2/2 + gm s^3/6 = dt, a cubic x^3 + 3 A x = 2 B in x = s + qv/gm.
    shift = qv / gm
    A = np.maximum(2.0 * r0 / gm - shift * shift, 0.0)
    B = 3.0 * dt / gm + shift * (3.0 * r0 / gm - shift * shift)
    z = np.cbrt(np.abs(B) + np.sqrt(B * B + A * A * A))
    z = np.where(z > 0.0, z, 1.0)
    parabola = 2.0 * B / (z * z + A + (A / z) ** 2) - shift

    root = np.sqrt(gm / np.abs(a))
    M = M + root / np.abs(a) * dt
    ellipse = a > 0.0
    s = np.empty_like(r0)
    reached = eccentric_anomaly(M[ellipse], e[ellipse], one_minus_e[ellipse])
    s[ellipse] = reached + TWO_PI * np.rint((M[ellipse] - reached) / TWO_PI)
    s[~ellipse] = np.arcsinh(sinh_anomaly(M[~ellipse], e[~ellipse], one_minus_e[~ellipse]))
    return np.where(parabolic, parabola, (s - E) / root)
