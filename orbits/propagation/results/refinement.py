"""Closest approaches to the accuracy of the orbit.

The run is marched again to the step of each, and the minimum distance is found by partial steps of the method.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.clock import Clock
from orbits.marching.roots import newton
from orbits.propagation.results.passage_walks import OnePair, Pairs, PairsTogether, Walk, massless_of, role_of
from orbits.propagation.results.recording import observed_until
from orbits.results.approaches import AT_ONCE
from orbits.results.passages import Passage, Seen
from orbits.system.model import most_inner

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory


WIDER = 2.0
"""The factor by which the search interval is wider than the estimated error of a passage's time, if steps differ."""

CLOSE = 1 / 16
"""The fraction of the time before a passage, if its step is unknown, in which one step leads through the pericentre:
0.03 of distance / speed there, a tenth of the steps that are chosen, and longer than the error of the recorded time."""

MOST_NUMBERS = 2**22
"""The most numbers of the states of passages that are refined together, 32 MB."""


def refine(trajectory: Trajectory, seen: Seen, numbers: Iterable[int]) -> None:
    """Refine distance, time, speed and states of some passages to the accuracy of the orbit.

    The massive bodies are marched from the preceding sample; if that lies between steps, the partial step to it is
    taken back. Massless ones are marched along unless the states of their passages were recorded. Where a partial step
    follows from the state at its beginning alone, those of all passages are taken together, in compiled code. A passage
    up to which the bodies cannot be marched again, as they meet there, say, stays as it was recorded: its number goes
    to `seen.estimated`. What is not reached, as the work is interrupted, is refined when it is asked for again.
    """
    numbers = {k: None for k in numbers if k not in seen.refined}
    if not numbers:
        return
    seen.errors = {k: error for k, error in seen.errors.items() if k not in numbers}
    times = np.abs(trajectory.times)
    starts: dict[int, list[int]] = {}
    for k in numbers:
        before = int(np.searchsorted(times, abs(trajectory.clock.time(seen.passages[k].step)), side="right")) - 1
        while before >= 0 and trajectory.excursions.include(times[before] / abs(trajectory.clock.h)):
            before -= 1  # from where the bodies left the map as in the run
        starts.setdefault(before, []).append(k)
    for sample, ones in starts.items():
        seen.estimated.update(ones)
        left = _together(trajectory, seen, sample, ones) if _steps_follow_from_states(trajectory) else ones
        for some in _parts(sorted(left, key=lambda k: abs(seen.passages[k].step)), AT_ONCE):
            bodies = {body for k in some for body in (seen.passages[k].body, seen.passages[k].other)}
            with suppress(IntegrationError):  # the run failed here
                walk = Walk(trajectory, sample, sorted(bodies))
                for k in some:
                    passage = seen.passages[k]
                    walk.to(passage.step)
                    chosen = walk.chooses(passage.step)
                    _keep(seen, [k], _refined(OnePair(walk, passage), trajectory, seen, [passage], chosen))
        seen.refined.update(ones)


def _steps_follow_from_states(trajectory: Trajectory) -> bool:
    """Return whether a step of massless bodies follows from the state of all at its beginning, as does one of massive
    bodies without any weight: not if forces have variables of their own, or a map treats encounters on its own.
    """
    clock = trajectory.clock
    own = most_inner(trajectory.system) > 0 or trajectory.integrator.follows_kepler
    return not own and (isinstance(clock, Adaptive) or not clock.changes)


