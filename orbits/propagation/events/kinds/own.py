"""Events of one's own: functions of time and states, in NumPy, compiled, or as SymPy expressions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from orbits.body_names import index_of
from orbits.errors import EventError, InputError, shown, with_unit
from orbits.kernels.compile.user_functions import call_each
from orbits.propagation.events.base import NOBODY, Array, Bound, Sought, Whole
from orbits.propagation.events.functions import calling
from orbits.propagation.events.kinds.of_pairs import pairs_of
from orbits.propagation.events.kinds.planes import wanted

if TYPE_CHECKING:
    from orbits.system import System

COORDINATES = ("x", "y", "z", "vx", "vy", "vz")


@dataclass(frozen=True)
class Event(Sought):
    """A function of time and states crosses zero.

        def alignment(t, q, v):  # t (m,); q, v (m, bodies, 3): floats in the units of the system
            return q[:, 1, 0] - q[:, 2, 0]

        run = orbits.propagate(system, duration=1 * u.yr, events=[orbits.events.Event(alignment, name="alignment")])

    function : of times t (m,), since the epoch, and of positions and velocities q, v (m, bodies, 3); returns (m,). A
        function that is compiled, by `orbits.kernel` for example, is called for one time at a time, with t a float and
        q, v (bodies, 3), and returns a float. Or a SymPy expression of `Event.symbols` and of `t`
    name : what the event is called
    direction : 1 if the function is to rise in time, -1 if it is to fall, 0 for both
    bodies : the names of one or two bodies that it is about, for the table, and for what acts on them
    then : what happens: "record"; "stop": the run ends there, and `run.stopped` has the state; an action; or a function
        of the time (a quantity) and the `System`, called between blocks of steps, that may return a `System` with which
        the run goes on: the same bodies with other q, v, gm or radii

    Zeros are found if the function has at most one extremum between two of its checks, which are at both ends of each
    step and at eight places between them. An archive holds what is found, but not the function. Bodies that are gone
    after a collision are NaN; a function that is not finite then is not sought any more, and a warning says so.
    Raises InputError for a function that cannot be called, or that is not finite at the start of the run.
    """

    function: Any
    name: str = "event"
    direction: int = field(default=0, kw_only=True)
    bodies: Any = field(default=(), kw_only=True)

    stored: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (callable(self.function) or hasattr(self.function, "free_symbols")):
            raise InputError(
                f"Event of {shown(self.function)}; expected a function of t, q and v, or a SymPy expression."
            )
        bodies = (self.bodies,) if isinstance(self.bodies, str) else self.bodies
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"Event: name is {shown(self.name)}; expected a text.")
        fits = isinstance(bodies, list | tuple) and len(bodies) <= 2 and all(isinstance(b, str) for b in bodies)
        if not fits:
            raise InputError(f"Event: bodies is {shown(self.bodies)}; expected the names of one or two bodies.")
        object.__setattr__(self, "bodies", tuple(bodies))
        if len(set(bodies)) < len(bodies):
            raise InputError(f"Event: {bodies[0]!r} twice; expected two bodies.")

    @property
    def bodies_named(self) -> tuple[str, ...]:
        """The bodies that it is about."""
        return self.bodies  # type: ignore[no-any-return]

    @staticmethod
    def symbols(body: str) -> Any:
        """Return the SymPy symbols x, y, z, vx, vy, vz of a body, in the axes and units of the system."""
        import sympy

        return tuple(sympy.Symbol(f"{body}.{name}", real=True) for name in COORDINATES)

    def bound(self, system: System) -> list[Bound]:
        """Return the function. Raises InputError if it fails at the start of the run."""
        rows = [index_of(name, system.names) for name in self.bodies]
        if len(rows) == 2:
            pairs_of(system, self.bodies[0], self.bodies[1], "Event")
        pair = (*rows, NOBODY, NOBODY)[:2]
        words, function = wanted((self.name, self.name), self.direction), _vectorised(self.function, system)
        own = Own(self.name, words, [pair], function, system.units.time)
        _try(self, own, system)
        return [own]


class Own(Bound):
    """A function of all states; unit : of times, as messages show them."""

    def __init__(
        self, name: str, words: Any, pairs: Any, function: Callable[[Array, Array, Array], Any], unit: object
    ) -> None:
        super().__init__(words, pairs)
        self._name, self._function, self._unit = name, function, unit

    def bodies(self) -> None:
        """Return None: the function may depend on all bodies."""
        return

    def values(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function, (m, 1). Raises what it raises, and EventError for anything but real numbers."""
        between = with_unit(f"t = {t.min():.10g} and {t.max():.10g}", self._unit)
        with calling(f"the function of {self._name!r}, between {between}"):
            found = self.called(t, q, v)
        try:
            return _numbers(found, t)[:, None]
        except ValueError as error:
            raise EventError(
                f"Event {self._name!r} fails between {between}: {error}. Mend the function; all before stays "
                "readable.",
                time=float(t[0]),
            ) from error

    def called(self, t: Array, q: Array, v: Array) -> Any:
        """Return what the function returns for copies of its arguments, which it may change."""
        return self._function(t.copy(), np.array(q, order="C"), np.array(v, order="C"))


