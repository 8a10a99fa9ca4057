"""The range of orbits that fit observations which leave one direction of the start almost free: the line of variations.

It is followed both ways: a step along the direction that is determined least, and corrections in the five others, until
chi-squared is too large. Two directions are almost free in a night, of which the other one is held by a weak belief: a
body that is bound to the Sun is more likely than one much faster.
Source: Milani & Gronchi (2010), Theory of Orbit Determination, ch. 10.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.finding import Finding
from orbits.fitting.correction import Problem, Solution
from orbits.fitting.least_squares import Linear
from orbits.observing.light import C
from orbits.units import GM_SUN

Array = NDArray[np.float64]

WIDE = 0.1
"""Of the eccentricity, or of q relative to itself: a sigma above this is not told by a covariance. That of a relative
to itself is always large near a parabola, where q and e may be well known."""

DEEP = 9.0
"""By how much chi-squared may be above the least."""

SIGMAS, PART, MOST = 0.5, 0.2, 25
"""A step along the line is of so many sigmas, but of no more than this part of the distance; the most of them a way."""

ROUNDS = 20
"""Of corrections from the best orbit to the one that is believed, too."""


class Variation(NamedTuple):
    """An orbit that fits.

    start : (6,), au and au/d, relative to the barycentre; chi2 : above the least; a : au, below 0 for a hyperbola
    distance : from the observer, au, at the middle observation
    """

    start: Array
    chi2: float
    distance: float
    a: float
    e: float


def from_sun(problem: Problem, start: Array) -> tuple[Array, Array]:
    """Return q and v of a start relative to the Sun."""
    sun, values = problem.arc.system.names.index("Sun"), problem.arc.system.values
    return start[:3] - values.q[sun], start[3:6] - values.v[sun]


def shape(problem: Problem, start: Array) -> tuple[float, float]:
    """Return a and e of a start, relative to the Sun."""
    q, v = from_sun(problem, start)
    r = float(np.linalg.norm(q))
    e = np.cross(v, np.cross(q, v)) / GM_SUN - q / r
    return 1.0 / (2.0 / r - float(v @ v) / GM_SUN), float(np.linalg.norm(e))


class _Line:
    """The line of variations at a start, with the belief as one more observation: its speed is 0, give or take that of
    escape.
    """

    def __init__(self, problem: Problem, used: NDArray[np.bool_], start: Array, delay: Array) -> None:
        residuals, self.delay = problem.seen(start, delay)
        white, derivatives = problem.white(residuals)[used].ravel(), problem.derivatives(start, self.delay)
        q, v = from_sun(problem, start)
        r, speed = np.linalg.norm(q), np.linalg.norm(v)
        fast = speed * np.sqrt(0.5 * r / GM_SUN)
        belief = fast * np.concatenate([0.5 * q / r**2, v / speed**2])
        rows = np.concatenate([derivatives[used].reshape(-1, 6), belief[None]])
        linear = Linear.of(rows)
        sizes, right, scale = linear.sizes, linear.right, linear.scale
        parts = linear.left.T @ np.append(white, -fast) / sizes
        self.cost = float(white @ white + fast**2)
        self.chi2, self.sigma, self.along = float(white @ white), 1.0 / float(sizes[-1]), right[-1] / scale
        self.whole, self.across = (right.T @ parts) / scale, (right[:-1].T @ parts[:-1]) / scale


def valley(problem: Problem, best: Solution) -> tuple[Variation, ...]:
    """Return orbits along the line of variations, from one end to the other: those that are bound, if there are any."""
    middle = int(np.argsort(problem.sight.days)[len(problem.sight.days) // 2])
    least = float((problem.white(best.residuals)[best.used] ** 2).sum())
    start, line = best.start, _Line(problem, best.used, best.start, best.delay)
    part = 1.0
    for _ in range(ROUNDS):
        tried = start + part * line.whole
        other = _Line(problem, best.used, tried, line.delay)
        better = other.cost < line.cost
        start, line, part = (tried, other, min(1.0, 3.0 * part)) if better else (start, line, 0.2 * part)
    first: tuple[Array, _Line] = (start, line)
    out: list[Variation] = []
    for sign in (-1.0, 1.0):
        (start, line), before = first, sign * first[1].along
        for _ in range(MOST):
            distance = float(line.delay[middle]) * C
            found = Variation(start, line.chi2 - least, distance, *shape(problem, start))
            if not (found.chi2 <= DEEP and distance > 0.0):
                break
            out.append(found)
            before = line.along if line.along @ before > 0.0 else -line.along
            size = min(SIGMAS * line.sigma, PART * distance / float(np.linalg.norm(before[:3])))
            try:
                start = start + size * before
                for _ in range(2):
                    line = _Line(problem, best.used, start, line.delay)
                    start = start + line.across
                line = _Line(problem, best.used, start, line.delay)
            except (IntegrationError, np.linalg.LinAlgError):
                break
        out = out[::-1][: -1 if sign < 0.0 else None]  # both ways begin with the same
    alone = Variation(best.start, 0.0, float(best.delay[middle]) * C, *shape(problem, best.start))
    return tuple(one for one in out if one.e < 1.0) or tuple(out) or (alone,)


def wide_range(body: str, orbits: tuple[Variation, ...]) -> Finding:
    """Return what is told of a range of orbits."""
    rows = [
        f"a = {one.a:.4g} au, e = {one.e:.3g}, {one.distance:.3g} au away: chi-squared {one.chi2:.2g} above the least"
        for one in (orbits[0], min(orbits, key=lambda one: one.chi2), orbits[-1])
    ]
    return Finding(
        f"the observations of {body} leave a range of orbits, which the covariance does not tell: from the first to "
        f"the last of these, with chi-squared within {DEEP:g} of the least, and bound to the Sun if there are such:",
        kind="a range of orbits",
        rows=rows,
        remedy="fit.range has orbits from one end to the other. Observations of other nights decide.",
    )


def wide_covariance(body: str, orbit: Array, sigma: Array) -> Finding:
    """Return what is told of a wide covariance of e and q, (2,), with parameters, for which no line is followed."""
    return Finding(
        f"the observations of {body} and these parameters leave a range of orbits, e = {orbit[0]:.3g} ± "
        f"{sigma[0]:.2g}, q = {orbit[1]:.4g} ± {sigma[1]:.2g} au, which the covariance does not tell, as it is linear.",
        kind="a range of orbits",
        remedy="Fit fewer parameters: without any, fit.range has orbits from one end to the other.",
    )