def _together(trajectory: Trajectory, seen: Seen, sample: int, numbers: list[int]) -> list[int]:
    """Refine passages after a sample together; return those that remain: where a march or a step fails, or bodies do
    not approach each other any more at what was taken for the beginning.
    """
    system, clock = trajectory.system, trajectory.clock
    passages = {k: _begun_close(seen.passages[k], clock) for k in numbers}
    order = sorted(numbers, key=lambda k: abs(passages[k].step))
    unknown = [k for k in order if passages[k].state is None and massless_of(system, passages[k])]
    left: list[int] = []
    for group in ([k for k in order if k not in set(unknown)], *_parts(unknown, AT_ONCE)):
        light = sorted({body for k in group for body in massless_of(system, passages[k]) if passages[k].state is None})
        walk = None
        for some in _parts(group, max(AT_ONCE, MOST_NUMBERS // (6 * len(light) + 6 * int(system.massive.sum())))):
            try:
                walk = walk or Walk(trajectory, sample, light)
                states = walk.states(np.array([passages[k].step for k in some]))
            except IntegrationError:
                left += some
                continue
            roles = [role_of(system, passages[k]) for k in some]
            kinds = [(role, bool(massless_of(system, passages[k]))) for role, k in zip(roles, some, strict=True)]
            for kind in dict.fromkeys(kinds):
                rows = [row for row, own in enumerate(kinds) if own == kind]
                these = [some[row] for row in rows]
                own = [passages[k] for k in these]
                pairs = PairsTogether(trajectory, own, walk.bodies, *(x[rows] for x in states))
                try:
                    found = _refined(pairs, trajectory, seen, own, clock.changes)
                except IntegrationError:
                    left += these
                    continue
                late = [one.state is None and _recedes(new, clock) for one, new in zip(own, found, strict=True)]
                left += [k for k, is_late in zip(these, late, strict=True) if is_late]
                good = [row for row, is_late in enumerate(late) if not is_late]
                _keep(seen, [these[row] for row in good], [found[row] for row in good])
    return left


def _parts(numbers: list[int], most: int) -> list[list[int]]:
    return [numbers[i : i + most] for i in range(0, len(numbers), most)]


def _keep(seen: Seen, numbers: Sequence[int], found: Sequence[Passage]) -> None:
    """Replace passages by what was found, if it is known."""
    for k, one in zip(numbers, found, strict=True):
        if math.isfinite(one.distance) and math.isfinite(one.speed):
            if seen.passages[k].state is not None:
                seen.recorded.setdefault(k, seen.passages[k])
            seen.passages[k] = one
            seen.estimated.discard(k)
            seen.refined.add(k)


def _begun_close(passage: Passage, clock: Clock) -> Passage:
    """Return a passage with a beginning so close that one step leads through it, if that of its step is unknown."""
    if passage.state is not None or not clock.changes:
        return passage
    return replace(passage, step=passage.steps - CLOSE * (passage.steps - passage.step))


def _recedes(passage: Passage, clock: Clock) -> bool:
    """Return whether two bodies leave each other already at the beginning of the step of their passage."""
    assert passage.state is not None
    return passage.steps != passage.step and float(passage.state[:3] @ passage.state[3:]) * clock.direction > 0.0


def _refined(
    pairs: Pairs, trajectory: Trajectory, seen: Seen, passages: Sequence[Passage], chosen: bool
) -> list[Passage]:
    """Return passages with the minimum distance of their pairs; chosen : whether steps are chosen one by one there."""
    clock, count = trajectory.clock, len(passages)
    begin, when = (np.array([getattr(one, name) for one in passages]) for name in ("step", "steps"))
    state, about = pairs.apart(np.arange(count), np.zeros(count)), pairs.about(seen.dominant)
    # At the start or end of the run, or exactly at a step, the state is that of the passage.
    part, distance, speed = np.zeros(count), *(np.linalg.norm(state[:, k : k + 3], axis=1) for k in (0, 3))
    rows = np.flatnonzero(when != begin)
    end = observed_until(trajectory)
    last = seen.end if clock.changes else abs(end / clock.h)
    ahead, limit = (when - begin)[rows], last - begin[rows]
    if chosen:
        unit = 1.0 if clock.changes else clock.h
        length = _lengths(pairs, rows, unit * ahead, unit * limit)
        guess, high, scale = unit * ahead / length, np.ones(len(rows)), length / unit
    else:
        length, high = np.full(len(rows), clock.h), np.where(begin[rows] == seen.end, limit, 1.0)
        guess, scale = np.minimum(ahead, high), np.ones(len(rows))
    mu = np.array([seen.gm(passages[row]) for row in rows.tolist()])
    part[rows], distance[rows], speed[rows] = _least(pairs, rows, mu, length, guess, high)
    part[rows] *= scale
    values = zip(passages, (begin + part).tolist(), distance.tolist(), speed.tolist(), state, about, strict=True)
    return [Passage(one.body, one.other, one.step, *found) for one, *found in values]


def _lengths(pairs: Pairs, rows: NDArray[np.intp], guess: Array, limit: Array) -> Array:
    """Return the lengths of steps to beyond the minimum distance of pairs, or to the end of the run."""

    def shorter(length: Array, limit: Array) -> Array:
        return np.where(np.abs(limit) < np.abs(length), limit, length)

    length = shorter(WIDER * guess, limit)
    left = np.flatnonzero(np.abs(length) < np.abs(limit))
    while len(left):
        state = pairs.apart(rows[left], length[left])
        left = left[(state[:, :3] * state[:, 3:]).sum(axis=1) * length[left] < 0.0]
        length[left] = shorter(WIDER * length[left], limit[left])
        left = left[np.abs(length[left]) < np.abs(limit[left])]
    return length


def _least(pairs: Pairs, rows: NDArray[np.intp], mu: Array, h: Array, part: Array, end: Array) -> tuple[Array, ...]:
    """Return the parts of steps h at which the distances of some pairs are least, these, and the relative speeds there,
    by Newton's method on r.v with the acceleration of the pair alone.

    part : of the step at which to begin
    end : the part of the step that belongs to the run; the minimum is there if the two still approach each other
    """
    state = np.zeros((len(rows), 6))

    def falls(part: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        state[which] = found = pairs.apart(rows[which], part * h[which])
        x, w = found[:, :3], found[:, 3:]
        r2, fall = (x * x).sum(axis=1), (x * w).sum(axis=1) * h[which]
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(r2 > 0.0, (w * w).sum(axis=1) - mu[which] / np.sqrt(r2), 0.0) * h[which] ** 2
        return fall, slope

    part, _ = newton(falls, np.zeros(len(rows)), end, part)
    return part, *(np.linalg.norm(state[:, k : k + 3], axis=1) for k in (0, 3))
