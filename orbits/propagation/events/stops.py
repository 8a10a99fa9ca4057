"""Distances at which a run ends, found where the march stops as a pair of bodies may come to one within a step.

Compiled code looks at all pairs after each block, and only excludes (`orbits.kernels.search.stopping`); in a step that
is left, see `orbits.marching.first_passage`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.body_names import index_of
from orbits.errors import InputError
from orbits.kernels.search.stopping import ANY, CLOSER, FARTHER, KIND
from orbits.marching.first_passage import Within, may_pass, rounding_of
from orbits.propagation.events.base import STOP, Array, Bound, Found, Sample, Sought, Whole
from orbits.propagation.events.kinds.of_pairs import Distance

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.system import System


class Stops:
    """The pairs of bodies whose distances end a run.

    bounds : the functions, by their numbers
    sought : (kind, first body, second body) of each, with `ANY` for a body without a name

    rows : as the march looks for them, (functions, 4); see `orbits.kernels.search.stopping`
    """

    def __init__(self, bounds: Mapping[int, Distance], sought: Mapping[int, tuple[int, int, int]]) -> None:
        self.bounds = bounds
        rows = [[*sought[k], bound.distance * bound.distance] for k, bound in bounds.items()]
        self.rows = np.array(rows, dtype=np.float64)

    def may_end(self, marcher: Legs, end: Sample) -> bool:
        """Return whether a pair may pass its bound between the state of the march and another."""
        within = _up_to(marcher, end)
        return any(_may_reach(within, 0.0, bound).any() for bound in self.bounds.values())

    def first(self, marcher: Legs, end: Sample, known: float) -> Found | None:
        """Return where a pair first passes its bound between the state of the march and another, less than a step
        ahead; None if none does. A pair that begins a run at its bound must have left it before.

        known : the time up to which this is known, in the direction of the run
        """
        begun, within, found = marcher.time, _up_to(marcher, end), list[Found]()
        passed = (known - begun * math.copysign(1.0, within.length)) / abs(within.length)
        start = min(max(passed, 0.0), 1.0)
        q, _ = within.state(0.0)
        for (number, bound), kind in zip(self.bounds.items(), self.rows[:, KIND], strict=True):
            how: dict[str, Any] = {"sign": 1.0 if kind == CLOSER else -1.0, "part": (start, 1.0)}
            for column in np.flatnonzero(_may_reach(within, start, bound)):
                one, other = pair = bound.pairs[column]
                noise = rounding_of(bound.distance, q[pair])
                is_at_bound = abs(float(np.linalg.norm(q[one] - q[other])) - bound.distance) <= noise
                waits = begun == start == 0.0 and is_at_bound
                part = within.first_passage(one, other, bound.distance, noise=noise, waits=waits, **how)
                if part is not None:
                    time, rising = begun + part * within.length, bound.words[0] is None
                    found.append(Found(number, int(column), rising, 0, time))
        return min(found, key=lambda one: abs(one.time - begun), default=None)


def _up_to(marcher: Legs, end: Sample) -> Within:
    """Return the motion of all bodies from the state of a march to another."""
    begun = marcher.time
    length = end.time - begun
    return Within(length, marcher.state_after(0.0), (end.q, end.v), lambda part: marcher.state_after(part * length))


def _may_reach(within: Within, start: float, bound: Distance) -> Array:
    """Return which pairs may come to their bound from a part of a step on, by their ways at most."""
    if start == 1.0:
        return np.zeros(len(bound.pairs), dtype=bool)
    first, second = bound.pairs.T
    states = np.array([within.state(part) for part in (start, 1.0)])
    distances, speeds = np.linalg.norm(states[:, :, first] - states[:, :, second], axis=3).swapaxes(0, 1)
    return may_pass(distances, speeds, within.length * (1.0 - start), bound.distance)


def stops_of(
    system: System, events: Sequence[Sought], bounds: Sequence[Bound], direction: float, alone: bool
) -> Stops | None:
    """Return the distances at which a run ends, as far as one of the bodies has mass; None without any. Their functions
    get all pairs of bodies, and the words of what is met in the direction of the run.

    bounds : the functions, and `events` those to which they belong
    alone : whether the run has neither collisions nor events that act, beside which these are sought like all others

    Raises InputError for distances that would end a run backwards in time where they are met forwards.
    """
    known: dict[int, Distance] = {}
    sought: dict[int, tuple[int, int, int]] = {}
    for k, (bound, event) in enumerate(zip(bounds, events, strict=True)):
        if not isinstance(bound, Distance) or event.then != STOP:
            continue
        given = event.given()
        one, two = (ANY if given[x] is None else index_of(given[x], system.names) for x in ("body", "other"))
        pairs = _pairs_that_stop(system, one, two) if alone else np.empty((0, 2), dtype=np.int64)
        if len(pairs):
            sought[k] = CLOSER if bound.words[0] else FARTHER, one, two
            known[k], bound.pairs = bound, pairs
            if direction < 0.0:
                bound.words = bound.words[::-1]
        elif direction < 0.0:
            raise InputError(
                f"{type(event).__name__}(then='stop') in a run backwards in time: expected a body with mass among "
                "the two, and no collisions or events that act beside it. Use then='record', or run forwards."
            )
    return Stops(known, sought) if known else None


def _pairs_that_stop(system: System, one: int, two: int) -> Whole:
    """Return the pairs of bodies, one of them with mass, that two numbers mean, (pairs, 2); `ANY` for any body."""
    massive, everyone = np.flatnonzero(system.massive), np.arange(len(system))
    if ANY not in (one, two):
        return np.array([[one, two]] if system.massive[[one, two]].any() else [], dtype=np.intp).reshape(-1, 2)
    one, two = (one, two) if one != ANY else (two, one)
    if one == ANY:
        first, second = np.repeat(everyone, len(massive)), np.tile(massive, len(everyone))
        once = ~system.massive[first] | (first < second)
        first, second = first[once], second[once]
    else:
        others = everyone if two == ANY and system.massive[one] else massive if two == ANY else np.array([two])
        first, second = np.full(len(others), one), others
    wanted = (first != second) & (system.massive[first] | system.massive[second])
    first, second = first[wanted], second[wanted]
    gm = system.values.gm
    lighter = gm[first] <= gm[second]
    return np.stack([np.where(lighter, first, second), np.where(lighter, second, first)], axis=1)
