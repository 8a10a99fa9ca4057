"""The growth of tangent vectors, eight in lanes: the logarithm of their lengths, and MEGNO.

With Y = (2 / t) sum t' d(ln |x|), t' the middle of each step, MEGNO is the mean of Y over time.

Source: Cincotta, Giordano & Simó (2003), Physica D 182, 151.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import any_lane, fma, full, load, select, store
from orbits.kernels.lanes.functions import log

LEVER, AREA, LOGARITHM, SQUARE, BEFORE = 0, 1, 2, 3, 4
"""The rows of the growth of eight vectors: sum of t d(ln |x|), integral of Y dt, ln |x| since the start; |x|^2 and Y at
the last step."""

LARGE, SMALLER = 2.0**600, 2.0**-300
"""The |x|^2 above which a vector whose growth is measured is scaled, and the factor."""

ODD = tuple(1.0 / (2 * k + 1) for k in range(12, 0, -1))
"""Coefficients of the series of artanh z / z - 1 in z^2, the highest first: complete to 1e-17 for |z| <= 1/4."""


@kernel(inline=True)
def add_growth(t, h, now, growth):
    """Add a step of h > 0 from t >= 0 to the growth of eight vectors; now : |x|^2 at its end.

    Returns the factors by which large vectors are to be scaled, 1 for all others.
    """
    grown = 0.5 * log_ratio(now, load(growth, SQUARE))
    lever = fma(full(t + 0.5 * h), grown, load(growth, LEVER))
    Y = (2.0 / (t + h)) * lever
    store(growth, LEVER, lever)
    store(growth, LOGARITHM, load(growth, LOGARITHM) + grown)
    store(growth, AREA, fma(full(0.5 * h), load(growth, BEFORE) + Y, load(growth, AREA)))
    store(growth, BEFORE, Y)
    factor = select(now > LARGE, full(SMALLER), full(1.0))
    store(growth, SQUARE, now * (factor * factor))
    return factor


@kernel(inline=True)
def log_ratio(a, b):
    """Return ln(a / b) of positive numbers."""
    z = (a - b) / (a + b)
    z2 = z * z
    series = 0.0 * z
    for k in range(len(ODD)):
        series = fma(series, z2, ODD[k])
    value = 2.0 * fma(z * z2, series, z)
    near = z2 <= 0.0625
    if any_lane(1.0 - near):
        value = select(near, value, _far_log(a, b))
    return value


@kernel
def _far_log(a, b):
    """Return ln(a / b), not copied into the caller."""
    return log(a / b)
