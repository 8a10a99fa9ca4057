"""States before the earliest time of a run: marched back from there by its method, for as long as light may take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EpochError, with_unit
from orbits.propagation.checks.before_the_start import check_span
from orbits.propagation.marchers import bound
from orbits.time_grid import TimeGrid

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]


def states_before(run: Trajectory, times: Array) -> tuple[Array, Array]:
    """Return q and v, (m, bodies, 3) each, at m times before the earliest one of a run; NaN for bodies not there yet.

    The run is continued backwards with its own method and steps from its earliest state. Neither events nor collisions
    are sought there. Raises EpochError if an ephemeris of the run begins later.
    """
    first = run._earliest
    system = run.at(first)
    dt = run.clock if run.clock.changes else abs(run.step)
    grid = TimeGrid.of(system, dt, duration=float(np.min(times)) - first)
    try:
        check_span(system, grid)
    except EpochError as error:
        early = with_unit(f"{abs(grid.end):.3g}", system.units.time)
        raise EpochError(
            f"light that is seen at the earliest time of the run left up to {early} before it, where it is marched "
            f"back to: {error} Or give times that are as much later."
        ) from None
    clock = grid.clock
    start = system.values.q, system.values.v
    march = bound(system, run.integrator, clock, threads=1, state=start)
    q, v = np.full((2, len(times), len(run.names), 3), np.nan)
    there = [run.names.index(name) for name in system.names]
    order = np.argsort(-times, kind="stable")
    for some, *states in march.along(clock.places(times[order] - first)):
        rows = order[some, None]
        q[rows, there], v[rows, there] = states
    return q, v
