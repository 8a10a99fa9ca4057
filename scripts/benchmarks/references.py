"""Rotated initial states and their exact solutions, including the effect of rounding the rotated states.

An initial state rotated by R is not exact in float64; a method gets a slightly different problem, whose solution is not
the rotated one. Over 1,000 years that rounding moves Jupiter by 1e-4 km, more than a good method's own error. The
difference of each rounded state from the reference is therefore propagated as well:

    end(q + d) = end(q) + [end(q + s d) - end(q)] / s,    s = 2^22,

both ends in brackets by IAS15. The bundled reference in quadruple precision gives the first summand; of the second,
four digits are enough, and IAS15 and the curvature of the flow leave five. R has rational entries and is exactly
orthogonal, and all sums are fractions, so that nothing else is rounded.

Integrations from the rotated starts in 80-bit floats (heyoka, tolerance 1e-20) agree with these ends to their own
round-off, 3e-5 km for the inner planets and 5e-6 km for the outer ones, which is too coarse for the latter.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.point_masses import PointMasses
from orbits.regression import peers

Array = NDArray[np.float64]
Exact = NDArray[np.object_]
"""Arrays of fractions."""

MAGNIFIED = 2.0**22
"""s: differences of starts of 1e-16 become 1e-9, far above round-off and far below where the flow bends."""


class Start(NamedTuple):
    """A rotated start as float64, what rotates it, and how far it is from the start of the reference.

    rotation : (3, 3) fractions, orthogonal
    q, v : (bodies, 3), each coordinate of the rotated start rounded once
    dq, dv : (bodies, 3), turned back and less the start of the reference
    """

    rotation: Exact
    q: Array
    v: Array
    dq: Array
    dv: Array


def rotations(count: int) -> list[Exact]:
    """Return the identity and random rotations, always the same, uniformly distributed but for the grid of 1/1000.

    (3, 3) arrays of fractions, exactly orthogonal: made from quaternions of whole numbers.
    """
    rng = np.random.default_rng(20000101)
    out = [exact(np.eye(3))]
    for _ in range(count - 1):
        a, b, c, d = (int(x) for x in np.rint(1000 * rng.normal(size=4)))
        whole = [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
        norm = a * a + b * b + c * c + d * d
        out.append(np.array([[Fraction(x, norm) for x in row] for row in whole], dtype=object))
    return out


def exact(x: object) -> Exact:
    """Return float64 numbers, or texts of decimal digits, as fractions."""
    values = np.asarray(x)
    return np.array([Fraction(y) for y in values.ravel().tolist()], dtype=object).reshape(values.shape)


def rotated(q: Array, v: Array, rotation: Exact) -> Start:
    """Return the start that a method gets."""
    turned, differences = [], []
    for x in (q, v):
        turned.append((exact(x) @ rotation.T).astype(np.float64))
        differences.append((exact(turned[-1]) @ rotation - exact(x)).astype(np.float64))
    return Start(rotation, *turned, *differences)


def ends(gm: Array, q: Array, v: Array, end: Exact, starts: list[Start], span: float) -> list[Exact]:
    """Return where each start leads after `span`, in the axes of the reference: (bodies, 3) fractions each.

    gm (bodies,), q and v (bodies, 3) : the start of the reference
    end : (bodies, 3) fractions, where that one leads
    """

    def ias15(dq: Array, dv: Array) -> Array:
        start = PointMasses(gm, q + MAGNIFIED * dq, v + MAGNIFIED * dv)
        run = peers.run("ias15", start, times=np.array([span]), dt=1.0)
        return run.q[-1]

    undisturbed = ias15(np.zeros_like(q), np.zeros_like(v))
    return [end + exact((ias15(start.dq, start.dv) - undisturbed) / MAGNIFIED) for start in starts]


def errors(end: Array, start: Start, truth: Exact) -> Array:
    """Return the distance of each body from where it should be, (bodies,).

    end : (bodies, 3) float64, where a method has taken `start`
    truth : as `ends` returns it
    """
    return np.linalg.norm((exact(end) @ start.rotation - truth).astype(np.float64), axis=1)
