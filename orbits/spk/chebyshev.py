"""Chebyshev polynomials through positions and velocities, and a bound on their truncation error.

A record of half-length r about t0 holds x(t0 + r s) = sum_k c_k T_k(s), -1 <= s <= 1. Positions and velocities at NODES
points determine DEGREE_OF_FIT + 1 coefficients, of which the first DEGREE + 1 are kept. As |T_k| <= 1, the sum of the
others bounds the truncation error.
Source: Newhall (1989), Celestial Mechanics 45, 305 (positions and velocities fitted together).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODES = 10
DEGREE_OF_FIT = 2 * NODES - 1
DEGREE = 13


@cache
def nodes() -> Array:
    """Return the points at which a record is sampled, ascending in (-1, 1), shape (NODES,)."""
    return np.polynomial.chebyshev.chebpts1(NODES)


@cache
def _from_states() -> Array:
    """Return the matrix from (positions, velocities r) at the nodes to coefficients, (2 NODES, 2 NODES)."""
    values = chebyshev.chebvander(nodes(), DEGREE_OF_FIT)
    slopes = chebyshev.chebval(nodes(), chebyshev.chebder(np.eye(DEGREE_OF_FIT + 1))).T
    inverse: Array = np.linalg.inv(np.concatenate([values, slopes]))
    return inverse


@cache
def _of_pairs() -> Array:
    """Return the matrix from the kept coefficients of two neighbouring records to those of the joined record.

    Shape (DEGREE_OF_FIT + 1, 2, DEGREE + 1).
    """
    points = chebyshev.chebpts1(DEGREE_OF_FIT + 1)
    inverse = np.linalg.inv(chebyshev.chebvander(points, DEGREE_OF_FIT))
    values = np.zeros((DEGREE_OF_FIT + 1, 2, DEGREE + 1))
    for side, first in enumerate((-1.0, 0.0)):
        inside = (points < 0.0) == (side == 0)
        values[inside, side] = chebyshev.chebvander(2.0 * (points[inside] - first) - 1.0, DEGREE)
    merged: Array = np.einsum("kp,psj->ksj", inverse, values)
    return merged


def fitted(q: Array, v: Array, half_length: float) -> tuple[Array, Array]:
    """Return (coefficients, lost) of records.

    q, v : (records, NODES, bodies, 3) at the nodes, in any unit of length, and that unit per unit of `half_length`
    coefficients : (records, DEGREE + 1, bodies, 3);  lost : (records, bodies), the bound on the truncation error
    """
    data = np.concatenate([q, v * half_length], axis=1)
    return _cut(np.einsum("kj,rjbc->rkbc", _from_states(), data))


def merged(coefficients: Array) -> tuple[Array, Array]:
    """Return (coefficients, lost) of records of twice the length, from those of an even number of records."""
    pairs = coefficients.reshape(-1, 2, *coefficients.shape[1:])
    return _cut(np.einsum("ksj,rsjbc->rkbc", _of_pairs(), pairs))


def _cut(coefficients: Array) -> tuple[Array, Array]:
    lost = np.linalg.norm(coefficients[:, DEGREE + 1 :], axis=-1).sum(axis=1)
    return coefficients[:, : DEGREE + 1], lost
