"""The least distance of two ellipses about one focus by a search that cannot miss it, as a reference.

Its square is a trigonometric polynomial in the eccentric anomalies u and v of the two, with third derivatives below a
bound that is known beforehand. All (u, v) are divided into boxes. Nowhere in a box is the function below its expansion
to second order about the centre less what that bound leaves: where this is above the least value found so far, the box
does not contain the minimum. The other boxes are halved, and from each that is left Newton's method goes down to the
minimum. So none falls between the points of a grid, however narrow it is.

Sources: for the search Moore, Kearfott & Cloud (2009), Introduction to Interval Analysis, ch. 5; for Newton's method
Li, Fukushima, Qi & Yamashita (2004), Comput. Optim. Appl. 28, 131.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.elements.kepler_equation import Floats

DIVISIONS = 16
"""Boxes in a full turn of each anomaly at first."""

HALVINGS = 5
"""How often boxes are halved: from those of a 512th of a turn, Newton's method finds each minimum, also of ellipses
that nearly touch or coincide.
"""

NEWTON_STEPS = 16
"""Four do for most pairs; the others are for ellipses that touch from within, whose minimum has no curvature."""

DAMPING = 0.5
"""What Newton's method adds to the curvatures at first, as a multiple of the slope."""

Rows = NDArray[np.intp]


class Ellipses(NamedTuple):
    """Ellipses about a focus at the origin: at the eccentric anomaly E, along (cos E - e) + across sin E.

    along : (n, 3), the semi-major axis, towards the pericentre
    across : (n, 3), the semi-minor axis, a quarter of a turn ahead
    e : (n,), 0 <= e < 1
    """

    along: Floats
    across: Floats
    e: Floats

    def at(self, E: Floats) -> Floats:
        """Return a position on each, (n, 3), at the eccentric anomalies E, (n,)."""
        return self.with_derivatives(E)[0]

    def with_derivatives(self, E: Floats) -> tuple[Floats, Floats, Floats]:
        """Return a position on each and its first and second derivatives by E, (n, 3) each."""
        cos, sin = np.cos(E)[:, None], np.sin(E)[:, None]
        q = self.along * (cos - self.e[:, None]) + self.across * sin
        return q, self.across * cos - self.along * sin, -self.along * cos - self.across * sin

    def some(self, rows: Rows) -> Ellipses:
        """Return those of the given rows."""
        return Ellipses(self.along[rows], self.across[rows], self.e[rows])


class _Pairs(NamedTuple):
    """Pairs of ellipses; what is minimized is |Q - q|^2 for q on one and Q on the other."""

    one: Ellipses
    other: Ellipses

    def some(self, rows: Rows) -> _Pairs:
        return _Pairs(self.one.some(rows), self.other.some(rows))

    def expanded(self, u: Floats, v: Floats) -> _Expansion:
        """Return the expansion about a point of each pair, (n,) each."""
        q, q_u, q_uu = self.one.with_derivatives(u)
        Q, Q_v, Q_vv = self.other.with_derivatives(v)
        apart = Q - q
        return _Expansion(
            _dot(apart, apart),
            -2.0 * _dot(apart, q_u),
            2.0 * _dot(apart, Q_v),
            2.0 * (_dot(q_u, q_u) - _dot(apart, q_uu)),
            -2.0 * _dot(q_u, Q_v),
            2.0 * (_dot(Q_v, Q_v) + _dot(apart, Q_vv)),
        )

    def remainder(self) -> Floats:
        """Return the most that the expansion leaves within 1 in u and v; it grows as the cube of that width."""
        (a, e), (b, f) = ((np.linalg.norm(each.along, axis=1), each.e) for each in (self.one, self.other))
        mixed = a * b * (16.0 + 2.0 * (e + f))  # of -2 q.Q: |q| is at most a (1 + e), its derivatives at most a
        own = a**2 * (2.0 * e + 4.0 * e**2) + b**2 * (2.0 * f + 4.0 * f**2)
        most: Floats = (mixed + own) / 6.0
        return most


