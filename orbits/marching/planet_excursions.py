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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, IntegrationError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.kernels.search.encounters_of_planets import first_clear, first_encounter
from orbits.kernels.search.record import DISTANCE2, OTHER, PARTNER, STEP, TIME, WHEN
from orbits.kernels.steps import NEAR_A_PLANET
from orbits.lagrangians.base import Lagrangian
from orbits.marching.clocks import variable_steps
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.constant import Clock, Place
from orbits.marching.following.excursion_rules import METHOD
from orbits.marching.following.own_clocks import REACHED
from orbits.marching.following.retirement import Lost, Retirement
from orbits.marching.marcher import Marcher
from orbits.marching.stepping.motion import Motion
from orbits.marching.watching import kepler_passages
from orbits.marching.watching.passage_list import UNKNOWN

FIRST_BLOCK = 8
"""The steps of the first block after all bodies left or entered the map; each is followed by one twice as long."""

ROOM = 4096
"""The most excursions that are listed."""

LEFT, RETURNED, BODY, OTHER_BODY = 0, 1, 2, 3
NOT_YET, NOBODY = -1, -1
"""Columns of the list of excursions: the steps before all bodies left the map and before they entered it again, or
`NOT_YET`; and the bodies whose encounter it was, in the numbers of the caller, or `NOBODY` if the map failed."""

EXCURSIONS, COUNTS, LOST, PREFIX = "excursions", "excursion_counts", "excursion_lost", "away_"
"""The arrays of a checkpoint: the list, (ROOM, 4); whether all bodies are away, and how many excursions there were; the
readings at which particles were lost on these, (particles,), or `NOT_YET`; and the prefix of those of the march by
chosen steps."""


class _Step(NamedTuple):
    """A step of the map that is one of an encounter: its number, and the two bodies in the kernels' order."""

    number: int
    pair: tuple[int, int]


class _ChosenSteps(Marcher):
    """The march by chosen steps: its blocks end with the step after which the map can go on.

    rules : of encounters, see `orbits.kernels.search.encounters_of_planets.first_clear`
    """

    rules: tuple[Array, Array, Array, float] | None = None

    def clear_after(self, count: int) -> int:
        """Return the number of steps of the block of `count` steps just marched after which the map can go on, or
        count + 1.
        """
        assert self.rules is not None
        return int(first_clear(self._watcher.recorded(count).ravel(), len(self._state["q"]), *self.rules, count))

    def _followed(self, count: int) -> int:
        """Return how many of the steps of the block just marched are taken."""
        returns = bool(self._state["clock"][variable_steps.EXACT])
        return count if returns or not count else min(self.clear_after(count), count)


