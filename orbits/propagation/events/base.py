"""What is sought in a run: the base class of all events, and what an event becomes for the bodies of a system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.elements.frames import checked_frame
from orbits.errors import EventError, InputError, shown
from orbits.propagation.events.functions import calling, named, picklable

if TYPE_CHECKING:
    from orbits.system import System

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

RECORD, STOP = "record", "stop"

NOBODY = -1
"""The number of a body in an event that has none."""


@dataclass(frozen=True)
class Happening:
    """One event at which a run stops, or that acts: what an `Action` and the function of `then=` are given.

    event : the event as it was given; kind : in words
    time : since the epoch, with unit; system : the bodies at that time
    body, other : names of the bodies concerned, None without them
    """

    event: Sought
    kind: str
    time: u.Quantity
    system: System
    body: str | None
    other: str | None


class Action:
    """What an event does to the bodies: the base class of values for `then=`. A function of the time and the system
    does as well.
    """

    def check(self, event: Sought, system: System) -> None:
        """Raise InputError if the action does not suit an event, or a system. Called once, before the run."""

    def act(self, happening: Happening) -> System | None:
        """Return the bodies as the run goes on with them, or None if they do not change."""
        raise NotImplementedError


@dataclass(frozen=True)
class Call(Action):
    """The action of a function: it is called with the time and the system, and may return a changed system."""

    function: Callable[[u.Quantity, System], System | None]

    def __getstate__(self) -> dict[str, Any]:
        """Leave out a function that cannot be pickled."""
        return {"function": picklable(self.function)}

    def act(self, happening: Happening) -> System | None:
        """Return what the function returns. Raises EventError for anything but a System or None."""
        from orbits.system import System

        with calling(f"then={named(self.function)}, at {happening.kind!r}, t = {happening.time:.10g}"):
            answer = self.function(happening.time, happening.system)
        if answer is None or isinstance(answer, System):
            return answer
        raise EventError(
            f"then=... of {happening.kind!r} returned {shown(answer)} at t = {happening.time:.10g}; expected a System, "
            "or None if the bodies do not change.",
            time=float(happening.time.value),
        )


@dataclass(frozen=True, kw_only=True)
class Sought:
    """The base class of events. A subclass has fields, and `bound`, which makes functions of states from them.

    then : what happens: "record", "stop" (the run ends there, and `run.stopped` has the state), an `Action`, or a
        function of the time (a quantity) and the `System`, which may return a changed `System`
    """

    then: Any = RECORD

    stored: ClassVar[bool] = True
    """Whether an archive can hold it, with all that is needed to seek it again when the run is resumed."""

    collides: ClassVar[bool] = False
    """Whether it is a collision, which the march itself seeks."""

    named: ClassVar[tuple[str, ...]] = ()
    """The fields that are names of different bodies, or None."""

    def __post_init__(self) -> None:
        self._check_names()
        if hasattr(self, "direction"):
            self._check_direction(self.direction)
        frame = getattr(self, "frame", None)
        if frame is not None:
            checked_frame(frame)
        if isinstance(self.then, Action) or (isinstance(self.then, str) and self.then in (RECORD, STOP)):
            return
        if callable(self.then) and not isinstance(self.then, type):
            object.__setattr__(self, "then", Call(self.then))
            return
        raise InputError(
            f"then = {shown(self.then)}; expected {RECORD!r}, {STOP!r}, or what is to be done: an action, or a "
            "function of the time and the system."
        )

    def _check_names(self) -> None:
        names = [getattr(self, name) for name in self.named]
        for name in names:
            if not isinstance(name, str | None):
                raise InputError(f"{type(self).__name__} of {shown(name)}; expected the name of a body, or None.")
        given = [name for name in names if name is not None]
        if len(set(given)) < len(given):
            raise InputError(f"{type(self).__name__}: {given[0]!r} twice; expected two bodies.")

    def _check_direction(self, given: Any) -> None:
        if isinstance(given, bool) or not isinstance(given, int | float | np.number) or given not in (-1, 0, 1):
            raise InputError(
                f"{type(self).__name__}: direction is {shown(given)}; expected 1 for functions that rise, -1 for those "
                "that fall, or 0 for both."
            )
        object.__setattr__(self, "direction", int(given))

    @property
    def bodies_named(self) -> tuple[str, ...]:
        """The names of bodies that it was given."""
        return tuple(name for key in self.named if (name := getattr(self, key)) is not None)

    @property
    def acts(self) -> bool:
        """Whether something acts on the bodies there."""
        return not isinstance(self.then, str)

    @property
    def interrupts(self) -> bool:
        """Whether a run cannot go on past it unseen: it stops there, or something acts on the bodies."""
        return self.acts or self.then != RECORD

    def bound(self, system: System) -> list[Bound]:
        """Return the functions whose zeros are sought among these bodies. Raises InputError, and UnknownNameError."""
        raise InputError(
            f"{type(self).__name__} has no functions; expected a method bound(self, system) that returns a list of "
            "them."
        )

    def __getstate__(self) -> dict[str, Any]:
        """Leave out functions that cannot be pickled."""
        return {name: picklable(value) for name, value in vars(self).items()}

    def __copy__(self) -> Self:
        """Return the event itself, which does not change."""
        return self

    def __deepcopy__(self, known: Any) -> Self:
        """Return the event itself, which does not change."""
        return self

    def given(self) -> dict[str, Any]:
        """Return the fields by name, except `then`."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "then" and f.init}


