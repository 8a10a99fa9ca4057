"""The steps ahead of a march whose bodies may collide, searched on copies."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.marching.legs.planet_excursions import Legs
from orbits.marching.stepping.motion import Motion
from orbits.propagation.collisions.bodies_of_run import BodiesOfRun, state_in_step
from orbits.propagation.collisions.impact import Impact, Step, impacts
from orbits.propagation.collisions.of_a_run import Collisions
from orbits.propagation.collisions.own_impacts import alone, own_impacts
from orbits.propagation.marchers import bound
from orbits.trajectory.changes import of_bodies

Array = NDArray[np.float64]


class Ahead(NamedTuple):
    """A step: the marches where it begins and ends, the time at which it ends, and the collisions in it, in the order
    of time.

    passed : the motion in whole steps before it in which no events were sought
    """

    start: Legs
    after: Legs
    end: float
    impacts: list[Impact]
    passed: tuple[Motion, ...] = ()


class StepsAhead:
    """Searches single steps of a march for collisions.

    of : the bodies; collisions : those that are sought; keeps_motion : whether events are sought in the steps, too
    """

    def __init__(self, of: BodiesOfRun, collisions: Collisions, keeps_motion: bool) -> None:
        self._of, self._collisions, self._keeps_motion = of, collisions, keeps_motion

    def after(self, ahead: Ahead) -> Ahead:
        """Return the step after one that was searched."""
        return self.next(ahead.after, (*ahead.passed, ahead.after.motion()) if self._keeps_motion else ())

    def next(self, marcher: Legs, passed: tuple[Motion, ...]) -> Ahead:
        """Search the next step of a march, on copies; passed : the motion in those before it."""
        now = marcher.checkpoint()
        after = self._of.again(marcher, now, seek=True)
        after.advance(1)
        end = after.time if after.step > marcher.step else self._of.clock.direction * math.inf  # nothing attracts
        start = marcher if after.met is None else self._of.again(marcher, now)
        return Ahead(start, after, end, self.impacts(start, after) if after.met is not None else [], passed)

    def impacts(self, start: Legs, after: Legs) -> list[Impact]:
        """Return the collisions in the step between two states of a march, in the order of time."""
        whole = self._of.whole
        q, v = whole(start.state(), start.time), whole(after.state(), start.time)

        def at(time: float) -> tuple[Array, Array]:
            return whole(state_in_step(start, time), start.time)

        massive = np.flatnonzero(self._of.present_massive())
        step = Step(start.time, after.time, q, v, at, massive, start.problem.strength[: 1 + len(massive)])
        if not start.clock.changes or self._of.massive.all():
            return impacts(step, self._of.bodies.radii, self._collisions.seeks, self._of.integrator.order)
        for x in (*step.before, *step.after):
            x[~self._of.massive] = np.nan
        found = impacts(step, self._of.bodies.radii, self._collisions.seeks, self._of.integrator.order)
        numbers = np.flatnonzero(self._of.there)
        for particle in numbers[after.home.observers.touching(after.home.loop.taken)].tolist():
            if self._of.bodies.present[particle]:
                found += self._impacts_of(particle, start, after.time)
        return sorted(found, key=lambda x: (x.time * self._of.clock.direction, x.first, x.second))

    def _impacts_of(self, particle: int, start: Legs, end: float) -> list[Impact]:
        """Return the collisions of a massless body in its own steps within one of the massive bodies, up to the first
        after which it does not go on as before.
        """
        values, collisions = self._of.system.values, self._collisions
        some = self._of.present_massive()
        some[particle] = True
        system = of_bodies(self._of.system, self._of.bodies._replace(present=some))
        march = bound(system, self._of.integrator, self._of.clock, 1, state=(values.q[some], values.v[some]))
        number = int((~self._of.massive & self._of.there)[:particle].sum())
        march.restore(alone(start.checkpoint(), march.checkpoint(), number))
        return own_impacts(march, particle, some, end, self._of.bodies.radii, collisions)
