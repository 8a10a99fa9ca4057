"""The leg of chosen steps that all bodies of a map take in encounters of massive ones: how they leave the map for it,
and how they enter the map again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.kernels.steps import NEAR_A_PLANET
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.excursion_rules import METHOD
from orbits.marching.following.own_clocks import REACHED
from orbits.marching.following.retirement import Lost, Retirement
from orbits.marching.legs.excursions.planet_encounters import NOBODY, Clears, Encounter, Rules, returns
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.particle_losses import close_to_planets
from orbits.marching.legs.problem import Ends

FIRST_BLOCK = 8
"""The most steps of the first block after all bodies left or entered the map; the next ones may be twice as long."""

ROOM = 4096
"""The most excursions that are listed."""

LEFT, RETURNED, BODY, OTHER_BODY = 0, 1, 2, 3
NOT_YET = -1
"""Columns of the list of excursions: the steps before all bodies left the map and before they entered it again, or
`NOT_YET`; and the bodies whose encounter it was, in the numbers of the caller, or `NOBODY` (see
`orbits.marching.legs.excursions.planet_encounters`)."""

EXCURSIONS, COUNTS, LOST, PREFIX = "excursions", "excursion_counts", "excursion_lost", "away_"
"""The arrays of a checkpoint: the list, (ROOM, 4); whether all bodies are away, 1, or 2 for the rest of a step, and how
many excursions there were; the readings at which particles were lost on these, (particles,), or `NOT_YET`; and the
prefix of those of the march by chosen steps."""

POSITIONS = tuple(f"{whose}{x}" for whose in ("", "particle_") for x in ("q", "q_lo", "v", "v_lo"))
"""The arrays of positions and velocities, which both legs have."""


class ChosenSteps:
    """The leg of chosen steps beside that of a map, and the excursions so far.

    map : the leg of the map; rules : which pairs it cannot follow; q, v : see `Leg`

    leg : that of chosen steps; taken : whether they are taken now
    unlisted : whether they are taken for the rest of a step alone, in which no encounter has begun so far
    rows, count : the excursions that are listed, see `LEFT`, and how many there were
    lost_at : (particles,), the readings at which particles were lost on them, or `NOT_YET`
    """

    def __init__(self, map: Leg, rules: Rules, q: NDArray[np.float64], v: NDArray[np.float64]) -> None:
        self._map, self._rules, problem = map, rules, map.problem
        clears = Clears()
        clears.rules = rules
        away = problem.but(
            integrator=METHOD,
            clock=Adaptive().towards(problem.clock.direction),
            start=0.0,
            forces=(),
            ends=Ends(problem.ends.stops),
            underway=False,
            surfaces=None if problem.surfaces_of_bodies is None else problem.surfaces,
        )
        try:
            self.leg = Leg(away, q, v, clears)
        except InputError as error:
            raise InputError(
                "where planets are followed, all bodies take steps that are chosen one by one in encounters, which is "
                f"not possible so far with '{problem.lagrangian.name}'. Use encounters='warn', or 'follow particles', "
                "or Gauss(stages=8) with dt=..."
            ) from error
        state = self.leg.stepper.state
        fresh = ("memory", "particle_memory", "particle_clock", "clock")
        self._fresh = {name: state[name].copy() for name in fresh if name in state}
        self.taken = self.unlisted = False
        self._listed = NOT_YET  # the step of the last block with which an encounter was listed
        self.rows: list[list[int]] = []
        self.count = 0
        self.lost_at = np.full(len(problem.particles), float(NOT_YET))

    # -------------------------------------------------------------------------------------------- the clock of the map

    def time_of(self, step: int) -> float:
        """Return the time at which a step of the map begins."""
        return self._map.problem.start + float(self._map.clock.time(step))

    def reading(self, time: Any) -> Any:
        """Return the reading of the map's clock at some times."""
        return (time - self._map.problem.start) / self._map.clock.h

    @property
    def return_step(self) -> int:
        """The steps of the map up to the next multiple of its step."""
        whole, rest = self._map.clock.place(self.leg.time - self._map.problem.start)
        return whole + (rest != 0.0)

    def goal(self, place: Place) -> Place:
        """Return the place of a place of the map in these steps."""
        return Place(0, self.time_of(place.steps) + place.rest)

    def lies_behind_return(self, time: float) -> bool:
        """Return whether all bodies enter the map again up to a time."""
        return (time - self.time_of(self.return_step)) * self._map.clock.direction >= 0.0

    # ------------------------------------------------------------------------------------------------------ the march

    def is_before(self, place: Place) -> bool:
        """Return whether there may be steps left before a place of the map."""
        goal, leg = self.goal(place), self.leg
        if returns(leg):
            return (goal.rest - leg.time) * leg.clock.direction > 0.0 and self.lies_behind_return(goal.rest)
        return leg.is_before(goal)

    @property
    def is_over(self) -> bool:
        """Whether they have led back to a multiple of the map's step, where all bodies enter it again."""
        return self.taken and returns(self.leg) and not self.leg.is_before(Place(0, self.time_of(self.return_step)))

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place of the map."""
        leg, goal = self.leg, self.goal(place)
        returning, self._listed = returns(leg), NOT_YET
        if returning and not self.lies_behind_return(goal.rest):
            return
        try:
            leg.approach(Place(0, self.time_of(self.return_step)) if returning else goal)
            count = leg.loop.taken
            if self.unlisted and not returning:
                self._list_encounter(count)
            if count and not returning and self._rules.clear_after(leg, count) <= count:
                leg.times.end_exactly()
        finally:
            self.keep_up()

    def go_back(self, steps: int) -> None:
        """Take back what was listed after the first `steps` steps of the last block, to which the leg has returned."""
        if self._listed >= steps:
            if self.count == len(self.rows):
                self.rows.pop()
            self.count, self.unlisted = self.count - 1, True
            self._list_encounter(0)
            self._listed = NOT_YET if self.unlisted else steps
        self.keep_up()

    def keep_up(self) -> None:
        """Let the map know how far the chosen steps have led."""
        self._map.times.step = self._map.clock.place(self.leg.time - self._map.problem.start).steps
        self._map.stepper.take_counts(self.leg.stepper)

    # ------------------------------------------------------------------------------------------------ the transitions

    def begin(self, encounter: Encounter | None, time: float) -> None:
        """Let all bodies leave the map, from its state, at a time less than a step ahead.

        encounter : that which begins here; None if one goes on, or none is listed
        """
        leg, home = self.leg, self._map
        home.losses.retired.begin()
        seen, state = home.as_seen(), leg.stepper.state
        for name in POSITIONS:
            state[name][...] = seen[name]
        for name, array in self._fresh.items():
            state[name][...] = array
        leg.times.begin_at(time)
        leg.losses.retired.follow(home.losses.retired)
        leg.times.step = home.times.step
        leg.bounds.beware(FIRST_BLOCK)
        leg.bounds.passes, home.bounds.passes = home.bounds.passes, False
        leg.stepper.take_counts(home.stepper)
        self.taken, self._listed = True, NOT_YET
        if encounter is not None:
            self._list(encounter)

    def _list(self, encounter: Encounter) -> None:
        """List an excursion that begins with a step of the map."""
        bodies = self._map.problem.bodies
        self.count, self.unlisted = self.count + 1, False
        if len(self.rows) < ROOM:
            pair = [int(bodies[k]) if k != NOBODY else NOBODY for k in encounter.pair]
            self.rows.append([encounter.number, NOT_YET, *pair])

    def _list_encounter(self, count: int) -> None:
        """List the encounter that began in the last `count` steps, or begins now, if there is one: all bodies were away
        before it for the rest of a step.
        """
        leg, clock = self.leg, self._map.clock
        step, pair = self._rules.first_encounter(leg, count) if count else (0, (NOBODY, NOBODY))
        begun = float(leg.times.ends()[step]) if count else leg.time
        if step == count:
            ahead = self._rules.encounter_ahead(leg)
            if ahead is None:
                return
            pair = ahead
        self._list(Encounter(clock.place(begun - self._map.problem.start).steps, pair))
        self._listed = step

    def end(self) -> None:
        """Let all bodies enter the map, at the beginning of a step."""
        leg, home, step = self.leg, self._map, self.return_step
        retired, state = home.losses.retired, home.stepper.state
        for name in POSITIONS:
            state[name][...] = leg.stepper.state[name]
        state["memory"][...] = 0.0
        state["particle_memory"][~retired.gone()] = 0.0
        self._hand_over_lost()
        self.taken = self.unlisted = False
        home.times.step = step
        home.bounds.beware(FIRST_BLOCK)
        home.bounds.passes, leg.bounds.passes = leg.bounds.passes, False
        retired.begin()
        home.stepper.loops.enter(state, home.clock, retired.block)
        if home.problem.integrator.in_encounters.retire_particles:
            there = ~retired.gone()
            there[there] = np.isin(np.flatnonzero(there), self._close_to_planets())
            if there.any():
                which = np.flatnonzero(there)
                retired.add(Lost(0, which, np.full(len(which), NEAR_A_PLANET)), step)
        self._note_return(step)

    def _note_return(self, step: int) -> None:
        if self.count == len(self.rows) and self.rows and self.rows[-1][RETURNED] == NOT_YET:
            self.rows[-1][RETURNED] = step

    def go_on_from(self, other: ChosenSteps, time: float) -> None:
        """Take over the excursions of a march whose bodies change at a time, and leave the map there unless it is the
        beginning of a step: parts of a step are covered by chosen steps. An encounter that begins in these is listed.
        """
        if other.taken:
            other._hand_over_lost()
            self._map.losses.go_on_from(self._map, other._map)
        self.rows, self.count, self.lost_at = other.rows, other.count, other.lost_at
        if time == self.time_of(self._map.times.step):
            self._note_return(self._map.times.step)
            return
        self.begin(None, time)
        self.unlisted = other.unlisted or not other.taken
        if self.unlisted:
            self._list_encounter(0)

    def _hand_over_lost(self) -> None:
        """Let the map know the particles that were lost on this excursion."""
        leg, retired = self.leg, self._map.losses.retired
        lost = leg.losses.retired.gone() & ~retired.gone()
        if lost.any():
            self.lost_at[lost] = self.reading(leg.stepper.state["particle_clock"][lost, REACHED])
            retired.take_over(leg.losses.retired, lost, self.lost_at[lost].astype(np.int64))

    def _close_to_planets(self) -> NDArray[np.intp]:
        """Return the particles within the reach of a planet."""
        problem, state = self._map.problem, self._map.stepper.state
        n, m = len(problem.bodies), len(problem.particles)
        bodies = state["q"][: 3 * n].reshape(3, n).T
        return close_to_planets(state["particle_q"][:, :m].T, bodies, problem.gm[:n], self._map.observers.dominant)

    # ------------------------------------------------------------------------------------------------ what is lost

    def retired(self, time: float | None = None) -> list[Retirement]:
        """Return what was retired by the map, and by chosen steps before and now, in the order of the caller's bodies.

        time : less than a step ahead, up to which particles are followed; None for where the march is
        """
        if not self.taken:
            return self._at_readings(self._map.retired(time))
        rows = {one.body: one for one in self._at_readings(self._map.retired())}
        for one in self.leg.retired(time):
            if one.body not in rows:
                at = float(self.reading(one.reading))
                rows[one.body] = one._replace(step=int(at), reading=at)
        return [rows[body] for body in sorted(rows)]

    def _at_readings(self, retired: list[Retirement]) -> list[Retirement]:
        """Return particles retired by the map, with the readings at which they were lost on earlier excursions."""
        places = np.searchsorted(self._map.problem.particles, [one.body for one in retired])
        readings = self.lost_at[places.astype(int)].tolist()
        return [
            one if at == NOT_YET else one._replace(reading=at) for one, at in zip(retired, readings, strict=True)
        ]

    # ------------------------------------------------------------------------------------------------- checkpoints

    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit, besides the checkpoint of the map."""
        rows = np.full((ROOM, 4), NOT_YET, dtype=np.int64)
        rows[: len(self.rows)] = self.rows or np.zeros((0, 4))
        counts = np.array([self.taken + self.unlisted, self.count], dtype=np.int64)
        away = {PREFIX + name: array for name, array in self.leg.checkpoint().items()}
        return {**away, EXCURSIONS: rows, COUNTS: counts, LOST: self.lost_at.copy()}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a checkpoint of a march bound in the same way. Raises InputError if it belongs to another problem."""
        if COUNTS not in checkpoint:
            raise InputError(f"the checkpoint does not fit this run: {COUNTS} is nothing, expected (2,)")
        rows, (away, count) = np.asarray(checkpoint[EXCURSIONS]), (int(x) for x in checkpoint[COUNTS])
        lost, listed = np.asarray(checkpoint[LOST], dtype=np.float64), min(max(count, 0), ROOM)
        known = rows[:listed]
        bodies = known[:, [BODY, OTHER_BODY]]
        fits = rows.shape == (ROOM, 4) and lost.shape == self.lost_at.shape and away in (0, 1, 2) and count >= 0
        fits = fits and not ((bodies < NOBODY).any() or (bodies >= len(self._map.problem.gm)).any())
        if not fits or not np.isfinite(lost).all():
            raise InputError("the excursions from the map in its checkpoint are not those of a run.")
        self.leg.restore({name[len(PREFIX) :]: x for name, x in checkpoint.items() if name.startswith(PREFIX)})
        self.taken, self.unlisted, self._listed = away > 0, away == 2, NOT_YET
        self.rows, self.count = known.tolist(), count
        self.lost_at[...] = lost
