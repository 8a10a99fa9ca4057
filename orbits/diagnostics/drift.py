"""How far a quantity that should stay strays from where it began."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.diagnostics.momenta import centre_of_mass
from orbits.errors import InputError, shown


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
    values = np.asarray(series, dtype=np.float64)
    if values.ndim not in (1, 2) or values.size == 0:
        raise InputError(f"the series has shape {values.shape}; expected (n,) or (n, 3) with at least one sample.")
    if not np.isfinite(values).all():
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise InputError(f"the series holds {values[row]} at sample {row}; expected finite values.")
    vectors = values.reshape(len(values), -1)
    size = float(np.linalg.norm(vectors[0])) if scale is None else abs(float(scale))
    if not np.isfinite(size):
        raise InputError(f"the scale is {shown(scale)}; expected a finite number.")
    strays = np.linalg.norm(vectors - vectors[0], axis=1)
    largest, last = float(strays.max()), float(strays[-1])
    return Drift(
        max_fraction=_ratio(largest, size),
        max_ulps=_ratio(largest, float(np.spacing(size)) if size else 0.0),
        last_fraction=_ratio(last, size),
        scale=size,
    )


def centre_of_mass_drift(gm: ArrayLike, t: ArrayLike, q: ArrayLike, v: ArrayLike) -> Drift:
    """Measure how far the centre of mass strays from its uniform motion.

    gm : (bodies,); t : (n,) times; q : (n, bodies, 3); v : (bodies, 3) at the first of the times, or (n, bodies, 3)
    Compared with the largest distance of a massive body from it at first, or its own way where that is longer.
    Raises InputError for shapes that do not fit, or where no body has a mass.
    """
    masses, velocities = np.asarray(gm, dtype=np.float64), np.asarray(v, dtype=np.float64)
    positions, first = np.asarray(q, dtype=np.float64), velocities if velocities.ndim == 2 else velocities[0]
    return uniform_motion_drift(masses, t, centre_of_mass(masses, positions), positions[0], first)


def uniform_motion_drift(gm: ArrayLike, t: ArrayLike, centre: ArrayLike, q: ArrayLike, v: ArrayLike) -> Drift:
    """`centre_of_mass_drift` from the centre itself, (n, 3), and the first of the states, (bodies, 3) each."""
    times, way, masses = (np.asarray(x, dtype=np.float64) for x in (t, centre, gm))
    massive = masses > 0.0
    uniform = way[0] + np.outer(times - times[0], centre_of_mass(masses, v))
    away = np.asarray(q, dtype=np.float64)[massive] - centre_of_mass(masses, q)
    reach = float(np.linalg.norm(away, axis=1).max())
    reach = max(reach, float(np.linalg.norm(uniform - uniform[0], axis=1).max(initial=0.0)))
    return drift(way - uniform, scale=reach)


def _ratio(value: float, scale: float) -> float:
    if value == 0.0:
        return 0.0
    return value / scale if scale else float("inf")
