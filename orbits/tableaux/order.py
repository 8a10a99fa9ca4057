"""Order conditions of partitioned Runge–Kutta methods: one for each rooted tree with vertices of two colours.

A vertex stands for V (white: a derivative of q, integrated by a) or F (black: a derivative of p, integrated by a_bar).
Phi_i of a vertex is the product over its children of sum_j a_ij Phi_j (white child) or sum_j a_bar_ij Phi_j (black
child). A method has order r if sum_i b_i Phi_i(tree) = 1 / gamma(tree) for every tree of at most r vertices.

Source: Hairer, Lubich & Wanner (2006), sec. III.2.1.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from orbits.tableaux.partitioned import PartitionedTableau

HIGHEST = 6
"""Orders are determined up to this one, which adds 916 trees."""

TOLERANCE = 1e-13
"""For float64 sums of at most eight terms of order one. A violated condition is off by 1/720 or more."""


def convergence_order(tableau: PartitionedTableau) -> int:
    """Return the order of the method for any Lagrangian, at most `HIGHEST`."""
    # A tree is stored as its contribution to its parent: (number of vertices, gamma, Phi seen from the parent).
    white: dict[int, list[tuple[int, np.ndarray[Any, Any]]]] = {}
    black: dict[int, list[tuple[int, np.ndarray[Any, Any]]]] = {}
    for size in range(1, HIGHEST + 1):
        forests = _forests(size - 1, white, black)
        weights = [(size * gamma, phi * np.ones(tableau.stages)) for gamma, phi in forests]
        if any(abs(float(tableau.b @ phi) - 1.0 / gamma) > TOLERANCE for gamma, phi in weights):
            return size - 1
        white[size] = [(gamma, tableau.a @ phi) for gamma, phi in weights]
        black[size] = [(gamma, tableau.a_bar @ phi) for gamma, phi in weights]
    return HIGHEST


def _forests(total: int, white: Any, black: Any) -> list[tuple[int, Any]]:
    """Return the products of gammas and of Phis for all multisets of coloured trees with `total` vertices."""
    if total == 0:
        return [(1, 1.0)]
    trees = [(size, *tree) for size in range(1, total + 1) for colour in (white, black) for tree in colour[size]]
    found = []
    for partition in partitions(total):
        pools = []
        for size in sorted(set(partition)):
            of_size = [tree for tree in trees if tree[0] == size]
            pools.append(list(combinations_with_replacement(of_size, partition.count(size))))
        found += _products(pools)
    return found


def _products(pools: list[list[Any]]) -> list[tuple[int, Any]]:
    combined: list[tuple[int, Any]] = [(1, 1.0)]
    for pool in pools:
        extended = []
        for gamma, phi in combined:
            for chosen in pool:
                g, x = gamma, phi
                for _, tree_gamma, tree_phi in chosen:
                    g, x = g * tree_gamma, x * tree_phi
                extended.append((g, x))
        combined = extended
    return combined


def partitions(total: int, largest: int | None = None) -> list[list[int]]:
    """Return the partitions of a whole number into parts of at most `largest`, in descending order."""
    largest = total if largest is None else largest
    if total == 0:
        return [[]]
    return [[part, *rest] for part in range(min(total, largest), 0, -1) for rest in partitions(total - part, part)]
