"""Which planets of a system come close to each other, now or where their orbits about the dominant body pass."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.elements.moid import Conics, come_within, least_distances
from orbits.finding import SHOWN
from orbits.integrators.forms import Array
from orbits.marching.watching.kepler_passages import HILL_RADII, reach
from orbits.propagation.checks.step_check import in_digits
from orbits.system.derived import derived

if TYPE_CHECKING:
    from orbits.system import System


ROUNDING = 1e-12
"""The distance of two orbits that cross, as a fraction of their size, up to which it is rounding."""


class Orbits(NamedTuple):
    """The orbits of bodies about the dominant one: rows of the system, relative states, GM of both, pericentres,
    eccentricities, planes.

    q, v : (n, 3); row, mu, pericentre, e : (n,)
    along, across : (n, 3), unit vectors to the pericentre and a quarter of a turn ahead
    """

    row: NDArray[np.intp]
    q: Array
    v: Array
    mu: Array
    pericentre: Array
    e: Array
    along: Array
    across: Array

    def conics(self, which: NDArray[np.intp]) -> Conics:
        """Return those at some places of the list."""
        return Conics(self.pericentre * (1.0 + self.e), self.e, self.along, self.across).some(which)


def orbits_of_planets(system: System) -> Orbits:
    """Return the orbits of the other massive bodies about the dominant one."""
    values, sun = system.values, int(system.values.gm.argmax())
    rows = system.massive.nonzero()[0]
    rows = rows[rows != sun]
    q, v, mu = values.q[rows] - values.q[sun], values.v[rows] - values.v[sun], values.gm[rows] + values.gm[sun]
    r, spin = np.linalg.norm(q, axis=1)[:, None], _cross(q, v)
    to_pericentre = _cross(v, spin) / mu[:, None] - q / r
    e = np.linalg.norm(to_pericentre, axis=1)
    round_ = e[:, None] <= 1e-12
    along = np.where(round_, q / r, to_pericentre) / np.where(round_, 1.0, e[:, None])
    plane = _cross(spin, along)
    size = np.linalg.norm(plane, axis=1)[:, None]
    across = plane / np.where(size > 0.0, size, 1.0)
    return Orbits(rows, q, v, mu, (spin**2).sum(axis=1) / mu / (1.0 + e), e, along, across)


def close_pairs(system: System) -> tuple[list[str], int]:
    """Return in words, up to `SHOWN`, which planets are or can come within `HILL_RADII` of each other, and how many
    pairs there are.
    """
    orbits = derived(system, orbits_of_planets)
    values, units, sun = system.values, system.units, int(system.values.gm.argmax())
    first, second = _pairs(len(orbits.row), 1)
    one, other = orbits.row[first], orbits.row[second]
    gm, dominant = values.gm[one] + values.gm[other], float(values.gm[sun])
    apart = np.linalg.norm(values.q[one] - values.q[other], axis=1)
    close = apart < reach(values.q[one] - values.q[sun], gm, dominant)
    crossing = np.zeros_like(close)
    bound = np.flatnonzero(~close & (np.maximum(orbits.e[first], orbits.e[second]) < 1.0))
    share = HILL_RADII * np.cbrt(gm[bound] / (3.0 * dominant))
    crossing[bound] = come_within(orbits.conics(first[bound]), orbits.conics(second[bound]), share)
    found = np.flatnonzero(close | crossing)
    if not len(found):
        return [], 0
    shown = found[:SHOWN]
    passing = shown[crossing[shown]]
    inner, outer = orbits.conics(first[passing]), orbits.conics(second[passing])
    gaps = least_distances(inner, outer)[0]
    gaps[gaps < ROUNDING * inner.p / (1.0 - inner.e**2)] = 0.0  # they cross
    gap_of, texts = dict(zip(passing.tolist(), gaps.tolist(), strict=True)), []
    for k in shown.tolist():
        names, within = f"{system.names[one[k]]} and {system.names[other[k]]}", f"less than {HILL_RADII:.0f} Hill radii"
        if k in gap_of:
            gap = in_digits(gap_of[k], units.length, 2)
            texts.append(f"the orbits of {names} come within {gap}, {within}")
        else:
            texts.append(f"{names} are {in_digits(float(apart[k]), units.length)} apart, {within}")
    return texts, len(found)


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of rows, (n, 3), in a fraction of NumPy's time for a few."""
    return np.asarray(a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]])


_pairs = lru_cache(maxsize=16)(np.triu_indices)
"""The numbers of both bodies of all pairs of so many, which nobody writes."""
