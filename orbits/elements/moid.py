"""The least distance of two orbits about one focus, MOID, of ellipses, parabolas and hyperbolas.

The square of the distance of two points, or that less a share of the square of the first one's distance from the focus,
has extrema where its derivatives by both true anomalies vanish. With r and R the two points, t and T the tangents
there, and the share s^2, (R - (1 - s^2) r) . t = 0 is linear in the cosine and sine of the second true anomaly, and
(R - r) . T = 0 is quadratic in them. Their resultant is a trigonometric polynomial g of degree ten in the first true
anomaly, whose coefficients follow from its values at 32 angles. All its roots are eigenvalues of a matrix; Newton's
method brings those with the least values to the last digits. Every start is a point on each orbit, so that no distance
is too small.

Sources: Gronchi (2002), SIAM J. Sci. Comput. 24, 61; Kholshevnikov & Vassiliev (1999), Celest. Mech. 75, 67, for the
two conditions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.elements.kepler_equation import Floats
from orbits.elements.states_from_elements import perifocal_axes

DEGREE = 10
"""Of g in the first true anomaly."""

SAMPLES = 32
"""Values of g, more than 2 DEGREE."""

BEST, NEWTON_STEPS, DAMPING = 8, 20, 0.5
"""Starts of Newton's method, those with the least values; its steps; what it adds to the curvatures at first, as a
multiple of the slope."""

ROUNDED = 1e-15, 1e-30
"""What a step of Newton's method takes off is rounding below so much of the square of the distance, and of that from
the focus."""

OVERTAKING = 2
"""The least steps of Newton's method, in which another start may come below the one that was least."""

FAR = 100.0
"""How far out two open orbits may be nearest, in units of their sizes at the pericentres."""

OPEN = 1e-12
"""The least 1 + e cos f of a point on the orbit."""

AT_ONCE = 4096
"""Pairs that are computed together."""


class Conics(NamedTuple):
    """Orbits about a focus at the origin, r = p / (1 + e cos f).

    p : (..., n), the parameter, q (1 + e); e : (..., n), >= 0
    along, across : (..., n, 3), unit vectors towards the pericentre and a quarter of a turn ahead
    """

    p: Floats
    e: Floats
    along: Floats
    across: Floats

    @classmethod
    def of(cls, q: Floats, e: Floats, inc: Floats, Omega: Floats, omega: Floats) -> Conics:
        """Return orbits by pericentre distances, eccentricities and angles, (..., n) each."""
        return cls(q * (1.0 + e), e, *perifocal_axes(inc, Omega, omega))

    def some(self, rows: int | slice | NDArray[np.intp]) -> Conics:
        """Return those of the given rows."""
        return Conics(*(x[rows] for x in self))

    def at(self, f: Floats) -> tuple[Floats, Floats, Floats]:
        """Return a position at true anomalies, (..., n, k), the tangent with length dr/df (1 + e cos f)^2 / p,
        (..., n, k, 3), and distances from the focus, negative where the orbit does not come.
        """
        cos, sin = np.cos(f)[..., None], np.sin(f)[..., None]
        P, Q, e = self.along[..., None, :], self.across[..., None, :], self.e[..., None, None]
        opening = 1.0 + e * cos
        r = self.p[..., None, None] / np.where(np.abs(opening) < OPEN, -OPEN, opening)
        return r * (P * cos + Q * sin), Q * (e + cos) - P * sin, r[..., 0]


