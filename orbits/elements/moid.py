"""The least distance of two orbits about one focus, MOID, of ellipses, parabolas and hyperbolas.

Where the distance has an extremum, the line between both points is perpendicular to both orbits. With r and R the two
points and t, T the tangents there, (R - r) . t = 0 is linear in the cosine and sine of the second true anomaly, and
(R - r) . T = 0 is quadratic in them. Their resultant is a trigonometric polynomial g of degree ten in the first true
anomaly, whose coefficients follow from its values at 32 angles. All its roots are eigenvalues of a matrix; Newton's
method brings those with the least distances to the last digits. Every start is a point on each orbit, so that no
distance is too small.

Sources: Gronchi (2002), SIAM J. Sci. Comput. 24, 61; Kholshevnikov & Vassiliev (1999), Celest. Mech. 75, 67, for the
two conditions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orbits.elements.kepler_equation import Floats

DEGREE = 10
"""Of g in the first true anomaly."""

SAMPLES = 32
"""Values of g, more than 2 DEGREE."""

BEST, NEWTON_STEPS, DAMPING = 8, 20, 0.5
"""Starts of Newton's method, those with the least distances; its steps; what it adds to the curvatures at first, as a
multiple of the slope."""

FAR = 100.0
"""How far out two open orbits may be nearest, in units of their sizes at the pericentres."""

OPEN = 1e-12
"""The least 1 + e cos f of a point on the orbit."""

AT_ONCE = 4096
"""Pairs that are computed together."""


class Conics(NamedTuple):
    """Orbits about a focus at the origin, r = p / (1 + e cos f).

    p : (n,), the parameter, q (1 + e); e : (n,), >= 0
    along, across : (n, 3), unit vectors towards the pericentre and a quarter of a turn ahead
    """

    p: Floats
    e: Floats
    along: Floats
    across: Floats

    @classmethod
    def of(cls, q: Floats, e: Floats, inc: Floats, Omega: Floats, omega: Floats) -> Conics:
        """Return orbits by pericentre distances, eccentricities and angles, (n,) each."""
        (ci, si), (cO, sO), (co, so) = ((np.cos(x), np.sin(x)) for x in (inc, Omega, omega))
        along = np.stack([cO * co - sO * so * ci, sO * co + cO * so * ci, so * si], axis=-1)
        across = np.stack([-cO * so - sO * co * ci, -sO * so + cO * co * ci, co * si], axis=-1)
        return cls(q * (1.0 + e), e, along, across)

    def some(self, rows: slice) -> Conics:
        """Return those of the given rows."""
        return Conics(*(x[rows] for x in self))

    def at(self, f: Floats) -> tuple[Floats, Floats, Floats]:
        """Return a position at true anomalies, (n, k), the tangent with length dr/df (1 + e cos f)^2 / p, (n, k, 3),
        and distances from the focus, negative where the orbit does not come.
        """
        cos, sin = np.cos(f)[..., None], np.sin(f)[..., None]
        P, Q, e = self.along[:, None], self.across[:, None], self.e[:, None, None]
        opening = 1.0 + e * cos
        r = self.p[:, None, None] / np.where(np.abs(opening) < OPEN, -OPEN, opening)
        return r * (P * cos + Q * sin), Q * (e + cos) - P * sin, r[..., 0]


def least_distances(one: Conics, other: Conics) -> tuple[Floats, Floats, Floats]:
    """Return the least distance of the orbits of each pair, and the true anomalies where they have it, (n,) each."""
    parts = [
        _of_some(one.some(slice(k, k + AT_ONCE)), other.some(slice(k, k + AT_ONCE)))
        for k in range(0, len(one.p), AT_ONCE)
    ]
    found = np.concatenate(parts, axis=1) if parts else np.empty((3, 0))
    return found[0], found[1], found[2]


def _of_some(one: Conics, other: Conics) -> Floats:
    stretch = _stretch(one, other)
    even = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    half = np.cos(0.5 * even), stretch[:, None] * np.sin(0.5 * even)
    sampled = 2.0 * np.arctan2(half[1], half[0])
    g = _resultant(one, other, sampled) * (half[0] ** 2 + half[1] ** 2) ** DEGREE
    f = np.concatenate([2.0 * np.arctan(stretch[:, None] * np.tan(0.5 * _roots(g))), sampled], axis=1)
    A, B, C = _line(one, other, f)
    towards, away = np.arctan2(B, A), np.arccos(np.clip(-C / np.maximum(np.hypot(A, B), 1e-300), -1.0, 1.0))
    f, F = np.tile(f, 2), np.concatenate([towards + away, towards - away], axis=1)
    best = np.argsort(_apart(one, other, f, F), axis=1)[:, :BEST]
    f, F, distance = _descended(one, other, *(np.take_along_axis(x, best, axis=1) for x in (f, F)))
    first = np.argmin(distance, axis=1)[:, None]
    return np.array([np.take_along_axis(x, first, axis=1)[:, 0] for x in (distance, f, F)])


def _stretch(one: Conics, other: Conics) -> Floats:
    """Return s, (n,), of the angle w, tan(f/2) = s tan(w/2), in which the parts of the first orbit near its pericentre
    and far out, as far as the other one comes, take equal shares.
    """
    q, size = one.p / (1.0 + one.e), []
    for x in (one, other):
        opening = np.maximum(1.0 - x.e**2, 0.0)
        size.append(np.where(opening > 0.0, x.p / np.where(opening > 0.0, opening, 1.0), np.inf))
    far = np.minimum(np.minimum(*size), FAR * np.maximum(q, other.p))
    tan2 = (far - q) * (1.0 + one.e) / np.maximum(q * (1.0 + one.e) - far * (1.0 - one.e), 1e-300)
    return np.asarray(np.clip(tan2, 1.0, 1e12) ** 0.25)


def _line(one: Conics, other: Conics, f: Floats) -> tuple[Floats, Floats, Floats]:
    """Return A, B, C, (n, k), of the first condition, A cos F + B sin F + C = 0."""
    cos, sin = np.cos(f), np.sin(f)
    e = one.e[:, None]
    tangent = one.across[:, None] * (e + cos)[..., None] - one.along[:, None] * sin[..., None]
    share = (one.p / other.p)[:, None] * e * sin
    A, B = (_dot(tangent, x[:, None]) * (1.0 + e * cos) for x in (other.along, other.across))
    return A - share * other.e[:, None], B, -share


def _resultant(one: Conics, other: Conics, f: Floats) -> Floats:
    """Return g, (n, k): the second condition at both roots of the first, times (A^2 + B^2)^2."""
    A, B, C = _line(one, other, f)
    cos, sin, e = np.cos(f), np.sin(f), other.e[:, None]
    towards = one.along[:, None] * cos[..., None] + one.across[:, None] * sin[..., None]
    along, across = (_dot(towards, x[:, None]) for x in (other.along, other.across))
    share = (other.p / one.p)[:, None] * (1.0 + one.e[:, None] * cos) * e
    # The second condition is c0 + c1 cos F + s1 sin F + c2 cos^2 F + m sin F cos F = 0, with c0 = c2.
    c1, s1, c2, m = -across * (1.0 + e * e), share + along, -e * across, e * along
    L, size = A * A + B * B, c2 * c2 + m * m
    alpha = c2 * (L + B * B) - m * A * B - C * (c1 * A + s1 * B)
    beta, gamma = c2 * (A * A - B * B) + 2.0 * m * A * B, s1 * A - c1 * B
    delta = 2.0 * c2 * A * B + m * (B * B - A * A)
    mixed = c1 * (c2 * A + m * B) + s1 * (m * A - c2 * B)
    squares: Floats = alpha * alpha + (C * C - L) * (gamma * gamma + size * C * C)
    return squares + C * (3.0 * C * c2 * beta - 2.0 * C * C * mixed - 2.0 * gamma * delta)


def _roots(g: Floats) -> Floats:
    """Return the angles of all roots, real and complex, (n, 2 DEGREE), of g with these values, (n, SAMPLES).

    With z = exp(i f), z^DEGREE g is a polynomial in z, whose first and last coefficients may vanish. Its roots are the
    eigenvalues of a pencil A - z B; those of (A - s B)^-1 B are 1 / (z - s), with s where |g| is largest, far from all
    roots.
    """
    n, size = len(g), 2 * DEGREE
    most = np.argmax(np.abs(g), axis=1)
    s = np.exp(2j * np.pi * most / SAMPLES)
    c = np.fft.fft(g, axis=1, norm="forward")[:, np.arange(-DEGREE, DEGREE + 1)]
    c /= np.maximum(np.abs(c).max(axis=1, keepdims=True), 1e-300)
    B, A = np.zeros((2, n, size, size), dtype=complex)
    B[:, np.arange(size - 1), np.arange(size - 1)] = 1.0
    B[:, -1, -1] = c[:, -1]
    A[:, np.arange(size - 1), np.arange(1, size)] = 1.0
    A[:, -1] = -c[:, :-1]
    known = np.abs(g).max(axis=1) > 0.0
    shifted = np.where(known[:, None, None], A - s[:, None, None] * B, np.eye(size))
    w = np.linalg.eigvals(np.linalg.solve(shifted, B))
    return np.asarray(np.angle(s[:, None] + 1.0 / np.where(w == 0.0, np.inf, w)))


def _apart(one: Conics, other: Conics, f: Floats, F: Floats) -> Floats:
    """Return distances of points, (n, k), infinite where one is not on its orbit."""
    (q, _, r), (Q, _, R) = one.at(f), other.at(F)
    return np.where((r > 0.0) & (R > 0.0), np.linalg.norm(Q - q, axis=-1), np.inf)


def _descended(one: Conics, other: Conics, f: Floats, F: Floats) -> tuple[Floats, Floats, Floats]:
    """Return f, F and the distance, (n, k), at the minimum next to them, by Newton's method with damping."""
    p, P = one.p[:, None], other.p[:, None]
    distance, damping = _apart(one, other, f, F), np.full(f.shape, DAMPING) / (p + P)
    idle = 0
    for _ in range(NEWTON_STEPS):
        # Half the square of the distance, by lengths along the tangents: by them q changes by t, and f by p / r^2.
        (q, t, r), (Q, T, R) = one.at(f), other.at(F)
        apart = Q - q
        u, v, uv = -_dot(apart, t), _dot(apart, T), -_dot(t, T)
        uu, vv = _dot(t, t) + _dot(apart, q) * p / r**3, _dot(T, T) - _dot(apart, Q) * P / R**3
        # As much more curvature as makes it positive, and more where the slope is large.
        least = 0.5 * (uu + vv) - np.hypot(0.5 * (uu - vv), uv)
        more = np.maximum(-2.0 * least, 0.0) + damping * np.hypot(u, v) + 1e-15 * np.abs(uu + vv)
        uu, vv = uu + more, vv + more
        determinant = np.where(uu * vv - uv**2 == 0.0, np.inf, uu * vv - uv**2)
        g = f - (vv * u - uv * v) / determinant * p / r**2
        G = F - (uu * v - uv * u) / determinant * P / R**2
        now = _apart(one, other, g, G)
        lower = now < distance * (1.0 - 1e-15)
        idle = 0 if lower.any() else idle + 1
        if idle == 2:
            break
        f, F, distance = np.where(lower, g, f), np.where(lower, G, F), np.where(lower, now, distance)
        damping *= np.where(lower, 0.5, 8.0)
    return f, F, distance


def _dot(a: Floats, b: Floats) -> Floats:
    product: Floats = (a * b).sum(axis=-1)
    return product
