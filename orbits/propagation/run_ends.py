"""What may end a run before its last sample: conditions, callbacks, events of bodies with mass."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from astropy import units as u

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.marching.legs import within_step
from orbits.marching.legs.march import March
from orbits.marching.watching.leg_observers import ENERGY
from orbits.propagation.control.stop_conditions import Condition, Conditions, WallTimeOver, asks_to_stop
from orbits.propagation.control.wall_clock import Deadline
from orbits.propagation.events.base import Found, Happening, Sample, Sought
from orbits.propagation.events.seeking import Seeking
from orbits.results.stop import Stop
from orbits.system import System
from orbits.system.model import continued
from orbits.trajectory.changes import at_time
from orbits.trajectory.events import BODY, NUMBER, OTHER, TIME
from orbits.trajectory.retired import absent, moved

if TYPE_CHECKING:
    from orbits.propagation.chain_of_legs import ChainOfLegs

Callback = Callable[[u.Quantity, System], object]


@dataclass
class RunEnds:
    """The conditions that may end a run early, and the one that did.

    system, marcher : of the run
    before : the sample from which it goes on; deadline : the limit of its wall time, if there is one
    """

    system: System
    marcher: March
    conditions: Conditions
    callback: Callback | None
    check_step: bool
    events: Seeking
    before: Sample | None = None
    deadline: Deadline | None = None
    stopped: Stop | None = None
    begun: float = 0.0

    def ended(self, *, done: bool) -> bool:
        """Return whether a condition that ends the run holds, and note it; done : whether it is at its end, so that no
        time is left to be limited.
        """
        marcher = self.marcher
        if marcher.ended is not None:
            row, bodies = marcher.ended
            names = " and ".join(self.system.names[int(k)] for k in row[[BODY, OTHER]])
            event = self.events.asked.of[int(row[NUMBER])]
            self.note(float(row[TIME]), (bodies.q, bodies.v), f"{names}: collision", event)
            return True
        watched = self.conditions.energy < np.inf
        found = self.conditions.exceeded() if watched and marcher.current.last.bounds.met == ENERGY else None
        if found is None and not done:
            found = self.conditions.overdue(time.perf_counter() - self.begun)
        if found is None and not done and self.deadline is not None and self.deadline.over:
            found = self.deadline.words, WallTimeOver(self.deadline.seconds)
        if found is not None:
            self.note(marcher.time, marcher.state(), *found)
        return found is not None

    def at_end(self, end: float) -> None:
        """Note a condition on the ends of steps that holds at the end of the run, if it lies within a step."""
        home = self.marcher.home
        if self.conditions.energy < np.inf and home.time != end:
            with suppress(IntegrationError):
                last = within_step.ended_at(home, end)
                if last.bounds.met == ENERGY:
                    self.note(end, self.marcher.state_after(end - self.marcher.time), *self.conditions.exceeded())

    def interrupted(self, found: Found | None) -> bool:
        """Return whether an event ends the run, and note it; others that interrupt it act, before it ends."""
        if found is None:
            return False
        marcher, asked, several = self.marcher, self.events.asked, (found, *found.besides)
        acting = [one for one in several if asked.of[one.number].acts]
        caused = self._act(acting) if acting else None
        if len(acting) == len(several):
            return self.interrupted(caused)
        state = marcher.state_after(found.time - marcher.time)
        at = self.system_at(found.time, *state) if self.events.touching else None
        self.events.of_bodies.log.drop_after(found.time)  # collisions in the step, which may be listed before
        self.end_at(asked.happening(several[-1], state, at), found.time, state)
        return True

    def _act(self, acting: Sequence[Found]) -> Found | None:
        """Let events of one time act, each on what those before it made of the bodies; return one that ends the run by
        what they did, if any.
        """
        marcher, asked, time = self.marcher, self.events.asked, acting[0].time
        state = marcher.state_after(time - marcher.time)
        before = now = asked.happening(acting[0], state).system
        kind = ""
        try:
            for happening in (asked.happening(one, state, now) for one in acting):
                changed = happening.event.then.act(happening)
                if changed is not None:
                    now, kind = changed, happening.kind
            if kind:
                cast("ChainOfLegs", marcher).change(kind, time, *state, before, now)
        except Exception:
            self.events.of_bodies.log.drop_from(time)  # a run that is resumed acts there
            raise
        if not kind:
            return None
        former = list(asked.bounds)
        marcher.follow_events()
        return self.events.jump_at(acting, former, state, marcher.state())

    def end_at(self, happening: Happening, time: float, state: tuple[Array, Array]) -> None:
        """Note the event that ends the run."""
        names = [name for name in (happening.body, happening.other) if name is not None]
        reason = " and ".join(names) + ": " * bool(names) + happening.kind
        self.note(time, state, reason, self.conditions.given(happening.event))

    def after(self) -> Found | None:
        """Take the block that was just marched; return the first event in it that interrupts the run, if any."""
        if not self.events.events:
            return None
        if self.events.touching:
            return cast("Found | None", self.marcher.found)  # it seeks them itself, from collision to collision
        return self.events.after(self.marcher.current)

    def ahead(self, time: float) -> Found | None:
        """Return the first event that interrupts the run before a time less than a step ahead, if any."""
        found, marcher = None, self.marcher
        if self.events.stops is not None:
            sample = Sample(time, *marcher.state_after(time - marcher.time))
            found = self.events.before_sample(marcher.current, sample)
        return found or self.events.ahead(marcher.current, time)

    def called_back(self, sample: Sample, accounts: Array) -> bool:
        """Return whether the callback ends the run at a sample, and note it; accounts : of the forces there."""
        if self.callback is None:
            return False
        time, now = u.Quantity(sample.time, self.system.units.time), self.system_at(*sample, accounts)
        if not asks_to_stop(self.callback, time, now):
            return False
        self.note(sample.time, sample[1:], "the callback ended the run", None, accounts)
        return True

    def note(
        self,
        now: float,
        state: tuple[Array, Array],
        reason: str,
        condition: Condition | Sought | None,
        accounts: Array | None = None,
    ) -> None:
        """Record the reason, the time and the state: q and v, (bodies, 3), and accounts as in `system_at`."""
        t = u.Quantity(now, self.system.units.time)
        self.stopped = Stop(f"{reason} at t = {t:.10g}", condition, t, self.system_at(now, *state, accounts))

    def system_at(self, time: float, q: Array, v: Array, accounts: Array | None = None) -> System:
        """Return the system at a time, with q and v, (n, 3), and the bodies that are there.

        accounts : of the forces there, (forces, columns), with their internal variables; None for those of the state
            that the march returned last
        """
        changes = self.marcher.changes()
        if changes is not None:
            return at_time(self.system, changes, q, v, time)
        system = continued(self.system, self.marcher.accounts() if accounts is None else accounts)
        return moved(system, q, v, time, absent(q, v, self.system.massive))