class _Pairs(NamedTuple):
    """Pairs of orbits, and what is minimized: |R - r|^2 - s^2 r^2, for r on one and R on the other.

    both : (2, n), the orbits; kept : (2, n, 1), 1 - s^2 and 1
    axes : (2, 2, n, 1), the products of both axes of the first with those of the second
    """

    both: Conics
    kept: Floats
    axes: Floats

    @classmethod
    def of(cls, one: Conics, other: Conics, share: Floats) -> _Pairs:
        """Return pairs of orbits, with s, (n,)."""
        both = Conics(*(np.stack(x) for x in zip(one, other, strict=True)))
        axes = np.stack([both.along, both.across])
        kept = np.stack([1.0 - share**2, np.ones_like(share)])[..., None]
        return cls(both, kept, _dot(axes[:, None, 0], axes[None, :, 1])[..., None])

    def stretch(self) -> Floats:
        """Return a, (n,), of the angle w, tan(f/2) = a tan(w/2), in which the parts of the first orbit near its
        pericentre and far out, as far as the other one comes, take equal shares.
        """
        p, e, _, _ = self.both
        q, closed = p / (1.0 + e), e < 1.0
        size = np.where(closed, p / np.where(closed, 1.0 - e**2, 1.0), np.inf)
        far = np.minimum(size.min(axis=0), FAR * q.max(axis=0))
        tan2 = (far - q[0]) * (1.0 + e[0]) / np.maximum(p[0] - far * (1.0 - e[0]), 1e-300)
        return np.asarray(np.clip(tan2, 1.0, 1e12) ** 0.25)

    def line(self, f: Floats) -> tuple[Floats, Floats, Floats]:
        """Return A, B, C, (n, k), of the first condition, A cos F + B sin F + C = 0."""
        cos, sin, (p, P), (e, E) = np.cos(f), np.sin(f), self.both.p[..., None], self.both.e[..., None]
        A, B = ((e + cos) * self.axes[1] - sin * self.axes[0]) * (1.0 + e * cos)
        own = self.kept[0] * (p / P) * e * sin
        return A - own * E, B, -own

    def resultant(self, f: Floats) -> Floats:
        """Return g, (n, k): the second condition at both roots of the first, times (A^2 + B^2)^2."""
        A, B, C = self.line(f)
        cos, sin, (p, P), (e, E) = np.cos(f), np.sin(f), self.both.p[..., None], self.both.e[..., None]
        along, across = cos * self.axes[0] + sin * self.axes[1]
        own = (P / p) * (1.0 + e * cos) * E
        # The second condition is c0 + c1 cos F + s1 sin F + c2 cos^2 F + m sin F cos F = 0, with c0 = c2.
        c1, s1, c2, m = -across * (1.0 + E * E), own + along, -E * across, E * along
        L, size = A * A + B * B, c2 * c2 + m * m
        alpha = c2 * (L + B * B) - m * A * B - C * (c1 * A + s1 * B)
        beta, gamma = c2 * (A * A - B * B) + 2.0 * m * A * B, s1 * A - c1 * B
        delta = 2.0 * c2 * A * B + m * (B * B - A * A)
        mixed = c1 * (c2 * A + m * B) + s1 * (m * A - c2 * B)
        squares = alpha * alpha + (C * C - L) * (gamma * gamma + size * C * C)
        return np.asarray(squares + C * (3.0 * C * c2 * beta - 2.0 * C * C * mixed - 2.0 * gamma * delta))

    def expanded(self, f: Floats) -> Floats:
        """Return, (10, n, k), what is minimized at true anomalies of both, (2, n, k), infinite where one is not on its
        orbit; half its derivatives by lengths along both tangents, the second ones, and the mixed one; both distances
        from the focus; and the anomalies.
        """
        q, t, r = self.both.at(f)
        kept, apart = self.kept, q[1] - q[0]
        square = _dot(apart, apart) - (1.0 - kept[0]) * r[0] ** 2
        pull = q[::-1] - kept[..., None] * q
        # Along a tangent q changes by t, and t by -p q / r^3.
        bend = kept * _dot(t, t) + _dot(pull, q) * (self.both.p[..., None] / r**3)
        value = np.where((r > 0.0).all(axis=0), square, np.inf)
        return np.concatenate([value[None], -_dot(pull, t), bend, -_dot(*t)[None], r, f])


def least_distances(one: Conics, other: Conics) -> tuple[Floats, Floats, Floats]:
    """Return the least distance of the orbits of each pair, and the true anomalies where they have it, (n,) each."""
    square, f, F = _minimized(one, other, np.zeros(len(one.p)))
    return np.sqrt(square), f, F


