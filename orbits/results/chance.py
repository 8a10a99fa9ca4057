"""Probabilities of impacts: of a normal distribution in a disc, and of hits among clones."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODES, WIDEST = 200, 9.0
"""Nodes of Gauss's quadrature over the disc, and how many sigmas of the wide axis it goes."""

CONFIDENT = 1.959963984540054
"""Sigmas of a normal distribution within which 95 % lie."""


class Chance(NamedTuple):
    """A probability by counting: hits among a number of clones.

    value : hits / clones, NaN without clones; low, high : Wilson's interval of 95 %
    """

    value: float
    low: float
    high: float
    hits: int
    clones: int

    @classmethod
    def of(cls, hits: int, clones: int) -> Chance:
        """Return the chance of hits among clones.

        Source: Wilson (1927), J. Am. Stat. Assoc. 22, 209.
        """
        if clones == 0:
            return cls(math.nan, 0.0, 1.0, 0, 0)
        p, z2 = hits / clones, CONFIDENT**2 / clones
        middle = (p + 0.5 * z2) / (1.0 + z2)
        half = math.sqrt(z2 * (p * (1.0 - p) + 0.25 * z2)) / (1.0 + z2)
        return cls(p, max(0.0, middle - half), min(1.0, middle + half), hits, clones)

    def __str__(self) -> str:
        interval = f"{self.low:.3g} to {self.high:.3g} (95 %)"
        return f"{self.value:.4g}, within {interval}: {self.hits:,} of {self.clones:,} hit"


def probability_in_disc(centre: Array, matrix: Array, radius: float) -> float:
    """Return the probability of a disc about the origin under a normal distribution.

    centre, matrix : (2,) and (2, 2), its mean and covariance, in the unit of the radius. NaN if one of them is
    """
    if not (np.isfinite(centre).all() and np.isfinite(matrix).all() and math.isfinite(radius)):
        return math.nan
    values, vectors = np.linalg.eigh(matrix)
    narrow, wide = np.sqrt(np.maximum(values, 1e-300))
    y0, x0 = vectors.T @ centre
    low, high = max(-radius, x0 - WIDEST * wide), min(radius, x0 + WIDEST * wide)
    if low >= high:
        return 0.0
    # Along the wide axis x = radius sin(angle), so that the ends of the disc are smooth; across it the integral is
    # known, and turns where the disc ends at the centre of the distribution.
    turns = math.acos(min(1.0, abs(y0) / radius)) * np.array([-1.0, 1.0])
    first, last = (math.asin(max(-1.0, min(1.0, x / radius))) for x in (low, high))
    edges = np.unique(np.clip([first, *turns, last], first, last))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    angles = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * nodes).ravel()
    scaled = (0.5 * np.diff(edges)[:, None] * weights).ravel()
    x, half = radius * np.sin(angles), radius * np.cos(angles)
    density = np.exp(-0.5 * ((x - x0) / wide) ** 2) / (wide * math.sqrt(2.0 * math.pi))
    across = _below((half - y0) / narrow) - _below((-half - y0) / narrow)
    return min(1.0, float(np.sum(scaled * half * density * across)))


def _below(x: Array) -> Array:
    """Return the normal distribution function."""
    return np.array([0.5 * math.erfc(-each / math.sqrt(2.0)) for each in x.tolist()])
