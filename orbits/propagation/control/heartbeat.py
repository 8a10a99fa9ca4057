"""A line about a run every minute, say: for logs, where no progress bar can be shown."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.archive.storage import human
from orbits.errors import InputError, shown, with_unit
from orbits.propagation.control.wall_clock import seconds_of, wall_time_text
from orbits.trajectory import Trajectory

if TYPE_CHECKING:
    from orbits.archive import ArchiveWriter
    from orbits.propagation.loop import Run


@dataclass(frozen=True)
class Heartbeat:
    """A line about a run again and again: the time reached, steps per second, what is left, and the drift of energy and
    angular momentum since the start.

    every : the wall time from line to line: a quantity, a number of seconds, or a text such as "5 min"
    to : called with each line, as in `to=logging.info`; None prints them on standard error
    first : the wall time until the first line, so that one soon knows what is left; that of `every` by default

    Raises InputError for anything but one finite time above 0, and for what cannot be called.
    """

    every: Any = 60.0
    to: Callable[[str], object] | None = None
    first: Any = None

    def __post_init__(self) -> None:
        seconds_of(self.every, "Heartbeat.every")
        if self.first is not None:
            seconds_of(self.first, "Heartbeat.first")
        if self.to is not None and not callable(self.to):
            raise InputError(f"Heartbeat.to is {shown(self.to)}; expected a function of a text, such as logging.info.")

    @property
    def seconds(self) -> float:
        """The wall time from line to line."""
        return seconds_of(self.every, "Heartbeat.every")

    @property
    def patience(self) -> float:
        """The wall time until the first line, in seconds."""
        return self.seconds if self.first is None else seconds_of(self.first, "Heartbeat.first")

    def say(self, text: str) -> None:
        """Give one line."""
        if self.to is None:
            print(text, file=sys.stderr, flush=True)
        else:
            self.to(text)


def heartbeat_of(given: Any) -> Heartbeat | None:
    """Return what `propagate` takes as `heartbeat`: None, a Heartbeat, or the wall time from line to line."""
    if given is None or isinstance(given, Heartbeat):
        return given
    return Heartbeat(seconds_of(given, "heartbeat"))


class Pulse:
    """The lines about one run or several: when one is due, and what all of them say.

    heartbeat : None for none; begun : the time from which it is marched, of a run to `end`; steps : the steps before
    """

    def __init__(self, heartbeat: Heartbeat | None, unit: Any, end: float, begun: float = 0.0, steps: int = 0) -> None:
        self._heartbeat, self._end, self._unit = heartbeat, end, unit
        self._begun = self._last = time.perf_counter(), begun, steps
        self._pause = math.inf if heartbeat is None else heartbeat.patience

    @property
    def due(self) -> bool:
        """Whether it is time for a line."""
        return time.perf_counter() - self._last[0] >= self._pause

    @property
    def beaten(self) -> bool:
        """Whether there was one."""
        return self._last is not self._begun

    def beat(self, reached: float, steps: int, more: Iterable[str], *, last: bool = False) -> None:
        """Give a line: the time and the number of steps reached, and more. The last one has the mean rate."""
        assert self._heartbeat is not None
        now = time.perf_counter()
        before = self._begun if last else self._last
        rate = (steps - before[2]) / max(now - before[0], 1e-9)
        left = self._left(reached, now)
        parts = [
            f"{abs(reached / self._end):.1%}",
            f"t = {self._times(reached)}",
            f"{_in_digits(rate)} steps/s",
            f"after {wall_time_text(now - self._begun[0])}" if last else left,
            *more,
        ]
        self._last, self._pause = (now, reached, steps), self._heartbeat.seconds
        self._heartbeat.say(f"{time.strftime('%Y-%m-%d %H:%M:%S')}  {', '.join(filter(None, parts))}")

    def _times(self, reached: float) -> str:
        from orbits.plotting.words import fitting_time

        factor, unit = fitting_time(self._end, self._unit)
        return with_unit(f"{factor * reached:,.6g} of {factor * self._end:,.6g}", unit)

    def _left(self, reached: float, now: float) -> str:
        """Return how long the rest takes, if it is as fast as what was marched here so far."""
        done, rest = abs(reached - self._begun[1]), abs(self._end - reached)
        return f"{wall_time_text((now - self._begun[0]) * rest / done)} left" if done and rest else ""


class Beats:
    """The lines about a run that is marched, in place of a progress bar; see `Pulse`."""

    def __init__(self, heartbeat: Heartbeat, run: Run, writer: ArchiveWriter | None) -> None:
        self._reached = run.marcher.time, run.marcher.step
        self._pulse = Pulse(heartbeat, run.system.units.time, run.grid.end, *self._reached)
        self._run, self._writer = run, writer

    def update(self, done: float, steps: int) -> None:
        """Give a line if it is time for it, and there were steps since the last time."""
        goes_on, self._reached = steps > self._reached[1], (done, steps)
        if goes_on and self._pulse.due:
            self._pulse.beat(done, steps, self._told())

    def close(self) -> None:
        """Give the last line, where there were others."""
        if self._pulse.beaten:
            self._pulse.beat(*self._reached, self._told(), last=True)

    def _told(self) -> Iterator[str]:
        system, marcher = self._run.system, self._run.marcher
        yield from drift_now(self._run)
        bodies, massless = len(system), int(np.count_nonzero(~system.massive))
        lost = len(marcher.retired())
        if massless:
            yield f"{massless - lost:,} of {massless:,} particles"
        changes = marcher.changes()
        if changes is not None:
            there = int((changes.bodies_at(marcher.time).present & system.massive).sum())
            yield f"{there:,} of {bodies - massless:,} massive bodies"
        if self._writer is not None:
            done, size = self._writer.committed, human(self._writer.size)
            yield f"{done:,} of {len(self._run.grid):,} samples in {self._writer.path.name}, {size}"


def drift_now(marched: Run) -> list[str]:
    """Return the relative changes of energy and angular momentum since the start of a run, as `Trajectory.drift` has
    them at its last sample, in words; nothing for those that are not conserved.
    """
    marcher = marched.marcher
    q, v = marcher.state()
    run = Trajectory(
        marched.system,
        np.array([marcher.time]),
        q[None],
        v[None],
        step=marched.grid.clock,
        integrator=marched.integrator,
        accounts=marcher.accounts()[None],
    )
    run.changes = marcher.changes()
    kept = run.drift()
    drifts = {"dE/E": kept.energy.last_fraction, "dL/L": kept.angular_momentum.last_fraction}
    return [f"{name} {drift:.1e}" for name, drift in drifts.items() if not math.isnan(drift)]


def _in_digits(rate: float) -> str:
    """Return a rate with three digits that count, without a power of ten: 3,550,000; 0.125."""
    return f"{float(f'{rate:.3g}'):,.{0 if rate >= 100.0 else 3}f}"
