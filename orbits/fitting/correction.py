"""Differential correction: the start of a body for which the weighted squares of the residuals are least.

Observations are rejected, and taken back, by the size of their residuals relative to what is expected of these after
the fit.
Sources: Milani & Gronchi (2010), Theory of Orbit Determination, ch. 5; Carpino, Milani & Chesley (2003), Icarus 166,
248.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, InputError, IntegrationError, counted
from orbits.fitting.instruments import Instrument
from orbits.fitting.least_squares import Fitted, Linear, least_squares
from orbits.propagation.variations.arc import Arc

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CONVERGED = 1e-3
"""A correction of this many of its own sigmas is the last one."""

ROUGH = 0.1
"""The same while outliers are sought, whose large residuals are far from linear."""

MOST_ROUNDS = 15
SINGULAR = 1e-11
"""Directions whose derivatives are smaller than this, relative to the largest, are not determined."""

REJECTED, RECOVERED, WORST = 8.0, 7.0, 0.25
"""Chi-squared of an observation that is rejected, and below which it is taken back; in each round only those above this
part of the largest are rejected, so that a gross error does not drag good ones along."""

GROSS = 20.0
"""Residuals of a beginning above so many times their median, or sigmas, do not count at first, as they lead astray."""


@dataclass(frozen=True)
class Solution:
    """A start of a body, and what it leaves.

    start : (n,), au and au/d, then the values of parameters; delay : of the light, days, (m,)
    residuals : arcseconds, or microseconds or Hz and 0, (m, 2)
    derivatives : of what is computed by the start, in units of sigmas without their correlation, (m, 2, n)
    used : which observations count, (m,); chi2 : of each observation, relative to what is expected of it after the fit
    """

    start: Array
    residuals: Array
    delay: Array
    derivatives: Array
    used: Mask
    chi2: Array


@dataclass(frozen=True)
class Problem:
    """What is fitted: arc and what observes; sigma : (m, 2), as residuals; correlation : of both coordinates, (m,)."""

    arc: Arc
    sight: Instrument
    sigma: Array
    correlation: Array

    def seen(self, start: Array, delay: Array) -> tuple[Array, Array]:
        """Return the residuals, (m, 2), and the light times; delay : about them."""
        seen = self.sight.seen(*self.arc.states(start, self.sight.days - delay), delay)
        return self.sight.residuals(seen), seen.delay

    def derivatives(self, start: Array, delay: Array) -> Array:
        """Return the derivatives of what is computed by the start, white, (m, 2, n)."""
        times = self.sight.days - delay
        seen = self.sight.seen(*self.arc.states(start, times), delay)
        return self.white(self.sight.derivatives(seen, self.arc.derivatives(start, times)))

    def white(self, x: Array) -> Array:
        """Return residuals or derivatives, (m, 2, ...), in units of their sigmas, without their correlation."""
        more = (1,) * (x.ndim - 2)
        sigma, c = self.sigma.reshape(*self.sigma.shape, *more), self.correlation.reshape(-1, *more)
        first = x[:, 0] / sigma[:, 0]
        return np.stack([first, (x[:, 1] / sigma[:, 1] - c * first) / np.sqrt(1.0 - c * c)], axis=1)


def at_start(problem: Problem, start: Array, used: Mask) -> Solution:
    """Return a start as it is, with what it leaves if it is that of the observations that are used."""
    now, delay = np.array(start, dtype=np.float64), np.zeros(len(used))
    for _ in range(2):  # the first light time is a guess
        seen = problem.seen(now, delay)
        delay = seen[1]
    return _solution(Fitted(now, problem.white(seen[0]), seen, problem.derivatives(now, delay)), used)


def corrected(
    problem: Problem, start: Array, used: Mask, known: Solution | None = None, enough: float = CONVERGED
) -> Solution:
    """Return the best start near a given one, for the observations that are used.

    known : the solution for others of them, or what its start leaves; enough : sigmas of the last correction
    Raises ConvergenceError if it is not found, or if the observations do not determine it.
    """
    known = at_start(problem, start, used) if known is None else known

    def residuals(x: Array, near: tuple[Array, Array]) -> tuple[Array, tuple[Array, Array]]:
        try:
            there = problem.seen(x, near[1])
        except (IntegrationError, InputError):  # the step leads to a body, or a mass, that cannot be
            return np.full_like(problem.sigma, np.inf), near
        return problem.white(there[0]), there

    found = least_squares(
        residuals,
        lambda x, there: problem.derivatives(x, there[1]),
        Fitted(known.start, problem.white(known.residuals), (known.residuals, known.delay), known.derivatives),
        lambda last, weak: _failure(problem, last, weak, used),
        enough=enough,
        singular=SINGULAR,
        used=used,
    )
    return _solution(found, used)


def _failure(problem: Problem, last: Fitted, weak: int | None, used: Mask) -> str:
    """Return what is told of a correction that does not converge, or of a start that is not determined."""
    if weak is not None:
        more = f" and {counted(len(last.x) - 6, 'parameter')}" * (len(last.x) > 6)
        return f"the observations do not determine all six elements of an orbit{more}."
    chi2 = np.where(used, (last.residuals**2).sum(axis=1), 0.0)
    worst, epoch = int(np.argmax(chi2)), problem.arc.system.epoch
    assert epoch is not None  # a system in an ephemeris has one
    count, left = int(used.sum()), int((~used).sum())
    said = (
        f"the differential correction does not converge: chi-squared of {counted(count, 'observation')} is "
        f"{chi2.sum():.3g}, that of the worst, of {(epoch + problem.sight.days[worst] * u.day).iso[:19]} TDB, "
        f"{chi2[worst]:.3g}; {left:,} more are rejected. "
    )
    if left or chi2[worst] > REJECTED:
        return said + 'Does the model lack a force, such as parameters=["A2"], or is the start far off?'
    return said + "They are met already, so that they hardly determine all that is fitted: fit fewer parameters."


def _solution(found: Fitted, used: Mask) -> Solution:
    """Return a solution with chi-squared of each observation: of residuals whose covariance is that of the observation,
    less what the fit takes of it, or more for one that is not used.
    """
    white, r = found.derivatives, found.residuals
    of_fit = white @ Linear.of(white[used]).covariance() @ np.swapaxes(white, 1, 2)
    expected = np.eye(2) + np.where(used, -1.0, 1.0)[:, None, None] * of_fit
    # An observation that determines the orbit by itself leaves nothing: of rounding, here a thousandth.
    expected[:, [0, 1], [0, 1]] = np.maximum(expected[:, [0, 1], [0, 1]], 1e-3)
    chi2 = np.einsum("mi,mi->m", r, np.linalg.solve(expected, r[:, :, None])[:, :, 0])
    seen, delay = found.known
    return Solution(found.x, seen, delay, white, used, np.abs(chi2))


def without_gross(problem: Problem, known: Solution) -> Mask:
    """Return the observations whose residuals are not far larger than those of most."""
    away = np.linalg.norm(problem.white(known.residuals), axis=1)
    return np.asarray(away <= GROSS * max(1.0, float(np.median(away))))


def with_outliers_rejected(problem: Problem, start: Array, used: Mask, known: Solution | None = None) -> Solution:
    """Return the solution whose outliers are rejected; gross ones from the start, if there is none with them.

    known : as for `corrected`, which raises ConvergenceError
    """
    known = at_start(problem, start, used) if known is None else known
    try:
        found = corrected(problem, start, used, known, enough=ROUGH)
    except ConvergenceError:
        fewer = used & without_gross(problem, known)
        if np.array_equal(fewer, used):
            raise
        found = corrected(problem, start, fewer, known, enough=ROUGH)
    tried: set[bytes] = set()
    for _ in range(MOST_ROUNDS):
        limit = max(REJECTED, WORST * float(found.chi2[found.used].max(initial=0.0)))
        now = np.where(found.used, found.chi2 <= limit, found.chi2 < RECOVERED)
        if np.array_equal(now, found.used) or now.tobytes() in tried or now.sum() < 4:
            break
        tried.add(now.tobytes())
        found = corrected(problem, found.start, now, found, enough=ROUGH)
    return corrected(problem, found.start, found.used, found)
