"""The collisions within a step, to the accuracy of the orbit, by partial steps of the method.

Kernels find steps in which two bodies may touch (`orbits.kernels.search.collisions`); here the pairs are found by the
same verdict, and the times at which the distance of each falls below the sum of its radii. A massless body that takes
steps of its own may go round another one many times in a step: its distances are followed through all of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.kernels.search.collisions import roughness, touching
from orbits.marching.first_passage import State, Within, rounding_of

Pairs = Iterable[tuple[int, int]]


class Impact(NamedTuple):
    """A collision: its time, and the two bodies, the lower number first."""

    time: float
    first: int
    second: int


class Step(NamedTuple):
    """A step of a march: the times and the states at its ends, and `at`, which returns the state at a time within.

    massive : the numbers of the massive bodies there
    strength : the squared softening length, and the GM of each of these
    """

    begin: float
    end: float
    before: State
    after: State
    at: Callable[[float], State]
    massive: NDArray[np.intp]
    strength: Array


def impacts(
    step: Step, radii: Array, passes: Callable[[int, int], bool | None], order: int, among: Pairs | None = None
) -> list[Impact]:
    """Return the collisions in a step, in the order of time; of those at the same time that of the first bodies first.

    radii : (n,), of all bodies; order : of the method
    passes : whether two bodies pass through each other, and may collide again; None if their collision is not sought
    among : pairs, the lower number first; None for those that may touch by the verdict that found the step

    A pair that overlaps at the beginning of the step does not collide in it before it has parted.
    """
    found, h, is_rough = [], step.end - step.begin, roughness(order) > 0.0
    within = Within(h, step.before, step.after, lambda part: step.at(step.begin + part * h), is_rough)
    for i, j in candidates(step, radii, _slack(step, order)) if among is None else among:
        through = passes(i, j)
        if through is not None:
            times = _times_of(within, step, i, j, float(radii[i] + radii[j]))
            found += [Impact(time, i, j) for time in (times if through else islice(times, 1))]
    direction = math.copysign(1.0, step.end - step.begin)
    return sorted(found, key=lambda impact: (impact.time * direction, impact.first, impact.second))


def candidates(step: Step, radii: Array, slack: float) -> Pairs:
    """Yield the pairs, the lower number first, that may touch within a step, by the verdict that found the step."""
    states, found = np.array([*step.before, *step.after]), np.zeros(len(radii), dtype=bool)
    massive, count = step.massive, len(step.massive)
    field = step.strength, states[:, massive].swapaxes(1, 2).ravel(), 0, 3 * count
    numbers = np.full(len(radii), count, dtype=np.int64)  # among the massive bodies; of massless ones as many as these
    numbers[massive] = np.arange(count)
    pairs: set[tuple[int, int]] = set()
    for i in massive.tolist():
        touching(i, states, numbers, field, step.end - step.begin, radii, slack, found)
        pairs |= {(min(i, j), max(i, j)) for j in np.flatnonzero(found).tolist()}
    return sorted(pairs)


def _slack(step: Step, order: int) -> float:
    """Return by how much bodies may move otherwise than the cubics of a step, besides the bound of their errors."""
    changes = np.linalg.norm(step.after[1] - step.before[1], axis=1)
    return roughness(order) * abs(step.end - step.begin) * float(np.nanmax(changes, initial=0.0))


def _times_of(within: Within, step: Step, i: int, j: int, reach: float) -> Iterator[float]:
    """Yield the times at which the distance of a pair falls below a reach within a step."""
    # At the nearer end: in a step of massive bodies, a massless one may go anywhere, or be lost.
    noise = float(np.nanmin([rounding_of(reach, x[0][[i, j]]) for x in (step.before, step.after)]))
    part = within.first_passage(i, j, reach, noise=noise)
    if part is None:
        before, after = (float(np.linalg.norm(x[0][j] - x[0][i])) for x in (step.before, step.after))
        if after < reach <= before:  # by rounding, or where no partial step of the method leads to
            yield step.end
    while part is not None:
        yield step.begin + part * within.length
        part = within.first_passage(i, j, reach, part=(part, 1.0), noise=noise, waits=True)


def overlapping(
    q: Array, radii: Array, massive: NDArray[np.bool_], share: float = 1.0, of: int | None = None
) -> Iterator[tuple[int, int]]:
    """Yield the pairs that are closer than `share` times the sum of their radii, (n, 3) and (n,), nearest first.

    of : a massive body, if only pairs with it are looked for
    """
    found = []
    numbers = np.arange(len(q)) if of is None else np.full(len(q), of + 1)
    for i in np.flatnonzero(massive).tolist() if of is None else [of]:
        distance, reach = np.linalg.norm(q - q[i], axis=1), radii + radii[i]
        others = ((numbers > i) | ~massive) & (distance < share * reach) & (reach > 0.0)
        near = [j for j in np.flatnonzero(others).tolist() if j != i]
        found += [(float(distance[j] / reach[j]), min(i, j), max(i, j)) for j in near]
    yield from ((i, j) for _, i, j in sorted(found))