class _Expansion(NamedTuple):
    """A function of u and v at some points, its first derivatives and its second ones."""

    value: Floats
    u: Floats
    v: Floats
    uu: Floats
    uv: Floats
    vv: Floats

    def least_curvature(self) -> Floats:
        """Return the lesser eigenvalue of the second derivatives."""
        least: Floats = 0.5 * (self.uu + self.vv) - np.hypot(0.5 * (self.uu - self.vv), self.uv)
        return least


def least_distance(one: Ellipses, other: Ellipses) -> tuple[Floats, Floats, Floats]:
    """Return the least distance of the ellipses of each pair, and the eccentric anomalies where they have it.

    one, other : n ellipses each, about the same focus and in the same unit of length
    Returns (distance, E on one, E on the other), (n,) each; one place of several. A distance is that of two points in
    floats: off by 1e-16 of the larger semi-major axis, and by at most 1e-12 of it where ellipses touch from within.
    """
    u, v = np.mod(_minimized(_Pairs(one, other))[1:], 2.0 * math.pi)
    return np.linalg.norm(other.at(v) - one.at(u), axis=1), u, v


def _minimized(pairs: _Pairs) -> Floats:
    """Return the minimum of each pair's function, its u and its v, (3, n)."""
    n, width, remainder = len(pairs.one.e), math.pi / DIVISIONS, pairs.remainder()
    centres = (2.0 * np.arange(DIVISIONS) + 1.0) * width
    pair = np.repeat(np.arange(n), DIVISIONS**2)
    u, v = np.tile(np.repeat(centres, DIVISIONS), n), np.tile(centres, n * DIVISIONS)
    least = np.full(n, math.inf)
    for halving in range(HALVINGS + 1):
        if halving:
            width *= 0.5
            pair = np.repeat(pair, 4)
            u = (u[:, None] + width * np.array([-1.0, -1.0, 1.0, 1.0])).ravel()
            v = (v[:, None] + width * np.array([-1.0, 1.0, -1.0, 1.0])).ravel()
        f = pairs.some(pair).expanded(u, v)
        np.minimum.at(least, pair, f.value)
        below = width * (np.abs(f.u) + np.abs(f.v)) - width**2 * np.minimum(f.least_curvature(), 0.0)
        left = f.value - below - width**3 * remainder[pair] <= least[pair]
        pair, u, v = pair[left], u[left], v[left]
    found = np.array([least, np.zeros(n), np.zeros(n)])
    reached = np.array(_descended(pairs.some(pair), u, v))
    order = np.lexsort((reached[0], pair))
    rows, first = np.unique(pair[order], return_index=True)
    found[:, rows] = reached[:, order[first]]
    return found


def _descended(pairs: _Pairs, u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the value at the minimum next to (u, v), and where that is, by Newton's method with damping."""
    damping = np.full(len(u), DAMPING)
    f = pairs.expanded(u, v)
    for _ in range(NEWTON_STEPS):
        # As much more curvature as makes it positive, and more where the slope is large; the last
        # term is above what rounding takes away.
        more = np.maximum(-2.0 * f.least_curvature(), 0.0) + damping * np.hypot(f.u, f.v) + 1e-15 * (f.uu + f.vv)
        uu, vv = f.uu + more, f.vv + more
        determinant = uu * vv - f.uv**2
        u_new, v_new = u - (vv * f.u - f.uv * f.v) / determinant, v - (uu * f.v - f.uv * f.u) / determinant
        g = pairs.expanded(u_new, v_new)
        lower = g.value < f.value
        u, v = np.where(lower, u_new, u), np.where(lower, v_new, v)
        f = _Expansion(*np.where(lower, g, f))
        damping *= np.where(lower, 0.5, 8.0)
    return f.value, u, v


def _dot(a: Floats, b: Floats) -> Floats:
    product: Floats = np.einsum("mi,mi->m", a, b)
    return product
