"""Marches of a finished run up to its close approaches, and the pairs there, which are moved by partial steps."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, padded
from orbits.marching.clocks.step_times import Place
from orbits.propagation.marchers import bound, march_of, with_light
from orbits.propagation.results.dense_output import state_of
from orbits.system.model import continued, model, most_inner
from orbits.trajectory.work import accounts_of

if TYPE_CHECKING:
    from orbits.forces.base import Force
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.results.passages import Passage
    from orbits.system import System
    from orbits.trajectory import Trajectory


class Walk:
    """A march of massive and some massless bodies along the steps of a run, from a sample or (-1) its start."""

    def __init__(self, trajectory: Trajectory, sample: int, bodies: Sequence[int]) -> None:
        system = trajectory.system
        (q, v), time = state_of(trajectory, sample), 0.0 if sample < 0 else float(trajectory.times[sample])
        wanted = system.massive.copy()
        wanted[list(bodies)] = True
        self.bodies = np.flatnonzero(wanted)
        self._clock, self._place = trajectory.clock, Place(0, 0.0)
        self._integrator, self._system = trajectory.integrator, system
        if most_inner(system) and sample >= 0:
            self._system = continued(system, accounts_of(trajectory)[sample])
        self._excursions = trajectory.excursions
        self.marcher = self._bound(q[wanted], v[wanted], time)
        start = self._clock.step_begin(time)
        if start != time:
            home, names = self.marcher.home, [system.names[i] for i in self.bodies]
            state = home.state_after(start - time)
            if most_inner(system):
                self._system = continued(self._system, home.accounts(), names)
            self.marcher = self._bound(*state, start)

    def to(self, step: float) -> None:
        """March on to the beginning of a step, given by the reading of the clock, which must lie ahead."""
        # Passages between two steps of a map, of bodies that took chosen ones there, have their state within a step.
        self._place = self.marcher.home.times.places_of(np.array([step])).at(0)
        self.marcher.advance_to(self._place)

    def states(self, steps: Array) -> tuple[Array, Array]:
        """March on, and return q and v of its bodies, (m, bodies, 3), at the beginnings of m steps ahead, in order."""
        _, first, rows = np.unique(np.abs(steps), return_index=True, return_inverse=True)
        q, v = np.empty((2, len(first), len(self.bodies), 3))
        for some, *states in self.marcher.along(self.marcher.home.times.places_of(steps[first])):
            q[some], v[some] = states
        return q[rows], v[rows]

    def chooses(self, step: float) -> bool:
        """Return whether steps are chosen there one by one, as on an excursion from a map."""
        return self._clock.changes or self._excursions.include(step)

    def after(self, offset: float) -> tuple[Array, Array]:
        """Return q and v of its bodies, (bodies, 3), a time after the beginning of the step."""
        return self.marcher.state_at(self._place._replace(rest=self._place.rest + offset))

    def _bound(self, q: Array, v: Array, start: float) -> Legs:
        # All massive bodies are included, so the model of the run applies.
        values = self._system.values._replace(gm=self._system.values.gm[self.bodies], q=q, v=v)
        how = self._integrator, self._clock
        return march_of(values, *how, model(self._system, self.bodies), start=start, underway=True)


class Pairs(Protocol):
    """The pairs of some passages at the beginnings of their steps."""

    def apart(self, rows: NDArray[np.intp], offsets: Array) -> Array:
        """Return position and velocity of the bodies of some passages relative to the others, (m, 6), after partial
        steps of offsets (m,).
        """

    def about(self, dominant: int) -> Array:
        """Return position and velocity of the bodies relative to the dominant one, (passages, 6); 0 without one."""


class OnePair:
    """The pair of a passage at the beginning of its step, to which a march has led."""

    def __init__(self, walk: Walk, passage: Passage) -> None:
        self._walk, self._passage = walk, passage
        self._rows = {int(body): row for row, body in enumerate(walk.bodies)}

    def apart(self, rows: NDArray[np.intp], offsets: Array) -> Array:
        found = [self._relative(self._passage.other, offset) for offset in offsets.tolist()]
        return np.array(found).reshape(len(rows), 6)

    def about(self, dominant: int) -> Array:
        none = dominant < 0 or self._passage.body == dominant
        return np.zeros((1, 6)) if none else self._relative(dominant, 0.0)[None]

    def _relative(self, other: int, offset: float) -> Array:
        q, v = self._walk.after(offset)
        i, j = self._rows[self._passage.body], self._rows[other]
        return np.concatenate([q[i] - q[j], v[i] - v[j]])


class PairsTogether:
    """Pairs at the beginnings of their steps, whose partial steps are taken together.

    passages : between massive bodies, or of massless ones on which the same forces act: these have a mass here, which
        moves nothing, so that all of them are one problem
    bodies : (m,) numbers of those with states q and v, (passages, m, 3), in ascending order: all massive ones, and the
        massless ones whose passages have no recorded state
    """

    def __init__(
        self, trajectory: Trajectory, passages: Sequence[Passage], bodies: NDArray[np.intp], q: Array, v: Array
    ) -> None:
        system, clock = trajectory.system, trajectory.clock
        light = massless_of(system, passages[0])
        acting, there = with_light(system, light)
        order, count = np.flatnonzero(there).tolist(), len(passages)
        place, row = {body: k for k, body in enumerate(order)}, {body: k for k, body in enumerate(bodies.tolist())}
        heavy = [body for body in order if system.massive[body]]
        states = np.empty((count, 2, len(order), 3))
        states[:, :, [place[body] for body in heavy]] = np.stack([q, v], axis=1)[:, :, [row[body] for body in heavy]]
        for k, passage in enumerate(passages):
            for body in massless_of(system, passage):
                place[body] = place[light[0]]
                if passage.state is None:
                    states[k, 0, place[body]], states[k, 1, place[body]] = q[k, row[body]], v[k, row[body]]
                    continue
                sign, other = (1.0, passage.other) if body == passage.body else (-1.0, passage.body)
                states[k, :, place[body]] = states[k, :, place[other]] + sign * passage.state.reshape(2, 3)
        self._n, self._states, self._place = len(order), states, place
        self._bodies = np.array([place[passage.body] for passage in passages])
        self._others = np.array([place[passage.other] for passage in passages])
        self._path = np.zeros((count, 2, padded(3 * self._n)))
        self._path[:, :, : 3 * self._n] = states.transpose(0, 1, 3, 2).reshape(count, 2, -1)
        self._times = np.asarray(clock.time(np.array([passage.step for passage in passages])), dtype=np.float64)
        one = states[0, 0], states[0, 1]
        march = bound(acting, trajectory.integrator, clock, threads=1, state=one, underway=True)
        self._partial = march.home.stepper.partial_steps()

    def apart(self, rows: NDArray[np.intp], offsets: Array) -> Array:
        q, v = np.empty((2, len(rows), 3 * self._n))
        starts, every = rows.astype(np.int64), np.ones(len(rows), dtype=bool)
        self._partial.take(self._path, starts, self._times[rows], np.ascontiguousarray(offsets), every, q, v)
        both = np.stack([q, v], axis=1).reshape(len(rows), 2, 3, self._n)
        k = np.arange(len(rows))
        return (both[k, :, :, self._bodies[rows]] - both[k, :, :, self._others[rows]]).reshape(len(rows), 6)

    def about(self, dominant: int) -> Array:
        k = np.arange(len(self._states))
        if dominant < 0:
            return np.zeros((len(k), 6))
        own, other = self._states[k, :, self._bodies], self._states[:, :, self._place[dominant]]
        return (own - other).reshape(len(k), 6)


def massless_of(system: System, passage: Passage) -> tuple[int, ...]:
    """Return the massless body of a passage, if there is one."""
    return tuple(body for body in (passage.body, passage.other) if not system.massive[body])


def role_of(system: System, passage: Passage) -> Hashable:
    """Return what decides which equations the pair of a passage obeys: those of bodies with the same role are the same,
    as forces that name bodies act alike on both.
    """
    return tuple(_share(force, system.names[body]) for body in massless_of(system, passage) for force in system.forces)


def _share(force: Force, name: str) -> Hashable:
    """Return what a force does to a massless body: the numbers that it has for it alone, or whether it acts on it."""
    if force.bodies is None or name not in force.bodies:
        return force.bodies is None
    values = (getattr(force, field) for field in force.per_body)
    k = list(force.bodies).index(name)
    return tuple(str(value[k]) for value in values if isinstance(value, tuple))
