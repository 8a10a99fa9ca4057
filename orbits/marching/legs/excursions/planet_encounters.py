"""Encounters of massive bodies that a map on Kepler orbits cannot follow, in the blocks of a leg."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orbits.integrators.forms import Array
from orbits.kernels.search.encounters_of_planets import first_clear, first_encounter
from orbits.marching.clocks import variable_steps
from orbits.marching.legs.interruptions import Interruption, Kind, LegWatcher
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.problem import Problem
from orbits.marching.watching import kepler_passages

NOBODY = -1
"""Stands for the bodies of an encounter where a step of the map failed."""


class Encounter(NamedTuple):
    """A step of the map that is one of an encounter: its number, and the two bodies in the kernels' order."""

    number: int
    pair: tuple[int, int]


class Rules:
    """Which pairs of massive bodies the map cannot follow; see `orbits.kernels.search.encounters_of_planets`."""

    def __init__(self, problem: Problem, dominant: int) -> None:
        n = len(problem.bodies)
        gm = problem.gm[:n]
        near = kepler_passages.near_each_other(gm, dominant)
        limits = np.array([dominant, gm[dominant], 2.0 * np.pi / problem.integrator.least_steps])
        self._rules = near, np.zeros((3, n)), limits, problem.clock.h
        self._who = np.zeros(2, dtype=np.int64)

    def first_encounter(self, leg: Leg, count: int) -> tuple[int, tuple[int, int]]:
        """Return the first of `count` steps of a block that the map cannot follow, or `count`, and the two bodies."""
        step = int(first_encounter(*_path(leg, count), *self._rules, count, self._who))
        return step, (int(self._who[0]), int(self._who[1]))

    def encounter_ahead(self, leg: Leg) -> tuple[int, int] | None:
        """Return the two bodies whose encounter begins in the next step of the map, by the state of a leg alone."""
        q, v = leg.stepper.state["q"], leg.stepper.state["v"]
        # Backwards from the second state, with the opposite velocities, is forwards from the first.
        path = np.concatenate([q, v, q, -v])
        none = int(first_encounter(path, len(q), *self._rules, 1, self._who))
        return None if none else (int(self._who[0]), int(self._who[1]))

    def clear_after(self, leg: Leg, count: int) -> int:
        """Return the number of steps of a block of `count` after which the map can go on, or count + 1."""
        return int(first_clear(*_path(leg, count), *self._rules, count))


def _path(leg: Leg, count: int) -> tuple[Array, int]:
    return leg.observers.recorded(count).ravel(), len(leg.stepper.state["q"])


class Leaves(LegWatcher):
    """Ends a block of the map before a step of an encounter."""

    rules: Rules
    found: Encounter | None = None

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return the first step of the block that the map cannot follow."""
        step, pair = self.rules.first_encounter(leg, count) if count else (0, (NOBODY, NOBODY))
        if step == count:
            return None
        self.found = Encounter(leg.step + step, pair)
        return Interruption(step, Kind.ENCOUNTER)


class Clears(LegWatcher):
    """Ends a block of chosen steps after the step from which the map can go on."""

    rules: Rules

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return the first step of the block after which encounters are over."""
        if returns(leg) or not count:
            return None
        step = self.rules.clear_after(leg, count)
        return Interruption(step, Kind.ENCOUNTER) if step < count else None


def returns(own: Leg) -> bool:
    """Return whether chosen steps lead back to the map, at the next multiple of its step."""
    return bool(own.stepper.state["clock"][variable_steps.EXACT])
