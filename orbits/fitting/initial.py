"""A first orbit for observations that come without one: from three of them, then from ever longer arcs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, IntegrationError, counted
from orbits.finding import Finding
from orbits.fitting.correction import (
    REJECTED,
    Problem,
    Solution,
    at_start,
    corrected,
    with_outliers_rejected,
    without_gross,
)
from orbits.fitting.sight import Sight
from orbits.fitting.valley import shape
from orbits.observing.light import C
from orbits.observing.three_directions import orbits_at, orbits_of, triples

Array = NDArray[np.float64]

GOOD = 2.5
"""Normalized RMS of a first orbit that is worth a longer arc."""

LONGER = 3.0
"""By how much arcs grow from one correction to the next."""


SHORT = 100.0
"""Days of an arc on which more than one orbit may fit, so that all beginnings are tried."""

DISTANCES = np.geomspace(0.05, 40.0, 8)
"""From the observer, au, of the beginnings on a short arc that are not from Gauss's equation."""

CHOICES = 3
"""Choices of three observations whose roots are all tried on a short arc."""

UNDECIDED = 9.0
"""Orbits whose chi-squared is within this of the least are not told apart by the observations."""

MANY = 20
"""Among fewer observations than these, outliers that are rejected may be those that would decide."""

ASTRAY = 1e4
"""Chi-squared, relative to what is expected of it, of an observation that is not of the body that an arc has shown so
far: an orbit is not bent towards it."""

EQUAL = 1e-3
"""Differences of chi-squared below this are none."""

NEAR = 0.05
"""Orbits closer to the observer than this, au, are taken after others that fit as well: among them is nearly always one
beside the Earth, through no more than its own motion."""

SAME = 0.01
"""Orbits whose distances from the observers differ by less than this part are the same."""


class Root(NamedTuple):
    """A beginning of a fit: a root of Gauss's equation, or, on a short arc, an orbit at a distance that was tried.

    rows : the numbers of the three observations; sun_distance, distance : of the body from the Sun and from the
        observer at the second one, au, those of the orbit that is fitted, if there is one
    day : when the light of that one left the body, since the epoch; state : heliocentric then, au and au/d, (6,)
    rms : normalized, of all observations about the orbit that is fitted from there, or of those about the three if that
        leads no farther; NaN if to none. a, e : of that orbit, au, below 0 for a hyperbola; NaN if there is none
    """

    rows: tuple[int, int, int]
    sun_distance: float
    distance: float
    day: float
    state: Array
    rms: float = np.nan
    a: float = np.nan
    e: float = np.nan


class Candidate(NamedTuple):
    """An orbit that fits all observations: where it began, its solution and the problem of that; its chi-squared."""

    root: Root
    problem: Problem
    found: Solution
    chi2: float


class First(NamedTuple):
    """What the search for a first orbit finds.

    problem, found : of the orbit that is taken; roots : all that were tried, from that of this orbit on
    undecided : those roots whose orbits fit as well, with that of this orbit, or none if there is but one
    """

    problem: Problem
    found: Solution
    roots: tuple[Root, ...]
    undecided: tuple[Root, ...]


def first_solution(sight: Sight, prepared: Callable[[Root], tuple[Problem, Sight, Array]]) -> First:
    """Return the solution for all observations: of those from all roots of three of them, or on a short arc from all
    beginnings, the one with the least chi-squared; of equal ones that with the smallest eccentricity,
    those near the observer last.

    prepared : returns the problem whose epoch is near a root, what it sees, and the start there
    Raises ConvergenceError if no root leads to one.
    """
    tried: list[Root] = []
    for group in _beginnings(sight):
        distinct: list[Candidate] = []
        for root in group:
            after, candidate = _followed(root, *prepared(root))
            if candidate is None:
                tried.append(after)
                continue
            same = [one for one in distinct if _are_same(one.found, candidate.found)]
            if not same:
                distinct.append(candidate)
            elif candidate.chi2 < min(one.chi2 for one in same) - EQUAL:
                distinct = [one for one in distinct if one not in same] + [candidate]
        if distinct:
            least = min(one.chi2 for one in distinct)
            distinct.sort(key=lambda one: (max(one.chi2 - least, EQUAL), one.root.distance < NEAR, one.root.e))
            near = tuple(one.root for one in distinct if one.chi2 < least + UNDECIDED)
            roots = (*(one.root for one in distinct), *tried)
            return First(distinct[0].problem, distinct[0].found, roots, near if len(near) > 1 else ())
    nights = 1 + int((np.diff(np.sort(sight.days)) > 0.4).sum())
    few = "" if nights > 2 else f" They are of {counted(nights, 'night')}: three are needed at least, some days apart."
    raise ConvergenceError(
        f"no orbit is found by Gauss's method: {len(tried)} roots were tried, from "
        f"{len({root.rows for root in tried})} choices of three observations.{few} Give a start: "
        "orbits.fit(observations, system=...), with the body in the system, or leave out observations that are not of "
        "it."
    )


def orbits_in_doubt(body: str, roots: tuple[Root, ...]) -> Finding:
    """Return what is told of orbits that fit equally well; the first one is taken."""
    rows = [
        f"a = {one.a:.4g} au, e = {one.e:.3g}, {one.distance:.3g} au away: normalized RMS {one.rms:.3g}"
        for one in roots
    ]
    return Finding(
        f"the observations of {body} do not decide between {len(roots)} orbits, whose chi-squared differs by less than "
        f"{UNDECIDED:g}. The first is taken, which has the least, or of equal ones the smallest eccentricity, "
        f"those within {NEAR:g} au of the observer last:",
        kind="orbits in doubt",
        rows=rows,
        remedy="fit.roots begins with them. More observations, of other nights, decide; or give a start: "
        "orbits.fit(observations, system), with the body in the system.",
    )


