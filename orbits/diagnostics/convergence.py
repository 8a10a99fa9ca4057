"""Measured orders of convergence, without the round-off plateau and the steps too long for the asymptotic regime."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import nonzero_number, real_numbers, whole_number
from orbits.diagnostics.stepping import MOST_STEPS, Bodies, march
from orbits.errors import InputError, IntegrationError

if TYPE_CHECKING:
    from orbits.integrators.base import Integrator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slope:
    """The slope of log(error) against log(h), and the points it was fitted to.

    order : NaN if fewer than three points lie between the round-off plateau and the steps that are too long
    """

    order: float
    h: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def bend(self) -> float:
        """The largest difference between slopes from one error to the next: small where they converge by one order."""
        local = np.diff(np.log(self.errors)) / np.diff(np.log(self.h))
        return float(np.ptp(local)) if len(local) else 0.0


def slope(h: Sequence[float], errors: Sequence[float], *, floor: float, ceiling: float, most: int = 5) -> Slope:
    """Fit the errors between `floor` and `ceiling`; if there are more than `most`, those of the shortest steps."""
    x, y = real_numbers(h, "h"), real_numbers(errors, "errors")
    order = np.argsort(x)
    x, y = x[order], y[order]
    keep = np.flatnonzero(np.isfinite(y) & (y > floor) & (y < ceiling))[:most]
    if len(keep) < 3:
        return Slope(float("nan"), tuple(map(float, x[keep])), tuple(map(float, y[keep])))
    fitted = float(np.polyfit(np.log(x[keep]), np.log(y[keep]), 1)[0])
    return Slope(fitted, tuple(map(float, x[keep])), tuple(map(float, y[keep])))


LEAST_FALL = 30.0
"""The factor by which errors must fall within a window before its slope counts as one of convergence."""

LEAST_POINTS = 4
"""The fewest points of a window: three lie near a line too easily."""


@dataclass(frozen=True, eq=False)
class Convergence:
    """A measured order, and the steps it was measured with.

    order, uncertainty : slope of log(error) against log(h), and its uncertainty; NaN if no part of the curve is
        straight
    h, errors : (n,), all that was given, by increasing h
    used : (n,) bool, the steps that were fitted
    plateau : the level of round-off: the median error of the shorter steps whose errors exceed twice the fit; NaN if
        there are none
    """

    order: float
    uncertainty: float
    h: Array
    errors: Array
    used: NDArray[np.bool_]
    plateau: float

    def __repr__(self) -> str:
        if math.isnan(self.order):
            return f"Convergence(no order: no part of the curve of {len(self.h)} steps is straight)"
        steps = self.h[self.used]
        fitted = f"from {len(steps)} of {len(self.h)} steps, {steps.min():.3g} to {steps.max():.3g}"
        floor = "" if math.isnan(self.plateau) else f"; round-off {self.plateau:.2g}"
        return f"Convergence(order {self.order:.4g} ± {self.uncertainty:.1g}, {fitted}{floor})"


def convergence(h: ArrayLike, errors: ArrayLike) -> Convergence:
    """Measure an order from the errors of several steps, leaving out round-off and steps that are too long.

    h, errors : (n,); points whose error is zero or not finite are ignored. Neighbouring steps should differ by a factor
        of at most the square root of two.
    Among all windows of at least four neighbouring steps over which errors fall by a factor of 30, the straightest one
    is fitted: the one with the least uncertainty of the slope over the square root of its number of points.
    Raises InputError for arrays that do not fit.
    """
    x, y = real_numbers(h, "h"), real_numbers(errors, "errors")
    if x.ndim != 1 or x.shape != y.shape or not np.isfinite(x).all() or not (x > 0.0).all():
        raise InputError(f"h and errors must be of one shape (n,), h > 0; got {x.shape} and {y.shape}, h = {x}")
    by_h = np.argsort(x)
    x, y = x[by_h], y[by_h]
    best, order, spread = np.inf, float("nan"), float("nan")
    used = np.zeros(len(x), dtype=bool)
    seen = np.flatnonzero(np.isfinite(y) & (y > 0.0))
    for i in range(len(seen)):
        for j in range(i + LEAST_POINTS, len(seen) + 1):
            window = seen[i:j]
            if y[window[-1]] < LEAST_FALL * y[window[0]]:
                continue
            slope, doubt = _line(np.log(x[window]), np.log(y[window]))
            if doubt / np.sqrt(len(window)) < best:
                best, order, spread = doubt / np.sqrt(len(window)), slope, doubt
                used[:] = False
                used[window] = True
    if not spread <= 0.1 * abs(order):
        return Convergence(float("nan"), float("nan"), x, y, np.zeros(len(x), dtype=bool), float("nan"))
    first = int(np.argmax(used))
    shorter = seen[seen < first]
    above = shorter[y[shorter] > 2.0 * y[first] * (x[shorter] / x[first]) ** order]
    return Convergence(order, spread, x, y, used, float(np.median(y[above])) if len(above) else float("nan"))


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Return the slope of y against x and its uncertainty: standard error, and half the difference of its halves."""
    slope, offset = np.polyfit(x, y, 1)
    rest = y - slope * x - offset
    width = np.sqrt(np.sum((x - x.mean()) ** 2))
    error = np.sqrt(np.sum(rest**2) / (len(x) - 2)) / width
    middle = (len(x) + 1) // 2
    halves = np.polyfit(x[:middle], y[:middle], 1)[0], np.polyfit(x[-middle:], y[-middle:], 1)[0]
    return float(slope), float(np.hypot(error, 0.5 * abs(halves[0] - halves[1])))


def order(
    gm: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    integrator: Integrator,
    dt: float,
    steps: int = 10,
    *,
    softening: float = 0.0,
    halvings: int = 8,
) -> Convergence:
    """Measure a method's order on these bodies, from position errors after the same time with ever shorter steps.

    gm (n,), q and v (n, 3) : float64 in one system of units
    dt : the longest step; the shortest is dt 2^-halvings, and neighbouring steps differ by about 2^(1/4)
    steps : how many steps of dt make up the time
    The reference is Gauss with 8 stages and steps of dt/4. An error is the largest distance of any body from its
    reference position, over the size of the system. Steps that the method cannot take are left out.
    Raises InputError for bodies or steps that cannot be marched, IntegrationError if the reference fails.
    """
    from orbits.integrators.gauss import Gauss

    bodies = Bodies.of(gm, q, v, softening)
    dt = nonzero_number(dt, "dt")
    first = whole_number(steps, "steps", most=MOST_STEPS)
    span, octaves = first * dt, whole_number(halvings, "halvings", most=MOST_STEPS)
    whole_number(first * 2 ** min(octaves, 64), "steps * 2^halvings", most=MOST_STEPS)
    fine = 4 * first
    truth = march(bodies, Gauss(stages=8), span / fine, [fine])[0][-1]
    size = float(np.max(np.linalg.norm(truth, axis=1))) or 1.0  # a body at rest at the origin
    lengths, errors = [], []
    for n in sorted({round(first * 2 ** (k / 4)) for k in range(4 * octaves + 1)}):
        try:
            moved = march(bodies, integrator, span / n, [n])[0][-1]
        except IntegrationError:
            continue
        lengths.append(abs(span) / n)
        errors.append(float(np.max(np.linalg.norm(moved - truth, axis=1))) / size)
    return convergence(lengths, errors)
