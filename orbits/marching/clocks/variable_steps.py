"""Clocks whose steps differ in length: what they share.

The steps depend on the state alone, not on the samples: a march stops before the step that would pass its goal, and a
sample is computed on a copy, whose last step ends at the goal.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import InputError, IntegrationError, SingularityError
from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form, coefficients_of
from orbits.kernels.compile import kernel
from orbits.kernels.dense import times_reached
from orbits.kernels.lanes import WIDTH, load, store
from orbits.marching.clocks.clock import OWN, Clock
from orbits.marching.clocks.step_times import UNLIMITED, Ahead, Behind, Place, Places, StepTimes, Way

TIME, TIME_LO, LENGTH, DIRECTION, LIMIT, EXACT, ORIGIN, NEXT = 0, 1, 2, 6, 7, 8, 9, 10
"""The state of such a clock: the time reached, in doubled precision; the last step; the direction 1 or -1; the time
limit; whether a step ends at the limit (1) or the march stops before it (0); the time at which the block began; and the
time at which a step would end that was refused by the limit, or the time reached. Numbers 3 to 5 are the clock's own.
"""

NUMBERS = 11

OF_BODIES = "q", "q_lo", "v", "v_lo", "memory", "clock"
"""The arrays of a leg that are of its massive bodies."""

FARTHEST = sys.float_info.max
"""The time limit of a march without a goal: finite, as all that archives hold."""


def since(block: int) -> int:
    """Return the place in the workspace of the time that terms and forces see when the clock reads 0."""
    return 3 * (block + 1)


@kernel(inline=True)
def step_of(clock, k):
    """Return the time at which step k of a block began, and its length."""
    return clock.numbers[ORIGIN] + clock.room[k], clock.room[k + 1] - clock.room[k]


@kernel(inline=True)
def keep(room, at, state, carry):
    """Copy the state and carry into `room`, starting at `at`."""
    for x in (state.q, state.q_lo, state.p, state.p_lo):
        for k in range(0, x.shape[0], WIDTH):
            store(room, at + k, load(x, k))
        at += x.shape[0]
    for row in range(carry.shape[0]):
        store(room, at + WIDTH * row, load(carry, row))


@kernel(inline=True)
def put_back(room, at, state, carry):
    """Restore the state and carry from `room`, starting at `at`."""
    for x in (state.q, state.q_lo, state.p, state.p_lo):
        for k in range(0, x.shape[0], WIDTH):
            store(x, k, load(room, at + k))
        at += x.shape[0]
    for row in range(carry.shape[0]):
        store(carry, row, load(room, at + WIDTH * row))


def is_number(x: object) -> bool:
    """Return whether x is a real number: not a text, nor True or False."""
    return isinstance(x, int | float | np.floating) and not isinstance(x, bool | str)


class ChangingSteps(Clock):
    """Base of clocks whose steps differ in length: their readings are times. They resolve passages by themselves."""

    changes: ClassVar[bool] = True
    passage_limits: ClassVar[tuple[float, float, float] | None] = math.inf, 1.0, math.inf
    particle_steps: ClassVar[str] = OWN

    @property
    def h(self) -> float:  # type: ignore[override]
        """NaN: the steps have no common length."""
        return math.nan

    def failure(
        self, status: int, integrator: Integrator, names: Sequence[str], *, momenta: bool, forces: bool
    ) -> tuple[type[IntegrationError], str] | None:
        """Return the error for steps none of which is short enough."""
        return SingularityError, (
            f"no step is short enough to go on: {' and '.join(names) or 'bodies'} meet there, or their accelerations "
            "are out of the range of floats. Use softening, end the run before with "
            "stop=orbits.events.CloserThan(...), or give radii and seek events=orbits.events.Collision(...)."
            + momenta * " Or a term adds as much as m v to the momenta there, which needs orbits.march."
            + forces * " Or a force jumps there, which no polynomial follows: give dt=..."
        )

    @staticmethod
    def check_particles(forces: Sequence[BoundForce], *, all_given: bool) -> None:
        """Raise InputError for forces whose internal variables are unknown in particles' own steps, and for bodies that
        are integrated beside given ones.
        """
        spinning = [force.name for force in forces if len(force.inner)]
        if spinning:
            raise InputError(
                f"massless particles take steps of their own, in which the internal variables of {spinning[0]}, such "
                "as a spin, are not known: give dt=... a length, or the particles a small mass."
            )
        if not all_given:
            raise InputError(
                "massless bodies take steps of their own among bodies of an ephemeris, but not if others with a mass "
                "are integrated along: give dt=..., or set the GM of these to 0."
            )

    def to_be_judged(self, record: Any) -> None:
        """Return None: steps that are chosen resolve all passages."""
        return

    def coefficients(self, form: Form) -> Any:
        """Return coefficients, which are written before each step."""
        return coefficients_of(form, 1.0).copy()

    def are_readings(self, steps: Array, when: Array, taken: int) -> bool:
        """Return whether the second times do not lie before the first."""
        return bool(((when - steps) * self.direction >= 0.0).all())

    def towards(self, direction: float) -> Self:
        """Return this clock for a run in a direction, 1 or -1."""
        sign = math.copysign(1.0, direction)
        if sign == self.direction:
            return self
        clock: Self = replace(self)  # type: ignore[type-var]
        object.__setattr__(clock, "direction", sign)
        return clock

    def numbers_for(self, integrator: Any) -> Array:
        """Return the state of the clock at the start of a march by a method whose steps it can choose."""
        numbers = np.zeros(NUMBERS)
        numbers[DIRECTION], numbers[LIMIT] = self.direction, math.copysign(FARTHEST, self.direction)
        return numbers

    def step_times(self, start: float) -> ChosenTimes:
        """Return what tells a leg when its steps are; start : the time that terms and forces see when it reads 0."""
        return ChosenTimes(self, start)

    def array(self, integrator: Any, *, alone: bool, given: bool) -> dict[str, Array]:
        """Return the array of the state of the clock, by its name, that a leg changes and archives have."""
        return {"clock": self.numbers_for(integrator)}

    def begun_within(self, step: int, time: float) -> tuple[Clock, float, int]:
        """Return the steps that are chosen from there on."""
        return self, time, step

    def room(self, block: int, size: int) -> int:
        """Return the length of the workspace: the times of a block since its beginning, the lengths of its steps, the
        times at which they begin for terms and forces, that which these see when the clock reads 0, and the state
        before a step.
        """
        return since(block) + 1 + size

    def time(self, reading: Any) -> Any:
        """Return the time that this clock reads: a time is its own reading."""
        return reading * 1.0

    def place(self, time: float | Fraction) -> Place:
        """Return the place of a time: no whole steps, as they are not known beforehand."""
        return Place(0, float(time))

    def places(self, times: ArrayLike) -> Places:
        """Return the places of times: no whole steps, and the times."""
        rest = np.asarray(times, dtype=np.float64)
        return Places(np.zeros(rest.shape, dtype=np.int64), rest)


class ChosenTimes(StepTimes):
    """When steps that are chosen one by one are: their readings are times, in the array `clock` of the leg's state."""

    clock: ChangingSteps
    _now: Array

    def bind(self, state: Mapping[str, Array], room: Array, block: int) -> None:
        """Take the arrays of the leg; room : the workspace of the clock for blocks of `block` steps."""
        self._now, self._room, self._block = state["clock"], room, block
        room[since(block)] = self.start
        self._begun, self._lengths, self._lows = np.zeros(2), np.zeros(0), np.zeros(0)

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return float(self._now[TIME])

    @property
    def reading(self) -> float:
        """The reading of the clock: the time."""
        return self.time

    def numbers(self, state: Mapping[str, Array], clock: Clock) -> Array:
        """Return the state of the clock in a state, for a block that begins there."""
        now = state["clock"]
        now[ORIGIN], self._begun_lo = now[TIME], float(now[TIME_LO])
        return now

    def pace(self, numbers: Array) -> tuple[float, float]:
        """Return the length of the last step, or of about a step, and the time at which the block began."""
        return float(numbers[LENGTH] or self.clock.direction), float(numbers[ORIGIN])

    def failed_at(self, numbers: Array, done: int) -> float:
        """Return the time at which a step began that failed."""
        return float(numbers[TIME])

    def aim(self, place: Place) -> None:
        """Let the next blocks lead up to a place: no step passes this time."""
        self._now[LIMIT] = place.rest

    def most(self, place: Place) -> int:
        """Return 0 if there are no whole steps left before a place; nobody knows how many there may be."""
        now, goal = self._now, place.rest
        if goal == now[TIME] or (self.arrived and now[LIMIT] == goal):
            return 0
        return UNLIMITED if (goal - now[NEXT]) * self.clock.direction >= 0.0 else 0

    def note(self, count: int, numbers: Array) -> None:
        """Take note of a block of `count` steps, and of its lengths: copies of the leg use the same workspace."""
        self._begun[:] = numbers[ORIGIN], self._begun_lo
        self._lengths, self._lows = self._room[self._block + 1 : self._block + 1 + count].copy(), np.zeros(count)

    def forget(self) -> None:
        """Take note that there is no last block."""
        self.arrived, self._lengths, self._lows = False, np.zeros(0), np.zeros(0)
        self._begun[:] = self._now[[TIME, TIME_LO]]

    def lengths(self) -> Array:
        """Return the lengths of the steps of the last block, (steps,)."""
        return self._lengths

    def ends(self) -> Array:
        """Return the times at which the steps of the last block begin, and its end, (steps + 1,): with what passed
        before the leg, which its clock leaves out.
        """
        return np.asarray(self.start + self.pairs()[:, 0])

    def pairs(self) -> Array:
        """Return the same times, each as the sum of two numbers, (steps + 1, 2)."""
        times = np.full((len(self._lengths) + 1, 2), self._begun)
        times_reached(self._lengths, self._lows, times)
        return times

    def steps_in_block(self, readings: Array) -> NDArray[np.int64]:
        """Return the steps of the block just marched in which times lie, counted from 0."""
        direction = self.clock.direction
        return np.searchsorted(self.pairs()[1:, 0] * direction, readings * direction)

    @property
    def origin_now(self) -> float:
        """The time reached."""
        return self.time

    def is_at(self, place: Place) -> bool:
        """Return whether its time is the one reached."""
        return bool(place.rest == self._now[TIME])

    def ahead(self, offset: float) -> Place:
        """Return the place of a time after the one reached."""
        return Place(0, self.time + offset)

    def place_of(self, time: float) -> Place:
        """Return the place of a time less than a step ahead."""
        return Place(0, time)

    def next_place(self) -> Place:
        """Return a place that no step reaches."""
        return Place(0, self.clock.direction * FARTHEST)

    def places_of(self, readings: Array) -> Places:
        """Return the times since the beginning of the leg."""
        return self.clock.places(readings - self.start)

    def copy_at(self, leg: Any, place: Place) -> dict[str, Array]:
        """Return a copy after the steps that the clock chooses, the last one of which ends at the place."""
        copy: dict[str, Array] = leg.stepper.copied()
        copy["clock"][[LIMIT, EXACT]] = place.rest, 1.0
        while leg.loop.march_copy(copy, self.clock, self._block) == self._block:
            pass
        return copy

    def passed(self, places: Places) -> int:
        """Return how many of these times do not lie ahead."""
        direction = self.clock.direction
        return int(np.searchsorted(places.rests * direction, self.time * direction, side="right"))

    def behind(self, places: Places) -> Behind:
        """Return where times in the last block lie behind the beginnings of its steps."""
        ends, direction = self.pairs(), self.clock.direction
        steps = np.searchsorted(ends[:, 0] * direction, places.rests * direction, side="right") - 1
        return _behind(self.start, places, steps, ends)

    def ahead_of(self, leg: Any, places: Places, passed: Callable[[Array], None]) -> Ahead:
        """Return the state at the beginning of the first step, beyond the whole steps taken, in which there are some of
        these times; it is the step that is taken without them, whatever they are. The next one may be shorter than it
        was proposed, and end before them.
        """
        state, direction, counts = leg.stepper.state, self.clock.direction, leg.stepper.counts()
        begun, ends, count, taken = state, np.zeros((1, 2)), 0, 0
        try:
            while not count:
                begun, copy = state, {name: state[name].copy() for name in OF_BODIES}
                state, now = copy, copy["clock"]
                ends, now[LIMIT] = now[[TIME, TIME_LO]][None], self.next_place().rest
                if places.rests[0] == ends[0, 0]:
                    break
                taken = leg.loop.march_copy(copy, self.clock, 1, particles=False)
                # The next step of a body alone may be longer than all times; it ends there without being taken.
                count = int(np.searchsorted(places.rests * direction, now[NEXT] * direction))
                if taken and not count:
                    passed(now)
        finally:
            leg.stepper.evaluations, leg.stepper.particle_evaluations = counts
        first, numbers = max(count, 1), state["clock"] if count and taken else None
        behind = _behind(self.start, places.between(0, first), np.zeros(first, dtype=np.intp), ends)
        return Ahead(begun, behind, numbers)

    def way(self, time: float) -> Way:
        """Return the steps of the clock, which goes on."""
        return Way(self.clock, self.start, Place(0, time), OF_BODIES)

    def hand_on(self, leg: Any, end: Any) -> None:
        """Let a leg begin from the checkpoint of another, and end exactly."""
        end.restore(leg.checkpoint())
        end.times.end_exactly()

    def begin_at(self, time: float) -> None:
        """Begin at a time since the start of the run, which the clock reads."""
        self._now[[TIME, NEXT]] = time

    def end_exactly(self) -> None:
        """Let the last step end exactly at the place that is approached: from there the leg cannot go on."""
        self.arrived = False
        self._now[[EXACT, NEXT]] = 1.0, self.time

    def reading_in_part(self, reading: Any, time: float) -> Any:
        """Return the reading of this clock for one of a leg that covers the part of a step up to a time: the same."""
        return reading


def _behind(start: float, places: Places, steps: NDArray[np.intp], ends: Array) -> Behind:
    """Return where times lie behind the beginnings of steps, which are at `ends` of a clock that begins at `start`."""
    times, (begun, begun_lo) = places.rests, ends[steps].T
    return Behind(steps, start + begun, np.where(times == begun, 0.0, (times - begun) - begun_lo))
