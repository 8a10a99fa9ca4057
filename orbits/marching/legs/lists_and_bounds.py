"""What ends the blocks of a leg besides lost particles: full lists, refused meetings, bounds, and the energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orbits.errors import InputError, IntegrationError
from orbits.marching.clocks.step_times import UNLIMITED
from orbits.marching.legs.interruptions import Block, Interruption, Kind, LegWatcher
from orbits.marching.stepping.failures import refused_meeting
from orbits.marching.watching import kepler_passages
from orbits.marching.watching.leg_observers import ENERGY
from orbits.marching.watching.passage_list import BlockList, Kept, PassageList

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg


class Listing(LegWatcher):
    """The passages of a leg; a block that has more than its list holds is marched again, in shorter blocks.

    passages : the list so far
    is_complete : whether the list of the block just marched holds all its passages, or it is a single step
    """

    def __init__(self, passages: PassageList, own: list[BlockList]) -> None:
        self.passages, self._own = passages, own
        self.is_complete = True
        self._kept: Kept = passages.keep()

    def begin(self) -> None:
        """Take note of what is in the list before a block."""
        self._kept = self.passages.keep()

    def return_to_begin(self) -> None:
        """Return to what was in the list before the block."""
        self.passages.put_back(self._kept)

    def forget(self) -> None:
        """Forget whether there was room."""
        self.is_complete = True

    def judge(self, leg: Leg, count: int) -> None:
        """Find out whether there was room for all passages of a block of `count` steps, before others look at them."""
        overflows = self.passages.overflows
        self.is_complete = count == 1 or not (overflows(leg.observers.lists) or overflows(self._own))

    def add(self, lists: list[BlockList]) -> None:
        """Add the lists of the block, and empty them."""
        self.passages.add(lists)

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return the beginning of the block, if there was no room."""
        if self.is_complete or count <= 1:
            return None
        leg.block = count // 2
        return Interruption(0, Kind.FULL)


class Refusals(LegWatcher):
    """Ends a leg before massive bodies meet, for a method that does not follow them there and refuses to go on."""

    _meeting: kepler_passages.Meeting | None = None
    _found: kepler_passages.Meeting | None = None

    def forget(self) -> None:
        """Forget what was seen of the last block."""
        self._meeting = None

    def see(self, leg: Leg, block: Block) -> None:
        """Look at the passages of massive bodies in a block."""
        if leg.listing.is_complete:
            gm, observers = leg.problem.gm[: len(leg.problem.bodies)], leg.observers
            self._meeting = kepler_passages.first_meeting(observers.lists[0], gm, observers.dominant, block.begun)

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return before which step two bodies meet."""
        self._found = self._meeting
        return None if self._found is None else Interruption(self._found.steps, Kind.REFUSED)

    def commit(self, leg: Leg, begun: int, last: Interruption | None) -> IntegrationError | None:
        """Return the error for the two."""
        if last is None or last.kind is not Kind.REFUSED:
            return None
        problem, meeting = leg.problem, self._found
        assert meeting is not None
        names = [problem.name(int(problem.bodies[k])) for k in meeting.pair]
        return refused_meeting(leg.step, leg.time, names, meeting.distance, problem.integrator)


class Bounds(LegWatcher):
    """Ends a leg after a step in which a pair may come to its bound, or two bodies may touch.

    met : why the leg ended: `SUSPECT`, `ENERGY` or `TOUCHED` of `orbits.marching.watching.leg_observers`, or None
    passes : whether the next step is taken whatever pairs come to their bounds in it
    """

    met: int | None = None
    passes = False
    _cautious = UNLIMITED

    def most(self, leg: Leg) -> int:
        """Return the most steps of the next block: one past a bound, and few near bounds."""
        return 1 if self.passes else self._cautious

    def relax(self) -> None:
        """Allow longer blocks, after one in which nothing was met."""
        self._cautious = min(2 * self._cautious, UNLIMITED)

    def beware(self, steps: int = 1) -> None:
        """Begin with few steps: the next ones may be alike, and no long block is marched in vain."""
        self.met, self._cautious = None, steps

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return after which step the leg stops."""
        found = leg.observers.met(count, not self.passes)
        if found is None:
            return None
        step, self.met = found
        return Interruption(step, Kind.BOUND)


class EnergyBound(LegWatcher):
    """Ends a leg after the first step at whose end the energy of the massive bodies has changed by too much.

    start : G times the energy at the start of the run; most : the largest change, as a fraction of it
    """

    def __init__(self, start: float, most: float) -> None:
        self.start, self._most = start, most

    def is_exceeded(self, leg: Leg) -> bool:
        """Return whether the energy error is above its bound where a leg is."""
        state = leg.stepper.state
        return abs(leg.observers.energy(state["q"], state["v"]) - self.start) > self._most * abs(self.start)

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return after which step the energy error is above its bound."""
        step = leg.observers.first_energy_error(count, self.start, self._most * abs(self.start))
        if step > count:
            return None
        leg.bounds.met = ENERGY
        return Interruption(step, Kind.BOUND)


def energy_bound_of(leg: Leg) -> EnergyBound | None:
    """Return what watches the energy of a leg, before its first step, if it has a bound. Raises InputError for a method
    of which it cannot be watched.
    """
    most, state = leg.problem.ends.energy_bound, leg.stepper.state
    if most is None:
        return None
    if not leg.stepper.loops.is_seen(1):
        raise InputError(
            f"{leg.problem.integrator.label} marches other coordinates than those seen, whose energy oscillates: the "
            "condition EnergyErrorAbove cannot be watched. Use a method such as Gauss(stages=8), or look at "
            "run.drift()."
        )
    return EnergyBound(leg.observers.energy(state["q"], state["v"]), most)