def _beginnings(sight: Sight) -> Iterator[list[Root]]:
    """Yield what is to be tried together, the most promising first."""
    choices = list(triples(sight.days))
    if choices and np.ptp(sight.days) <= SHORT:
        of_gauss: list[Root] = []
        for root in (root for three in choices[:CHOICES] for root in roots(sight, three)):
            if all(abs(root.distance - one.distance) > SAME * one.distance for one in of_gauss):
                of_gauss.append(root)
        yield [*of_gauss, *roots(sight, choices[0], DISTANCES)]
        choices = choices[CHOICES:]
    # The last ones are for nights whose middle is an outlier.
    for three in (*choices, *triples(sight.days, 0.0, CHOICES), *triples(sight.days, 1.0, CHOICES)):
        yield list(roots(sight, three))


def roots(sight: Sight, three: tuple[int, int, int], distances: Array | None = None) -> Iterator[Root]:
    """Yield the orbits through three observations, of Gauss's equation, or about them at given distances."""
    rows = list(three)
    times, from_sun, measured = sight.days[rows], sight.here[rows] - sight.sun[rows], sight.measured[rows]
    found = (
        orbits_of(times, from_sun, measured) if distances is None else orbits_at(distances, times, from_sun, measured)
    )
    for state in found:
        away = float(np.linalg.norm(state[:3] - from_sun[1]))
        yield Root(three, float(np.linalg.norm(state[:3])), away, float(times[1]) - away / C, state)


def _part(problem: Problem, sight: Sight, rows: NDArray[np.intp]) -> Problem:
    """Return the problem of some of the observations."""
    return replace(problem, sight=sight.some(rows), sigma=problem.sigma[rows], correlation=problem.correlation[rows])


def _followed(root: Root, problem: Problem, sight: Sight, start: Array) -> tuple[Root, Candidate | None]:
    """Return a root with what became of it, and the orbit that fits all observations, or None if it leads to none."""
    days = np.abs(sight.days)
    span = 1.2 * max(float(days[list(root.rows)].max()), 0.05)
    rows = np.flatnonzero(days <= span)
    try:
        part = _part(problem, sight, rows)
        known = at_start(part, start, np.ones(len(rows), dtype=bool))
        found = with_outliers_rejected(part, start, without_gross(part, known), known)
        root = root._replace(rms=normalized_rms(part, found))
        if root.rms >= GOOD:
            return root, None
        found = _without_needless_rejections(problem, _grown(problem, sight, found, rows, span))
    except (ConvergenceError, IntegrationError):
        return root, None
    root = _fitted(root, problem, sight, found)
    if root.rms >= GOOD or found.used.mean() <= 0.5:
        return root, None
    return root, Candidate(root, problem, found, _chi2(problem, found))


def _without_needless_rejections(problem: Problem, found: Solution) -> Solution:
    """Return the solution with all of few observations, if their chi-squared is then less.

    An orbit that is bent towards one that is astray goes anywhere, and is not tried.
    """
    if found.used.all() or len(found.used) >= MANY or found.chi2.max() > ASTRAY:
        return found
    try:
        whole = corrected(problem, found.start, np.ones(len(found.used), dtype=bool))
    except (ConvergenceError, IntegrationError):
        return found
    return min(found, whole, key=lambda one: _chi2(problem, one))


def _chi2(problem: Problem, found: Solution) -> float:
    """Return chi-squared, in which an observation that is rejected counts as much as one that just is not."""
    white = problem.white(found.residuals)[found.used]
    return float((white**2).sum() + REJECTED * (~found.used).sum())


def _fitted(root: Root, problem: Problem, sight: Sight, found: Solution) -> Root:
    """Return a root with what is known of the orbit that fits."""
    a, e = shape(problem, found.start)
    middle = root.rows[1]
    distance = float(found.delay[middle]) * C
    from_sun = sight.here[middle] - sight.sun[middle] + distance * sight.measured[middle]
    return root._replace(
        sun_distance=float(np.linalg.norm(from_sun)),
        distance=distance,
        rms=normalized_rms(problem, found),
        a=a,
        e=e,
    )


def _are_same(one: Solution, other: Solution) -> bool:
    """Return whether two orbits are as far away: those through the same directions then differ in nothing."""
    return bool(np.abs(one.delay - other.delay).max() < SAME * np.abs(one.delay).max())


def normalized_rms(problem: Problem, found: Solution) -> float:
    """Return the RMS of residuals in units of their sigmas, of what is used."""
    white = problem.white(found.residuals)[found.used]
    return float(np.sqrt((white**2).sum() / np.isfinite(problem.sigma[found.used]).sum()))


def _grown(problem: Problem, sight: Sight, found: Solution, rows: NDArray[np.intp], span: float) -> Solution:
    """Return the solution for all observations, from that for those within `span` days of t = 0, by ever longer arcs.

    Raises ConvergenceError, or an IntegrationError, if an arc on the way has none.
    """
    days = np.abs(sight.days)
    used = np.zeros(len(days), dtype=bool)
    used[rows] = found.used
    while len(rows) < len(days):
        span = max(span * LONGER, float(days[days > span].min()) + 1.0)
        before, rows = rows, np.flatnonzero(days <= span)
        part = _part(problem, sight, rows)
        known = at_start(part, found.start, used[rows])
        new = ~np.isin(rows, before)
        found = with_outliers_rejected(part, found.start, used[rows] | (new & ~(known.chi2 > ASTRAY)), known)
        used[rows] = found.used
    return found