class Bound:
    """A function of time and states for several pairs of bodies, a column each, whose zeros are sought.

    words : what a zero is called where the function falls in time, and where it rises; None if that is not sought
    pairs : (columns, 2), the numbers of the bodies of each column; `NOBODY` for none
    within : the distance of the bodies of a pair beyond which a zero is no event

    All numbers are floats in the units of the system; t is (m,), since the epoch; q and v are (m, n, 3), of all bodies
    in the order of the system.
    """

    within: float = np.inf

    def __init__(self, words: tuple[str | None, str | None], pairs: Any) -> None:
        self.words = words
        self.pairs: Whole = np.array(pairs, dtype=np.int64).reshape(-1, 2)

    def values(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function of these columns, (m, len(columns))."""
        raise NotImplementedError

    def at(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function of one column at each time; columns : (m,)."""
        if len(self.pairs) == 1:
            return self.values(t, q, v, np.zeros(1, dtype=np.int64))[:, 0]
        found = np.empty(len(t))
        for column in np.unique(columns):
            rows = columns == column
            found[rows] = self.values(t[rows], q[rows], v[rows], np.array([column]))[:, 0]
        return found

    def of_pairs(self) -> tuple[int, Array] | None:
        """Return how compiled code computes the function, see `orbits.kernels.search.zeros`; None if it cannot."""
        return None

    def bodies(self) -> Whole | None:
        """Return the numbers of the bodies on which the function depends, or None for all."""
        return np.unique(self.pairs[self.pairs != NOBODY])

    def keeps(self, t: Array, q: Array, v: Array, columns: Whole) -> NDArray[np.bool_]:
        """Return which zeros are events, (m,); columns : (m,)."""
        return np.ones(len(t), dtype=bool)

    def figures(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return distance, speed and angle (radians) at each zero, (m, 3); NaN for what has no meaning."""
        out = np.full((len(t), 3), np.nan)
        pair = self.pairs[columns]
        if len(t) and (pair != NOBODY).all():
            rows = np.arange(len(t))
            for column, x in enumerate((q, v)):
                out[:, column] = np.linalg.norm(x[rows, pair[:, 0]] - x[rows, pair[:, 1]], axis=1)
        return out


class Sample(NamedTuple):
    """The states of all bodies at a time: q and v, (n, 3); NaN for retired particles."""

    time: float
    q: Array
    v: Array


class Found(NamedTuple):
    """An event that interrupts a run: the number of its function, its column, and where it happened.

    besides : others that act at the same time, in the order in which they do, and then one that ends the run
    """

    number: int
    column: int
    rising: bool
    steps: int
    time: float
    besides: tuple[Found, ...] = ()


class Touching(Bound):
    """Two bodies touch, which the march itself seeks: what that is called, the numbers of both, None for any, and what
    happens then.
    """

    def __init__(self, word: str, first: int | None, second: int | None, then: Any) -> None:
        super().__init__((word, None), [NOBODY, NOBODY])
        self.first, self.second, self.then = first, second, then

    def concerns(self, i: int, j: int) -> bool:
        """Return whether it applies to two bodies."""
        one, other = self.first, self.second
        return (one in (None, i) and other in (None, j)) or (one in (None, j) and other in (None, i))


def dot(a: Array, b: Array) -> Array:
    """Return the scalar product over the last axis, of three, by the same operations for any number of rows."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


class PairBound(Bound):
    """A function of the position and the velocity of a body relative to another one."""

    def values(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function of these columns, (m, len(columns))."""
        found = np.empty((len(columns), len(t)))
        for row, (a, b) in enumerate(self.pairs[columns]):
            found[row] = self.of(q[:, a] - q[:, b], v[:, a] - v[:, b])
        return found.T

    def at(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function of one column at each time."""
        return self.of(*self.apart(q, v, columns))

    def apart(self, q: Array, v: Array, columns: Whole) -> tuple[Array, Array]:
        """Return the position and the velocity of the first body relative to the second, (m, 3); columns : (m,)."""
        rows, (a, b) = np.arange(len(q)), self.pairs[columns].T
        return q[rows, a] - q[rows, b], v[rows, a] - v[rows, b]

    def of(self, q: Array, v: Array) -> Array:
        """Return the function of relative positions and velocities, (..., 3)."""
        raise NotImplementedError
