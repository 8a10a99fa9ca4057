"""Which bodies of a run are there, and marches of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EventError, with_unit
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.kernels.steps import NOWHERE
from orbits.marching.clocks.clock import Clock
from orbits.marching.legs import within_step
from orbits.marching.legs.excursions.planet_excursions import Legs
from orbits.marching.legs.leg import Leg
from orbits.propagation.collisions.merge_and_bounce import State
from orbits.propagation.collisions.of_a_run import Collisions, rows_of_change
from orbits.propagation.marchers import bound
from orbits.system import System
from orbits.trajectory.changes import Bodies, Changes, no_changes, of_bodies


class BodiesOfRun:
    """The bodies of a run as they change, from which the march of each leg is made.

    system : at the start; collisions : those that are sought, or None
    dense : whether motion within steps is recorded; approaches : as in `propagate`

    changes : so far; bodies : as they are now; there : (n,), which are in the current leg
    """

    def __init__(
        self,
        system: System,
        integrator: Integrator,
        clock: Clock,
        threads: int | None,
        collisions: Collisions | None,
        dense: bool,
        approaches: bool | None,
    ) -> None:
        self.system, self.integrator, self.clock, self.collisions = system, integrator, clock, collisions
        self._threads, self._dense, self._approaches = threads, dense, approaches
        self.massive = system.massive
        self.there = np.ones(len(system), dtype=bool)
        self._leg: System | None = None  # the bodies of this leg, once they are needed
        self.know(no_changes())

    def know(self, rows: Array) -> None:
        """Take the changes so far, (k, COLUMNS)."""
        self.changes = Changes(self.system, rows, self.clock.direction)
        self.bodies: Bodies = self.changes.bodies_after(len(rows))

    def note(self, rows: Array) -> None:
        """Take further changes, (k, COLUMNS)."""
        self.know(np.concatenate([self.changes.rows, rows]))

    def changed(
        self, kind: str, time: float, q: Array, v: Array, before: System, after: System
    ) -> tuple[State, Array]:
        """Return the state of all bodies after a change by an event, and the rows of those that changed.

        kind, time, q, v, before, after : see `ChainOfLegs.change`
        """
        at = f"{kind} at t = {with_unit(f'{time:.10g}', self.system.units.time)}"
        if after.names != before.names or (after.massive != before.massive).any():
            raise EventError(
                f"{at}: the function returned other bodies, or gave one a mass that had none or "
                "took all of it; expected the same bodies, of which q, v, gm and radii may change.",
                time=time,
            )
        same = ("units", "softening", "terms", "forces", "epoch")
        if any(getattr(after, name) != getattr(before, name) for name in same):
            raise EventError(
                f"{at}: the function changed something besides q, v, gm and radii; expected a System with the same "
                "units, softening, terms, forces and epoch, which stay as they are in a run.",
                time=time,
            )
        numbers = [self.system.names.index(name) for name in after.names]
        old = State(self.bodies.gm, self.bodies.radii, q, v)
        new = State(*(x.copy() for x in old))
        radii = np.zeros(len(after)) if after.radii is None else np.asarray(after.radii.value)
        for kept, changed in zip(new, (after.values.gm, radii, after.values.q, after.values.v), strict=True):
            kept[numbers] = changed
        return new, rows_of_change(self.system, self.bodies, time, old, new)

    def now(self) -> System:
        """Return the bodies at the start of the run, with the masses and radii that they have now."""
        radii = None if self.system.radii is None else self.bodies.radii
        return self.system.replaced(gm=self.bodies.gm, radii=radii)

    def begin_leg(self) -> None:
        """Let the next leg have the bodies that are there now; massless ones that are gone keep their places."""
        self.there, self._leg = self.bodies.present | ~self.massive, None

    def present_massive(self) -> NDArray[np.bool_]:
        """Return which massive bodies are there, (n,)."""
        return np.asarray(self.massive & self.bodies.present)

    def acting(self) -> NDArray[np.bool_]:
        """Return which forces act in the current leg, (forces,): those on bodies that are all gone do not."""
        gone = {name for name, there in zip(self.system.names, self.there, strict=True) if not there}
        return np.array([force.without(gone) is not None for force in self.system.forces], dtype=bool)

    def of_leg(self) -> Bodies:
        """Return the bodies of this leg, with the masses and radii that they have in it."""
        return self.bodies._replace(present=self.there)

    def march(self, q: Array, v: Array, clock: Clock, time: float = 0.0) -> Legs:
        """Return a march of the bodies of this leg, of q and v (there, 3), from a time on."""
        if self._leg is None:
            self._leg = of_bodies(self.system, self.of_leg())
        q, v = np.where(np.isnan(q), NOWHERE, q), np.where(np.isnan(v), 0.0, v)
        radii = None if self.collisions is None else self.collisions.sought(self.bodies.radii)[self.there]
        made = bound(
            self._leg,
            self.integrator,
            clock,
            self._threads,
            state=(q, v),
            radii=radii,
            dense=self._dense,
            approaches=self._approaches,
        )
        if time != 0.0:
            made.home.times.begin_at(time)
        return made

    def whole(self, state: tuple[Array, Array], time: float) -> tuple[Array, Array]:
        """Return a state of all bodies of the run, NaN for those that are gone at a time."""
        q, v = np.full((2, len(self.there), 3), np.nan)
        q[self.there], v[self.there] = state
        gone = ~self.changes.bodies_at(time).present
        q[gone] = v[gone] = np.nan
        return q, v


def state_in_step(start: Leg, time: float) -> tuple[Array, Array]:
    """Return (q, v) at a time in the step that begins where a march is."""
    return within_step.state_at(start, start.times.place_of(time))
