"""The events asked for in a run, as functions of time and states whose zeros are sought."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.errors import InputError, shown, with_unit
from orbits.propagation.events.base import NOBODY, Array, Bound, Found, Happening, Sought, Touching
from orbits.propagation.events.bodies_left import Left, bounds_left
from orbits.propagation.events.stops import stops_of
from orbits.trajectory.retired import absent, moved

if TYPE_CHECKING:
    from orbits.system import System

MOST_PARTICLES = 64
"""The most massless bodies whose events are sought: each is marched again with the bodies that have mass."""

RETURNS = (
    "Expected `of` of a PairBound to return (m,) for q and v (m, 3), or `values` of a Bound to return "
    "(m, len(columns)) for q and v (m, bodies, 3)."
)
"""What functions return, in words."""


class Asked:
    """The events of a run and their functions, which all searches for them share.

    system : the bodies; events : as they were given; direction : of the run in time, 1 or -1

    of, bounds : of each function, by its number, the event that it belongs to, and what it is among these bodies
    views : of each function the number of its event, the observer and whether it is apparent, as `Events` has them
    touching : the functions that the march itself seeks, as collisions; act : whether any event acts on the bodies
    stops : the distances that end the run, which it seeks as well; None without any

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
        self.system, self.direction, self.events = system, direction, tuple[Sought, ...](given)
        self.of: list[Sought] = []
        self.views: list[tuple[int, Any, bool]] = []
        self.bounds: list[Bound] = []
        for number, event in enumerate(self.events):
            if event.acts:
                event.then.check(event, system)
            bounds = _functions_of(event, system)
            self.bounds += bounds
            self.of += [event] * len(bounds)
            view = number, getattr(event, "observer", None), getattr(event, "apparent", False)
            self.views += [view] * len(bounds)
        self.touching = {k: bound for k, bound in enumerate(self.bounds) if isinstance(bound, Touching)}
        for event in self.events:
            if self.touching and event.acts and not event.collides:
                raise InputError(
                    f"{type(event).__name__}(then={shown(event.then)}) beside collisions; expected then='record' or "
                    "then='stop', as only collisions act in a run whose bodies collide. Let it stop the run, change "
                    "run.stopped.system, and go on from there; or seek it in a run without collisions."
                )
        self.act = any(event.acts for event in self.events)
        self.stops = stops_of(system, self.of, self.bounds, direction, not (self.act or self.touching))

    @property
    def on_motion(self) -> list[int]:
        """The numbers of the functions that are sought on the motion of the bodies within the steps, as recorded."""
        return [k for k in range(len(self.of)) if self.stops is None or k not in self.stops.bounds]

    def by_particles(self) -> dict[tuple[int, ...], list[int]]:
        """Return the numbers of these by the numbers of the massless bodies that they are about, without those of
        `touching`. Raises InputError for what cannot be sought of massless bodies.
        """
        groups: dict[tuple[int, ...], list[int]] = {}
        for number in self.on_motion:
            if number in self.touching:
                continue
            bound = self.bounds[number]
            needed = bound.bodies()
            concerned = np.unique(np.concatenate([bound.pairs.ravel(), [] if needed is None else needed]).astype(int))
            particles = tuple(int(k) for k in concerned if k != NOBODY and not self.system.massive[k])
            groups.setdefault(particles, []).append(number)
            if particles:
                self._check_of_particle(self.of[number], self.system.names[particles[0]])
        if len(groups) - (() in groups) > MOST_PARTICLES:
            raise InputError(
                f"events of {len(groups) - (() in groups)} massless bodies; at most {MOST_PARTICLES} are followed one "
                "by one between the samples. Seek those of fewer, or in several runs."
            )
        return groups

    def _check_of_particle(self, event: Sought, name: str) -> None:
        what = type(event).__name__
        if event.acts:
            raise InputError(
                f"{what}: {name} is a massless particle, on which nothing acts in a run: its events are recorded, or "
                "end the run (then='stop'). Give it a small mass, such as gm=1e-20, or leave out then=..."
            )
        if self.act or self.touching:
            raise InputError(
                f"{what}: {name} is a massless particle, whose events are not sought in a run whose bodies may be "
                "changed by others (then=...) or collide. Give it a small mass, such as gm=1e-20, or seek its events "
                "in a run of their own."
            )

    def follow(self, system: System) -> None:
        """Take bodies whose masses or radii have changed; `system` is otherwise that of the start."""
        self.system = system
        self.bounds[:] = [bound for event in self.events for bound in event.bound(system)]

    def go_on_with(self, left: Left) -> dict[int, str]:
        """Make the functions of the bodies that are left after collisions; those of bodies that are gone are over.

        Returns what is to be said of functions that are over, by their numbers.
        """
        over: dict[int, str] = {}
        for number, bound, why in bounds_left(self.system, self.events, tuple(self.bounds), left):
            self.bounds[number] = bound
            if why is not None:
                over[number] = why
        return over

    def said(self, number: int) -> str:
        """Return what all zeros of a function are called."""
        return " / ".join(repr(word) for word in dict.fromkeys(self.bounds[number].words) if word)

    def when(self, time: float) -> str:
        """Return a time in words."""
        return "t = " + with_unit(f"{time:.10g}", self.system.units.time)

    def happening(self, found: Found, state: tuple[Array, Array], at: System | None = None) -> Happening:
        """Return an event that interrupts a run, with the bodies at its time.

        state : q and v of all, (n, 3); at : the bodies there, if they are not all those of the start
        """
        system, bound = self.system, self.bounds[found.number]
        names = [None if k == NOBODY else system.names[k] for k in bound.pairs[found.column]]
        at = moved(system, *state, found.time, absent(*state, system.massive)) if at is None else at
        kind = bound.words[found.rising] or ""
        return Happening(self.of[found.number], kind, u.Quantity(found.time, system.units.time), at, *names)


