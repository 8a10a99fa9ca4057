"""Hermite's interpolation: polynomials through values and rates at nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def between(nodes: Array, known: Array, times: Array, most: int) -> Array:
    """Return states, or derivatives of states, at times, (m, 6, ...), from those at nodes, (k, 6, ...).

    nodes : (k,), in their order, forwards or back; velocities, the last three of six, are the rates of the first three
    most : nodes of a polynomial, those about each time, or all if there are fewer
    """
    if len(nodes) == 1:
        return np.repeat(known, len(times), axis=0)
    sign = np.sign(nodes[-1] - nodes[0])
    use = min(most, len(nodes))
    place = np.searchsorted(sign * nodes, sign * times, side="right") - 1
    first = np.clip(place - (use // 2 - 1), 0, len(nodes) - use)
    rows = first[:, None] + np.arange(use)
    x, t = nodes[rows], times[:, None]
    gaps = x[:, :, None] - x[:, None, :] + np.eye(use)
    away = t - x
    # Lagrange's polynomials l, and the sums of 1 / (x_i - x_j): the derivative of l_i at x_i.
    terms = np.where(np.eye(use, dtype=bool), 1.0, away[:, None, :] / gaps)
    l = terms.prod(axis=2)  # noqa: E741 - Lagrange's own letter
    slope = (1.0 / gaps - np.eye(use)).sum(axis=2)
    # dl_i/dt: the sum over k of the product without the factor k, over its gap.
    dl = np.zeros_like(l)
    for k in range(use):
        without = np.where(np.arange(use) == k, 1.0, terms).prod(axis=2)
        dl += np.where(np.arange(use) == k, 0.0, without / gaps[:, :, k])
    values, rates = known[rows, :3], known[rows, 3:]
    h, k = (1.0 - 2.0 * away * slope) * l**2, away * l**2
    dh = -2.0 * slope * l**2 + (1.0 - 2.0 * away * slope) * 2.0 * l * dl
    dk = l**2 + away * 2.0 * l * dl
    at = np.einsum("mi,mij...->mj...", h, values) + np.einsum("mi,mij...->mj...", k, rates)
    by = np.einsum("mi,mij...->mj...", dh, values) + np.einsum("mi,mij...->mj...", dk, rates)
    return np.concatenate([at, by], axis=1)
