"""Events as seen from a body or from infinity: conjunctions, oppositions, transits and occultations."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.checks import checked_flag
from orbits.errors import InputError, UnknownNameError, shown
from orbits.observing.line_of_sight import LineOfSight, arrived, line_of_sight
from orbits.propagation.events.base import NOBODY, Array, Bound, Sought, Whole, dot
from orbits.propagation.events.kinds.planes import axes_of

if TYPE_CHECKING:
    from orbits.system import System


FROM_FAR = "The observer of an exoplanet is at infinity: observer=orbits.along(inc=...), for transits and occultations."
"""What to do if no body of the system is the observer."""


@dataclass(frozen=True)
class Seen(Sought):
    """The base class of events of two bodies as seen from a third one.

    body, other, observer : names of three bodies; of those whose `from_infinity` is true the observer may be a line of
        sight, `orbits.along(inc=...)`
    apparent : whether they are seen where they appear, by the time that light takes and by aberration, to first order
        in v/c; otherwise where they are
    then : "record", "stop", or what is to be done; see `orbits.events.Event`
    """

    body: str
    other: str
    observer: str | LineOfSight = field(default="", kw_only=True)
    apparent: bool = field(default=False, kw_only=True)

    from_infinity: ClassVar[bool] = False
    """Whether it can be seen from infinity."""

    def __post_init__(self) -> None:
        super().__post_init__()
        what = type(self).__name__
        for name in (self.body, self.other):
            if not isinstance(name, str):
                raise InputError(
                    f"{what} of {shown(name)}; expected names, as in {what}('Venus', 'Sun', observer='Earth')."
                )
        if self.from_infinity and isinstance(self.observer, list | tuple):
            object.__setattr__(self, "observer", line_of_sight(self.observer, f"{what}.observer"))
        elif not isinstance(self.observer, str) or not self.observer:
            got = "has no observer" if isinstance(self.observer, str) else f"has observer={shown(self.observer)}"
            raise InputError(
                f"{what} of {self.body!r} and {self.other!r} {got}; expected the name of a third body, as in "
                f"{what}('Venus', 'Sun', observer='Earth'). {FROM_FAR}"
            )
        names = self.body, self.other, self.observer
        if len(set(names)) < 3:
            twice = self.body if self.body in names[1:] else self.other
            several = "two" if isinstance(self.observer, LineOfSight) else "three"
            raise InputError(f"{what}: {twice!r} twice; expected {several} bodies.")
        checked_flag(self.apparent, f"{what}.apparent")

    @property
    def bodies_named(self) -> tuple[str, ...]:
        """The names of the bodies, and of an observer among them."""
        return tuple(name for name in (self.body, self.other, self.observer) if isinstance(name, str))

    def sight(self, system: System) -> Sight:
        """Return the bodies, from there. Raises InputError for one body twice, and UnknownNameError."""
        what = type(self).__name__
        body, other = (index_of(name, system.names) for name in (self.body, self.other))
        if self.apparent and not system.units.is_physical:
            raise InputError(f"{what}: apparent positions need physical units; {system.units.name} has none.")
        delay = 1.0 / system.units.speed_of_light if self.apparent else 0.0
        if isinstance(self.observer, LineOfSight):
            observer = NOBODY
        else:
            try:
                observer = index_of(self.observer, system.names)
            except UnknownNameError as error:
                needed = "The observer must be a body of the system; run.ephemeris takes observatories, too."
                raise UnknownNameError(f"{what}.observer: {error} {needed} {FROM_FAR}") from None
        if len({body, other, observer}) < 3:
            twice = system.names[body if body in (other, observer) else other]
            several = "two" if observer == NOBODY else "three"
            raise InputError(f"{what}: {twice!r} twice; expected {several} bodies.")
        if observer == NOBODY:
            return SightFromInfinity(body, other, observer, delay, np.array(self.observer))
        return Sight(body, other, observer, delay)


@dataclass(frozen=True)
class Sight:
    """Two bodies as seen from an observer, by their numbers; delay : the time that light takes for a unit of length."""

    body: int
    other: int
    observer: int
    delay: float

    def of(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Return the positions of both bodies relative to the observer, (m, 3) each, and their velocities."""
        found = []
        for row in (self.body, self.other):
            way, speed = q[:, row] - q[:, self.observer], v[:, row] - v[:, self.observer]
            if self.delay:
                # Where it was when light left it, seen by a moving observer: both by the relative velocity.
                way = way - (self.delay * np.sqrt(dot(way, way)))[:, None] * speed
            found.append((way, speed))
        (a, va), (b, vb) = found
        return a, b, va, vb

    def apart(self, a: Array, b: Array) -> Array:
        """Return how far apart both are on the sky, (m,): the angle between them."""
        across = np.cross(a, b)
        return np.asarray(np.arctan2(np.sqrt(dot(across, across)), dot(a, b)))

    def disc(self, radius: float, way: Array) -> Array:
        """Return how large a sphere is on the sky, (m,): its angular radius; a right angle within it."""
        return np.asarray(np.arcsin(np.minimum(radius / np.sqrt(dot(way, way)), 1.0)))

    def before(self, a: Array, b: Array) -> Array:
        """Return a number, (m,), which is positive where the first body is the nearer one."""
        return dot(b, b) - dot(a, a)

    def parting(self, a: Array, b: Array, va: Array, vb: Array) -> Array:
        """Return d/dt of minus the cosine of the angle, times the distances, (m,)."""
        ab, aa, bb = dot(a, b), dot(a, a), dot(b, b)
        return np.asarray(ab * (dot(a, va) / aa + dot(b, vb) / bb) - dot(va, b) - dot(a, vb))


