"""States before the earliest time of a run: marched back from there by its method, for as long as light may take."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import OrbitsWarning

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]


def states_before(run: Trajectory, times: Array) -> tuple[Array, Array]:
    """Return q and v, (m, bodies, 3) each, at m times before the earliest one of a run; NaN for bodies not there yet.

    The run is continued backwards with its own method and steps from its earliest state. Neither events nor collisions
    are sought there.
    """
    from orbits.propagation.run import propagate

    first = run.earliest
    system = run.at(first)
    back, place = np.unique(first - times, return_inverse=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OrbitsWarning)
        before = propagate(
            system,
            run.integrator,
            dt=run.clock if run.clock.changes else abs(run.step),
            duration=-float(back[-1]),
            samples=(-back).tolist(),
            check_step=False,
            progress=False,
        )
    q, v = np.full((2, len(times), len(run.names), 3), np.nan)
    there = [run.names.index(name) for name in system.names]
    q[:, there], v[:, there] = before.q.value[place], before.v.value[place]
    return q, v