def come_within(one: Conics, other: Conics, share: Floats) -> NDArray[np.bool_]:
    """Return of each pair of ellipses whether a point of the first is nearer to the second than a share of its own
    distance from the focus; share : (n,), >= 0.
    """
    near, far, near_other, far_other = (x.p / (1.0 + side * x.e) for x in (one, other) for side in (1.0, -1.0))
    within: NDArray[np.bool_] = (near_other < (1.0 + share) * far) & (far_other > (1.0 - share) * near)
    rows = np.flatnonzero(within)
    within[rows] = _minimized(one.some(rows), other.some(rows), share[rows])[0] < 0.0
    return within


def _minimized(one: Conics, other: Conics, share: Floats) -> Floats:
    """Return the minimum of |R - r|^2 - share^2 r^2 of each pair, and its true anomalies, (3, n)."""
    parts = [np.empty((3, 0))]
    for k in range(0, len(share), AT_ONCE):
        part = slice(k, k + AT_ONCE)
        parts.append(_of_some(_Pairs.of(one.some(part), other.some(part), share[part])))
    return np.concatenate(parts, axis=1)


def _of_some(pairs: _Pairs) -> Floats:
    stretch, even = pairs.stretch()[:, None], np.pi * np.arange(SAMPLES) / SAMPLES
    cos, sin = np.cos(even), stretch * np.sin(even)
    sampled = 2.0 * np.arctan2(sin, cos)
    g = pairs.resultant(sampled) * (cos**2 + sin**2) ** DEGREE
    f = np.concatenate([2.0 * np.arctan(stretch * np.tan(0.5 * _roots(g))), sampled], axis=1)
    A, B, C = pairs.line(f)
    towards, away = np.arctan2(B, A), np.arccos(np.clip(-C / np.maximum(np.hypot(A, B), 1e-300), -1.0, 1.0))
    starts = pairs.expanded(np.array([np.tile(f, 2), np.concatenate([towards + away, towards - away], axis=1)]))
    found = _descended(pairs, _least(starts, BEST))
    return _least(found, 1)[[0, -2, -1], :, 0]


def _least(found: Floats, count: int) -> Floats:
    """Return so many of each pair, (10, n, count), those of the least values."""
    order = np.argsort(found[0], axis=1)[:, :count]
    return np.asarray(found[:, np.arange(len(order))[:, None], order])


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


def _descended(pairs: _Pairs, found: Floats) -> Floats:
    """Return, as `_Pairs.expanded`, the minima next to the given places, by Newton's method with damping."""
    p = pairs.both.p[..., None]
    damping = DAMPING / np.broadcast_to(p.sum(axis=0), found[0].shape)
    for steps in range(NEWTON_STEPS):
        slope, bend, mixed, r, f = found[1:3], found[3:5], found[5], found[6:8], found[8:]
        mean, half = 0.5 * (bend[0] + bend[1]), 0.5 * (bend[0] - bend[1])
        # As much more curvature as makes it positive, and more where the slope is large.
        more = np.maximum(2.0 * (np.hypot(half, mixed) - mean), 0.0)
        bend = bend + (more + damping * np.hypot(*slope) + 2e-15 * np.abs(mean))
        determinant = bend[0] * bend[1] - mixed**2
        step = (mixed * slope[::-1] - bend[::-1] * slope) / np.where(determinant == 0.0, np.inf, determinant)
        tried = pairs.expanded(f + step * p / r**2)
        lower = tried[0] < found[0]
        rounded = ROUNDED[0] * (found[0] + (1.0 - pairs.kept[0]) * r[0] ** 2) + ROUNDED[1] * r[0] ** 2
        settled = np.abs(slope * step).sum(axis=0) <= rounded
        found, damping = np.where(lower, tried, found), damping * np.where(lower, 0.5, 8.0)
        if steps + 1 >= OVERTAKING and settled[np.arange(len(p[0])), np.argmin(found[0], axis=1)].all():
            break
    return found


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))
