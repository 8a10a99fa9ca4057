"""Least squares: the parameters for which the weighted squares of residuals are least.

Steps are those of Gauss and Newton, shortened after Levenberg and Marquardt while they do not help. Residuals and the
derivatives of what is computed are in units of their sigmas.
Sources: Marquardt (1963), J. SIAM 11, 431; Milani & Gronchi (2010), Theory of Orbit Determination, ch. 5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError

Array = NDArray[np.float64]

MOST_STEPS = 100

NOTHING = 0.01
"""By how much the sum of squares, in units of sigmas, may grow in a step."""

STILL_GOOD = 1e-3
"""Derivatives are used again as long as residuals change as they predict, to this part."""

FACTOR = 30.0
"""By how much damping grows with a step that does not help, and shrinks after one that does."""

LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e10
"""Damping below the first is none; with the second, no step is short enough to help."""


class Fitted(NamedTuple):
    """Where a fit is: the parameters, (n,); measured less computed, (m, ...); what else is known there; and the
    derivatives of what is computed, (m, ..., n), there or as good.
    """

    x: Array
    residuals: Array
    known: Any
    derivatives: Array


@dataclass(frozen=True)
class Linear:
    """The parts of derivatives, (m, n), in units of sigmas and of the lengths of their columns, `scale`, (n,)."""

    left: Array
    sizes: Array
    right: Array
    scale: Array

    @classmethod
    def of(cls, derivatives: Array) -> Linear:
        """Return the parts; a column that is not finite counts as nothing, so that its parameter is not determined."""
        rows = derivatives.reshape(-1, derivatives.shape[-1])
        scale = np.linalg.norm(rows, axis=0)
        known = np.isfinite(scale) & (scale > 0.0)
        return cls(*np.linalg.svd(np.where(known, rows, 0.0) / np.where(known, scale, 1.0), full_matrices=False), scale)

    def undetermined(self, singular: float) -> int | None:
        """Return the parameter that is determined least, None if none is by less than this part of the best."""
        enough = len(self.sizes) == len(self.scale) and self.sizes[-1] > singular * self.sizes[0]
        return None if enough else int(np.abs(self.right[-1]).argmax())

    def step(self, residuals: Array, damping: float) -> tuple[Array, Array]:
        """Return the correction of the parameters, (n,), and what it takes off the residuals."""
        parts = self.sizes / (self.sizes**2 + damping) * (self.left.T @ residuals)
        return (self.right.T @ parts) / self.scale, self.left @ (self.sizes * parts)

    def covariance(self) -> Array:
        """Return the covariance of the parameters, (n, n)."""
        half = self.right.T / self.sizes / self.scale[:, None]
        return np.asarray(half @ half.T)


def least_squares(
    residuals: Callable[[Array, Any], tuple[Array, Any]],
    derivatives: Callable[[Array, Any], Array],
    now: Fitted,
    failure: Callable[[Fitted, int | None], str],
    *,
    enough: float,
    singular: float,
    damping: float = 0.0,
    used: Any = slice(None),
) -> Fitted:
    """Return the parameters with the least squares near some.

    residuals : of parameters and what is known near by; returns them, infinite where there is no such motion, and what
        is known there. derivatives : of parameters and what is known there
    failure : what is told of where the search ends, and of the parameter that is not determined, if it is that
    enough : a correction of so many of its own sigmas, in each parameter, is the last one
    singular : directions whose derivatives are smaller than this, relative to the largest, are not determined
    damping : at first; used : which rows count
    Raises ConvergenceError if they are not found, or if the measurements do not determine them.
    """
    exact, linear = True, Linear.of(now.derivatives[used])  # whether the derivatives are those of this very place
    for _ in range(MOST_STEPS):
        weak = linear.undetermined(singular)
        if weak is not None:
            raise ConvergenceError(failure(now, weak))
        r = now.residuals[used].ravel()
        last = float(np.linalg.norm(linear.left.T @ r)) < enough * np.sqrt(len(now.x))
        step, change = linear.step(r, 0.0 if last else damping)
        found, known = residuals(now.x + step, now.known)
        off = found[used].ravel()
        if np.isfinite(off).all() and (last or float(off @ off) <= float(r @ r) + NOTHING):
            now, exact = Fitted(now.x + step, found, known, now.derivatives), False
            if last:
                return now
            damping = damping / FACTOR if damping > LEAST_DAMPING else 0.0
            if np.linalg.norm(off - (r - change)) <= STILL_GOOD * np.linalg.norm(change):
                continue
        elif last:
            return now
        elif exact:
            damping = max(FACTOR * damping, 10.0 * LEAST_DAMPING)
            if damping > MOST_DAMPING:
                break
            continue
        now, exact = now._replace(derivatives=derivatives(now.x, now.known)), True
        linear = Linear.of(now.derivatives[used])
    raise ConvergenceError(failure(now, None))
