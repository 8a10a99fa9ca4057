"""Closest approaches to the accuracy of the orbit.

The run is marched again to the step of each, and the minimum distance is found by partial steps of the method.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.base import Integrator
from orbits.marching.adaptive import Adaptive
from orbits.marching.clocks import Clock, Place
from orbits.marching.handing_over import METHOD
from orbits.propagation.marchers import march_of
from orbits.propagation.passages_seen import Passage, Seen
from orbits.system.model import continued, model, most_inner
from orbits.trajectory.work import accounts_of

if TYPE_CHECKING:
    from orbits.marching.marcher import Marcher
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

PRECISION = 1e-13
"""The time of a pericentre has converged when it changes by less than this, in steps."""

ROUNDS = 60

WIDER = 2.0
"""The factor by which the search interval is wider than the estimated error of a passage's time, if steps differ."""


def refine(trajectory: Trajectory, seen: Seen, numbers: Sequence[int]) -> None:
    """Refine distance, time, speed and states of some passages to the accuracy of the orbit.

    The massive bodies and the massless ones concerned are marched from the preceding sample. If that sample lies
    between steps, a partial step leads back to the grid. A passage up to which they cannot be marched again, as they
    meet a body there, say, stays as it was recorded: its number goes to `seen.estimated`.
    """
    numbers = [k for k in numbers if k not in seen.refined]
    seen.refined.update(numbers)
    seen.errors = {k: error for k, error in seen.errors.items() if k not in seen.refined}
    times = np.abs(trajectory.times)
    starts: dict[int, list[int]] = {}
    for k in sorted(numbers, key=lambda k: abs(seen.passages[k].step)):
        before = int(np.searchsorted(times, abs(trajectory.clock.time(seen.passages[k].step)), side="right")) - 1
        starts.setdefault(before, []).append(k)
    for sample, ones in starts.items():
        bodies = [seen.passages[k].body for k in ones] + [seen.passages[k].other for k in ones]
        seen.estimated.update(ones)
        with suppress(IntegrationError):  # the run failed here
            walk = _Walk(trajectory, sample, sorted(set(bodies)))
            for k in ones:
                found = _refined(walk, seen, seen.passages[k], trajectory.clock)
                if math.isfinite(found.distance) and math.isfinite(found.speed):
                    seen.passages[k] = found
                    seen.estimated.discard(k)


class _Walk:
    """A march of massive and some massless bodies along the steps of a run, from a sample or (-1) its start."""

    def __init__(self, trajectory: Trajectory, sample: int, bodies: Sequence[int]) -> None:
        system = trajectory.system
        q, v, time = _state(trajectory, sample)
        self._massive = system.massive
        self.end = trajectory.reached if trajectory.complete else trajectory.last_time
        wanted = self._massive.copy()
        wanted[list(bodies)] = True
        self._bodies = np.flatnonzero(wanted)
        step, rest = trajectory.clock.place(time)
        self.step: float = step + (rest != 0.0)
        self._clock = trajectory.clock
        self._integrator, self._system = trajectory.integrator, system
        if most_inner(system) and sample >= 0:
            self._system = continued(system, accounts_of(trajectory)[sample])
        self._excursions = trajectory.excursions
        self.marcher = self._bound(self._bodies, q[wanted], v[wanted], time)
        if self._clock.changes:
            self._begun = self.step = time
        elif rest != 0.0:
            at = self._clock.time(self.step)
            state = self.marcher.state_after(self._clock.h - rest)
            self._continue()
            self.marcher = self._bound(self._bodies, *state, at)
        self._first, self._place = int(self.step) if not self._clock.changes else 0, Place(0, 0.0)

    def to(self, step: float) -> None:
        """March on to the beginning of a step, given by the reading of the clock, which must lie ahead."""
        if self._clock.changes:
            self.step = step
            self.marcher.advance_to(Place(0, step - self._begun))
            return
        # Passages between two steps, of bodies that took chosen ones there, have their state within a step.
        self._place = Place(math.floor(step) - self._first, (step - math.floor(step)) * self._clock.h)
        self.marcher.advance_to(self._place)
        self.step = step

    def chooses(self, step: float) -> bool:
        """Return whether steps are chosen there one by one, as on an excursion from a map."""
        return self._clock.changes or self._excursions.include(step)

    def pair(self, *pair: int) -> _Pair:
        """Return the massive bodies together with a pair of bodies, in their present state."""
        wanted = self._massive.copy()
        wanted[list(pair)] = True
        there = wanted[self._bodies]
        q, v = self._state()
        self._continue()
        bodies = self._bodies[there]
        start = float(self._clock.time(self.step))
        if self.chooses(self.step) and not self._clock.changes:
            chosen = METHOD, Adaptive().towards(self._clock.direction)
            return _Pair(self._bound(bodies, q[there], v[there], start, *chosen), bodies)
        return _Pair(self._bound(bodies, q[there], v[there], start), bodies)

    def _continue(self) -> None:
        """Give forces the internal variables that they have at the state returned last."""
        if most_inner(self._system):
            names = [self._system.names[i] for i in self._bodies]
            self._system = continued(self._system, self.marcher.accounts(), names)

    def _state(self) -> tuple[Array, Array]:
        place = Place(0, self.step - self._begun) if self._clock.changes else self._place
        return self.marcher.state_at(place)

    def _bound(
        self,
        bodies: NDArray[np.intp],
        q: Array,
        v: Array,
        start: float,
        integrator: Integrator | None = None,
        clock: Clock | None = None,
    ) -> Marcher:
        # All massive bodies are included, so the model of the run applies.
        values = self._system.values._replace(gm=self._system.values.gm[bodies], q=q, v=v)
        how = integrator or self._integrator, clock or self._clock
        return march_of(values, *how, model(self._system, bodies), start=start, underway=True)


