"""Kepler's equation for every conic, solved to the round-off floor, for whole arrays at once.

    ellipse:    M = E - e sin E          written as  (1 - e) sin E + (E - sin E)
    hyperbola:  M = e sinh F - F         written as  (e - 1) S + (S - asinh S),   S = sinh F
    parabola:   M = D + D^3/3,  D = tan(f/2)         with M = sqrt(gm/(2 q^3)) (t - T):  Barker's equation

In the forms on the right every term has the sign of M, so nothing cancels however close e is to 1, as long as
E - sin E is not computed by subtraction. 1 - e may be passed in addition to e: a float e determines it only to 1.1e-16,
whereas pericentre distance and semi-major axis determine it to full precision. The hyperbola is solved for S, because
states need S and cosh F, and exponentiating F would multiply its rounding error by F.

Sources: Mikkola (1987), Celest. Mech. 40, 329 (starting values); Gooding & Odell (1988), Celest. Mech. 44, 267 (sinh F
as the unknown); Battin (1999), 4.2 (Barker's equation).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

TWO_PI = 2.0 * np.pi
# 2 pi = TWO_PI + TWO_PI_REST to 33 digits, to reduce angles of many turns without losing digits.
TWO_PI_REST = 2.4492935982947064e-16
# Above this, the number of turns is not a float any more, but sines are still exact.
MOST_COUNTED = 2.0**53

# Below this argument x - sin x and sinh x - x are computed by series; above it, subtraction loses at most one bit.
SERIES_BELOW = 1.6
# Twelve terms: the next one is 1.6**24 * 6 / 27!, less than 1e-22 of the sum.
SERIES_TERMS = 12

# The starting values are good to 0.5 %, and Halley's iteration cubes the error: two rounds reach the round-off floor.
HALLEY_ROUNDS = 3


def reduced_angle(x: Floats) -> Floats:
    """Return x minus the nearest multiple of 2 pi, in [-pi, pi], any shape and size, radians."""
    far = np.abs(x) > MOST_COUNTED
    if np.any(far):
        return np.where(far, np.arctan2(np.sin(x), np.cos(x)), reduced_angle(np.where(far, 0.0, x)))
    rest = np.fmod(x, TWO_PI)
    turns = np.rint((x - rest) / TWO_PI)
    rest = rest - turns * TWO_PI_REST
    over = np.rint(rest / TWO_PI)
    return np.asarray((rest - over * TWO_PI) - over * TWO_PI_REST)


def positive_angle(x: Floats) -> Floats:
    """Return x modulo 2 pi, in [0, 2 pi), any shape, radians."""
    rest = reduced_angle(x)
    turned = np.where(rest < 0.0, rest + TWO_PI, rest)
    # A negative angle below the spacing of floats at 2 pi rounds up to a whole turn.
    return np.where(turned >= TWO_PI, 0.0, turned)


def cubic_and_beyond(z: Floats) -> Floats:
    """Return (sqrt z - sin sqrt z) / z^(3/2) = 1/6 - z/120 + z^2/5040 - ..., by its series; z may be negative."""
    total = np.ones_like(z)
    for k in range(SERIES_TERMS, 0, -1):
        total = 1.0 - z / ((2 * k + 2) * (2 * k + 3)) * total
    return total / 6.0


def angle_minus_sine(x: Floats) -> Floats:
    """Return x - sin x without cancellation, any shape."""
    small = np.abs(x) < SERIES_BELOW
    y = np.where(small, x, 0.0)
    return np.where(small, y**3 * cubic_and_beyond(y * y), x - np.sin(x))


def sinh_minus_angle(F: Floats, S: Floats) -> Floats:
    """Return S - F where S = sinh F, without cancellation, any shape."""
    small = np.abs(F) < SERIES_BELOW
    y = np.where(small, F, 0.0)
    return np.where(small, y**3 * cubic_and_beyond(-y * y), S - F)


def _mikkola_root(M: Floats, e: Floats, one_minus_e: Floats) -> Floats:
    """Return the root s of s^3 + 3 alpha s = 2 beta, Mikkola's auxiliary cubic; M >= 0."""
    alpha = np.abs(one_minus_e) / (4.0 * e + 0.5)
    beta = 0.5 * M / (4.0 * e + 0.5)
    root = np.sqrt(alpha)
    # z >= root always; enforced for an alpha whose power 3/2 underflows.
    z = np.maximum(np.cbrt(beta + np.hypot(beta, alpha * root)), root)
    # This is the textbook's z - alpha/z, without its cancellation at small M.
    return np.asarray(2.0 * beta / (z * z + alpha + (alpha / z) ** 2))


def eccentric_anomaly(M: Floats, e: Floats, one_minus_e: Floats | None = None) -> Floats:
    """Return the eccentric anomaly E of an ellipse, in [-pi, pi].

    M : mean anomaly, radians, any number of turns
    e : eccentricity, 0 <= e < 1
    one_minus_e : 1 - e > 0, if it is known better than from e, which may then round to 1
    All of one shape. Accurate to the floor set by the rounding of M and E.
    """
    one_minus_e = 1.0 - e if one_minus_e is None else one_minus_e
    m = reduced_angle(M)
    target = np.abs(m)
    s = _mikkola_root(target, e, one_minus_e)
    s = s - 0.078 * s**5 / (1.0 + e)
    E = np.minimum(target + e * (3.0 * s - 4.0 * s**3), np.pi)
    for _ in range(HALLEY_ROUNDS):
        sine = np.sin(E)
        value = one_minus_e * sine + angle_minus_sine(E) - target
        slope = one_minus_e * np.cos(E) + 2.0 * np.sin(0.5 * E) ** 2
        E = E - value / (slope - 0.5 * value * e * sine / slope)
    return np.copysign(E, m)


def sinh_anomaly(M: Floats, e: Floats, one_minus_e: Floats | None = None) -> Floats:
    """Return S = sinh F for the hyperbolic anomaly F.

    M : mean anomaly e sinh F - F, radians, any size
    e : eccentricity, e > 1
    one_minus_e : 1 - e < 0, if it is known better than from e, which may then round to 1
    All of one shape. Accurate to the floor set by the rounding of M and S.
    """
    e_minus_one = e - 1.0 if one_minus_e is None else -one_minus_e
    target = np.abs(M)
    s = _mikkola_root(target, e, e_minus_one)
    s2 = s * s
    s = s + 0.071 * s * (s2 / (1.0 + 0.45 * s2)) * (s2 / (1.0 + 4.0 * s2)) / e
    S = np.sinh(3.0 * np.arcsinh(s))
    for _ in range(HALLEY_ROUNDS):
        C = np.hypot(1.0, S)
        value = e_minus_one * S + sinh_minus_angle(np.arcsinh(S), S) - target
        slope = e_minus_one + (S / C) * (S / (C + 1.0))
        S = S - value / (slope - 0.5 * value * (S / C) / (C * C) / slope)
    return np.copysign(S, M)


def barker_anomaly(M: Floats) -> Floats:
    """Return D = tan(f/2) of a parabola, the root of D + D^3/3 = M, any shape and size."""
    D = 2.0 * np.sinh(np.arcsinh(1.5 * M) / 3.0)
    # sinh multiplies the rounding error of its argument by the argument, up to 200: one Newton step removes this.
    return np.asarray(D - (D * (1.0 + D * D / 3.0) - M) / (1.0 + D * D))
