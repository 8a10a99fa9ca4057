"""How far a quantity that should stay strays from where it began."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.diagnostics.arrays import finite, numbers, scaled
from orbits.diagnostics.doubledouble import Floats
from orbits.diagnostics.momenta import centre_of_mass
from orbits.errors import InputError, shown

CANCELLED = 1e-6
"""An initial value this small against its terms is no scale to compare with."""


@dataclass(frozen=True)
class Drift:
    """How far a series strays from its first value.

    max_fraction : largest |x_k - x_0| over the scale
    max_ulps : the same in units in the last place of the scale
    last_fraction : |x_last - x_0| over the scale
    scale : what "one" means; in the unit of the series
    """

    max_fraction: float
    max_ulps: float
    last_fraction: float
    scale: float


def drift(series: ArrayLike, scale: float | None = None) -> Drift:
    """Measure the drift of a sampled scalar, shape (n,), or vector, shape (n, 3).

    scale : compared with; the size of the first value by default. Give one where the first value is near zero by
        cancellation, such as the total momentum in barycentric coordinates: sum gm |v|.
    A series that never changes has no drift, whatever its scale; one that changes about a scale of zero has an
    infinite one. Raises InputError for an empty series, another shape or values that are not finite.
    """
    values = numbers(series, "the series")
    if values.ndim not in (1, 2) or values.size == 0:
        raise InputError(f"the series has shape {values.shape}; expected (n,) or (n, 3) with at least one sample.")
    if not np.isfinite(values).all():
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise InputError(f"the series holds {values[row]} at sample {row}; expected finite values.")
    vectors = values.reshape(len(values), -1)
    size = None if scale is None else _scale(scale)
    # Exact, and with it no square overflows or vanishes.
    both, power = scaled(np.append(vectors, 0.0 if size is None else size))
    vectors = both[:-1].reshape(vectors.shape)
    size = float(np.linalg.norm(vectors[0])) if size is None else float(both[-1])
    strays = np.linalg.norm(vectors - vectors[0], axis=1)
    largest, last = float(strays.max()), float(strays[-1])
    return Drift(
        max_fraction=_ratio(largest, size),
        max_ulps=_ratio(largest, float(np.spacing(size)) if size else 0.0),
        last_fraction=_ratio(last, size),
        scale=math.ldexp(size, power),
    )


def own_scale(first: ArrayLike, terms: float, later: Callable[[], float]) -> float:
    """Return what changes of a conserved quantity are to be compared with.

    first : its first value, a scalar or a vector; terms : the sum of the sizes of what that is the sum of
    later : gives the largest such sum of all samples, and is asked only where all is at rest at first
    This is the size of the first value, or that of its terms where they cancel to less than a millionth of it, as in
    the angular momentum of the figure-eight.
    """
    vector, power = scaled(np.atleast_1d(np.asarray(first, dtype=np.float64)))
    size = math.ldexp(float(np.linalg.norm(vector)), power)
    return size if size > CANCELLED * terms else terms or later()


def kinetic_energies(gm: Floats, v: Floats) -> Floats:
    """The sum of gm v^2 / 2, what the energy is a part of, to a few digits: (..., n, 3) to (...)."""
    return np.asarray(0.5 * np.sum(gm * np.sum(v * v, axis=-1), axis=-1))


def moments(gm: Floats, q: Floats, v: Floats) -> Floats:
    """The sum of gm |q| |v|, what the angular momentum is a part of, to a few digits: (..., n, 3) to (...)."""
    return np.asarray(np.sum(gm * lengths(q) * lengths(v), axis=-1))


def momenta(gm: Floats, v: Floats) -> Floats:
    """The sum of gm |v|, what the linear momentum is a part of, to a few digits: (..., n, 3) to (...)."""
    return np.asarray(np.sum(gm * lengths(v), axis=-1))


def lengths(x: Floats) -> Floats:
    """Of vectors, (..., 3) to (...), without squares that overflow or vanish."""
    return np.asarray(np.hypot(np.hypot(x[..., 0], x[..., 1]), x[..., 2]))


def _scale(scale: object) -> float:
    value = numbers(scale, "the scale")  # type: ignore[arg-type]
    if value.shape or not np.isfinite(value):
        raise InputError(f"the scale is {shown(scale)}; expected a finite number.")
    return abs(float(value))


def centre_of_mass_drift(gm: ArrayLike, t: ArrayLike, q: ArrayLike, v: ArrayLike) -> Drift:
    """Measure how far the centre of mass strays from its uniform motion.

    gm : (bodies,); t : (n,) times; q : (n, bodies, 3); v : (bodies, 3) at the first of the times, or (n, bodies, 3)
    Compared with the largest distance of a massive body from it at first, or its own way where that is longer.
    Raises InputError for what is not finite or does not fit, or where no body has a mass.
    """
    masses, times = finite(numbers(gm, "gm"), "gm"), finite(numbers(t, "t"), "t")
    positions, velocities = finite(numbers(q, "q"), "q"), finite(numbers(v, "v"), "v")
    if times.ndim != 1 or not len(times) or positions.shape != (len(times), masses.size, 3):
        raise InputError(
            f"t and q have shapes {times.shape} and {positions.shape}; expected (n,) and (n, {masses.size}, 3) with at "
            "least one sample."
        )
    if velocities.shape not in (positions.shape, positions.shape[1:]):
        raise InputError(f"v has shape {velocities.shape}; expected {positions.shape[1:]} or {positions.shape}.")
    first = velocities if velocities.ndim == 2 else velocities[0]
    return uniform_motion_drift(masses, times, centre_of_mass(masses, positions), positions[0], first)


def uniform_motion_drift(gm: Floats, t: Floats, centre: Floats, q: Floats, v: Floats) -> Drift:
    """`centre_of_mass_drift` from the centre itself, (n, 3), and the first of the states, (bodies, 3) each."""
    uniform = centre[0] + np.outer(t - t[0], centre_of_mass(gm, v))
    away = q[gm > 0.0] - centre_of_mass(gm, q)
    reach = float(max(lengths(away).max(), lengths(uniform - uniform[0]).max()))
    return drift(centre - uniform, scale=reach)


def _ratio(value: float, scale: float) -> float:
    if value == 0.0:
        return 0.0
    return value / scale if scale else float("inf")