class _Pair:
    """The massive bodies, and the massless ones of a pair, at the beginning of a step."""

    def __init__(self, marcher: Marcher, bodies: NDArray[np.intp]) -> None:
        self._marcher, self._rows = marcher, {int(body): row for row, body in enumerate(bodies)}

    def relative(self, body: int, other: int, offset: float = 0.0) -> Array:
        """Return position and velocity of a body relative to another one, (6,), after a partial step from here."""
        q, v = self._marcher.state_after(offset)
        i, j = self._rows[body], self._rows[other]
        return np.concatenate([q[i] - q[j], v[i] - v[j]])


class _Least(NamedTuple):
    part: float
    distance: float
    speed: float


def _refined(walk: _Walk, seen: Seen, passage: Passage, clock: Clock) -> Passage:
    walk.to(passage.step)
    body, other = passage.body, passage.other
    pair = walk.pair(body, other)
    state = pair.relative(body, other)
    about = pair.relative(body, seen.dominant) if seen.dominant >= 0 and body != seen.dominant else np.zeros(6)
    if passage.steps == passage.step:  # at the start or end of the run, or exactly at a step
        least = _Least(0.0, float(np.linalg.norm(state[:3])), float(np.linalg.norm(state[3:])))
    elif walk.chooses(passage.step):
        unit = 1.0 if clock.changes else clock.h
        last = seen.end if clock.changes else abs(walk.end / clock.h)
        guess, end = unit * (passage.steps - passage.step), unit * (last - passage.step)
        length = min(WIDER * guess, end, key=abs)
        while abs(length) < abs(end) and _approach_still(pair, passage, length):
            length = min(WIDER * length, end, key=abs)
        least = _least(pair, passage, seen.gm(passage), length, guess / length, 1.0)
        least = least._replace(part=least.part * length / unit)
    else:
        end = abs(walk.end / clock.h) - passage.step if passage.step == seen.end else 1.0
        least = _least(pair, passage, seen.gm(passage), clock.h, min(passage.steps - passage.step, end), end)
    when = passage.step + least.part
    return Passage(body, other, passage.step, when, least.distance, least.speed, state=state, about=about)


def _approach_still(pair: _Pair, passage: Passage, offset: float) -> bool:
    """Return whether two bodies still approach each other after a partial step."""
    state = pair.relative(passage.body, passage.other, offset)
    return float(state[:3] @ state[3:]) * offset < 0.0


def _least(pair: _Pair, passage: Passage, mu: float, h: float, part: float, end: float) -> _Least:
    """Return the minimum distance within a step, by Newton's method on r.v with the acceleration of the pair alone.

    part : of the step at which to begin
    end : the part of the step that belongs to the run; the minimum is there if the two still approach each other
    """
    low, high = 0.0, end
    x = w = np.zeros(3)
    for _ in range(ROUNDS):
        state = pair.relative(passage.body, passage.other, part * h)
        x, w = state[:3], state[3:]
        r2, fall = float(x @ x), float(x @ w) * h
        if fall < 0.0:
            low = part
        else:
            high = part
        slope = (float(w @ w) - mu / math.sqrt(r2)) * h * h if r2 > 0.0 else 0.0
        after = part - fall / slope if slope > 0.0 else 0.5 * (low + high)
        if abs(after - part) <= PRECISION or r2 == 0.0:
            break
        if not low < after < high:
            after = 0.5 * (low + high)
        if high - low <= PRECISION:
            break
        part = after
    return _Least(part, float(np.linalg.norm(x)), float(np.linalg.norm(w)))


def _state(trajectory: Trajectory, sample: int) -> tuple[Array, Array, float]:
    """Return q and v, (bodies, 3), and the time of a sample, or (-1) of the start of the run."""
    if sample < 0:
        return trajectory.system.values.q, trajectory.system.values.v, 0.0
    q, v = trajectory.sample(sample)
    return q, v, float(trajectory.times[sample])
