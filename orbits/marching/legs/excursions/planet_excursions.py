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
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.step_times import Place, Places
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs import within_step
from orbits.marching.legs.excursions.chosen_steps import FIRST_BLOCK, NOT_YET, ChosenSteps
from orbits.marching.legs.excursions.planet_encounters import NOBODY, Encounter, Leaves, Rules
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.march import March
from orbits.marching.legs.problem import Problem
from orbits.marching.legs.record import Record, joined, seen_by
from orbits.marching.legs.samples import Samples


class PlanetExcursions(March):
    """A march of constant steps by a map on Kepler orbits, which all bodies leave for encounters of massive ones.

    It is two legs, of which `home` is that of the map: what it shows is that of the leg of chosen steps while all
    bodies are away. `step` is then the number of whole steps of the map up to the time reached.

    problem, q, v : see `Leg`
    """

    def __init__(self, problem: Problem, q: Array, v: Array) -> None:
        self.problem, self.clock, self._leaves = problem, problem.clock, Leaves()
        self._map = self._last = Leg(problem, q, v, self._leaves)
        self._leaves.rules = Rules(problem, self._map.observers.dominant)
        self._chosen = ChosenSteps(self._map, self._leaves.rules, q, v)
        self._looked = NOT_YET

    # ----------------------------------------------------------------------------------------- what it shows

    @property
    def leg(self) -> Leg:
        """The leg of the map, or of chosen steps."""
        return self._chosen.leg if self._chosen.taken else self._map

    @property
    def last(self) -> Leg:
        """The leg that marched the last block."""
        return self._last

    @property
    def home(self) -> Leg:
        """The leg of the map, whose clock this march has."""
        return self._map

    def excursions(self) -> tuple[NDArray[np.int64], int] | None:
        """Return the excursions from the map that are listed, see `LEFT`, and how many there were."""
        return np.array(self._chosen.rows, dtype=np.int64).reshape(-1, 4), self._chosen.count

    @cached_property
    def samples(self) -> Samples:
        """Its states at samples."""
        return SamplesOfBoth(self)

    @property
    def step(self) -> int:
        """Whole steps of the map up to the time reached."""
        return self._map.step

    @property
    def time(self) -> float:
        """The time reached, since the start of the run."""
        return self.leg.time

    def state(self) -> tuple[Array, Array]:
        """Return (q, v), each (n, 3), in the order of the caller, at the time reached."""
        return self.leg.state()

    def state_after(self, offset: float) -> tuple[Array, Array]:
        """Return (q, v) after a partial step of `offset`; all bodies leave the map here, if its step is one of an
        encounter.
        """
        if not self._chosen.taken and offset != 0.0:
            self._settle(Place(self.step, offset))
        return self.leg.state_after(offset)

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v) at a place up to which the march has advanced."""
        self._settle(place)
        return self.leg.state_at(self._chosen.goal(place) if self._chosen.taken else place)

    def accounts(self) -> Array:
        """Return what is known of each force: there is none in a map."""
        return self._map.accounts()

    def retired(self, by: float | None = None) -> list[Retirement]:
        """Return the particles that were retired, in the order of the caller's bodies; by : see `March.retired`."""
        return self._chosen.retired(by)

    def record(self, end: float) -> Record:
        """Return what was seen of passages up to a time; see `Leg.record`."""
        chosen, direction = self._chosen.leg, self.clock.direction
        with suppress(IntegrationError):  # where the run itself failed
            if (end - self.time) * direction > 0.0:
                self.advance_to(self.clock.place(end))
        if self._chosen.taken:
            ended = chosen
            if (end - self.time) * direction > 0.0:
                with suppress(IntegrationError):
                    ended = within_step.ended_at(chosen, end)
            away = seen_by(ended)
            mine = seen_by(self._map, noting_end=False)._replace(end=float(self._chosen.reading(self.time)))
        else:
            mine, away = self._map.record(end), seen_by(chosen, noting_end=False)
        particles = slice(len(self.problem.bodies), len(self.problem.gm))
        return joined(mine, away, self._chosen.reading, particles)

    def compile(self) -> None:
        """Compile, or load from the cache, all that `approach` needs."""
        self._map.compile()
        self._chosen.leg.compile()

    def close(self) -> None:
        """Release the threads."""
        self._map.close()
        self._chosen.leg.close()

    # ------------------------------------------------------------------------------------------------ the march

    def is_before(self, place: Place) -> bool:
        """Return whether there may be steps left before a place."""
        self._settle(place)
        return self._chosen.is_before(place) if self._chosen.taken else self._map.is_before(place)

    def approach(self, place: Place) -> None:
        """March on by a block of steps, or by those before a place. Raises what `advance_to` raises."""
        self._settle(place)
        self._last = self.leg
        if self._chosen.taken:
            self._chosen.approach(place)
        elif self.step < place.steps:
            self._approach_by_map(place)

    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""
        self._last.go_back(steps)
        if self._last is self._map:
            self._leaves.found = None
        else:
            self._chosen.go_back(steps)

    def begun_within(self, clock: Clock, step: int, time: float) -> tuple[Clock, float, int]:
        """Return how a march of changed bodies goes on from a time in a step: by chosen steps for the rest of it."""
        return clock, 0.0, step

    def go_on_from(self, old: Any, step: int, time: float) -> None:
        """Follow a march of bodies that change at a time in the step after `step` ones."""
        self._map.go_on_from(old, step, time)
        self._chosen.go_on_from(old._chosen, time)

    def _settle(self, place: Place) -> None:
        """Let all bodies leave or enter the map, if the way to a place begins with that."""
        if self._chosen.is_over:
            self._chosen.end()
            self._looked = NOT_YET
        if self._chosen.taken or not place > (self.step, 0.0):
            return
        if self._leaves.found is None and place.steps == self.step and self._looked != self.step:
            self._look_ahead()
        encounter = self._leaves.found
        if encounter is not None and encounter.number == self.step:
            self._leaves.found = None
            self._chosen.begin(encounter, self.time)

    def _approach_by_map(self, place: Place) -> None:
        self._leaves.found = None
        try:
            self._map.approach(place)
        except IntegrationError:
            if self._leaves.found is None:
                self._leaves.found = Encounter(self.step, (NOBODY, NOBODY))

    def _look_ahead(self) -> None:
        """Find out whether the next step of the map, which leads beyond a place, is one of an encounter."""
        step, leg = self.step, self._map
        self._last, self._looked = leg, step
        try:
            while self.step == step and self._leaves.found is None:
                self._approach_by_map(Place(step + 1, 0.0))
        finally:
            if self.step > step:
                leg.go_back(0)
            leg.bounds.met = None

    # ------------------------------------------------------------------------------------------------- checkpoints

    def checkpoint(self, *, seen: bool = False) -> dict[str, NDArray[np.generic]]:
        """Return all that is needed to resume bit for bit; see `Leg`."""
        return {**self._map.checkpoint(seen=seen and not self._chosen.taken), **self._chosen.checkpoint()}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]], *, seen: bool = False) -> None:
        """Restore a checkpoint of a march bound in the same way. Raises InputError if it belongs to another problem."""
        self._chosen.restore(checkpoint)
        self._map.restore(checkpoint, seen=seen)
        self._last, self._leaves.found, self._looked = self.leg, None, NOT_YET
        for leg in (self._map, self._chosen.leg):
            leg.bounds.beware(FIRST_BLOCK)


class SamplesOfBoth(Samples):
    """Those of the leg of the map; of the leg of chosen steps, one by one."""

    def __init__(self, march: PlanetExcursions) -> None:
        super().__init__(march)
        self._map = march.home.samples

    @property
    def _by_map(self) -> bool:
        return self._march.current.leg is self._march.home

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to."""
        return self._map.together(places) if self._by_map else 1

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched, with states that are known."""
        return self._map.passed(places)

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched."""
        return self._map.in_block(places)

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at the first of these places, or at those in the next step of the map."""
        self._march.is_before(places.at(0))  # all bodies leave the map here, if its step is one of an encounter
        return self._map.ahead(places) if self._by_map else super().ahead(places)


Legs = Leg | PlanetExcursions
"""What marches the same bodies: one leg, or two that take turns."""
