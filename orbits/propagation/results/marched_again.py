"""States at any times of a run, marched from one that is known, through the changes of its bodies after that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.propagation.marchers import bound
from orbits.system.model import continued
from orbits.trajectory.changes import BODY, GM, GONE, TIME, Q, V, of_bodies

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]


class MarchedAgain:
    """A run marched again by its own method and steps.

    run : the run; time, q, v : of the state from which it is marched, of all bodies
    accounts : of the forces there, if some have internal variables; a run with these has no changes
    """

    march: Legs

    def __init__(self, run: Trajectory, time: float, q: Array, v: Array, accounts: Array | None = None) -> None:
        self._run, self._system = run, run.system if accounts is None else continued(run.system, accounts)
        self._begin(time, np.array(q), np.array(v))

    def at(self, time: float) -> tuple[Array, Array]:
        """Return q and v of all bodies, (n, 3), at a time not before those asked for earlier; NaN for those gone."""
        direction, changes = self._run.clock.direction, self._run.changes
        if changes is not None:
            ahead = changes.between(self._time, time)
            for instant in (np.unique(ahead[:, TIME] * direction) * direction).tolist():
                q, v = self._state(instant)
                for row in ahead[ahead[:, TIME] == instant]:
                    there = row[GM] != GONE
                    q[int(row[BODY])] = row[Q : Q + 3] if there else np.nan
                    v[int(row[BODY])] = row[V : V + 3] if there else np.nan
                self._begin(instant, q, v)
        return self._state(time)

    def _begin(self, time: float, q: Array, v: Array) -> None:
        run, changes, system = self._run, self._run.changes, self._system
        self._time, self._there = time, np.ones(len(q), dtype=bool)
        if changes is not None and len(changes):
            bodies = changes.bodies_at(time)
            self._there = bodies.present & np.isfinite(q).all(axis=1)
            system = of_bodies(system, bodies._replace(present=self._there))
        how, state = (run.integrator, run.clock), (q[self._there], v[self._there])
        self.march = bound(system, *how, threads=1, state=state, start=time, underway=True)

    def _state(self, time: float) -> tuple[Array, Array]:
        q, v = np.full((2, len(self._there), 3), np.nan)
        place = self._run.clock.place(time - self._time)
        self.march.advance_to(place)
        q[self._there], v[self._there] = self.march.state_at(place)
        return q, v
