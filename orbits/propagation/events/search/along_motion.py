"""The search for events on the motion of some bodies: of all that have mass, or of these and a massless one."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EventError
from orbits.marching.stepping.motion import Collected, Motion
from orbits.propagation.events.asked import Asked
from orbits.propagation.events.base import NOBODY, STOP, Array, Bound, Found, Whole
from orbits.propagation.events.bodies_left import Left, sides_of
from orbits.propagation.events.functions import Raised
from orbits.propagation.events.log import Log
from orbits.propagation.events.search.brackets import NotFiniteError, Stretch, brackets_of, may_come_within
from orbits.propagation.events.search.meaning import (
    SAME,
    are_at_start,
    are_clear,
    in_every_step,
    in_rapid_succession,
)
from orbits.propagation.events.search.zeros import NEAR_BY, Zeros, zeros_of
from orbits.trajectory.events import BODY, COLUMNS, MOST_EVENTS, NUMBER, OTHER, RISING, TIME

STEPS, NUMBERS = 4096, 1 << 22
"""The steps, and roughly the numbers that describe their motion, after which events are sought that only record."""

ROUND_OFF = (
    "where its function is nothing but round-off, as for apsides of a circular orbit, nodes of one in the plane, or an "
    "element that stays at the value; such zeros mean nothing, and are left out."
)
EVERY_STEP = (
    "in every one of many steps: its function changes faster than the steps, and zeros are missed if there is more "
    "than one extremum between two checks. Give a shorter dt, or seek something else."
)
CAUSED = "came about by what another event did, where it does not act itself."
"""What is said of events that mean nothing, that happen in every step, and that others cause."""

ENOUGH = 0.25
"""The share of these steps from which on a block is searched as it is, not copied first."""

ROUNDED = 2.0**-46
"""Times that differ by less than this fraction of themselves are those of one event, found twice."""


class MotionSearch:
    """The search for the zeros of some functions, and what was found of them.

    asked : the events; numbers : of the functions
    subjects : the massless bodies on whose motion, besides that of all with mass, they are sought

    interrupts : whether any of the events ends the run, or acts; log : the rows of those found
    """

    def __init__(self, asked: Asked, numbers: list[int], subjects: tuple[int, ...]) -> None:
        self.asked, self.subjects, self._direction = asked, subjects, asked.direction
        self.numbers, self._bounds, self._of = numbers, asked.bounds, asked.of
        self.interrupts = any(self._of[k].interrupts for k in numbers)
        if numbers:
            self._there = asked.system.massive.copy()
            self._there[list(subjects)] = True
            self._begin_leg()
        self._since = -self._direction * np.inf
        self._remarks: dict[int, str] = {}
        self._longest = 0.0
        self.log = Log(self._direction)

    def _begin_leg(self) -> None:
        """Make room for the motion of these bodies, and see which of them matter."""
        self._needed = np.zeros(len(self.asked.system), dtype=bool)
        for k in self.numbers:
            bodies = self._bounds[k].bodies()
            self._needed[slice(None) if bodies is None else bodies] = True
        most = max(1, min(STEPS, NUMBERS // (30 * len(self.asked.system))))
        self._collected, self._enough = Collected(most), ENOUGH * most

    def go_on_with(self, left: Left) -> None:
        """Seek the events of the bodies that are left after collisions; those of bodies that are gone are over."""
        self.flush()
        if not self:
            return
        self._there = self.asked.system.massive & ~left.gone
        try:
            over = self.asked.go_on_with(left)
        except (EventError, Raised):
            self.log.broken = True
            raise
        for number in over.keys() & set(self.numbers):
            self._remark(number, over[number])
        self.numbers = [k for k in self.numbers if len(self._bounds[k].pairs)]
        self._begin_leg()

    def jump(
        self,
        former: list[Bound],
        time: float,
        before: tuple[Array, Array],
        after: tuple[Array, Array],
        but: Collection[int] = (),
    ) -> Found | None:
        """Go through a change of bodies: functions whose sign is another one after it are zero there. Return the first
        that stops the run, if any; those that act are listed, but do not act on what has just been done to the bodies.

        former : the functions before it; before, after : q and v of all bodies, (n, 3), at that time
        but : the numbers of functions that are left out
        """
        found: list[Found] = []
        try:
            for number in self.numbers:
                if number not in but:
                    found += self._jumps(number, former[number], time, before, after)
        except (EventError, Raised):
            self.log.broken = True
            raise
        for one in found:
            if self._of[one.number].acts:
                self._remark(one.number, CAUSED)
        return next((one for one in found if self._of[one.number].then == STOP), None)

    def _jumps(
        self, number: int, former: Bound, time: float, before: tuple[Array, Array], after: tuple[Array, Array]
    ) -> Iterator[Found]:
        """List the zeros of a function at a change of bodies: of the columns whose sign is another one after it."""
        bound, t = self._bounds[number], np.array([time])
        g, g_after, columns = sides_of(bound, former, t, before, after)
        if not np.isfinite(g_after).all():
            value = g_after[~np.isfinite(g_after)][0]
            raise self._not_finite(number, NotFiniteError(time, float(value)))
        rising = (g < 0.0) != (self._direction < 0.0)
        wanted = np.array([word is not None for word in bound.words])[rising.astype(int)]
        which = np.flatnonzero(((g >= 0.0) != (g_after >= 0.0)) & wanted)
        if not len(which):
            return
        columns, rising, sizes = columns[which], rising[which], np.abs(g_after - g)[which]
        nothing = np.zeros(len(which), dtype=np.int64)
        t, (q, v) = np.full(len(which), time), (np.repeat(x[None], len(which), axis=0) for x in after)
        kept = bound.keeps(t, q, v, columns)
        zeros = Zeros(nothing, np.zeros(len(which)), columns, rising, sizes)
        longest = max(self._longest, np.finfo(np.float64).tiny)
        clear = are_clear(bound, zeros, np.array([longest]), longest, t, q, v)
        if (kept & ~clear).any():
            self._remark(number, ROUND_OFF)
        rows = self.rows_of(number, rising, t, q, v, columns)
        for k in np.flatnonzero(kept & clear):
            if not self.log.has(rows[k], ROUNDED * abs(time)):
                self.add(rows[k], True)
                yield Found(number, int(columns[k]), bool(rising[k]), 0, time)

    def __bool__(self) -> bool:
        """Whether there are functions whose zeros are sought on the motion of the bodies with mass."""
        return bool(self.numbers)

    def take(self, motion: Motion) -> Found | None:
        """Take whole steps; return the first event that interrupts the run, if any: later ones are not listed."""
        if not self or self.interrupts:
            return self.seek(motion, True) if self else None
        if len(motion) >= self._enough or not self._collected.takes(motion):
            self.flush()
            if len(motion) >= self._enough or not self._collected.takes(motion):
                self.seek(motion, True)
        return None

    def flush(self) -> None:
        """Seek events in all steps that were taken."""
        if self and len(self._collected):
            self.seek(self._collected.emptied(), True)

    def along(self, motion: Motion, since: float) -> Found | None:
        """Seek events in the next stretch of a motion; return the first one that interrupts the run, if any.

        since : the time up to which they were sought before
        """
        self._since = since
        return self.seek(motion, False)

    def may_be(self, motion: Motion) -> Array:
        """Return the times between which there may be events in a motion whose steps resolve all passages, (2, m):
        those of the steps with brackets of zeros, and of half a step beside them. Raises NotFiniteError.
        """
        stretch, found = Stretch(motion, self._there, self._needed), [np.empty((2, 0))]
        lengths, nothing = np.diff(stretch.times), np.empty(0, dtype=np.int64)
        self._longest = max(self._longest, float(np.abs(lengths).max(initial=0.0)))
        bounds = [self._bounds[number] for number in self.numbers]
        for bound, (parts, failure) in zip(bounds, brackets_of(bounds, stretch), strict=True):
            if failure is not None:
                raise failure
            close = (some.of(may_come_within(bound, stretch, some)) for some in parts)
            steps = np.unique(np.concatenate([nothing, *(some.steps for some in close)]))
            found.append(stretch.times[steps] + lengths[steps] * np.array([[-0.5], [1.5]]))
        return np.concatenate(found, axis=1)

    def between(self, t: Array, q: Array, v: Array) -> Found | None:
        """Seek events between two states, t (2,), q and v (2, n, 3), that are too close for more than one zero of any
        function; as `along`.
        """
        try:
            return self._take(*self._between(t, q, v), t, False, True, None)
        except (EventError, Raised):
            self.log.broken = True
            raise

    def _between(self, t: Array, q: Array, v: Array) -> tuple[Array, NDArray[np.int64], None]:
        """Return what `_found` returns, between two such states."""
        rows, places = [np.empty((0, COLUMNS))], [np.empty((0, 3), dtype=np.int64)]
        for number in self.numbers:
            bound = self._bounds[number]
            g, g_end = bound.values(t, q, v, np.arange(len(bound.pairs)))
            wanted = np.array([word is not None for word in bound.words])
            rising = (g < 0.0) != (self._direction < 0.0)
            columns = np.flatnonzero(((g < 0.0) != (g_end < 0.0)) & wanted[rising.astype(int)])
            if not len(columns):
                continue
            fractions, sizes = (g / (g - g_end))[columns], NEAR_BY * np.abs(g_end - g)[columns]
            zeros = Zeros(np.zeros_like(columns), fractions, columns, rising[columns], sizes)
            at = t[0] + (t[1] - t[0]) * fractions
            there, there_v = (np.repeat(x[1:], len(columns), axis=0) for x in (q, v))
            kept = bound.keeps(at, there, there_v, columns)
            kept &= ~are_at_start(bound, zeros, np.diff(t), at, there, there_v)
            rows.append(self.rows_of(number, zeros.rising, at, there, there_v, columns)[kept])
            places.append(np.array([(number, column, 0) for column in columns])[kept])
        return np.concatenate(rows), np.concatenate(places), None

    def seek(self, motion: Motion, firm: bool, record: bool = True, until: float | None = None) -> Found | None:
        """Find the events in a stretch of the march and record them; those after one that interrupts are left out, and
        those after a time `until`.
        """
        if not len(motion):
            return None
        stretch = Stretch(motion, self._there, self._needed)
        try:
            return self._take(*self._found(stretch), stretch.times, firm, record, until)
        except (EventError, Raised):
            self.log.broken = True
            raise

    def _take(
        self,
        rows: Array,
        places: NDArray[np.int64],
        failure: EventError | None,
        times: Array,
        firm: bool,
        record: bool,
        until: float | None,
    ) -> Found | None:
        """Record what `_found` found in steps that begin and end at these times; see `seek`."""
        order = np.lexsort((rows[:, NUMBER], rows[:, TIME] * self._direction))
        if np.isfinite(self._since):
            # A sample lies within the first step: what was before is known, and what is close to it may be.
            apart = SAME * float(abs(np.diff(times)).max())
            order = order[(rows[order, TIME] - self._since) * self._direction > -apart]
            order = order[[not self.log.has(row, apart) for row in rows[order]]]
        # The stretch to the end of a run may be far shorter than the step in which an event was found before.
        apart = max(SAME * float(abs(np.diff(times)).max()), ROUNDED * float(abs(times).max()))
        order = order[self.log.are_new(rows[order, TIME], apart)]
        acting = [k for k in order if self._of[int(rows[k, NUMBER])].interrupts]
        last = float(rows[acting[0], TIME]) if acting else np.inf * self._direction
        # Behind it they would count as known.
        late = (rows[order, TIME] - last) * self._direction
        rows[order[(late > 0.0) & (late <= apart)], TIME] = last
        if until is not None:
            order = order[(rows[order, TIME] - until) * self._direction <= 0.0]
            acting = acting if (last - until) * self._direction <= 0.0 else []
            failure = None if failure is None or (failure.time - until) * self._direction > 0.0 else failure
        if record or acting:
            for k in order[(rows[order, TIME] - last) * self._direction <= 0.0]:
                self.add(rows[k], firm or bool(acting))
        if failure is not None and (failure.time - last) * self._direction <= 0.0:
            raise failure
        if not acting:
            return None
        self.log.pass_by(last)
        return self._at_once([k for k in acting if rows[k, TIME] == last], rows, places)

    def _at_once(self, acting: list[int], rows: Array, places: NDArray[np.int64]) -> Found:
        """Return what interrupts the run at one time: what acts, in turn, and then what ends it."""
        self._check_alone(rows[acting])
        acting.sort(key=lambda k: not self._of[int(rows[k, NUMBER])].acts)
        found = [
            Found(int(number), int(column), bool(rows[k, RISING]), int(step), float(rows[k, TIME]))
            for k, (number, column, step) in zip(acting, places[acting], strict=True)
        ]
        act = sum(self._of[one.number].acts for one in found)
        return found[0]._replace(besides=tuple(found[1 : act + 1]) if act else ())

    def _found(self, stretch: Stretch) -> tuple[Array, NDArray[np.int64], EventError | None]:
        """Return rows; number of the function, column and step of each; and what failed, with the rows before that."""
        rows, places, failure = [np.empty((0, COLUMNS))], [np.empty((0, 3), dtype=np.int64)], None
        bounds = [self._bounds[number] for number in self.numbers]
        answers = zeros_of(bounds, stretch)
        lengths = np.diff(stretch.times)
        self._longest = max(self._longest, float(np.abs(lengths).max()))
        for number, bound, (found, missing) in zip(self.numbers, bounds, answers, strict=True):
            if missing is not None and (failure is None or (missing.time - failure.time) * self._direction < 0.0):
                failure = self._not_finite(number, missing)
            if not len(found.steps):
                continue
            t, q, v = stretch.at(found.steps, found.fractions)
            kept = bound.keeps(t, q, v, found.columns) & ~are_at_start(bound, found, lengths, t, q, v)
            clear = are_clear(bound, found, lengths, self._longest, t, q, v)
            if (kept & ~clear).any():
                self._remark(number, ROUND_OFF)
            elif in_every_step(found.steps[kept], found.columns[kept], len(stretch)):
                self._remark(number, EVERY_STEP)
            kept &= clear
            rows.append(self.rows_of(number, found.rising, t, q, v, found.columns)[kept])
            places.append(np.column_stack([np.full(len(t), number), found.columns, found.steps])[kept])
        every, where = np.concatenate(rows), np.concatenate(places)
        if failure is not None:
            before = (every[:, TIME] - failure.time) * self._direction < 0.0
            every, where = every[before], where[before]
        return every, where, failure

    def rows_of(self, number: int, rising: NDArray[np.bool_], t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the rows of zeros of a function, whether it rises at each, and the states there."""
        bound, numbers = self._bounds[number], np.full(len(t), number)
        return np.column_stack([t, numbers, rising, bound.pairs[columns], bound.figures(t, q, v, columns)])

    def _remark(self, number: int, what: str) -> None:
        event = self._of[number]
        names = ", ".join(str(value) for value in event.given().values() if isinstance(value, str))
        self._remarks[number] = f"{type(event).__name__}({names}): {self.asked.said(number)} {what}"

    def remarks(self) -> list[str]:
        """Return what is to be said of events that mean nothing, or may be incomplete."""
        for number in self.numbers:
            # What acts ends a stretch of the march, in which it is therefore found but once.
            rows = self.log.rows[self.log.rows[:, NUMBER] == number]
            if self._of[number].acts and in_rapid_succession(rows, 0.5 * self._longest):
                self._remark(number, EVERY_STEP)
        return [said for _, said in sorted(self._remarks.items())]

    def add(self, row: Array, firm: bool) -> None:
        """List an event; firm : whether the march goes on from there. Raises EventError if there are too many."""
        if self.log.full:
            often = np.bincount(self.log.rows[:, NUMBER].astype(int))
            most, when = int(np.argmax(often)), self.asked.when(row[TIME])
            raise EventError(
                f"there are more than {MOST_EVENTS:,} events by {when}, {often[most]:,} of them "
                f"{self.asked.said(most)}. Seek fewer (a bound, a direction, fewer bodies), or run in parts; all "
                "before stays readable.",
                time=float(row[TIME]),
            )
        self.log.add(row, firm)

    def _check_alone(self, rows: Array) -> None:
        """Refuse two events that act on one body at once."""
        acting = [row for row in rows if self._of[int(row[NUMBER])].acts]
        for one, two in combinations(acting, 2):
            both = ({int(k) for k in one[BODY : OTHER + 1]} & {int(k) for k in two[BODY : OTHER + 1]}) - {NOBODY}
            if both:
                names = [self.asked.system.names[k] for k in both]
                kinds = [self._bounds[int(row[NUMBER])].words[int(row[RISING])] for row in (one, two)]
                raise EventError(
                    f"{kinds[0]!r} and {kinds[1]!r} both act on {names[0]} at {self.asked.when(one[TIME])}; expected "
                    "one at a time. Let one of them only record.",
                    time=float(one[TIME]),
                    bodies=names,
                )

    def _not_finite(self, number: int, error: NotFiniteError) -> EventError:
        when = self.asked.when(error.time)
        return EventError(
            f"the function of {self.asked.said(number)} is {error.value} at {when}; expected finite numbers. "
            "Mend the function; all before stays readable.",
            time=error.time,
        )
