"""The loop over the blocks of a leg: the only one. A block is marched, looked at, marched again up to the earliest of
what watchers found, and committed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING
from weakref import proxy

import numpy as np

from orbits.errors import ConvergenceError, IntegrationError
from orbits.marching.clocks.clock import Clock
from orbits.marching.following.contract import NO_SAMPLES
from orbits.marching.legs.interruptions import Block, Interruption, Kind, LegWatcher
from orbits.marching.legs.stepper import State
from orbits.marching.stepping.failures import last_good

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg

_NOTHING = np.zeros(0)


@lru_cache(maxsize=64)
def _having_hooks(*kinds: type[LegWatcher]) -> list[list[int]]:
    """Return for each hook the places of the watchers of these kinds that have it."""
    hooks = ("most", "forget", "see", "look", "commit")
    return [[k for k, kind in enumerate(kinds) if getattr(kind, x) is not getattr(LegWatcher, x)] for x in hooks]


class BlockLoop:
    """Marches a leg block by block.

    watchers : in the order in which they look at a block that the ones before them have shortened

    listeners : what is told of committed blocks alone

    begun : the state at the beginning of the last block; taken : the number of its steps
    was_interrupted : whether the last block ended because a bound may have been reached
    """

    def __init__(self, leg: Leg, watchers: list[LegWatcher]) -> None:
        # No circle of references: the arrays of a leg, of megabytes, are free as soon as the leg is.
        self._leg: Leg = proxy(leg)
        self.watchers = watchers
        self._limiting, self._forgetting, self._seeing, self._looking, self._committing = [
            [watchers[k] for k in having] for having in _having_hooks(*map(type, watchers))
        ]
        self.listeners: list[LegWatcher] = []
        self.begun: State = {}
        self.taken = 0
        self.was_interrupted = False
        self._counts = 0, 0
        self._sees_more = False

    def most(self) -> int:
        """Return the most steps of the next block for which watchers look."""
        return min([watcher.most(self._leg) for watcher in (*self._limiting, *self.listeners)])

    def one_block(self, most: int) -> int:
        """March on by a block of at most `most` steps, and return their number. Raises the error for the step that
        cannot be taken, or for what watchers found there; the state is then that before this step.
        """
        leg, begun = self._leg, self._leg.times.step
        self._back_up()
        try:
            last = self._attempt(most)
            errors = [watcher.commit(leg, begun, last) for watcher in (*self._committing, *self.listeners)]
        except BaseException:  # an interrupt: return to the state after the last complete block
            leg.losses.retired.return_to(begun)
            self.replay(0)
            leg.times.step = begun
            raise
        self.was_interrupted = last is not None and last.kind is Kind.BOUND
        error = next((error for error in errors if error is not None), None)
        if last is not None and last.kind is Kind.FAILED:
            error = error or self._failure_of_next_step() or last.error
        if error is not None:
            raise error
        return leg.times.step - begun

    def _attempt(self, most: int) -> Interruption | None:
        """March on by at most `most` steps, up to the earliest of what watchers find; return that, if any."""
        last: Interruption | None = None
        try:
            count = self.march(most)
        except IntegrationError as error:
            # Explicit methods look at the end of a block only; an iteration tells which step did not converge.
            known = isinstance(error, ConvergenceError)
            count = error.step - self._leg.step if known else last_good(self._can_be_taken, most)
            last = Interruption(count, Kind.FAILED, error)
            self.replay(count)
        if self._sees_more:
            self.replay(count)
        for watcher in self._looking:
            found = watcher.look(self._leg, count)
            if found is not None:
                if found.step < count:
                    self.replay(found.step)
                count, last = found.step, found
        self._leg.times.step += count
        return last

    def _failure_of_next_step(self) -> IntegrationError | None:
        """Return the error with the number and the time of the step that cannot be taken."""
        self._leg.losses.retired.begin()
        try:
            self.march_copy(self._leg.stepper.copied(), self._leg.clock, 1)
        except IntegrationError as error:
            return error
        return None

    def _can_be_taken(self, steps: int) -> bool:
        """Return whether `steps` steps of the block that has just failed can be taken, after taking them."""
        try:
            self.replay(steps)
        except IntegrationError:
            return False
        return True

    def _back_up(self) -> None:
        """Copy the state at the beginning of a block."""
        state = self._leg.stepper.state
        if self.begun:
            for name, array in state.items():
                self.begun[name][...] = array
        else:
            self.begun = {name: array.copy() for name, array in state.items()}
        self._counts = self._leg.stepper.counts()
        self._leg.listing.begin()

    def replay(self, count: int) -> None:
        """March `count` steps from the state at the beginning of the block."""
        leg = self._leg
        for name, array in leg.stepper.state.items():
            np.copyto(array, self.begun[name])
        leg.stepper.evaluations, leg.stepper.particle_evaluations = self._counts
        leg.listing.return_to_begin()
        leg.times.forget()
        self.taken = 0
        if count:
            self.march(count)
        else:
            self._forget()

    def _forget(self) -> None:
        for watcher in self._forgetting:
            watcher.forget()

    def march(self, count: int, copy: State | None = None) -> int:
        """March `count` steps, or those before the goal of the clock, and let watchers see them; return their number.

        copy : of the state, to be marched in its place
        """
        leg = self._leg
        stepper, observers, begun = leg.stepper, leg.observers, leg.times.step
        state, before = (stepper.state, self.begun) if copy is None else (copy, stepper.state)
        self._forget()
        numbers = leg.times.numbers(state, leg.clock)
        (h, origin), sees = leg.times.pace(numbers), observers.sees_path
        self._sees_more = False
        path = observers.path(count) if sees else _NOTHING
        self.taken = count = stepper.bodies(state, before, leg.clock, numbers, path, count)
        leg.times.note(count, numbers)
        if count:
            observers.begin(state["approaches"], begun, origin)
            self._sees_more = observers.may_pass(stepper.loops.scratch)
            if sees:
                observers.look(h, count, state["q"], state["v"], stepper.loops.parallel)
        samples = leg.samples.of_particles(count) if copy is None else NO_SAMPLES
        stepper.particles(state, leg.clock, numbers, leg.losses.retired.block, observers, count, samples)
        if count:
            leg.listing.judge(leg, count)
            for watcher in self._seeing:
                watcher.see(leg, Block(count, begun, h))
            leg.listing.add(observers.lists)
        return count

    def march_copy(self, copy: State, clock: Clock, count: int, *, particles: bool = True) -> int:
        """March a copy of the state by `count` steps of a clock, or those before its goal, without watchers; return
        their number. Particles that were lost since `Retired.begin` stay where they are, or all without `particles`.
        """
        leg = self._leg
        numbers = leg.times.numbers(copy, clock)
        count = leg.stepper.bodies(copy, leg.stepper.state, clock, numbers, _NOTHING, count)
        if particles:
            leg.stepper.particles(copy, clock, numbers, leg.losses.retired.block, None, count)
        return count

    def go_back(self, steps: int) -> None:
        """Return to the state after the first `steps` steps of the last block."""
        leg, count = self._leg, self.taken
        if steps < count:
            for watcher in (*self.watchers, *self.listeners):
                watcher.go_back(leg, steps, count)
            leg.times.step -= count
            self.replay(steps)
            leg.times.step += steps

    def try_out(self) -> None:
        """March one step of a copy of the state, with all that looks at it; the leg does not change."""
        leg = self._leg
        counts, listed = leg.stepper.counts(), leg.listing.passages.keep()
        copy: State = {name: array.copy() for name, array in leg.stepper.state.items()}
        try:
            self.march(1, copy)
        finally:
            leg.stepper.evaluations, leg.stepper.particle_evaluations = counts
            leg.listing.passages.put_back(listed)
            leg.times.forget()
            self.taken = 0
            self._forget()
