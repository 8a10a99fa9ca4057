"""Closest approaches as good as the orbit: the run is marched again to the step of each, and its own partial steps say
where the distance is least.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.propagation.binding import march_of
from orbits.propagation.passages_seen import Passage, Seen
from orbits.system.model import model
from orbits.time_grid import split

if TYPE_CHECKING:
    from orbits.marching.marcher import Marcher
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

PRECISION = 1e-13
"""Change of the time of a pericentre, in steps, at which it is known."""

ROUNDS = 60


def refine(trajectory: Trajectory, seen: Seen, numbers: Sequence[int]) -> None:
    """Make distance, time, speed and states of some passages as good as the orbit of the run.

    The massive bodies, with the massless ones concerned, are marched from the sample before: one at a step, or one
    between steps, from which a partial step leads back to the grid.
    """
    numbers = [k for k in numbers if k not in seen.refined]
    seen.refined.update(numbers)
    seen.errors = {k: error for k, error in seen.errors.items() if k not in seen.refined}
    h, times = trajectory.step, np.abs(trajectory.times)
    starts: dict[int, list[int]] = {}
    for k in sorted(numbers, key=lambda k: seen.passages[k].step):
        before = int(np.searchsorted(times, seen.passages[k].step * abs(h), side="right")) - 1
        starts.setdefault(before, []).append(k)
    for sample, ones in starts.items():
        bodies = [seen.passages[k].body for k in ones] + [seen.passages[k].other for k in ones]
        with suppress(IntegrationError):  # the run failed here; what was recorded has to do
            walk = _Walk(trajectory, sample, sorted(set(bodies)))
            for k in ones:
                seen.passages[k] = _refined(walk, seen, seen.passages[k], h)


class _Walk:
    """The march of the massive bodies and some massless ones from a sample (-1: the start) along the steps of a run."""

    def __init__(self, trajectory: Trajectory, sample: int, bodies: Sequence[int]) -> None:
        system, h = trajectory.system, trajectory.step
        q, v, time = _state(trajectory, sample)
        self._massive, self._h = system.massive, h
        self.end = float(trajectory.times[-1]) if len(trajectory) else 0.0
        wanted = self._massive.copy()
        wanted[list(bodies)] = True
        self._bodies = np.flatnonzero(wanted)
        (step,), (rest,) = split(np.array([time]), h)
        self.step = int(step) + (rest != 0.0)
        self._integrator, self._system = trajectory.integrator, system
        self.marcher = self._bound(self._bodies, q[wanted], v[wanted], time)
        if rest != 0.0:
            self.marcher = self._bound(self._bodies, *self.marcher.state_after(h - rest), self.step * h)

    def to(self, step: int) -> None:
        """March on to a step that is not behind."""
        while self.step < step:
            count = min(self.marcher.block, step - self.step)
            self.marcher.advance(count)
            self.step += count

    def pair(self, *pair: int) -> _Pair:
        """Return the massive bodies with a pair of bodies alone, as they are here."""
        wanted = self._massive.copy()
        wanted[list(pair)] = True
        there = wanted[self._bodies]
        q, v = self.marcher.state()
        bodies = self._bodies[there]
        return _Pair(self._bound(bodies, q[there], v[there], self.step * self._h), bodies)

    def _bound(self, bodies: NDArray[np.intp], q: Array, v: Array, start: float) -> Marcher:
        # All massive bodies are among them, so that the model is that of the run.
        values = self._system.values._replace(gm=self._system.values.gm[bodies], q=q, v=v)
        return march_of(values, self._integrator, self._h, model(self._system, bodies), start=start)


class _Pair:
    """The massive bodies, and the massless ones of a pair, at the beginning of a step."""

    def __init__(self, marcher: Marcher, bodies: NDArray[np.intp]) -> None:
        self._marcher, self._rows = marcher, {int(body): row for row, body in enumerate(bodies)}

    def relative(self, body: int, other: int, offset: float = 0.0) -> Array:
        """Return position and velocity of a body relative to another one, (6,), a partial step from here."""
        q, v = self._marcher.state_after(offset)
        i, j = self._rows[body], self._rows[other]
        return np.concatenate([q[i] - q[j], v[i] - v[j]])


class _Least(NamedTuple):
    part: float
    distance: float
    speed: float


def _refined(walk: _Walk, seen: Seen, passage: Passage, h: float) -> Passage:
    walk.to(passage.step)
    body, other = passage.body, passage.other
    pair = walk.pair(body, other)
    state = pair.relative(body, other)
    about = pair.relative(body, seen.dominant) if seen.dominant >= 0 and body != seen.dominant else np.zeros(6)
    if passage.steps == passage.step:  # where the run begins or ends, or to the bit at a step
        least = _Least(0.0, float(np.linalg.norm(state[:3])), float(np.linalg.norm(state[3:])))
    else:
        end = abs(walk.end / h) - passage.step
        least = _least(pair, passage, seen.gm(passage), h, end if passage.step == seen.steps else 1.0)
    return Passage(
        body, other, passage.step, passage.step + least.part, least.distance, least.speed, state=state, about=about
    )


def _least(pair: _Pair, passage: Passage, mu: float, h: float, end: float) -> _Least:
    """Return where in a step the distance is least: Newton's method on r.v, with the acceleration of the pair alone.

    end : part of the step that there is; where the two still approach each other there, it is the least
    """
    low, high, part = 0.0, end, min(passage.steps - passage.step, end)
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
    """Return q and v, (bodies, 3), and the time of a sample, or of the start of the run for -1."""
    if sample < 0:
        return trajectory.system.values.q, trajectory.system.values.v, 0.0
    q, v = trajectory.sample(sample)
    return q, v, float(trajectory.times[sample])
