"""The growth of round-off with time, over an ensemble of initial conditions: Brouwer's law, or a drift.

With unbiased rounding the energy performs a random walk: its error grows as t^1/2 and the phase error as t^3/2. A bias,
for example from coefficients that are not exactly symplectic, makes them grow as t and t^2.

Source: Brouwer (1937), AJ 46, 149; Hairer, McLachlan & Razakarivony (2008), BIT 48, 231.
"""

from __future__ import annotations

from dataclasses import dataclass

import mpmath
import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import real_numbers
from orbits.diagnostics.doubledouble import Floats, Pair
from orbits.errors import InputError
from orbits.many_digits import many_digits

LEAST_STARTS, LEAST_TIMES = 8, 4

DIGITS = 40


def energy_errors(gm: ArrayLike, q: Pair, v: Pair) -> Floats:
    """Return the relative errors of the energy of massive bodies against the first state, (n,) of n + 1 states, in
    forty digits: the rounding of a state to float64 hides what a good method does in a thousand steps.

    gm : (bodies,); q, v : (n + 1, bodies, 3) each, as `orbits.diagnostics.stepping.march_finely` returns
        them
    """
    masses = [mpmath.mpf(float(m)) for m in real_numbers(gm, "gm")]
    with many_digits(DIGITS):
        found = [_energy(masses, numbers(q, k), numbers(v, k)) for k in range(len(q.hi))]
        return np.array([float(each / found[0] - 1) for each in found[1:]])


def numbers(x: Pair, k: int) -> list[list[mpmath.mpf]]:
    """Return sample k of pairs, (bodies, 3), as mpmath numbers, in the precision that is set."""
    rows = zip(x.hi[k], x.lo[k], strict=True)
    return [[mpmath.mpf(float(a)) + mpmath.mpf(float(b)) for a, b in zip(*row, strict=True)] for row in rows]


def _energy(gm: list[mpmath.mpf], q: list[list[mpmath.mpf]], v: list[list[mpmath.mpf]]) -> mpmath.mpf:
    energy = mpmath.fsum(m * mpmath.fdot(w, w) / 2 for m, w in zip(gm, v, strict=True))
    for j in range(len(gm)):
        for i in range(j):
            apart = mpmath.sqrt(mpmath.fsum((a - b) ** 2 for a, b in zip(q[i], q[j], strict=True)))
            energy -= gm[i] * gm[j] / apart
    return energy


@dataclass(frozen=True, eq=False)
class Growth:
    """How errors grow with time, over an ensemble.

    exponent, uncertainty : slope of log(rms) against log(t), and its standard error over the ensemble
    bias : mean error at the last time, in standard errors of this mean; of order one for a random walk
    t : (k,) times, increasing; rms : (k,) root mean square over the starts
    """

    exponent: float
    uncertainty: float
    bias: float
    t: Floats
    rms: Floats

    def consistent_with(self, exponent: float, sigmas: float = 3.0) -> bool:
        """Whether the measured exponent agrees with this one within `sigmas` standard errors."""
        return bool(abs(self.exponent - exponent) <= sigmas * self.uncertainty)


def growth(t: ArrayLike, errors: ArrayLike) -> Growth:
    """Fit the growth of errors with time: the log-log slope of their RMS over the ensemble.

    t : (k,) times > 0, all of equal weight, so best in a geometric sequence
    errors : (starts, k), signed
    The errors of one start at different times are correlated, so the uncertainty comes from leaving out one start at a
    time (the jackknife), not from the fit.
    Raises InputError for fewer than 8 starts or 4 times, shapes that do not fit, values that are not finite, times that
    are all the same, and one at which no start has an error.
    """
    x, e = real_numbers(t, "t"), real_numbers(errors, "errors")
    if x.ndim != 1 or e.ndim != 2 or e.shape[1] != len(x):
        raise InputError(f"errors must be (starts, times) for times (k,); got {e.shape} and {x.shape}.")
    if len(e) < LEAST_STARTS or len(x) < LEAST_TIMES:
        raise InputError(f"got {len(e)} starts and {len(x)} times; expected at least {LEAST_STARTS} and {LEAST_TIMES}.")
    if not (np.isfinite(x).all() and (x > 0.0).all() and np.isfinite(e).all()):
        raise InputError("times must be positive and errors finite; leave out t = 0.")
    by_t = np.argsort(x)
    x, e = x[by_t], e[:, by_t]
    if x[0] == x[-1]:
        raise InputError(f"all times are {x[0]:g}; expected different ones, best in a geometric sequence.")
    squares = np.sum(e * e, axis=0)
    if not (squares > 0.0).all():
        raise InputError(f"no start has any error at t = {x[squares == 0.0][0]:g}; begin later.")
    n = len(e)
    log_t = np.log(x) - np.log(x).mean()

    def slope(sums: Floats) -> Floats:
        found: Floats = 0.5 * np.log(sums) @ log_t / (log_t @ log_t)
        return found

    without = slope(np.maximum(squares - e * e, np.finfo(float).tiny))
    uncertainty = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    spread = float(np.std(e[:, -1], ddof=1) / np.sqrt(n))
    mean = float(np.mean(e[:, -1]))
    bias = mean / spread if spread else float(np.copysign(np.inf, mean))
    return Growth(float(slope(squares)), uncertainty, bias, x, np.sqrt(squares / n))
