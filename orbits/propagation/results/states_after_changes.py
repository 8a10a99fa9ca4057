"""States at any times of a run whose bodies changed: from the preceding sample, through the changes after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.propagation.marchers import bound
from orbits.trajectory.changes import BODY, GM, GONE, TIME, Q, V, of_bodies

if TYPE_CHECKING:
    from orbits.marching.legs.planet_excursions import Legs
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]


class LegsAgain:
    """Marches a run again from a sample, with its own method and steps, through the changes that are known.

    run : the run; time, q, v : of the sample, or of its start
    """

    def __init__(self, run: Trajectory, time: float, q: Array, v: Array) -> None:
        self._run = run
        self._begin(time, np.array(q), np.array(v))

    def at(self, time: float) -> tuple[Array, Array]:
        """Return q and v of all bodies, (n, 3), at a time not before those asked for earlier; NaN for those gone."""
        run = self._run
        assert run.changes is not None
        ahead = run.changes.between(self._time, time)
        for instant in np.unique(ahead[:, TIME] * run.clock.direction) * run.clock.direction:
            q, v = self._state(float(instant))
            for row in ahead[ahead[:, TIME] == instant]:
                there = row[GM] != GONE
                q[int(row[BODY])] = row[Q : Q + 3] if there else np.nan
                v[int(row[BODY])] = row[V : V + 3] if there else np.nan
            self._begin(float(instant), q, v)
        return self._state(time)

    def _begin(self, time: float, q: Array, v: Array) -> None:
        run = self._run
        assert run.changes is not None
        bodies = run.changes.bodies_at(time)
        self._time, self._there = time, bodies.present & np.isfinite(q).all(axis=1)
        system = of_bodies(run.system, bodies._replace(present=self._there))
        state = (q[self._there], v[self._there])
        self._march: Legs = bound(system, run.integrator, run.clock, threads=1, state=state, start=time)

    def _state(self, time: float) -> tuple[Array, Array]:
        q, v = np.full((2, len(self._there), 3), np.nan)
        place = self._run.clock.place(time - self._time)
        self._march.advance_to(place)
        q[self._there], v[self._there] = self._march.state_at(place)
        return q, v