def _numbers(found: Any, t: Array) -> Array:
    """Return what a function returned as floats, (m,). Raises ValueError for anything but real numbers."""
    found = np.asarray(found)
    if found.shape != t.shape:
        given = f"times of shape {t.shape}" if t.ndim else "one time"
        raise ValueError(f"it returned shape {found.shape} for {given}")
    if np.iscomplexobj(found):
        raise ValueError("it returned complex numbers")
    if found.dtype == bool:
        raise ValueError("it returned booleans, which do not cross zero; expected numbers, such as a - b for a > b")
    return np.array(found, dtype=np.float64)


def _try(event: Event, own: Own, system: System) -> None:
    """Call the function with the state at the start, twice. Raises InputError if that fails."""
    _, q, v, _ = system.values
    expected = "of t (m,), and of q and v (m, bodies, 3), that returns (m,)"
    try:
        if hasattr(event.function, "py_func"):
            expected = "of one t, and of q and v (bodies, 3), that returns a number, as it is compiled"
            _numbers(event.function(0.0, q.copy(), v.copy()), np.zeros(()))
        found = _numbers(own.called(np.zeros(2), np.stack([q, q]), np.stack([v, v])), np.zeros(2))
    except Exception as error:  # the function of a user may raise anything
        why = next(iter(str(error).splitlines()), "").rstrip(". ")  # of Numba's, pages
        raise InputError(
            f"Event {event.name!r} fails at the start of the run: {type(error).__name__}: {why}. Expected a function "
            f"{expected}."
        ) from error
    if not np.isfinite(found).all():
        raise InputError(f"Event {event.name!r} is {found[0]} at the start of the run; expected a finite number.")
    unseen = ~system.massive
    unseen[[system.index(name) for name in event.bodies]] = False
    if not unseen.any() or not np.array_equal(found, _without(own, system, np.zeros_like(unseen), 0.0)):
        return  # what differs from call to call says nothing about bodies
    spoilt = (_without(own, system, unseen, value) for value in (np.nan, np.inf, -np.inf))
    if not all(each is None or np.array_equal(found, each) for each in spoilt):
        name = system.names[int(np.argmax(unseen))]
        raise InputError(
            f"Event {event.name!r} depends on massless bodies, which are NaN in the functions of events that are not "
            f"about them, as {name} here: give Event(..., bodies=({name!r},)) if the function needs it."
        )


def _without(own: Own, system: System, unseen: Any, value: float) -> Any:
    """Return the function of the start with a value in place of bodies that it is not to see; None if it fails."""
    q, v = (np.stack([np.where(unseen[:, None], value, x)] * 2) for x in system.values[1:3])
    with np.errstate(all="ignore"), suppress(Exception):
        return own.called(np.zeros(2), q, v)
    return None


def _vectorised(function: Any, system: System) -> Callable[[Array, Array, Array], Any]:
    """Return a function of arrays of times and states."""
    if hasattr(function, "free_symbols"):
        return _of_expression(function, system)
    if not hasattr(function, "py_func"):
        found: Callable[[Array, Array, Array], Any] = function
        return found

    def compiled(t: Array, q: Array, v: Array) -> Array:
        out = np.empty(len(t))
        call_each(function, t, q, v, out)
        return out

    return compiled


def _of_expression(expression: Any, system: System) -> Callable[[Array, Array, Array], Any]:
    """Return the function of a SymPy expression. Raises InputError for symbols that are no coordinates."""
    import sympy

    used = sorted(expression.free_symbols, key=str)
    places = []
    for symbol in used:
        body, _, name = str(symbol).rpartition(".")
        if str(symbol) == "t":
            places.append((-1, 0))
        elif name in COORDINATES and body:
            places.append((index_of(body, system.names), COORDINATES.index(name)))
        else:
            raise InputError(
                f"Event of an expression with {symbol}; expected t, and symbols of "
                "orbits.events.Event.symbols(a body's name)."
            )
    try:
        compiled = sympy.lambdify(used, expression, modules="numpy", cse=True)
    except Exception as error:  # of functions and constants that it does not print
        raise InputError(f"Event of {expression}, which NumPy cannot compute; write it as a function.") from error

    def of(t: Array, q: Array, v: Array) -> Array:
        values = [t if row < 0 else (q if k < 3 else v)[:, row, k % 3] for row, k in places]
        return np.broadcast_to(compiled(*values), t.shape)

    return of