@dataclass(frozen=True)
class SightFromInfinity(Sight):
    """Two bodies as seen from infinity: lengths on the plane of the sky take the place of angles.

    towards : the direction to the observer, a vector of length 1
    """

    towards: Array

    def of(self, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """Return the positions of both bodies, (m, 3) each, and their velocities."""
        rows = [self.body, self.other]
        way, speed = q[:, rows], v[:, rows]
        if self.delay:
            way = arrived(way, speed, self.towards, self.delay)
        return way[:, 0], way[:, 1], speed[:, 0], speed[:, 1]

    def apart(self, a: Array, b: Array) -> Array:
        """Return how far apart both are on the sky, (m,), a length."""
        across = np.cross(a - b, self.towards)
        return np.asarray(np.sqrt(dot(across, across)))

    def disc(self, radius: float, way: Array) -> Array:
        """Return the radius of a sphere, (m,)."""
        return np.full(len(way), radius)

    def before(self, a: Array, b: Array) -> Array:
        """Return by how much the first body is nearer to the observer, (m,)."""
        return dot(a - b, self.towards)

    def parting(self, a: Array, b: Array, va: Array, vb: Array) -> Array:
        """Return half of d/dt of the squared distance on the sky, (m,)."""
        way, speed = a - b, va - vb
        return dot(way, speed) - dot(way, self.towards) * dot(speed, self.towards)


class SeenBound(Bound):
    """A function of two bodies as seen from a third one; all columns are of these."""

    def __init__(self, words: tuple[str | None, str | None], sight: Sight) -> None:
        super().__init__(words, [(sight.body, sight.other)])
        self._sight = sight

    def bodies(self) -> Whole:
        """Return the numbers of the bodies, with that of the observer if it is one."""
        numbers = np.array([self._sight.body, self._sight.other, self._sight.observer])
        return np.asarray(numbers[numbers != NOBODY])

    def values(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function, (m, 1)."""
        return self.of(*self._sight.of(q, v))[:, None]

    def of(self, a: Array, b: Array, va: Array, vb: Array) -> Array:
        """Return the function of the positions and velocities that are seen, (m, 3) each."""
        raise NotImplementedError

    def figures(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the distance of the two bodies, their relative speed, and the angle between them, (m, 3); from
        infinity there is no angle.
        """
        out = super().figures(t, q, v, columns)
        if self._sight.observer != NOBODY:
            a, b, _, _ = self._sight.of(q, v)
            out[:, 2] = self._sight.apart(a, b)
        return out


@dataclass(frozen=True)
class Conjunction(Seen):
    """Two bodies have the same longitude, as seen from a third one.

    body, other, observer : names of three bodies
    frame : "ecliptic" (of J2000) for longitudes, "icrf" for right ascensions, or "system"; by default `System.frame`
    apparent : whether they are seen where they appear, by the time that light takes and by aberration, to first order
        in v/c; otherwise where they are
    then : "record", "stop", or what is to be done; see `orbits.events.Event`
    """

    frame: str | None = field(default=None, kw_only=True)

    def bound(self, system: System) -> list[Bound]:
        """Return the sine of the difference of longitudes, times the distances from the axis."""
        word = type(self).__name__.lower()
        sign = -1.0 if word == "opposition" else 1.0
        return [Longitudes((word, word), self.sight(system), axes_of(system, self.frame), sign)]


@dataclass(frozen=True)
class Opposition(Conjunction):
    """Two bodies have opposite longitudes, as seen from a third one; see `Conjunction`."""


class Longitudes(SeenBound):
    """The sine of the difference of two longitudes, times distances, whose zeros count where its cosine has a sign."""

    def __init__(self, words: tuple[str | None, str | None], sight: Sight, axes: Array, sign: float) -> None:
        super().__init__(words, sight)
        self._axes, self._sign = axes, sign

    def of(self, a: Array, b: Array, va: Array, vb: Array) -> Array:
        """Return the sine."""
        x, y, _ = self._axes
        return np.asarray(dot(a, y) * dot(b, x) - dot(a, x) * dot(b, y))

    def keeps(self, t: Array, q: Array, v: Array, columns: Whole) -> NDArray[np.bool_]:
        """Return where the cosine has the right sign."""
        a, b, _, _ = self._sight.of(q, v)
        x, y, _ = self._axes
        return np.asarray(self._sign * (dot(a, x) * dot(b, x) + dot(a, y) * dot(b, y)) > 0.0)


@dataclass(frozen=True)
class Transit(Seen):
    """A body passes in front of another one, as seen from a third one or from infinity: its contacts, and where they
    are closest.

        orbits.events.Transit("Venus", "Sun", observer="Earth", apparent=True)
        orbits.events.Transit("b", "star", observer=orbits.along())  # of a planet whose elements are in frame="sky"

    body, other : names of two bodies with radii
    observer : the name of a third body, or the line of sight to one at infinity, `orbits.along(inc=..., node=...)`
    apparent : whether they are seen where they appear, by the time that light takes and by aberration, to first order
        in v/c; otherwise where they are. From infinity times are those at which the light arrives, less the time from
        the origin of the system
    then : "record", "stop", or what is to be done; see `orbits.events.Event`

    The discs touch at the first and the fourth contact from outside, at the second and the third from inside; the
    middle of a transit is where the centres are closest on the sky. `run.transits` is a table of those from infinity.
    """

    from_infinity: ClassVar[bool] = True

    def bound(self, system: System) -> list[Bound]:
        """Return three functions: the distances of the discs, and the change of the angle between their centres."""
        word, sight = type(self).__name__.lower(), self.sight(system)
        radii = [0.0, 0.0] if system.radii is None else system.radii.value[[sight.body, sight.other]].tolist()
        for name, radius in zip((self.body, self.other), radii, strict=True):
            if not radius > 0.0:
                raise InputError(
                    f"{type(self).__name__} needs the radius of {name}; expected radii in the system: "
                    "System(radii=...), or system.add(..., radius=...)."
                )
        sign = 1.0 if word == "transit" else -1.0
        return [
            Discs((f"{word}, contact 1", f"{word}, contact 4"), sight, radii, sign, 1.0),
            Discs((f"{word}, contact 2", f"{word}, contact 3"), sight, radii, sign, -1.0),
            Closest((None, f"{word}, closest"), sight, radii, sign),
        ]


@dataclass(frozen=True)
class Occultation(Transit):
    """A body passes behind another one, as seen from a third one: its contacts, and where they are closest; see
    `Transit`.
    """


class Discs(SeenBound):
    """The angle between two bodies, less the sum or the difference of the angular radii of their discs.

    radii : of both; sign : 1 if the first one is to be nearer, -1 if it is to be farther
    touching : 1 for discs that touch from outside, -1 for one within the other
    """

    def __init__(self, words: Any, sight: Sight, radii: Any, sign: float, touching: float) -> None:
        super().__init__(words, sight)
        self._radii, self._sign, self._touching = radii, sign, touching

    def of(self, a: Array, b: Array, va: Array, vb: Array) -> Array:
        """Return the angle less the sum, or the difference, of the radii."""
        one, two = (self._sight.disc(radius, way) for radius, way in zip(self._radii, (a, b), strict=True))
        return np.asarray(self._sight.apart(a, b) - (one + two if self._touching > 0.0 else abs(one - two)))

    def keeps(self, t: Array, q: Array, v: Array, columns: Whole) -> NDArray[np.bool_]:
        """Return where the first body is on the right side of the second one."""
        a, b, _, _ = self._sight.of(q, v)
        return np.asarray(self._sign * self._sight.before(a, b) > 0.0)


class Closest(Discs):
    """The change of the angle between two bodies, whose discs overlap."""

    def __init__(self, words: Any, sight: Sight, radii: Any, sign: float) -> None:
        super().__init__(words, sight, radii, sign, 1.0)

    def of(self, a: Array, b: Array, va: Array, vb: Array) -> Array:
        """Return what rises through zero where both are closest."""
        return self._sight.parting(a, b, va, vb)

    def keeps(self, t: Array, q: Array, v: Array, columns: Whole) -> NDArray[np.bool_]:
        """Return where the discs overlap, and the first body is on the right side."""
        overlap = Discs.of(self, *self._sight.of(q, v)) < 0.0
        return np.asarray(overlap & super().keeps(t, q, v, columns))
