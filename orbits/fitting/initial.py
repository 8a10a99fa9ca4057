"""A first orbit for observations that come without one: from three of them, then from ever longer arcs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, IntegrationError
from orbits.fitting.correction import Problem, Solution, with_outliers_rejected
from orbits.fitting.gauss import orbits_of, triples
from orbits.fitting.sight import Sight
from orbits.observing.light import C

Array = NDArray[np.float64]

GOOD = 2.5
"""Normalized RMS of a first orbit that is worth a longer arc."""

LONGER = 3.0
"""By how much arcs grow from one correction to the next."""


class Root(NamedTuple):
    """A solution of Gauss's equation.

    rows : the numbers of the three observations; sun_distance, distance : of the body from the Sun and from the
        observer at the second one, au
    day : when the light of that one left the body, since the epoch; state : heliocentric then, au and au/d, (6,)
    rms : normalized, of the observations about them once they are fitted; NaN if they were not, or cannot be
    """

    rows: tuple[int, int, int]
    sun_distance: float
    distance: float
    day: float
    state: Array
    rms: float = np.nan


def roots(sight: Sight) -> Iterator[Root]:
    """Yield the orbits through three observations at a time, the most promising ones first."""
    for three in triples(sight.days):
        rows = list(three)
        from_sun = sight.here[rows] - sight.sun[rows]
        for state in orbits_of(sight.days[rows], from_sun, sight.measured[rows]):
            away = float(np.linalg.norm(state[:3] - from_sun[1]))
            yield Root(three, float(np.linalg.norm(state[:3])), away, float(sight.days[rows[1]]) - away / C, state)


def first_solution(
    sight: Sight, prepared: Callable[[Root], tuple[Problem, Array]]
) -> tuple[Problem, Solution, tuple[Root, ...]]:
    """Return the solution for all observations, the problem whose it is, and the roots that were tried.

    prepared : returns the problem whose epoch is near a root, and the start there
    Raises ConvergenceError if no root leads to one.
    """
    tried: list[Root] = []
    for root in roots(sight):
        problem, start = prepared(root)
        days = np.abs(problem.sight.days)
        span = 1.2 * max(float(days[list(root.rows)].max()), 0.05)
        rows = np.flatnonzero(days <= span)
        try:
            found = with_outliers_rejected(problem.some(rows), start, np.ones(len(rows), dtype=bool))
            tried.append(root._replace(rms=normalized_rms(problem.some(rows), found)))
            if tried[-1].rms < GOOD:
                whole = _grown(problem, found, rows, span)
                if normalized_rms(problem, whole) < GOOD and whole.used.mean() > 0.5:
                    return problem, whole, tuple(tried)
        except (ConvergenceError, IntegrationError):
            tried.append(root)
    raise ConvergenceError(
        f"no orbit is found by Gauss's method: {len(tried)} roots were tried, from "
        f"{len({root.rows for root in tried})} choices of three observations. Give a start: orbits.fit(observations, "
        "system=...), with the body in the system, or leave out observations that are not of it."
    )


def normalized_rms(problem: Problem, found: Solution) -> float:
    """Return the RMS of residuals in units of their sigmas, of what is used."""
    white = problem.white(found.residuals)[found.used]
    return float(np.sqrt(np.mean(white**2)))


def _grown(problem: Problem, found: Solution, rows: NDArray[np.intp], span: float) -> Solution:
    """Return the solution for all observations, from that for those within `span` days of t = 0, by ever longer arcs.

    Raises ConvergenceError, or an IntegrationError, if an arc on the way has none.
    """
    days = np.abs(problem.sight.days)
    used = np.ones(len(days), dtype=bool)
    used[rows] = found.used
    while len(rows) < len(days):
        span = max(span * LONGER, float(days[days > span].min()) + 1.0)
        rows = np.flatnonzero(days <= span)
        found = with_outliers_rejected(problem.some(rows), found.start, used[rows])
        used[rows] = found.used
    return found
