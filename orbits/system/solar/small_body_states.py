"""States of the small bodies of DE440 at any date near 2000 to 2030, as floats.

Their osculating elements are known for one date, MJD 59800; from there they were integrated, with all that the model
"full" contains, to the `DAYS` of a bundled table. The sixteen largest asteroids have there the states of JPL's own
integration, sb441-n16. A date between is at most 548 days from one of these, and is reached by a march from it that
begins with Sun and planets of DE440.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EpochError
from orbits.resources import data_path
from orbits.system.solar.building import full
from orbits.system.solar.small_bodies import from_elements, small_bodies

if TYPE_CHECKING:
    from orbits.system.system import System

Floats = NDArray[np.float64]

STATES = "de440_small_bodies.npy"

FIRST, LAST, COUNT = 2451544.5, 2462502.5, 11
DAYS = np.linspace(FIRST, LAST, COUNT)
"""Julian dates, TDB, of the states in the table."""

FARTHEST = 50 * 365.25
"""How many days before the first and after the last of these states can be computed."""

STEP = 2.0
"""Days of a step of Gauss with 8 stages in which they are marched."""


@cache
def _table() -> Floats:
    found: Floats = np.load(data_path(STATES), allow_pickle=False)
    return found


def states(cls: type[System], jd1: float, jd2: float) -> tuple[Floats, Floats]:
    """Return heliocentric positions and velocities at the Julian date jd1 + jd2, TDB: (n, 3), au and au/d, ICRF.

    cls : the class `System`, of what is marched

    Raises EpochError for a date too far from those of the table.
    """
    days = (jd1 - FIRST) + jd2
    if not -FARTHEST <= days <= LAST - FIRST + FARTHEST:
        raise EpochError(
            f"the epoch is JD {jd1 + jd2} TDB; the states of DE440's asteroids are known from JD {FIRST - FARTHEST} to "
            f"{LAST + FARTHEST}. Choose an epoch from 1950 to 2079, or model='relativistic', which has no asteroids."
        )
    nearest = int(np.abs(DAYS - FIRST - days).argmin())
    begin = _table()[nearest]
    return carried(cls, begin[:, :3], begin[:, 3:], float(DAYS[nearest]), (jd1 - float(DAYS[nearest])) + jd2)


def carried(cls: type[System], q: Floats, v: Floats, day: float, span: float) -> tuple[Floats, Floats]:
    """Return heliocentric states `span` days after a Julian date at which they are q and v."""
    if span == 0.0:
        return q, v
    from orbits.integrators.gauss import Gauss
    from orbits.marching.clocks.step_times import Place
    from orbits.marching.legs.leg import Leg
    from orbits.system.model import model

    system = full(cls, day, (q, v))
    acting, bodies = model(system), system.values
    steps = math.ceil(abs(span) / STEP)
    marcher = Leg.of(
        acting.lagrangian,
        Gauss(stages=8),
        acting.vectors,
        system.massive,
        bodies.q,
        bodies.v,
        span / steps,
        names=system.names,
        forces=acting.forces,
    )
    marcher.advance_to(Place(steps, 0.0))
    there_q, there_v = marcher.state()
    return relative(system, there_q), relative(system, there_v)


def relative(system: System, x: Floats) -> Floats:
    """Return the rows of the small bodies relative to that of the Sun."""
    rows = [system.index(name) for name in small_bodies().names]
    return np.asarray(x[rows] - x[system.index("Sun")])


def write_table(cls: type[System], path: Path, known: Callable[[float], Mapping[str, Floats]]) -> None:
    """Integrate from the elements to all dates of the table, with Sun and planets of DE440 at each, and write it.

    known : returns heliocentric states (6,) of some of them at a Julian date, by their key, which are taken instead
    """

    def replaced(state: Floats, day: float) -> Floats:
        better = known(day)
        return np.array([better.get(key, row) for key, row in zip(small_bodies().keys, state, strict=True)])

    begin, q, v = from_elements()
    found = np.empty((COUNT, len(q), 6))
    for order in (np.flatnonzero(begin < DAYS), np.flatnonzero(begin > DAYS)[::-1]):
        day, state = begin, replaced(np.hstack([q, v]), begin)
        for k in order:
            there = carried(cls, state[:, :3], state[:, 3:], day, float(DAYS[k]) - day)
            day, state = float(DAYS[k]), replaced(np.hstack(there), float(DAYS[k]))
            found[k] = state
    np.save(path, found, allow_pickle=False)
