"""Order conditions of compositions, for numbers of any precision.

A symmetric method of order p is the flow of h Y_1 + h^(p+1) Y_(p+1) + h^(p+3) Y_(p+3) + ... A composition of steps
gamma_i h is the product of such exponentials with Y_k scaled by gamma_i^k. In the free algebra on the letters Y_k, of
degree k, it has order r if and only if it agrees with exp(h Y_1) in every word of degree at most r. The Lyndon words
determine the others, and for a symmetric composition the Lyndon words of odd degree suffice.

For q'' = g(q), a chain of kicks and drifts is an explicit Runge–Kutta–Nyström method, and has order r if sum_i k_i
Phi_i = 1 / gamma for every tree of at most r vertices in which each velocity has at most one force.

Source: Hairer, Lubich & Wanner (2006), sec. III.3.3, V.3.1 and III.2.3; Murua & Sanz-Serna (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement
from math import factorial
from typing import Any

from orbits.tableaux.order import partitions

Word = tuple[int, ...]


def words(base_order: int, order: int) -> list[Word]:
    """Return the Lyndon words of odd degree up to `order` over the letters 1, p + 1, p + 3, ..., p the base's order."""
    letters = [1, *range(base_order + 1, order + 1, 2)]
    found = [w for w in _all_words(letters, order) if sum(w) % 2 and w and _is_lyndon(w)]
    return sorted(found, key=lambda w: (sum(w), len(w), w))


def composition_defects(gammas: Sequence[Any], base_order: int, order: int) -> list[Any]:
    """Return the defect of each condition of `words`, for steps gamma_i h of a symmetric method of order p."""
    letters = [1, *range(base_order + 1, order + 1, 2)]
    every = sorted(_all_words(letters, order), key=len, reverse=True)
    value: dict[Word, Any] = dict.fromkeys(every, gammas[0] * 0)
    value[()] = gammas[0] * 0 + 1
    for gamma in gammas:
        powers = [gamma**k for k in range(order + 1)]
        for w in every:  # long words first: the shorter ones they depend on must still be those before this factor
            value[w] = sum(value[w[:cut]] * powers[sum(w[cut:])] / factorial(len(w) - cut) for cut in range(len(w) + 1))
    return [value[w] - (gammas[0] * 0 + 1) ** 0 / factorial(len(w)) * (set(w) == {1}) for w in words(base_order, order)]


def nystrom_defects(kicks: Sequence[Any], drifts: Sequence[Any], order: int) -> list[Any]:
    """Return the defect of each condition of a chain kick - drift - ... - kick, with one kick more than drifts."""
    zero = kicks[0] * 0
    nodes = [zero]
    for d in drifts:
        nodes.append(nodes[-1] + d)
    s = range(len(kicks))
    # A force is stored as its contribution to the velocity above it: (vertices, density, Phi seen from the next force).
    seen: dict[int, list[tuple[int, list[Any]]]] = {1: [(1, nodes)]}
    found = [nodes[-1] - 1]
    for size in range(1, order + 1):
        here = []
        for gamma, phi in _forests(size - 1, seen, [zero + 1 for _ in s]):
            density = size * gamma
            found.append(sum(kicks[i] * phi[i] for i in s) - (zero + 1) / density)
            above = [sum((kicks[j] * (nodes[i] - nodes[j]) * phi[j] for j in range(i)), zero) for i in s]
            here.append((density * (size + 1), above))
        seen[size + 1] = here
    return found


def _all_words(letters: Sequence[int], degree: int) -> list[Word]:
    found: list[Word] = [()]
    for w in found:  # grows during the iteration
        found += [(*w, k) for k in letters if sum(w) + k <= degree]
    return found


def _is_lyndon(word: Word) -> bool:
    return all(word < word[k:] + word[:k] for k in range(1, len(word)))


def _forests(total: int, seen: dict[int, list[tuple[int, list[Any]]]], one: list[Any]) -> list[tuple[int, list[Any]]]:
    """Return the products of densities and of Phis for all multisets of subtrees with `total` vertices."""
    found = []
    for partition in partitions(total):
        combined = [(1, one)]
        for size in sorted(set(partition)):
            pool = seen.get(size, [])
            combined = [
                _product(start, chosen)
                for start in combined
                for chosen in combinations_with_replacement(pool, partition.count(size))
            ]
        found += combined
    return found


def _product(start: tuple[int, list[Any]], chosen: Sequence[tuple[int, list[Any]]]) -> tuple[int, list[Any]]:
    gamma, phi = start
    for density, factor in chosen:
        gamma, phi = gamma * density, [x * y for x, y in zip(phi, factor, strict=True)]
    return gamma, phi
