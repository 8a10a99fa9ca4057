"""The passages that a run went through: what its marcher recorded, in the order of the system's bodies."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, IntegrationError
from orbits.kernels import encounters
from orbits.kernels.encounters import DISTANCE2, PARTNER, SPEED2, TIME
from orbits.propagation.marchers import bound, restore
from orbits.propagation.passage_effect import Pair

if TYPE_CHECKING:
    from orbits.marching.clocks import Clock
    from orbits.marching.marcher import Marcher
    from orbits.system import System
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

SAME = 1.5
"""Steps by which two records of one passage may differ."""


class Record(NamedTuple):
    """What a marcher saw: `closest` (4, 2, rows) and `listed` (n, columns), see `orbits.kernels.encounters`; how many
    passages more there were; the body that dominates the system, in the kernels' rows, or -1; how close to each
    massive body flybys are listed; and what the clock read then.
    """

    closest: Array
    listed: Array
    left_out: int
    dominant: int
    reaches: Array
    end: float

    @classmethod
    def of(cls, marcher: Marcher, end: float) -> Record:
        """Return what a marcher has seen up to now, and what happens from there to the end of the run, less than a step
        later.
        """
        dominant, reaches, step = marcher.dominant, marcher.reaches.copy(), marcher.reading
        if marcher.clock.changes:
            if (end - marcher.time) * marcher.clock.direction > 0.0:  # not where a condition ended it later
                with suppress(IntegrationError):  # where the run itself failed
                    marcher = marcher.ended_at(end)
            return cls(marcher.approaches(), *marcher.passages(), dominant, reaches, marcher.reading)
        closest, (listed, left_out) = marcher.approaches(), marcher.passages()
        h = marcher.clock.h
        rest = end - marcher.clock.time(step)
        if not 0.0 < rest / h < 1.0:
            return cls(closest, listed, left_out, dominant, reaches, step)
        try:
            part = marcher.part_of_a_step(rest)
        except IntegrationError:  # where the run itself failed
            return cls(closest, listed, left_out, dominant, reaches, step)
        share = rest / h
        later, (more, _) = part.approaches(), part.passages()
        later[TIME] = step + share * later[TIME]
        nearer = later[DISTANCE2] < closest[DISTANCE2]
        closest = np.where(nearer, later, closest)
        more = more.copy()
        more[:, encounters.STEP] = step
        more[:, encounters.WHEN] = step + share * more[:, encounters.WHEN]
        return cls(closest, np.concatenate([listed, more]), left_out, dominant, reaches, step)


@dataclass(frozen=True, eq=False)
class Passage:
    """One passage of a body by another one, numbered as in the system; floats in its units.

    step : what the clock reads where the states are, at the beginning of a step; steps : at the pericentre
    distance, speed : at the pericentre
    state : (6,), position and velocity relative to the other, or None where they are not known
    about : (6,), relative to the dominant body; zeros without one
    """

    body: int
    other: int
    step: float
    steps: float
    distance: float
    speed: float
    state: Array | None = None
    about: Array | None = None

    def pair(self, system: System, dominant: int) -> Pair | None:
        """Return the lighter body and the other for `passage_effect`; None where the states are not known.

        dominant : number of the body that dominates the system, or -1
        """
        if self.state is None or self.about is None:
            return None
        gm = system.values.gm
        mu, state, about = float(gm[self.body] + gm[self.other]), self.state, self.about
        light, heavy, other = self.body, self.other, about - state
        if gm[light] > gm[heavy]:
            light, heavy, state, other = heavy, light, -state, about
        if dominant < 0 or heavy == dominant:
            other = np.zeros(6)
        return Pair(
            mu,
            float(gm[heavy]) / mu,
            state[:3],
            state[3:],
            system.values.softening,
            float(gm[dominant]) if dominant >= 0 else 0.0,
            other[:3],
            other[3:],
        )


class Seen:
    """All passages of a run that are known: those that were listed, and the closest approach of each body.

    passages : numbered from 0; errors : what is known of the error at the end that they cause; refined : the numbers of
        those that are as good as the orbit
    dominant : number of the body that dominates the system, or -1
    reach : (bodies,), how close to each body flybys are listed; end : what the clock read at the end of the run
    closest : (bodies, 2) numbers of passages, -1 where there is none: the closest to the dominant body, and to another
    flybys : numbers of the passages that are listed, and of the closest approaches but to the dominant body
    """

    def __init__(self, system: System, record: Record, clock: Clock) -> None:
        massive = system.massive
        self._order = np.concatenate([np.flatnonzero(massive), np.flatnonzero(~massive)])
        self._gm = system.values.gm
        self.dominant = int(self._order[record.dominant]) if record.dominant >= 0 else -1
        self.left_out, self.end, self._clock = record.left_out, record.end, clock
        self.refined: set[int] = set()
        self.errors: dict[int, float | None] = {}
        self.reach = np.zeros(len(system))
        self.reach[massive] = record.reaches
        self.passages = [self._listed(row) for row in record.listed]
        self.closest = np.full((len(system), 2), -1)
        for row, body in enumerate(self._order):
            for column in (0, 1):
                if math.isfinite(record.closest[DISTANCE2, column, row]):
                    self.closest[body, column] = self._number_of(record.closest[:, column, row], int(body))

    @classmethod
    def by(cls, trajectory: Trajectory, record: Record | None) -> Seen:
        """Return what a run saw; of one in an archive without `record`, what its last checkpoint holds."""
        if record is None:
            assert trajectory.archive is not None
            marcher = bound(trajectory.system, trajectory.integrator, trajectory.clock, threads=1)
            restore(marcher, trajectory.archive.checkpoint(), trajectory.archive.path)
            if not trajectory.clock.changes and marcher.step > trajectory.archive.grid.whole_steps:
                raise ArchiveError(
                    f"{trajectory.archive.path} is damaged: its checkpoint is at step {marcher.step}, which lies "
                    "behind the end of the run. Restore it from a copy."
                )
            record = Record.of(marcher, float(trajectory.times[-1]) if len(trajectory) else 0.0)
        return cls(trajectory.system, record, trajectory.clock)

    @cached_property
    def flybys(self) -> list[int]:
        """Numbers of the passages by others than the dominant body, in the order in which they are known."""
        return [k for k, passage in enumerate(self.passages) if self.dominant not in (passage.body, passage.other)]

    def _listed(self, row: Array) -> Passage:
        begin, end = encounters.STATE, encounters.ABOUT
        return Passage(
            body=int(self._order[int(row[encounters.ROW])]),
            other=int(self._order[int(row[encounters.MATE])]),
            step=float(row[encounters.STEP]),
            steps=float(row[encounters.WHEN]),
            distance=math.sqrt(row[encounters.LEAST2]),
            speed=math.sqrt(row[encounters.FASTEST2]),
            state=row[begin:end],
            about=row[end:],
        )

    def _number_of(self, entry: Array, body: int) -> int:
        """Return the number of a closest approach, which is listed or is now."""
        other, steps = int(self._order[int(entry[PARTNER])]), float(entry[TIME])
        key = (min(body, other), max(body, other))
        same = 0.0 if self._clock.changes else SAME
        for k in self._numbers.get(key, ()):
            if self.passages[k].steps == steps or abs(self.passages[k].steps - steps) < same:
                return k
        distance, speed = math.sqrt(entry[DISTANCE2]), math.sqrt(entry[SPEED2])
        begin: float = math.floor(steps)
        if self._clock.changes:  # no step is known there: half the time that the passage takes
            way = 0.5 * distance / speed if speed > 0.0 else 0.0
            begin = steps - self._clock.direction * min(way, abs(steps))
        self.passages.append(Passage(body, other, begin, steps, distance, speed))
        self._numbers.setdefault(key, []).append(len(self.passages) - 1)
        return len(self.passages) - 1

    @cached_property
    def _numbers(self) -> dict[tuple[int, int], list[int]]:
        numbers: dict[tuple[int, int], list[int]] = {}
        for k, passage in enumerate(self.passages):
            key = (min(passage.body, passage.other), max(passage.body, passage.other))
            numbers.setdefault(key, []).append(k)
        return numbers

    def gm(self, passage: Passage) -> float:
        """Return GM of the two bodies of a passage together."""
        return float(self._gm[passage.body] + self._gm[passage.other])
