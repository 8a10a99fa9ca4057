"""How far a conserved quantity drifts from its first value."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import finite_number, finite_numbers, real_numbers
from orbits.diagnostics.arrays import scaled
from orbits.diagnostics.doubledouble import Floats
from orbits.diagnostics.momenta import centre_of_mass
from orbits.errors import InputError

CANCELLED = 1e-6
"""A first value smaller than this fraction of its terms cannot serve as the scale of changes."""


@dataclass(frozen=True)
class Drift:
    """How far a series drifts from its first value.

    max_fraction : largest |x_k - x_0| over the scale
    max_ulps : the same, in units in the last place of the scale
    last_fraction : |x_last - x_0| over the scale
    scale : what changes are divided by, in the unit of the series
    """

    max_fraction: float
    max_ulps: float
    last_fraction: float
    scale: float


def drift(series: ArrayLike, scale: float | None = None) -> Drift:
    """Measure the drift of a sampled scalar, shape (n,), or vector, shape (n, 3).

    scale : what changes are divided by; the size of the first value by default. Give one if the first value nearly
        cancels, as the total momentum does in barycentric coordinates: sum gm |v|.
    A series that never changes has a drift of zero, whatever its scale; one that changes has an infinite drift if its
    scale is zero. Raises InputError for an empty series, another shape, or values that are not finite.
    """
    values = real_numbers(series, "the series")
    if values.ndim not in (1, 2) or values.size == 0:
        raise InputError(f"the series has shape {values.shape}; expected (n,) or (n, 3) with at least one sample.")
    if not np.isfinite(values).all():
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise InputError(f"the series holds {values[row]} at sample {row}; expected finite values.")
    vectors = values.reshape(len(values), -1)
    size = None if scale is None else abs(finite_number(scale, "the scale"))
    # Scaling is exact, and keeps squares from overflowing or vanishing.
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
    """Return the scale that changes of a conserved quantity are compared with.

    first : its first value, a scalar or a vector
    terms : the sum of the absolute values of the terms that make up the first value
    later : returns the largest such sum over all samples; called only if `terms` is 0, with everything at rest
    The scale is the size of the first value, or `terms` where they cancel to less than a millionth of their size, as
    in the angular momentum of the figure-eight.
    """
    vector, power = scaled(np.atleast_1d(np.asarray(first, dtype=np.float64)))
    size = math.ldexp(float(np.linalg.norm(vector)), power)
    return size if size > CANCELLED * terms else terms or later()


def kinetic_energies(gm: Floats, v: Floats) -> Floats:
    """The sum of gm v^2 / 2, the scale of the energy, to a few digits: (..., n, 3) to (...)."""
    return np.asarray(0.5 * np.sum(gm * np.sum(v * v, axis=-1), axis=-1))


def moments(gm: Floats, q: Floats, v: Floats) -> Floats:
    """The sum of gm |q| |v|, the scale of the angular momentum, to a few digits: (..., n, 3) to (...)."""
    return np.asarray(np.sum(gm * lengths(q) * lengths(v), axis=-1))


def momenta(gm: Floats, v: Floats) -> Floats:
    """The sum of gm |v|, the scale of the linear momentum, to a few digits: (..., n, 3) to (...)."""
    return np.asarray(np.sum(gm * lengths(v), axis=-1))


def lengths(x: Floats) -> Floats:
    """The lengths of vectors, (..., 3) to (...), without squares that overflow or vanish."""
    return np.asarray(np.hypot(np.hypot(x[..., 0], x[..., 1]), x[..., 2]))


def centre_of_mass_drift(gm: ArrayLike, t: ArrayLike, q: ArrayLike, v: ArrayLike) -> Drift:
    """Measure how far the centre of mass departs from uniform motion.

    gm : (bodies,); t : (n,) times; q : (n, bodies, 3); v : (bodies, 3) at the first time, or (n, bodies, 3)
    The scale is the largest initial distance of a massive body from the centre of mass, or the distance that the
    centre of mass travels if that is longer.
    Raises InputError for values that are not finite, shapes that do not fit, and if no body has a mass.
    """
    masses, times = finite_numbers(gm, "gm"), finite_numbers(t, "t")
    positions, velocities = finite_numbers(q, "q"), finite_numbers(v, "v")
    if times.ndim != 1 or not len(times) or positions.shape != (len(times), masses.size, 3):
        raise InputError(
            f"t and q have shapes {times.shape} and {positions.shape}; expected (n,) and (n, {masses.size}, 3) with at "
            "least one sample."
        )
    if velocities.shape not in (positions.shape, positions.shape[1:]):
        raise InputError(f"v has shape {velocities.shape}; expected {positions.shape[1:]} or {positions.shape}.")
    first = velocities if velocities.ndim == 2 else velocities[0]
    centre = centre_of_mass(masses, positions)
    return uniform_motion_drift(masses, times, centre, positions[0], centre_of_mass(masses, first))


def uniform_motion_drift(gm: Floats, t: Floats, centre: Floats, q: Floats, velocity: Floats) -> Drift:
    """`centre_of_mass_drift` from the centre of mass itself, (n, 3), its velocity, (3,), and the first positions."""
    uniform = centre[0] + np.outer(t - t[0], velocity)
    away = q[gm > 0.0] - centre_of_mass(gm, q)
    reach = float(max(lengths(away).max(), lengths(uniform - uniform[0]).max()))
    return drift(centre - uniform, scale=reach)


def _ratio(value: float, scale: float) -> float:
    if value == 0.0:
        return 0.0
    return value / scale if scale else float("inf")
