"""Discrete Liouville: the area of a loop of initial conditions, the integral of p . dq around it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from orbits.checks import real_numbers, whole_number
from orbits.errors import InputError

Array = NDArray[np.float64]
Map = Callable[[Array, Array], tuple[Array, Array]]


def loop(q: Array, p: Array, dq: Array, dp: Array, points: int = 64) -> tuple[Array, Array]:
    """Return a loop around (q, p): (q + cos(x) dq, p + sin(x) dp) at `points` equally spaced x, each (points, d).

    Its area is -pi dq . dp, for it runs counterclockwise in (q, p). Raises InputError for fewer than 4 points.
    """
    q, p, dq, dp = (real_numbers(x, what) for x, what in ((q, "q"), (p, "p"), (dq, "dq"), (dp, "dp")))
    points = whole_number(points, "points", least=4)
    x = 2.0 * np.pi * np.arange(points) / points
    return q + np.cos(x)[:, None] * dq, p + np.sin(x)[:, None] * dp


def area(q: Array, p: Array) -> float:
    """Return the integral of p . dq around a closed loop given by its points, (n, d) each.

    The points must belong to equally spaced parameters of a smooth loop; the error is then that of a Fourier series of
    n terms. Raises InputError for fewer than 4 points.
    """
    q, p = real_numbers(q, "q"), real_numbers(p, "p")
    if q.shape != p.shape or q.ndim != 2 or len(q) < 4:
        raise InputError(f"a loop needs q and p of one shape (n, d), n >= 4; got {q.shape} and {p.shape}")
    x, y = q - q.mean(axis=0), p - p.mean(axis=0)
    n = len(q)
    frequency = np.fft.fftfreq(n, 1.0 / n)
    if n % 2 == 0:
        frequency[n // 2] = 0.0
    slope = np.fft.ifft(1j * frequency[:, None] * np.fft.fft(x, axis=0), axis=0).real
    return float(2.0 * np.pi / n * np.sum(y * slope))


def marched(step: Map, q: Array, p: Array) -> tuple[Array, Array]:
    """Return the loop after `step`, a map of (q, p), has been applied to every point."""
    moved = [step(x, y) for x, y in zip(q, p, strict=True)]
    return np.array([x for x, _ in moved]), np.array([y for _, y in moved])
