"""The passages of a run: what a march records of them, and these with the bodies numbered as in the system."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.search import record
from orbits.kernels.search.record import DISTANCE2, PARTNER, SPEED2, TIME
from orbits.system.model import given_bodies

if TYPE_CHECKING:
    from orbits.marching.clocks.clock import Clock
    from orbits.marching.legs.record import Record
    from orbits.system import System

Array = NDArray[np.float64]

UNBOUND = 2.0 * (1.0 + 1e-6)
"""The least v^2 r / GM at the pericentre of a hyperbola, with a margin for passages that are only estimated."""

SAME = 1.5
"""The number of steps by which two records of one passage may differ."""


@dataclass(frozen=True, eq=False)
class Passage:
    """One passage of a body by another one, numbered as in the system; floats in its units.

    step : reading of the clock at the time of the states, the beginning of a step; steps : reading at the pericentre
    distance, speed : at the pericentre
    state : (6,), position and velocity relative to the other body, or None if they are not known
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


class Seen:
    """All known passages of a run: the listed ones, and the closest approach of each body.

    passages : numbered from 0; errors : the errors at the end of the run that they cause, if known; refined : the
        numbers of those refined to the accuracy of the orbit; estimated : those among them for which that was not
        possible, so that they are as recorded, from the two-body orbit within the step; recorded : the others that
        were, before
    dominant : number of the body that dominates the system, or -1
    reach : (bodies,), distance within which flybys are listed; end : reading of the clock at the end of the run
    closest : (bodies, 2) numbers of passages, -1 for none: the closest to the dominant body, and to any other body
    looked : whether the run looked for these; if not, the passages are the listed ones alone
    flybys : numbers of the listed passages, and of the closest approaches to bodies other than the dominant one, or to
        that one on a hyperbola
    """

    def __init__(self, system: System, record: Record, clock: Clock) -> None:
        massive = system.massive
        self._order = np.concatenate([np.flatnonzero(massive), np.flatnonzero(~massive)])
        self._gm = system.values.gm
        self.dominant = int(self._order[record.dominant]) if record.dominant >= 0 else -1
        self.left_out, self.end, self._clock = record.left_out, record.end, clock
        self.refined: set[int] = set()
        self.estimated: set[int] = set()
        self.recorded: dict[int, Passage] = {}
        self.errors: dict[int, float | None] = {}
        self.reach = np.zeros(len(system))
        self.reach[massive] = record.reaches
        self.looked = record.closest is not None
        self._system, self._record = system, record

    @property
    def passages(self) -> list[Passage]:
        """All passages, by their numbers."""
        return self._numbered[0]

    def judged(self, k: int) -> Passage:
        """Return a passage as recorded, if its states were: steps that do not resolve it do not refine it, either."""
        return self.recorded.get(k, self.passages[k])

    @property
    def closest(self) -> NDArray[np.intp]:
        """The numbers of the closest approaches, (bodies, 2)."""
        return self._numbered[1]

    @cached_property
    def _numbered(self) -> tuple[list[Passage], NDArray[np.intp]]:
        """The passages, and the numbers of the closest approaches: most runs end without a question about them."""
        system, record = self._system, self._record
        # Of two bodies that are read from an ephemeris, only the states at the ends of steps are known.
        given = np.isin(system.names, given_bodies(system))
        listed = [self._listed(row) for row in record.listed]
        passages = [one for one in listed if not (given[one.body] and given[one.other])]
        numbers: dict[tuple[int, int], list[int]] = {}
        for k, passage in enumerate(passages):
            numbers.setdefault(_key(passage.body, passage.other), []).append(k)
        closest = np.full((len(system), 2), -1)
        entries = np.zeros((4, 2, 0)) if record.closest is None else record.closest[..., : len(system)]
        for row, column in np.argwhere(np.isfinite(entries[DISTANCE2].T)).tolist():
            body, entry = int(self._order[row]), entries[:, column, row]
            if given[body]:
                continue
            of_pair = numbers.setdefault(_key(body, int(self._order[int(entry[PARTNER])])), [])
            known = next((k for k in of_pair if self._is_same(passages[k], float(entry[TIME]))), None)
            if known is None:
                known = len(passages)
                passages.append(self._of_entry(entry, body))
                of_pair.append(known)
            closest[body, column] = known
        return passages, closest

    @cached_property
    def flybys(self) -> list[int]:
        """Numbers of the passages by bodies other than the dominant one, and by that one on a hyperbola, in order of
        discovery.
        """
        passages = enumerate(self.passages)
        return [k for k, one in passages if self.dominant not in (one.body, one.other) or self._free(one)]

    def _free(self, passage: Passage) -> bool:
        """Return whether two bodies leave each other for good after a passage."""
        return passage.speed**2 * passage.distance > UNBOUND * self.gm(passage)

    def _listed(self, row: Array) -> Passage:
        begin, end = record.STATE, record.ABOUT
        return Passage(
            body=int(self._order[int(row[record.ROW])]),
            other=int(self._order[int(row[record.MATE])]),
            step=float(row[record.STEP]),
            steps=float(row[record.WHEN]),
            distance=math.sqrt(row[record.LEAST2]),
            speed=math.sqrt(row[record.FASTEST2]),
            state=row[begin:end],
            about=row[end:],
        )

    def _is_same(self, passage: Passage, steps: float) -> bool:
        """Return whether a passage of a pair is the one at a reading of the clock."""
        return passage.steps == steps or abs(passage.steps - steps) < (0.0 if self._clock.changes else SAME)

    def _of_entry(self, entry: Array, body: int) -> Passage:
        """Return the closest approach of a body."""
        other, steps = int(self._order[int(entry[PARTNER])]), float(entry[TIME])
        distance, speed = math.sqrt(entry[DISTANCE2]), math.sqrt(entry[SPEED2])
        begin: float = math.floor(steps)
        if self._clock.changes:  # the step there is unknown: half the duration of the passage
            way = 0.5 * distance / speed if speed > 0.0 else 0.0
            begin = steps - self._clock.direction * min(way, abs(steps))
        return Passage(body, other, begin, steps, distance, speed)

    def gm(self, passage: Passage) -> float:
        """Return the total GM of the two bodies of a passage."""
        return float(self._gm[passage.body] + self._gm[passage.other])


def _key(one: int, other: int) -> tuple[int, int]:
    return min(one, other), max(one, other)
