"""States at any times of a run, marched from one that is known, through the changes of its bodies after that."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.marching.clocks.step_times import Place
from orbits.propagation.marchers import bound
from orbits.system.model import continued
from orbits.trajectory.changes import BODY, GM, GONE, TIME, Q, V, of_bodies

if TYPE_CHECKING:
    from orbits.marching.clocks.clock import Clock
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.system import System
    from orbits.trajectory import Trajectory


class MarchedAgain:
    """A run marched again by its own method and along its own steps.

    A sample within a step is where a partial step has led from its beginning, or from a change of the bodies within it.
    It is taken back first: by a symmetric method to round-off, by others with the error of such a step.

    run : the run; time, q, v : of the state from which it is marched, of all bodies
    accounts : of the forces there, if some have internal variables; a run with these has no changes
    """

    march: Legs

    def __init__(self, run: Trajectory, time: float, q: Array, v: Array, accounts: Array | None = None) -> None:
        self._run, self._accounts = run, accounts
        self._begin(time, np.array(q), np.array(v))

    def along(self, times: Array) -> Iterator[tuple[slice, Array, Array]]:
        """Yield which of ascending times, not before those asked for earlier, come next, or none, and q and v of all
        bodies there, (m, n, 3); NaN for those gone.
        """
        if self._run.changes is None or not len(self._run.changes):
            yield from self.march.along(self._clock.places(times - self._start))
            return
        for k, time in enumerate(times.tolist()):
            q, v = self.at(time)
            yield slice(k, k + 1), q[None], v[None]

    def at(self, time: float) -> tuple[Array, Array]:
        """Return q and v of all bodies, (n, 3), at a time not before those asked for earlier; NaN for those gone."""
        direction, changes = self._run.clock.direction, self._run.changes
        if changes is not None:
            ahead = changes.between(self._time, time)
            ahead = ahead[~self._leave_alone(ahead)]
            for instant in (np.unique(ahead[:, TIME] * direction) * direction).tolist():
                q, v = self._state(instant)
                for row in ahead[ahead[:, TIME] == instant]:
                    there = row[GM] != GONE
                    q[int(row[BODY])] = row[Q : Q + 3] if there else np.nan
                    v[int(row[BODY])] = row[V : V + 3] if there else np.nan
                self._begin(instant, q, v)
        q, v = self._state(time)
        if changes is not None:
            gone = ~changes.bodies_at(time).present
            q[gone] = v[gone] = np.nan
        return q, v

    def _leave_alone(self, rows: Array) -> NDArray[np.bool_]:
        """Return which changes begin no leg: massless bodies that are gone then."""
        return np.asarray((rows[:, GM] == GONE) & ~self._run.system.massive[rows[:, BODY].astype(int)])

    def accounts(self) -> Array:
        """Return the accounts of the forces at the states yielded last, if there were any, (m or 1, forces, 7 + inner),
        since the run began, if they were given.
        """
        return self._with_those_before(self.march.samples.accounts())

    def _with_those_before(self, accounts: Array) -> Array:
        """Return the accounts of forces, (..., forces, 7 + inner), with those of the run before this march."""
        accounts = accounts.copy()
        if self._accounts is not None:
            accounts[..., :FIGURES] += self._accounts[:, :FIGURES]
        return accounts

    def _begin(self, time: float, q: Array, v: Array) -> None:
        """March on from a state at a time, after the changes there."""
        run, changes = self._run, self._run.changes
        self._time, self._there = time, np.ones(len(q), dtype=bool)
        begun, changed = run.clock.step_begin(time), False
        if changes is not None and len(changes):
            bodies = changes.bodies_at(time)
            self._there = bodies.present & np.isfinite(q).all(axis=1)
            earlier = changes.between(begun, time)
            earlier = earlier[~self._leave_alone(earlier)]
            changed = len(earlier) > 0
            begun = float(earlier[-1, TIME]) if changed else begun
        state = q[self._there], v[self._there]
        if begun != time:
            home = self._bound(run.clock, time, state).home
            state = home.state_after(begun - time)
            self._accounts = None if self._accounts is None else self._with_those_before(home.accounts())
        self._clock, self._start, self._grid = run.clock, begun, -1
        if changed:
            step = run.clock.place(begun).steps
            self._clock, self._start, _ = run.clock.begun_within(step, begun)
            self._grid = step + 1 if self._clock is not run.clock else -1
        self.march = self._bound(self._clock, self._start, state)

    def _bound(self, clock: Clock, start: float, state: tuple[Array, Array]) -> Legs:
        return bound(
            self._system(), self._run.integrator, clock, threads=1, state=state, start=start, underway=True
        )

    def _system(self) -> System:
        """Return the bodies that are there, with the forces as they are now."""
        system, changes = self._run.system, self._run.changes
        if changes is not None and len(changes):
            return of_bodies(system, changes.bodies_at(self._time)._replace(present=self._there))
        return system if self._accounts is None else continued(system, self._accounts)

    def _state(self, time: float) -> tuple[Array, Array]:
        clock, direction = self._run.clock, self._run.clock.direction
        if self._grid >= 0 and (time - float(clock.time(self._grid))) * direction >= 0.0:  # beyond the part of a step
            self._begin(float(clock.time(self._grid)), *self._advanced(Place(1, 0.0)))
        return self._advanced(self._clock.place(time - self._start))

    def _advanced(self, place: Place) -> tuple[Array, Array]:
        q, v = np.full((2, len(self._there), 3), np.nan)
        self.march.advance_to(place)
        q[self._there], v[self._there] = self.march.state_at(place)
        return q, v
