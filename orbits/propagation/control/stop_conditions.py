"""Conditions that end a run early."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.checks import positive_number
from orbits.errors import InputError, shown, with_unit
from orbits.marching.first_passage import rounding_of
from orbits.propagation.control.wall_clock import seconds_of
from orbits.propagation.events.base import RECORD, STOP, Sought
from orbits.propagation.events.functions import calling, named
from orbits.propagation.events.kinds.of_pairs import Distance, a_distance, pairs_of
from orbits.units import told_apart

if TYPE_CHECKING:
    from orbits.propagation.events.base import Bound
    from orbits.system import System


@dataclass(frozen=True)
class AtDistance(Sought):
    """The base class of events of two bodies that pass a distance; see `CloserThan` and `FartherThan`."""

    distance: Any
    body: str | None = None
    other: str | None = None

    named = "body", "other"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "distance", a_distance(self.distance, f"{type(self).__name__}.distance"))

    def bound(self, system: System) -> list[Bound]:
        """Return the squared distance less that of the bound."""
        what, unit = type(self).__name__, system.units.length
        bound = float(system.units.length_value(self.distance, what))
        pairs, least = pairs_of(system, self.body, self.other, what), with_unit(f"{bound:g}", unit)
        closer = isinstance(self, CloserThan)
        words = (f"closer than {least}", None) if closer else (None, f"farther than {least}")
        if self.then == STOP and self.body is not None and self.other is not None:
            self._check_start(system, pairs[0], bound)
        return [Distance(words, pairs, bound)]

    def _check_start(self, system: System, pair: tuple[int, int], bound: float) -> None:
        """Raise InputError if two bodies are where the run is to end already at its start."""
        q, unit = system.values.q[list(pair)], system.units.length
        apart = float(np.linalg.norm(q[1] - q[0]))
        beyond = bound - apart if isinstance(self, CloserThan) else apart - bound
        if beyond > rounding_of(bound, q):
            far, least = (with_unit(text, unit) for text in told_apart(apart, bound))
            raise InputError(
                f"{type(self).__name__}: {self.body} and {self.other} are {far} apart at the start already; the bound "
                f"is {least}. Give another one."
            )


@dataclass(frozen=True)
class CloserThan(AtDistance):
    """Two bodies come closer than a distance, at the time at which they do on the motion itself. In `stop`, or with
    then="stop", the run ends there.

    distance : a quantity, a text such as "0.1 AU", or a number in the system's unit of length
    body, other : names; None means any body with mass and, where the run ends, any other one beside a body with mass
    then : among `events`, what happens; see `orbits.events.Event`

    A run that is to stop there is refused if two named bodies are there at its start; others stop it when they get
    there again. So do bodies at that very distance, where another run may have stopped: from there a run goes on, even
    if they come closer at once. It stops as they come closer in the direction of the run; what is recorded is meant in
    time.
    Raises InputError for a distance that is not one finite number above 0, and for names that are not strings.
    """


@dataclass(frozen=True)
class FartherThan(AtDistance):
    """Two bodies get farther apart than a distance, at the time at which they do on the motion itself. In `stop`, or
    with then="stop", the run ends there.

    distance : a quantity, a text such as "0.1 AU", or a number in the system's unit of length
    body, other : names; None means any body with mass and, where the run ends, any other one beside a body with mass
    then : among `events`, what happens; see `orbits.events.Event`

    A run that is to stop there is refused if two named bodies are there at its start; others stop it when they get
    there again. So do bodies at that very distance, where another run may have stopped: from there a run goes on, even
    if they part at once. It stops as they part in the direction of the run; what is recorded is meant in time.
    Raises InputError for a distance that is not one finite number above 0, and for names that are not strings.
    """


@dataclass(frozen=True)
class EnergyErrorAbove:
    """Stop after the first step at whose end the relative energy error of the massive bodies exceeds a fraction, or at
    the end of the run.

    Raises InputError for a fraction that is not one finite number above 0.
    """

    fraction: float

    def __post_init__(self) -> None:
        positive_number(self.fraction, "EnergyErrorAbove.fraction")


@dataclass(frozen=True)
class WallTimeOver:
    """Stop when the run has taken longer than this wall time, which is checked between blocks of steps.

    duration : a quantity, or a number of seconds. The step at which a run stops depends on the machine.

    Raises InputError for anything but one finite time above 0.
    """

    duration: Any

    def __post_init__(self) -> None:
        seconds_of(self.duration, "WallTimeOver.duration")


Condition = CloserThan | FartherThan | EnergyErrorAbove | WallTimeOver


class Conditions:
    """What was given as `stop`.

    distances : the conditions on distances, as events that stop a run
    energy, seconds : bounds, infinite if there are none
    """

    def __init__(self, stop: Condition | Sequence[Condition]) -> None:
        given = [stop] if isinstance(stop, Condition) else stop
        if not isinstance(given, list | tuple) or not all(isinstance(c, Condition) for c in given):
            raise InputError(
                f"stop = {shown(stop)}; expected conditions such as orbits.events.CloserThan(0.01 * u.au, 'Apophis', "
                "'Earth'), orbits.events.FartherThan, orbits.events.EnergyErrorAbove or "
                "orbits.events.WallTimeOver, one or a list of them."
            )
        for c in given:
            if isinstance(c, Sought) and c.then != RECORD:
                raise InputError(f"stop holds {type(c).__name__} with then=..., for events alone: give it in events=.")
        self._given = [c for c in given if isinstance(c, AtDistance)]
        self.distances = [replace(c, then=STOP) for c in self._given]
        self._energy = self._only([c for c in given if isinstance(c, EnergyErrorAbove)])
        self._clock = self._only([c for c in given if isinstance(c, WallTimeOver)])
        self.energy = math.inf if self._energy is None else float(self._energy.fraction)
        self.seconds = math.inf if self._clock is None else seconds_of(self._clock.duration, "WallTimeOver.duration")

    def beside(self, events: Sought | Sequence[Sought]) -> Sought | Sequence[Sought]:
        """Return events with those that stop a run at a distance."""
        given = [events] if isinstance(events, Sought) else events
        return [*given, *self.distances] if self.distances and isinstance(given, list | tuple) else events

    def given(self, event: Sought) -> Condition | Sought:
        """Return the condition of which an event was made, or the event."""
        return next((c for c, made in zip(self._given, self.distances, strict=True) if made is event), event)

    def exceeded(self) -> tuple[str, Condition]:
        """Return why a march ended whose energy error is above its bound, in words and as a value."""
        assert self._energy is not None
        return f"the energy error exceeded {self._energy.fraction:g}", self._energy

    def overdue(self, seconds: float) -> tuple[str, Condition] | None:
        """Return why a run ends after so many seconds, or None."""
        if seconds <= self.seconds or self._clock is None:
            return None
        return f"it took longer than {self.seconds:g} s", self._clock

    @staticmethod
    def _only(conditions: list[Any]) -> Any:
        """Return the only condition of a kind, or None."""
        if len(conditions) > 1:
            raise InputError(f"stop holds {len(conditions)} {type(conditions[0]).__name__}; expected at most one.")
        return conditions[0] if conditions else None


def check_callback(callback: Any) -> None:
    """Raise InputError for a callback that cannot be called with a time and a system."""
    if callback is None:
        return
    expected = "expected a function of the time and the system, or None."
    if not callable(callback):
        raise InputError(f"callback is {shown(callback)}; {expected}")
    try:
        signature = inspect.signature(callback)
    except (TypeError, ValueError):  # some functions written in C have no signature
        return
    try:
        signature.bind(None, None)
    except TypeError as error:
        raise InputError(f"callback has the signature {signature}, not two arguments ({error}); {expected}") from None


def asks_to_stop(callback: Callable[[u.Quantity, System], object], t: u.Quantity, system: System) -> bool:
    """Return whether a callback ends the run. Raises `Raised` with what it raises, and with an InputError for an
    answer that is not True, False or None.
    """
    with calling(f"callback={named(callback)}, at t = {t:.10g}"):
        answer = callback(t, system)
        if answer is None or isinstance(answer, bool | np.bool_):
            return bool(answer)
        raise InputError(f"callback returned {shown(answer)} at t = {t:.10g}; expected True, False or None.")