def _functions_of(event: Sought, system: System) -> list[Bound]:
    """Return the functions of an event among these bodies. Raises InputError for a kind of a user's whose functions are
    not as `Bound` says.
    """
    name, bounds = type(event).__name__, event.bound(system)
    if not isinstance(bounds, list) or not all(isinstance(bound, Bound) for bound in bounds):
        raise InputError(
            f"{name}.bound returned {shown(bounds)}; expected a list of functions, such as a PairBound in [...]."
        )
    for bound in bounds:
        words = bound.words
        if not (isinstance(words, tuple | list) and len(words) == 2 and all(isinstance(w, str | None) for w in words)):
            raise InputError(
                f"{name}: the words of {type(bound).__name__} are {shown(words)}; expected a pair: what a zero is "
                "called where the function falls, and where it rises; None for what is not sought."
            )
        strange = bound.pairs[(bound.pairs < NOBODY) | (bound.pairs >= len(system))]
        if len(strange):
            raise InputError(
                f"{name}: {type(bound).__name__} is of body number {strange[0]}; expected numbers from 0 to "
                f"{len(system) - 1}, as system.index(a name) returns them."
            )
        if event.stored and not isinstance(bound, Touching) and len(bound.pairs):  # `Event` tries its function itself
            _try(name, bound, system)
    return bounds


def _try(name: str, bound: Bound, system: System) -> None:
    """Call a function with the state at the start, twice. Raises InputError if that fails, or is of another shape."""
    t, none = np.zeros(2), np.zeros(2, dtype=np.int64)
    q, v = (np.stack([x, x]) for x in (system.values.q, system.values.v))
    try:
        with np.errstate(all="ignore"):
            shapes = np.shape(bound.at(t, q, v, none)), np.shape(bound.values(t, q, v, none[:1]))
    except Exception as error:  # the function of a user may raise anything
        raise InputError(
            f"{name}: {type(bound).__name__} fails at the start of the run: {type(error).__name__}: {error}. {RETURNS}"
        ) from error
    if shapes != ((2,), (2, 1)):
        raise InputError(f"{name}: {type(bound).__name__} returned shape {shapes[0]} for two times. {RETURNS}")
