"""A march by a map on Kepler orbits that all bodies leave while massive ones are too close to each other for it.

At the beginning of the step of such an encounter (`orbits.kernels.search.encounters_of_planets`), all bodies leave the
map, uncorrected, in doubled precision, for steps of Gauss that are chosen one by one; once the encounter is over, these
end at a multiple of the map's step, and all bodies enter the map again, as at the start of a run: with planets that are
numbered anew, and a new place of each massless particle among them.

Where they leave depends on the states at the ends of the map's steps alone, and where they return on those of the
chosen steps: samples change nothing. It is not reversible in time, nor symplectic: where bodies leave and where they
return depends on the direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, IntegrationError
from orbits.integrators.forms import Array
from orbits.kernels.steps import NEAR_A_PLANET
from orbits.marching.clocks import variable_steps
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.excursion_rules import METHOD
from orbits.marching.following.own_clocks import REACHED
from orbits.marching.following.retirement import Lost, Retirement
from orbits.marching.legs import within_step
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.march import MarchOfSameBodies
from orbits.marching.legs.particle_losses import close_to_planets
from orbits.marching.legs.planet_encounters import NOBODY, Clears, Encounter, Leaves, Rules, returns
from orbits.marching.legs.problem import Ends, Problem
from orbits.marching.legs.record import Record, joined, seen_by
from orbits.marching.stepping.motion import Motion

FIRST_BLOCK = 8
"""The steps of the first block after all bodies left or entered the map; each is followed by one twice as long."""

ROOM = 4096
"""The most excursions that are listed."""

LEFT, RETURNED, BODY, OTHER_BODY = 0, 1, 2, 3
NOT_YET = -1
"""Columns of the list of excursions: the steps before all bodies left the map and before they entered it again, or
`NOT_YET`; and the bodies whose encounter it was, in the numbers of the caller, or `NOBODY` (see
`orbits.marching.legs.planet_encounters`)."""

EXCURSIONS, COUNTS, LOST, PREFIX = "excursions", "excursion_counts", "excursion_lost", "away_"
"""The arrays of a checkpoint: the list, (ROOM, 4); whether all bodies are away, and how many excursions there were; the
readings at which particles were lost on these, (particles,), or `NOT_YET`; and the prefix of those of the march by
chosen steps."""

POSITIONS = tuple(f"{whose}{x}" for whose in ("", "particle_") for x in ("q", "q_lo", "v", "v_lo"))
"""The arrays of positions and velocities, which both legs have."""


class PlanetExcursions(MarchOfSameBodies):
    """A march of constant steps by a map on Kepler orbits, which all bodies leave for encounters of massive ones.

    It is two legs, of which `home` is that of the map: what it shows is that of the leg of chosen steps while all
    bodies are away. `step` is then the number of whole steps of the map up to the time reached.

    problem, q, v : see `Leg`
    """

    def __init__(self, problem: Problem, q: Array, v: Array) -> None:
        self.problem, self.clock = problem, problem.clock
        leaves, clears = Leaves(), Clears()
        self._map, self._leaves = Leg(problem, q, v, leaves), leaves
        steps = Adaptive().towards(self.clock.direction)
        surfaces = None if problem.surfaces_of_bodies is None else problem.surfaces
        away = problem.but(
            integrator=METHOD,
            clock=steps,
            start=0.0,
            forces=(),
            ends=Ends(problem.ends.stops),
            underway=False,
            surfaces=surfaces,
        )
        try:
            self._own = Leg(away, q, v, clears)
        except InputError as error:
            raise InputError(
                "where planets are followed, all bodies take steps that are chosen one by one in encounters, which is "
                f"not possible so far with '{problem.lagrangian.name}'. Use encounters='warn', or 'follow particles', "
                "or Gauss(stages=8) with dt=..."
            ) from error
        self._rules = leaves.rules = clears.rules = Rules(problem, self._map.observers.dominant)
        fresh = ("memory", "particle_memory", "particle_clock", "clock")
        state = self._own.stepper.state
        self._fresh = {name: state[name].copy() for name in fresh if name in state}
        self._largest = self._map.block, self._own.block
        self._away = self._own_last = False
        self._looked = NOT_YET
        self._excursions: list[list[int]] = []
        self._count = 0
        self._lost_at = np.full(len(problem.particles), float(NOT_YET))

    # ----------------------------------------------------------------------------------------- what it shows

    @property
    def _leg(self) -> Leg:
        """The leg of the map, or of chosen steps."""
        return self._own if self._away else self._map

    @property
    def home(self) -> Leg:
        """The leg of the map, whose clock this march has."""
        return self._map

    @property
    def last(self) -> Leg:
        """The leg that marched the last block."""
        return self._own if self._own_last else self._map

    @property
    def is_away(self) -> bool:
        """Whether all bodies take chosen steps now."""
        return self._away

    def excursions(self) -> tuple[NDArray[np.int64], int] | None:
        """Return the excursions from the map that are listed, see `LEFT`, and how many there were."""
        return np.array(self._excursions, dtype=np.int64).reshape(-1, 4), self._count

    @property
    def step(self) -> int:
        """Whole steps of the map up to the time reached."""
        return self._map.step

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return self._leg.time

    @property
    def reading(self) -> float:
        """The reading of the clock: whole steps, and a part of one while all bodies are away."""
        return float(self._read(self._own.time)) if self._away else self._map.reading

    def _read(self, time: Any) -> Any:
        """Return the reading of the clock at some times."""
        return (time - self.problem.start) / self.clock.h

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller, at the time reached."""
        return self._leg.state()

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) after a partial step of `offset`; all bodies leave the map here, if its step is one of an
        encounter.
        """
        if not self._away and offset != 0.0:
            self._settle(Place(self.step, offset))
        return self._leg.state_after(offset)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced."""
        self._settle(place)
        return self._own.state_at(self._goal(place)) if self._away else self._map.state_at(place)

    def motion(self) -> Motion:
        """Return the motion of the massive bodies within the steps of the last block."""
        return self.last.motion()

    def towards(self, time: float) -> tuple[Leg, Place]:
        """Return a leg of the massive bodies that ends at a time less than a step ahead; see `within_step`."""
        return within_step.towards(self._leg, time)

    def accounts(self) -> Array:
        """Return what is known of each force: there is none in a map."""
        return self._map.accounts()

    def retired(self) -> list[Retirement]:
        """Return the particles that were retired, in the order of the caller's bodies."""
        return self._all_retired(self._own.retired() if self._away else [])

    def retired_by(self, time: float) -> list[Retirement]:
        """Return these, and those that cannot be followed up to a time less than a step ahead."""
        if self._away:
            return self._all_retired(self._own.retired_by(time))
        return self._at_readings(self._map.retired_by(time))

    def _all_retired(self, away: list[Retirement]) -> list[Retirement]:
        """Return what was retired by the map, and by chosen steps before and now."""
        rows = {one.body: one for one in self._at_readings(self._map.retired())}
        for one in away:
            if one.body not in rows:
                at = float(self._read(one.reading))
                rows[one.body] = one._replace(step=int(at), reading=at)
        return [rows[body] for body in sorted(rows)]

    def _at_readings(self, retired: list[Retirement]) -> list[Retirement]:
        """Return particles retired by the map, with the readings at which they were lost on earlier excursions."""
        places = np.searchsorted(self.problem.particles, [one.body for one in retired])
        readings = self._lost_at[places.astype(int)].tolist()
        return [
            one if at == NOT_YET else one._replace(reading=at) for one, at in zip(retired, readings, strict=True)
        ]

    def record(self, end: float) -> Record:
        """Return what was seen of passages up to a time; see `Leg.record`."""
        with suppress(IntegrationError):  # where the run itself failed
            if (end - self.time) * self.clock.direction > 0.0:
                self.advance_to(self.clock.place(end))
        if self._away:
            ended = self._own
            if (end - self.time) * self.clock.direction > 0.0:
                with suppress(IntegrationError):
                    ended = within_step.ended_at(self._own, end)
            away = seen_by(ended)
            mine = seen_by(self._map, noting_end=False)._replace(end=self.reading)
        else:
            mine, away = self._map.record(end), seen_by(self._own, noting_end=False)
        particles = slice(len(self.problem.bodies), len(self.problem.gm))
        return joined(mine, away, self._read, particles)

    def compile(self) -> None:
        """Compile, or load from the cache, all that `approach` needs."""
        self._map.compile()
        self._own.compile()

    def close(self) -> None:
        """Release the threads."""
        self._map.close()
        self._own.close()

    # ------------------------------------------------------------------------------------------------ the march

    def is_before(self, place: Place) -> bool:
        """Return whether there may be steps left before a place."""
        self._settle(place)
        if not self._away:
            return self._map.is_before(place)
        if returns(self._own):
            goal = self._goal(place).rest
            return (goal - self._own.time) * self.clock.direction > 0.0 and self._lies_behind_return(goal)
        return self._own.is_before(self._goal(place))

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place. Raises what `advance_to` raises."""
        self._settle(place)
        if self._away:
            self._approach_by_own_steps(self._goal(place))
        elif self.step < place.steps:
            self._approach_by_map(place)

    def advance(self, steps: int) -> None:
        """March on to `steps` whole steps from here, or by those before it, if all bodies are away there."""
        place = Place(self.step + steps, 0.0)
        self.met = None
        while self.met is None and self.is_before(place):
            self.approach(place)

    @property
    def met(self) -> int | None:
        """Why the last block ended, see `Bounds`."""
        return self.last.bounds.met

    @met.setter
    def met(self, why: int | None) -> None:
        self.last.bounds.met = why

    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""
        self.last.go_back(steps)
        self._after_going_back()

    def step_back(self) -> None:
        """Return to the state before the last step of the last block, in which a pair may come to its bound."""
        self.last.step_back()
        self._after_going_back()

    def _after_going_back(self) -> None:
        if self._own_last:
            self._keep_up()
        else:
            self._leaves.found = None

    def pass_by(self) -> None:
        """Take the next step whatever pairs come to their bounds in it."""
        self._leg.pass_by()

    @property
    def block(self) -> int:
        """The most steps of a block of the map."""
        return self._map.block

    @block.setter
    def block(self, most: int) -> None:
        self._map.block = most

    def _settle(self, place: Place) -> None:
        """Let all bodies leave or enter the map, if the way to a place begins with that."""
        if self._away and returns(self._own) and not self._own.is_before(Place(0, self._return_time)):
            self._enter_again()
        if self._away or not place > (self.step, 0.0):
            return
        if self._leaves.found is None and place.steps == self.step and self._looked != self.step:
            self._look_ahead()
        encounter = self._leaves.found
        if encounter is not None and encounter.number == self.step:
            self._leave(encounter)

    def _goal(self, place: Place) -> Place:
        return Place(0, self._time_of(place.steps) + place.rest)

    def _time_of(self, step: int) -> float:
        return self.problem.start + float(self.clock.time(step))

    def _approach_by_map(self, place: Place) -> None:
        leg, leaves = self._map, self._leaves
        self._own_last, leaves.found = False, None
        try:
            leg.approach(place)
            if leaves.found is None:
                leg.block = min(2 * leg.block, self._largest[0])
        except IntegrationError:
            if leaves.found is None:
                leaves.found = Encounter(self.step, (NOBODY, NOBODY))

    def _look_ahead(self) -> None:
        """Find out whether the next step of the map, which leads beyond a place, is one of an encounter."""
        leg, step, block = self._map, self.step, self._map.block
        try:
            while self.step == step and self._leaves.found is None:
                self._approach_by_map(Place(step + 1, 0.0))
        finally:
            if self.step > step:
                leg.go_back(0)
            leg.bounds.met, leg.block, self._looked = None, block, step

    def _approach_by_own_steps(self, goal: Place) -> None:
        own, self._own_last = self._own, True
        returning = returns(own)
        if returning and not self._lies_behind_return(goal.rest):
            return
        try:
            own.approach(Place(0, self._return_time) if returning else goal)
            count = own.loop.taken
            if count and not returning and self._rules.clear_after(own, count) <= count:
                own.times.end_exactly()
            own.block = min(2 * own.block, self._largest[1])
        finally:
            self._keep_up()

    @property
    def _return_step(self) -> int:
        whole, rest = self.clock.place(self._own.time - self.problem.start)
        return whole + (rest != 0.0)

    @property
    def _return_time(self) -> float:
        return self._time_of(self._return_step)

    def _lies_behind_return(self, time: float) -> bool:
        return (time - self._return_time) * self.clock.direction >= 0.0

    def _keep_up(self) -> None:
        """Take over how far the chosen steps have led."""
        self._map.times.step = self.clock.place(self._own.time - self.problem.start).steps
        self._map.stepper.take_counts(self._own.stepper)

    def _leave(self, encounter: Encounter) -> None:
        """Let all bodies leave the map, at the beginning of a step."""
        own, self._leaves.found = self._own, None
        self._map.losses.retired.begin()
        seen, state = self._map.as_seen(), own.stepper.state
        for name in POSITIONS:
            state[name][...] = seen[name]
        for name, array in self._fresh.items():
            state[name][...] = array
        state["clock"][[variable_steps.TIME, variable_steps.NEXT]] = self._time_of(self.step)
        own.losses.retired.follow(self._map.losses.retired)
        own.times.step, own.block, own.bounds.met = self.step, FIRST_BLOCK, None
        own.bounds.passes, self._map.bounds.passes = self._map.bounds.passes, False
        own.stepper.take_counts(self._map.stepper)
        pair = [int(self.problem.bodies[k]) if k != NOBODY else NOBODY for k in encounter.pair]
        self._away = True
        self._count += 1
        if len(self._excursions) < ROOM:
            self._excursions.append([self.step, NOT_YET, *pair])

    def _enter_again(self) -> None:
        """Let all bodies enter the map, at the beginning of a step."""
        own, leg, step = self._own, self._map, self._return_step
        retired, state = leg.losses.retired, leg.stepper.state
        lost = own.losses.retired.gone() & ~retired.gone()
        for name in POSITIONS:
            state[name][...] = own.stepper.state[name]
        state["memory"][...] = 0.0
        state["particle_memory"][~retired.gone()] = 0.0
        if lost.any():
            self._lost_at[lost] = self._read(own.stepper.state["particle_clock"][lost, REACHED])
            retired.take_over(own.losses.retired, lost, self._lost_at[lost].astype(np.int64))
        self._away, leg.times.step, self._looked, leg.block = False, step, NOT_YET, FIRST_BLOCK
        leg.bounds.passes, own.bounds.passes = own.bounds.passes, False
        retired.begin()
        leg.stepper.loops.enter(state, self.clock, retired.block)
        if self.problem.integrator.in_encounters.retire_particles:
            there = ~retired.gone()
            there[there] = np.isin(np.flatnonzero(there), self._close_to_planets())
            if there.any():
                which = np.flatnonzero(there)
                retired.add(Lost(0, which, np.full(len(which), NEAR_A_PLANET)), step)
        if self._count == len(self._excursions):
            self._excursions[-1][RETURNED] = step

    def _close_to_planets(self) -> NDArray[np.intp]:
        """Return the particles within the reach of a planet."""
        n, m, state = len(self.problem.bodies), len(self.problem.particles), self._map.stepper.state
        bodies = state["q"][: 3 * n].reshape(3, n).T
        return close_to_planets(state["particle_q"][:, :m].T, bodies, self.problem.gm[:n], self._map.observers.dominant)

    # ------------------------------------------------------------------------------------------------- checkpoints

    def checkpoint(self, *, seen: bool = False) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit; see `Leg`."""
        out = self._map.checkpoint(seen=seen and not self._away)
        out |= {PREFIX + name: array for name, array in self._own.checkpoint().items()}
        rows = np.full((ROOM, 4), NOT_YET, dtype=np.int64)
        rows[: len(self._excursions)] = self._excursions or np.zeros((0, 4))
        counts = np.array([self._away, self._count], dtype=np.int64)
        return {**out, EXCURSIONS: rows, COUNTS: counts, LOST: self._lost_at.copy()}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]], *, seen: bool = False) -> None:
        """Restore a checkpoint of a march bound in the same way. Raises InputError if it belongs to another problem."""
        if COUNTS not in checkpoint:
            raise InputError(f"the checkpoint does not fit this run: {COUNTS} is nothing, expected (2,)")
        rows, (away, count) = np.asarray(checkpoint[EXCURSIONS]), (int(x) for x in checkpoint[COUNTS])
        lost, listed = np.asarray(checkpoint[LOST], dtype=np.float64), min(max(count, 0), ROOM)
        known = rows[:listed]
        bodies = known[:, [BODY, OTHER_BODY]]
        fits = rows.shape == (ROOM, 4) and lost.shape == self._lost_at.shape and away in (0, 1) and count >= away
        fits = fits and not ((bodies < NOBODY).any() or (bodies >= len(self.problem.gm)).any())
        if not fits or not np.isfinite(lost).all():
            raise InputError("the excursions from the map in its checkpoint are not those of a run.")
        self._own.restore({name[len(PREFIX) :]: x for name, x in checkpoint.items() if name.startswith(PREFIX)})
        self._map.restore(checkpoint, seen=seen)
        self._away = self._own_last = bool(away)
        self._excursions, self._count = known.tolist(), count
        self._lost_at[...], self._leaves.found, self._looked = lost, None, NOT_YET
        self._map.block = self._own.block = FIRST_BLOCK
        self._map.met = self._own.met = None


Legs = Leg | PlanetExcursions
"""What marches the same bodies: one leg, or two that take turns."""
