"""The length of a step from a quantity, a number, a text, or a fraction of the shortest period."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.checks import single_number
from orbits.errors import InputError, shown
from orbits.marching.clocks.constant import rounded_step
from orbits.point_masses import PointMasses
from orbits.units import quantity_from_text

if TYPE_CHECKING:
    from orbits.protocols import State


FRACTION = re.compile(r"\s*P\s*/\s*(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*")
"""A fraction of the shortest orbital period, as text: "P/20"."""

PAIRS_AT_ONCE = 100_000
"""The pairs of bodies whose distances are in memory at the same time."""


def step_length(system: State, dt: Any, span: float, what: str = "dt") -> float:
    """Return dt > 0 in the unit of time of `system`, rounded to 24 significant bits; its sign is ignored.

    dt : a quantity, a number in that unit, or a text: "6 d", "P/20", where P is the shortest orbital period within
        `span`

    Raises InputError, calling it `what`, for anything else, and unless it is finite and not zero.
    """
    value = abs(single_number(system.units.time_value(_from_text(system, dt, span, what), what), what))
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{what} must be finite and not zero, got {value:g}; it is the length of a step")
    h = rounded_step(value)
    if not (h > 0.0 and math.isfinite(h)):
        raise InputError(
            f"{what} = {value:g} is out of the range of floats; choose units in which it is of ordinary size"
        )
    return h


def dynamical_time(system: State) -> float:
    """Return the shortest dynamical time, (sum G (m + m') / r^3)^(-1/2) over all pairs, at the start; infinite for a
    single body.
    """
    return dynamical_time_of(system.values)


def dynamical_time_of(start: PointMasses) -> float:
    """Return the dynamical time of a start in floats."""
    gm, q, _, softening = start
    massive, rate = gm.nonzero()[0], 0.0
    share = max(1, PAIRS_AT_ONCE // len(gm))
    with np.errstate(all="ignore"):
        for first in range(0, len(massive), share):
            # Each pair is there once for each of its massive bodies, with the attraction of that body.
            rows = massive[first : first + share]
            apart = q[rows, None] - q
            r2 = np.einsum("ijk,ijk->ij", apart, apart) + softening**2
            r2[np.arange(len(rows)), rows] = np.inf
            rate += float((gm[rows, None] * r2**-1.5).sum())
    return rate**-0.5 if rate > 0.0 else math.inf


def _from_text(system: State, dt: Any, span: float, what: str) -> Any:
    """Return dt, with a text such as "P/20" or "6 d" converted to a number or a quantity.

    Raises InputError for other texts, and for "P/..." if no bodies are bound.
    """
    if not isinstance(dt, str):
        return dt
    match = FRACTION.fullmatch(dt)
    if match is None:
        expected = (
            f'a quantity (6 * u.day), a number in {str(system.units.time) or "units of time"}, a text with a unit '
            '("6 d"), or a fraction of the shortest period ("P/20")'
        )
        return quantity_from_text(dt, what, expected)
    period, parts = fastest_passage_of(system, span)[5], float(match[1])
    if not (math.isfinite(period) and period > 0.0):
        raise InputError(
            f"{what} = {shown(dt)}: P is the shortest orbital period, and no body is bound to another. Give a time."
        )
    if not parts > 0.0:
        raise InputError(f"{what} = {shown(dt)}; expected P divided by a number above 0.")
    return period / parts


def fastest_passage_of(system: State, span: float) -> tuple[int, int, float, float, float, float]:
    """Return the result of `orbits.kernels.search.fastest_passage.fastest_passage` for a system: rows of both bodies,
    distance, speed and eccentricity of their passage, and the shortest period.
    """
    from orbits.kernels.search.fastest_passage import fastest_passage

    values, given = system.values, np.zeros(len(system.names), dtype=np.bool_)
    if system.terms:
        names = {name for term in system.terms for name in term.gives_bodies}
        given[:] = [name in names for name in system.names]
    found: tuple[int, int, float, float, float, float] = fastest_passage(
        values.gm, values.softening, values.q, values.v, (values.gm > 0.0).nonzero()[0], given, span
    )
    return found