class LeavingMarcher(Marcher):
    """A `Marcher` of constant steps by a map on Kepler orbits, which all bodies leave for encounters of massive ones.

    The arguments are those of `Marcher`; what it shows is that of the march by chosen steps while all bodies are away:
    `step` is then the number of whole steps of the map up to the time reached.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        integrator: Integrator,
        parameters: Array | tuple[Array, ...],
        massive: NDArray[np.bool_],
        q: Array,
        v: Array,
        clock: Clock | float,
        **options: Any,
    ) -> None:
        self._away = self._away_last = False
        super().__init__(lagrangian, integrator, parameters, massive, q, v, clock, **options)
        shared = ("names", "threads", "stops", "retire", "dense", "approaches")
        known: dict[str, Any] = {name: options[name] for name in shared if name in options}
        if self._surfaces is not None:
            known["surfaces"] = options["surfaces"]
        steps = Adaptive().towards(self.clock.direction)
        try:
            self._own = _ChosenSteps(lagrangian, METHOD, parameters, massive, q, v, steps, **known)
        except InputError as error:
            raise InputError(
                "planets='follow' lets all bodies take steps that are chosen one by one in encounters, which is not "
                f"possible so far with '{lagrangian.name}'. Use planets='warn' or 'refuse', or Gauss(stages=8) with "
                "dt=..."
            ) from error
        fresh = ("memory", "particle_memory", "particle_clock", "clock")
        self._fresh = {name: self._own._state[name].copy() for name in fresh if name in self._own._state}
        n, dominant = self._bodies, self._watcher.dominant
        gm = self._gm[:n]
        self._near = kepler_passages.near_each_other(gm, dominant)
        self._limits = np.array([dominant, gm[dominant], 2.0 * np.pi / integrator.least_steps])
        self._extent, self._who = np.zeros((3, n)), np.zeros(2, dtype=np.int64)
        self._own.rules = self._near, self._extent, self._limits, self.clock.h
        self._largest = self.block, self._own.block
        self._leaves: _Step | None = None
        self._looked, self._by_map = NOT_YET, False
        self._excursions: list[list[int]] = []
        self._count = 0
        self._lost_at = np.full(len(self._particles), float(NOT_YET))

    # ----------------------------------------------------------------------------------------- what a march shows

    @property
    def is_away(self) -> bool:
        """Whether all bodies take chosen steps now."""
        return self._away

    def excursions(self) -> tuple[NDArray[np.int64], int]:
        """Return the excursions from the map that are listed, see `LEFT`, and how many there were."""
        return np.array(self._excursions, dtype=np.int64).reshape(-1, 4), self._count

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return self._own.time if self._away else super().time

    @property
    def reading(self) -> float:
        """The reading of the clock: whole steps, and a part of one while all bodies are away."""
        return float(self._read(self._own.time)) if self._away else super().reading

    def _read(self, time: Any) -> Any:
        """Return the reading of the clock at some times."""
        return (time - self._start) / self.clock.h

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller, at the time reached."""
        return self._own.state() if self._away else super().state()

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) after a partial step of `offset`; all bodies leave the map here, if its step is one of an
        encounter.
        """
        if not (self._away or self._by_map) and offset != 0.0:
            self._settle(Place(self.step, offset))
        return self._own.state_after(offset) if self._away else super().state_after(offset)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced."""
        self._settle(place)
        return self._own.state_at(self._goal(place)) if self._away else super().state_at(place)

    def motion(self) -> Motion:
        """Return the motion of the massive bodies within the steps of the last block."""
        return self._own.motion() if self._away_last else super().motion()

    def towards(self, time: float) -> tuple[Marcher, Place]:
        """Return a march of the massive bodies that ends at a time less than a step ahead; see `Marcher`."""
        return self._own.towards(time) if self._away else super().towards(time)

    def retired(self) -> list[Retirement]:
        """Return the particles that were retired, in the order of the caller's bodies."""
        return self._all_retired(self._own.retired()) if self._away else self._all_retired([])

    def retired_by(self, time: float) -> list[Retirement]:
        """Return these, and those that cannot be followed up to a time less than a step ahead."""
        return self._all_retired(self._own.retired_by(time)) if self._away else super().retired_by(time)

    def _all_retired(self, away: list[Retirement]) -> list[Retirement]:
        """Return what was retired by the map, and by chosen steps before and now."""
        rows = {}
        for one in super().retired():
            at = float(self._lost_at[int(np.searchsorted(self._particles, one.body))])
            rows[one.body] = one if at == NOT_YET else one._replace(reading=at)
        for one in away:
            if one.body not in rows:
                at = float(self._read(one.reading))
                rows[one.body] = one._replace(step=int(at), reading=at)
        return [rows[body] for body in sorted(rows)]

    def approaches(self) -> Array:
        """Return the closest approaches so far; see `Marcher`."""
        if self._away:
            return self._merged(self._state["approaches"].copy(), self._own.approaches())
        return self._merged(super().approaches(), self._own._state["approaches"])

    def passages(self) -> tuple[Array, int]:
        """Return the passages listed so far, and the number of those left out; see `Marcher`."""
        return self._all_passages(*self._own.passages())

    def record_at(self, end: float) -> tuple[Array | None, Array, int]:
        """Return closest approaches, None if they are not looked for, passages, and the number left out, up to a time
        less than a chosen step ahead, while all bodies are away.
        """
        ended = self._own.ended_at(end) if (end - self.time) * self.clock.direction > 0.0 else self._own
        closest = None
        if self.looks_for_approaches:
            closest = self._merged(self._state["approaches"].copy(), ended.approaches())
        return closest, *self._all_passages(*ended.passages())

    def _all_passages(self, away: Array, left_out: int) -> tuple[Array, int]:
        passages, missing = super().passages()
        away = away.copy()
        away[:, [STEP, WHEN]] = self._read(away[:, [STEP, WHEN]])
        both = np.concatenate([passages, away])
        return both[np.argsort(both[:, WHEN], kind="stable")], UNKNOWN if missing == UNKNOWN else missing + left_out

    def _merged(self, mine: Array, own: Array) -> Array:
        """Return the closer ones of two records, whose times are readings and times."""
        own = own.copy()
        own[TIME] = self._read(own[TIME])
        ranks = []
        for record in (mine, own):
            rank = record[DISTANCE2].copy()
            reach = np.append(self.reaches, 1.0)[record[PARTNER, OTHER].astype(int)]
            particles = slice(self._bodies, len(self._gm))
            with np.errstate(divide="ignore", invalid="ignore"):
                rank[OTHER, particles] /= reach[particles] ** 2
            ranks.append(np.where(np.isfinite(record[DISTANCE2]), rank, np.inf))
        return np.where(ranks[1] < ranks[0], own, mine)

    def compile(self) -> None:
        """Compile, or load from the cache, all that `advance` needs."""
        super().compile()
        self._own.compile()

    def close(self) -> None:
        """Release the threads."""
        super().close()
        self._own.close()

    # ------------------------------------------------------------------------------------------------ the march

    def is_before(self, place: Place) -> bool:
        """Return whether there may be steps left before a place."""
        self._settle(place)
        if not self._away:
            return super().is_before(place)
        if self._returns:
            goal = self._goal(place).rest
            return (goal - self._own.time) * self.clock.direction > 0.0 and self._lies_behind_return(goal)
        return self._own.is_before(self._goal(place))

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place. Raises what `advance` raises."""
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

    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""
        if self._away_last:
            self._own.go_back(steps)
            self._keep_up()
        else:
            super().go_back(steps)
            self._leaves = None

    def step_back(self) -> None:
        """Return to the state before the last step of the last block, in which a pair may come to its bound."""
        if self._away_last:
            self._own.step_back()
            self._keep_up()
        else:
            super().step_back()

    def pass_by(self) -> None:
        """Take the next step whatever pairs come to their bounds in it."""
        self._own.pass_by() if self._away else super().pass_by()

    def _settle(self, place: Place) -> None:
        """Let all bodies leave or enter the map, if the way to a place begins with that."""
        if self._away and self._returns and not self._own.is_before(Place(0, self._return_time)):
            self._enter_again()
        if self._away or not place > (self.step, 0.0):
            return
        if self._leaves is None and place.steps == self.step and self._looked != self.step:
            self._look_ahead()
        if self._leaves is not None and self._leaves.number == self.step:
            self._leave(self._leaves)

    def _goal(self, place: Place) -> Place:
        return Place(0, self._time_of(place.steps) + place.rest)

    def _approach_by_map(self, place: Place) -> None:
        self._away_last, self._leaves, self._by_map = False, None, True
        try:
            super().approach(place)
            if self._leaves is None:
                self.block = min(2 * self.block, self._largest[0])
        except IntegrationError:
            if self._leaves is None:
                self._leaves = _Step(self.step, (NOBODY, NOBODY))
        finally:
            self._by_map = False

    def _followed(self, count: int) -> int:
        """Return how many of the steps of the block just marched the map can follow."""
        if not count:
            return 0
        path, stride = self._watcher.recorded(count).ravel(), len(self._state["q"])
        rules = self._near, self._extent, self._limits, self.clock.h
        first = int(first_encounter(path, stride, *rules, count, self._who))
        if first < count:
            self._leaves = _Step(self.step + first, (int(self._who[0]), int(self._who[1])))
        return first

    def _look_ahead(self) -> None:
        """Find out whether the next step of the map, which leads beyond a place, is one of an encounter."""
        step, block = self.step, self.block
        try:
            while self.step == step and self._leaves is None:
                self._approach_by_map(Place(step + 1, 0.0))
        finally:
            if self.step > step:
                super().go_back(0)
            self.met, self.block, self._looked = None, block, step

    def _approach_by_own_steps(self, goal: Place) -> None:
        own, self._away_last = self._own, True
        returning = self._returns
        if returning and not self._lies_behind_return(goal.rest):
            return
        try:
            own.approach(Place(0, self._return_time) if returning else goal)
            count = own._block[0]
            if count and not returning:
                clear = own.clear_after(count)
                if clear <= count:
                    own._state["clock"][[variable_steps.EXACT, variable_steps.NEXT]] = 1.0, own.time
            own.block = min(2 * own.block, self._largest[1])
        finally:
            self._keep_up()

    @property
    def _returns(self) -> bool:
        """Whether the chosen steps lead back to the map, at the next multiple of its step."""
        return bool(self._own._state["clock"][variable_steps.EXACT])

    @property
    def _return_step(self) -> int:
        whole, rest = self.clock.place(self._own.time - self._start)
        return whole + (rest != 0.0)

    @property
    def _return_time(self) -> float:
        return self._time_of(self._return_step)

    def _lies_behind_return(self, time: float) -> bool:
        return (time - self._return_time) * self.clock.direction >= 0.0

    def _keep_up(self) -> None:
        """Take over how far the chosen steps have led."""
        own = self._own
        self.step = self.clock.place(own.time - self._start).steps
        self.evaluations, self.particle_evaluations = own.evaluations, own.particle_evaluations
        self.met = own.met

    def _leave(self, encounter: _Step) -> None:
        """Let all bodies leave the map, at the beginning of a step."""
        own, self._leaves = self._own, None
        self._retired.begin()
        seen = self._as_seen()
        for name in ("q", "q_lo", "v", "v_lo", *(f"particle_{x}" for x in ("q", "q_lo", "v", "v_lo"))):
            own._state[name][...] = seen[name]
        for name, array in self._fresh.items():
            own._state[name][...] = array
        own._state["clock"][[variable_steps.TIME, variable_steps.NEXT]] = self._time_of(self.step)
        own._retired.follow(self._retired)
        own.step, own.block, own.met = self.step, FIRST_BLOCK, None
        own._passes, self._passes = self._passes, False
        own.evaluations, own.particle_evaluations = self.evaluations, self.particle_evaluations
        pair = [int(self._massive[k]) if k != NOBODY else NOBODY for k in encounter.pair]
        self._away = True
        self._count += 1
        if len(self._excursions) < ROOM:
            self._excursions.append([self.step, NOT_YET, *pair])

    def _enter_again(self) -> None:
        """Let all bodies enter the map, at the beginning of a step."""
        own, step = self._own, self._return_step
        lost = own._retired.gone() & ~self._retired.gone()
        for name in ("q", "q_lo", "v", "v_lo", *(f"particle_{x}" for x in ("q", "q_lo", "v", "v_lo"))):
            self._state[name][...] = own._state[name]
        self._state["memory"][...] = 0.0
        self._state["particle_memory"][~self._retired.gone()] = 0.0
        if lost.any():
            self._lost_at[lost] = self._read(own._state["particle_clock"][lost, REACHED])
            self._retired.take_over(own._retired, lost, self._lost_at[lost].astype(np.int64))
        self._away, self.step, self._looked, self.block = False, step, NOT_YET, FIRST_BLOCK
        own._passes = False
        self._retired.begin()
        self._loops.enter(self._state, self.clock, self._retired.block)
        if self.integrator.retires_in_encounters:
            there = ~self._retired.gone()
            there[there] = np.isin(np.flatnonzero(there), self._close_to_planets())
            if there.any():
                which = np.flatnonzero(there)
                self._retired.add(Lost(0, which, np.full(len(which), NEAR_A_PLANET)), step)
        if self._count == len(self._excursions):
            self._excursions[-1][RETURNED] = step

    def _close_to_planets(self) -> NDArray[np.intp]:
        """Return the particles within the reach of a planet."""
        n, m, sun = self._bodies, len(self._particles), self._watcher.dominant
        x = self._state["q"][: 3 * n].reshape(3, n).T
        planets = np.arange(n) != sun
        place = self._state["particle_q"][:, :m].T - x[sun]
        near = kepler_passages.near_a_planet(
            place, (x - x[sun])[planets], self._gm[:n][planets], float(self._gm[sun])
        )
        return np.flatnonzero(near >= 0)

    # ------------------------------------------------------------------------------------------------- checkpoints

    def checkpoint(self, *, seen: bool = False) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit; see `Marcher`."""
        out = super().checkpoint(seen=seen and not self._away)
        out |= {PREFIX + name: array for name, array in self._own.checkpoint().items()}
        rows = np.full((ROOM, 4), NOT_YET, dtype=np.int64)
        rows[: len(self._excursions)] = self._excursions or np.zeros((0, 4))
        counts = np.array([self._away, self._count], dtype=np.int64)
        return {**out, EXCURSIONS: rows, COUNTS: counts, LOST: self._lost_at.copy()}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]], *, seen: bool = False) -> None:
        """Restore a checkpoint of a marcher bound in the same way. Raises InputError if it belongs to another
        problem.
        """
        if COUNTS not in checkpoint:
            raise InputError(f"the checkpoint does not fit this run: {COUNTS} is nothing, expected (2,)")
        rows, (away, count) = np.asarray(checkpoint[EXCURSIONS]), (int(x) for x in checkpoint[COUNTS])
        lost, listed = np.asarray(checkpoint[LOST], dtype=np.float64), min(max(count, 0), ROOM)
        known = rows[:listed]
        bodies = known[:, [BODY, OTHER_BODY]]
        fits = rows.shape == (ROOM, 4) and lost.shape == self._lost_at.shape and away in (0, 1) and count >= away
        if not fits or (bodies < NOBODY).any() or (bodies >= len(self._gm)).any() or not np.isfinite(lost).all():
            raise InputError("the excursions from the map in its checkpoint are not those of a run.")
        self._own.restore({name[len(PREFIX) :]: x for name, x in checkpoint.items() if name.startswith(PREFIX)})
        super().restore(checkpoint, seen=seen)
        self._away = self._away_last = bool(away)
        self._excursions, self._count = known.tolist(), count
        self._lost_at[...], self._leaves, self._looked = lost, None, NOT_YET
        self.block, self._own.block = FIRST_BLOCK, FIRST_BLOCK
