"""The events of a run, sought block by block as it is marched."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import EventError, InputError, IntegrationError, shown, with_unit
from orbits.marching.stepping.motion import Collected, Motion
from orbits.marching.watching.watcher import SUSPECT
from orbits.propagation.events.base import NOBODY, STOP, Bound, Happening, Sample, Sought, Touching, Whole
from orbits.propagation.events.brackets import NotFiniteError, Stretch
from orbits.propagation.events.functions import Raised
from orbits.propagation.events.left import Left, bounds_left, sides_of
from orbits.propagation.events.log import PARTICLES, Log, padded_rows, rows_of_particles
from orbits.propagation.events.meaning import are_clear, in_every_step, in_rapid_succession
from orbits.propagation.events.search import Zeros, zeros_of
from orbits.propagation.events.stops import stops_of
from orbits.propagation.events.subjects import by_particles
from orbits.propagation.events.to_archive import description_of
from orbits.trajectory.events import (
    BODY,
    COLUMNS,
    MOST_EVENTS,
    NUMBER,
    OTHER,
    RISING,
    TIME,
    Events,
    in_order,
)
from orbits.trajectory.retired import absent, moved

if TYPE_CHECKING:
    from collections.abc import Mapping

    from orbits.marching.legs.planet_excursions import Legs
    from orbits.system import System

Array = NDArray[np.float64]

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
"""What is said of events that mean nothing, and of those that happen in every step."""

ENOUGH = 0.25
"""The share of these steps from which on a block is searched as it is, not copied first."""

SAME = 1e-9
"""Events that act on one body at once are less than this fraction of a step apart."""

ROUNDED = 2.0**-46
"""Times that differ by less than this fraction of themselves are those of one event, found twice."""


class Found(NamedTuple):
    """An event that interrupts a run: the number of its function, its column, and where it happened."""

    number: int
    column: int
    rising: bool
    steps: int
    time: float


class Seeking:
    """The events of a run, and what was found of them.

    events : as they were given;  direction : of the run in time, 1 or -1

    particles : searches like this one for the events of massless bodies, each on a motion with those of its `subjects`
    Raises InputError for events that cannot be sought among these bodies.
    """

    def __init__(self, system: System, events: Sought | Sequence[Sought], direction: float) -> None:
        given = [events] if isinstance(events, Sought) else events
        if not isinstance(given, list | tuple) or not all(isinstance(event, Sought) for event in given):
            names = [type(event).__name__ for event in (given if isinstance(given, list | tuple) else [given])]
            ends = next((name for name in names if name in ("EnergyErrorAbove", "WallTimeOver")), "")
            raise InputError(
                f"events = {shown(events)}; expected events such as orbits.events.CloseApproach('Apophis', 'Earth') or "
                "orbits.events.Pericentre('Halley'), one or a list of them."
                + (f" {ends} ends a run after a whole step: give it as stop=..." if ends else "")
            )
        self._system, self._direction = system, direction
        self.events: tuple[Sought, ...] = tuple(given)
        self._of: list[Sought] = []
        self._bounds: list[Bound] = []
        for event in self.events:
            if not isinstance(event.then, str):
                event.then.check(event, system)
            bounds = event.bound(system)
            self._bounds += bounds
            self._of += [event] * len(bounds)
        self.touching = {k: bound for k, bound in enumerate(self._bounds) if isinstance(bound, Touching)}
        for event in self.events:
            if self.touching and not isinstance(event.then, str) and not event.collides:
                raise InputError(
                    f"{type(event).__name__}(then={shown(event.then)}) beside collisions; expected then='record' or "
                    "then='stop', as only collisions act in a run whose bodies collide. Let it stop the run, change "
                    "run.stopped.system, and go on from there; or seek it in a run without collisions."
                )
        self.act = any(not isinstance(event.then, str) for event in self.events)
        self.stops = stops_of(system, self._of, self._bounds, direction, not (self.act or self.touching))
        numbers = [k for k in range(len(self._bounds)) if self.stops is None or k not in self.stops.bounds]
        groups = by_particles(numbers, self._bounds, self._of, system, self.act or bool(self.touching))
        self.particles: list[Seeking] = []
        for particles, numbers in groups.items():
            if particles:
                search = copy(self)
                search.particles = []
                search._narrow(numbers, particles)
                self.particles.append(search)
        self._narrow(groups.get((), []), ())

    def _narrow(self, numbers: list[int], particles: tuple[int, ...]) -> None:
        """Seek the zeros of some of the functions, on the motion of the bodies with mass and of these particles."""
        numbers = [k for k in numbers if k not in self.touching]
        self._numbers, self.subjects, system = numbers, particles, self._system
        self._there = system.massive.copy()
        self._there[list(particles)] = True
        self.interrupts = any(self._of[k].interrupts for k in numbers)
        self._begin_leg()
        self._first = True
        self._remarks: dict[int, str] = {}
        self._longest = 0.0
        self.log = Log(self._direction)

    def _begin_leg(self) -> None:
        """Make room for the motion of these bodies, and see which of them matter."""
        self._needed = np.zeros(len(self._system), dtype=bool)
        for k in self._numbers:
            bodies = self._bounds[k].bodies()
            self._needed[slice(None) if bodies is None else bodies] = True
        most = max(1, min(STEPS, NUMBERS // (30 * len(self._system))))
        self._collected, self._enough = Collected(most), ENOUGH * most

    def go_on_with(self, left: Left) -> None:
        """Seek the events of the bodies that are left after collisions; those of bodies that are gone are over."""
        self.flush()
        if not self:
            return
        self._there = self._system.massive & ~left.gone
        try:
            for number, bound, over in bounds_left(self._system, self.events, self._bounds, left):
                self._bounds[number] = bound
                if number in self._numbers and over is not None:
                    self._remark(number, over)
        except (EventError, Raised):
            self.log.broken = True
            raise
        self._numbers = [k for k in self._numbers if len(self._bounds[k].pairs)]
        self._begin_leg()

    def go_through(
        self, time: float, before: tuple[Array, Array], after: tuple[Array, Array], left: Left
    ) -> Found | None:
        """Go on after a collision, as `go_on_with`; functions whose sign is another one then are zero there. Return the
        first that interrupts the run, if any.

        before, after : q and v of all bodies, (n, 3), at that time
        """
        former = list(self._bounds)
        self.go_on_with(left)
        found: list[Found] = []
        try:
            for number in self._numbers:
                found += self._jumps(number, former[number], time, before, after)
        except (EventError, Raised):
            self.log.broken = True
            raise
        return next((one for one in found if self._of[one.number].interrupts), None)

    def _jumps(
        self, number: int, former: Bound, time: float, before: tuple[Array, Array], after: tuple[Array, Array]
    ) -> Iterator[Found]:
        """List the zeros of a function at a collision: of the columns whose sign is another one after it."""
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
        rows = self._rows(number, rising, t, q, v, columns)
        for k in np.flatnonzero(kept & clear):
            if not self.log.has(rows[k], ROUNDED * abs(time)):
                self._add(rows[k], True)
                yield Found(number, int(columns[k]), bool(rising[k]), 0, time)

    def follow(self, system: System) -> None:
        """Seek the events among bodies whose masses or radii have changed; `system` is otherwise that of the start."""
        self._system = system
        self._bounds = [bound for event in self.events for bound in event.bound(system)]

    def __bool__(self) -> bool:
        """Whether there are functions whose zeros are sought on the motion of the bodies with mass."""
        return bool(self._numbers)

    @property
    def on_motion(self) -> list[Sought]:
        """The events that are sought on the motion of the bodies within the steps, as it was recorded."""
        apart = () if self.stops is None else self.stops.bounds
        return [self._of[k] for k in range(len(self._of)) if k not in apart]

    def check(self, marcher: Legs) -> None:
        """Raise InputError for a march that does not tell the motion within its steps."""
        if self and marcher.home.stepper.loops.parallel is not None:
            raise InputError(
                f"events are sought on the motion within steps, which is not recorded for the {len(self._system):,} "
                "bodies of this run on several threads; use threads=1, or leave out events=..."
            )

    @property
    def words(self) -> list[tuple[str | None, str | None]]:
        """What the zeros of each function are called."""
        return [bound.words for bound in self._bounds]

    def table(self) -> Events:
        """Return what was found so far."""
        rows = [self.log.rows, *(search.log.rows for search in self.particles)]
        return Events(self._system, self.words, in_order(rows, self._direction) if self.particles else rows[0])

    def described(self) -> str:
        """Return the events as an archive holds them."""
        return description_of(self.events, self._of, self._bounds)

    def checkpoint(self) -> dict[str, NDArray[Any]]:
        """Return what is found up to the state that the march has reached, as arrays of fixed shapes."""
        known = self.log.checkpoint() if self.events else {}
        if self.particles:
            logs = [search.log for search in self.particles]
            firm = in_order([log.rows[: log.firm] for log in logs], self._direction)
            later = in_order([log.rows[log.firm :] for log in logs], self._direction)
            known |= dict(zip(PARTICLES, padded_rows(np.concatenate([firm, later]), len(firm)), strict=True))
        return known

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], begun: bool, path: Any) -> None:
        """Go on with the list of a checkpoint; begun : whether the march has taken steps."""
        if self.events:
            self.log.restore(checkpoint, len(self._bounds), len(self._system), path)
            self._first = not begun
            if self.touching:  # the march may list a collision before it comes to events that are earlier in its step
                ends = np.array([event.then == STOP for event in self._of])[self.log.rows[:, NUMBER].astype(int)]
                self.log.forget()
                if ends.any():
                    self.log.pass_by(float(self.log.rows[ends, TIME][-1]))
        if self.particles:
            rows = rows_of_particles(checkpoint, len(self._bounds), len(self._system), path)
            for search in self.particles:
                search.log.take(rows[np.isin(rows[:, NUMBER], search._numbers)])

    # ------------------------------------------------------------------------------------------- along the march

    def after(self, marcher: Legs) -> Found | None:
        """Take the block that was just marched; return the first event in it that interrupts the run, if any.

        The events before it are then recorded, and it is as well; the march is at the begin of its step. So it is if
        it stopped as a pair of bodies might come to its bound in the last step, but none does.
        """
        if marcher.met != SUSPECT:
            return self._after(marcher)
        end = Sample(marcher.time, *marcher.state())
        marcher.step_back()
        found = self._after(marcher) or self._at_a_bound(marcher, end, end.time)
        if found is None:
            marcher.pass_by()
        return found

    def before_sample(self, marcher: Legs, sample: Sample) -> Found | None:
        """Return the event that ends the run between the state of the march and a sample less than a step ahead, if a
        pair of bodies comes to its bound there: where it is without a sample.
        """
        if self.stops is None or (sample.time - marcher.time) * self._direction <= 0.0:
            return None
        if not self.stops.may_end(marcher, sample):
            return None
        with suppress(IntegrationError):
            end = marcher.after_next_step(lambda: Sample(marcher.time, *marcher.state()))
            if (end.time - sample.time) * self._direction >= 0.0:
                return self._at_a_bound(marcher, end, sample.time)
        return self._at_a_bound(marcher, sample, sample.time)

    def _at_a_bound(self, marcher: Legs, end: Sample, until: float) -> Found | None:
        """Return the first event that ends the run between the state of the march and another, if a pair of bodies
        comes to its bound up to a time; it is recorded, with those before it.
        """
        assert self.stops is not None
        passed = self.stops.first(marcher, end, self.log.last + SAME * abs(end.time - marcher.time))
        if passed is None or (passed.time - until) * self._direction > 0.0:
            return None
        earlier = self.before(marcher, passed.time, record=True)
        if earlier is not None:
            return earlier
        number, column, time = passed
        bound, columns = self._bounds[number], np.array([column])
        t, (q, v) = np.array([time]), (x[None] for x in marcher.state_after(time - marcher.time))
        rising = bound.words[0] is None
        self._add(self._rows(number, np.array([rising]), t, q, v, columns)[0], True)
        self.log.pass_by(time)
        return Found(number, column, rising, 0, time)

    def _after(self, marcher: Legs) -> Found | None:
        if not self:
            return None
        found = self.take(marcher.motion())
        if found is not None:
            marcher.go_back(found.steps)
        return found

    def take(self, motion: Motion) -> Found | None:
        """Take whole steps; return the first event that interrupts the run, if any: later ones are not listed."""
        if not self or self.interrupts:
            return self._seek(motion, True) if self else None
        if len(motion) >= self._enough or not self._collected.takes(motion):
            self.flush()
            if len(motion) >= self._enough or not self._collected.takes(motion):
                self._seek(motion, True)
        return None

    def search(self, motion: Motion) -> Found | None:
        """Seek events in the next stretch of the march at once; as `take`."""
        self.flush()
        return self._seek(motion, True)

    def flush(self) -> None:
        """Seek events in all steps that were taken; call it before the list is stored."""
        if len(self._collected):
            self._seek(self._collected.emptied(), True)

    def before(self, marcher: Legs, time: float, record: bool) -> Found | None:
        """Seek events between the state of the march and a time less than a step ahead.

        record : whether to record them; otherwise only those up to one that interrupts the run are recorded, if any
        """
        self.flush()
        if not self or (time - marcher.time) * self._direction <= 0.0:
            return None
        (rest, goal), found = marcher.towards(time), None
        while found is None and rest.is_before(goal):
            rest.approach(goal)
            found = self._seek(rest.motion(), False, record)
        return found

    def ahead(self, marcher: Legs, time: float) -> Found | None:
        """Seek the first event that interrupts the run between the state of the march and a time less than a step
        ahead, in the whole step: it is where it is without a sample at this time. If the march cannot take the step,
        on the way to the time.
        """
        self.flush()
        if not self.interrupts or (time - marcher.time) * self._direction <= 0.0:
            return None
        with suppress(IntegrationError):
            return marcher.after_next_step(lambda: self._seek(marcher.motion(), False, False, time))
        return self.before(marcher, time, record=False)

    def before_in(self, steps: Iterable[Legs], time: float) -> Found | None:
        """Seek the first event that interrupts the run up to a time, in whole steps that lead beyond it.

        steps : marches that have taken one step each. Events are then where they are without a sample at this time.
        """
        for rest in steps:
            found = self._seek(rest.motion(), False, False, time)
            if found is not None:
                return found
        return None

    def along(self, motion: Motion, first: bool) -> Found | None:
        """Seek events in the next stretch of a motion; return the first one that interrupts the run, if any.

        first : whether the run starts with it
        """
        self._first = first
        return self._seek(motion, False)

    def between(self, t: Array, q: Array, v: Array, first: bool) -> Found | None:
        """Seek events between two states, t (2,), q and v (2, n, 3), that are too close for more than one zero of any
        function; as `along`.
        """
        rows, places = [np.empty((0, COLUMNS))], [np.empty((0, 3), dtype=np.int64)]
        for number in self._numbers:
            bound = self._bounds[number]
            g, g_end = bound.values(t, q, v, np.arange(len(bound.pairs)))
            wanted = np.array([word is not None for word in bound.words])
            rising = (g < 0.0) != (self._direction < 0.0)
            columns = np.flatnonzero(((g < 0.0) != (g_end < 0.0)) & wanted[rising.astype(int)] & ~(first & (g == 0.0)))
            if not len(columns):
                continue
            at = t[0] + (t[1] - t[0]) * (g / (g - g_end))[columns]
            states = (np.repeat(x[1:], len(columns), axis=0) for x in (q, v))
            there = at, *states, columns
            kept = bound.keeps(*there)
            rows.append(self._rows(number, rising[columns], *there)[kept])
            places.append(np.array([(number, column, 0) for column in columns])[kept])
        return self._take(np.concatenate(rows), np.concatenate(places), None, t, False, True, None)

    def event_of(self, number: int) -> Sought:
        """Return the event, as it was given, to which a function belongs."""
        return self._of[number]

    def happening(self, found: Found, state: tuple[Array, Array], at: System | None = None) -> Happening:
        """Return an event that interrupts a run, with the bodies at its time.

        state : q and v of all, (n, 3); at : the bodies there, if they are not all those of the start
        """
        system, bound = self._system, self._bounds[found.number]
        names = [None if k == NOBODY else system.names[k] for k in bound.pairs[found.column]]
        at = moved(system, *state, found.time, absent(*state, system.massive)) if at is None else at
        kind = bound.words[found.rising] or ""
        return Happening(self._of[found.number], kind, u.Quantity(found.time, system.units.time), at, *names)

    def _seek(self, motion: Motion, firm: bool, record: bool = True, until: float | None = None) -> Found | None:
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
        """Record what `_found` found in steps that begin and end at these times; see `_seek`."""
        order = np.lexsort((rows[:, NUMBER], rows[:, TIME] * self._direction))
        if until is not None:
            order = order[(rows[order, TIME] - until) * self._direction <= 0.0]
            failure = None if failure is None or (failure.time - until) * self._direction > 0.0 else failure
        if self.log.known:
            # The stretch to the end of a run may be far shorter than the step in which an event was found before.
            apart = max(SAME * float(abs(np.diff(times)).max()), ROUNDED * float(abs(times).max()))
            order = order[[self.log.is_new(float(time), apart) for time in rows[order, TIME]]]
        acting = [k for k in order if self._of[int(rows[k, NUMBER])].interrupts]
        last = float(rows[acting[0], TIME]) if acting else np.inf * self._direction
        if record or acting:
            for k in order[(rows[order, TIME] - last) * self._direction <= 0.0]:
                self._add(rows[k], firm or bool(acting))
        if failure is not None and (failure.time - last) * self._direction <= 0.0:
            raise failure
        if firm:
            self._first = False
        if not acting:
            return None
        self.log.pass_by(last)
        self._check_alone(rows[acting], times)
        number, column, steps = (int(x) for x in places[acting[0]])
        return Found(number, column, bool(rows[acting[0], RISING]), steps, last)

    def _found(self, stretch: Stretch) -> tuple[Array, NDArray[np.int64], EventError | None]:
        """Return rows; number of the function, column and step of each; and what failed, with the rows before that."""
        rows, places, failure = [np.empty((0, COLUMNS))], [np.empty((0, 3), dtype=np.int64)], None
        bounds = [self._bounds[number] for number in self._numbers]
        answers = zeros_of(bounds, stretch, self._first)
        lengths = np.diff(stretch.times)
        self._longest = max(self._longest, float(np.abs(lengths).max()))
        for number, bound, (found, missing) in zip(self._numbers, bounds, answers, strict=True):
            if missing is not None and (failure is None or (missing.time - failure.time) * self._direction < 0.0):
                failure = self._not_finite(number, missing)
            if not len(found.steps):
                continue
            t, q, v = stretch.at(found.steps, found.fractions)
            kept = bound.keeps(t, q, v, found.columns)
            clear = are_clear(bound, found, lengths, self._longest, t, q, v)
            if (kept & ~clear).any():
                self._remark(number, ROUND_OFF)
            elif in_every_step(found.steps[kept], found.columns[kept], len(stretch)):
                self._remark(number, EVERY_STEP)
            kept &= clear
            rows.append(self._rows(number, found.rising, t, q, v, found.columns)[kept])
            places.append(np.column_stack([np.full(len(t), number), found.columns, found.steps])[kept])
        every, where = np.concatenate(rows), np.concatenate(places)
        if failure is not None:
            before = (every[:, TIME] - failure.time) * self._direction < 0.0
            every, where = every[before], where[before]
        return every, where, failure

    def _rows(self, number: int, rising: NDArray[np.bool_], t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the rows of zeros of a function, whether it rises at each, and the states there."""
        bound, numbers = self._bounds[number], np.full(len(t), number)
        return np.column_stack([t, numbers, rising, bound.pairs[columns], bound.figures(t, q, v, columns)])

    def _remark(self, number: int, what: str) -> None:
        event, bound = self._of[number], self._bounds[number]
        names = ", ".join(str(value) for value in event.given().values() if isinstance(value, str))
        self._remarks[number] = f"{type(event).__name__}({names}): {_said(bound)} {what}"

    def remarks(self) -> list[str]:
        """Return what is to be said of events that mean nothing, or may be incomplete."""
        for number in self._numbers:
            # What acts ends a stretch of the march, in which it is therefore found but once.
            rows = self.log.rows[self.log.rows[:, NUMBER] == number]
            if not isinstance(self._of[number].then, str) and in_rapid_succession(rows, 0.5 * self._longest):
                self._remark(number, EVERY_STEP)
        return [said for search in (self, *self.particles) for _, said in sorted(search._remarks.items())]

    def note(self, row: Array) -> None:
        """List an event that the march found. Raises EventError if there are too many."""
        self._add(row, True)

    def _add(self, row: Array, firm: bool) -> None:
        if self.log.full:
            often = np.bincount(self.log.rows[:, NUMBER].astype(int))
            most, when = int(np.argmax(often)), self._when(row[TIME])
            raise EventError(
                f"there are more than {MOST_EVENTS:,} events by {when}, {often[most]:,} of them "
                f"{_said(self._bounds[most])}. Seek fewer (a bound, a direction, fewer bodies), or run in parts; all "
                "before stays readable.",
                time=float(row[TIME]),
            )
        self.log.add(row, firm)

    def _check_alone(self, rows: Array, times: Array) -> None:
        """Refuse two events that act on one body at once."""
        one, rest = rows[0], rows[1:]
        if isinstance(self._of[int(one[NUMBER])].then, str):
            return
        step = abs(float(np.diff(times).max()))
        for two in rest[np.abs(rest[:, TIME] - one[TIME]) <= SAME * step]:
            both = ({int(k) for k in one[BODY : OTHER + 1]} & {int(k) for k in two[BODY : OTHER + 1]}) - {NOBODY}
            if both and not isinstance(self._of[int(two[NUMBER])].then, str):
                names = [self._system.names[k] for k in both]
                kinds = [self._bounds[int(row[NUMBER])].words[int(row[RISING])] for row in (one, two)]
                raise EventError(
                    f"{kinds[0]!r} and {kinds[1]!r} both act on {names[0]} at {self._when(one[TIME])}; expected one at "
                    "a time. Let one of them only record.",
                    time=float(one[TIME]),
                    bodies=names,
                )

    def _when(self, time: float) -> str:
        return "t = " + with_unit(f"{time:.10g}", self._system.units.time)

    def _not_finite(self, number: int, error: NotFiniteError) -> EventError:
        when = self._when(error.time)
        return EventError(
            f"the function of {_said(self._bounds[number])} is {error.value} at {when}; expected finite numbers. Mend "
            "the function; all before stays readable.",
            time=error.time,
        )


def _said(bound: Bound) -> str:
    return " / ".join(repr(word) for word in dict.fromkeys(bound.words) if word)
