"""Events of two bodies: close approaches, pericentres and apocentres; and what all events of named bodies share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import few, index_of
from orbits.checks import positive_number
from orbits.errors import InputError
from orbits.integrators.maps.dominant import DOMINANT
from orbits.kernels.search.zeros import CLOSING, DISTANCE
from orbits.propagation.events.base import Array, PairBound, Sought, Whole, dot
from orbits.units import quantity_from_text

if TYPE_CHECKING:
    from orbits.propagation.events.base import Bound
    from orbits.system import System


@dataclass(frozen=True)
class CloseApproach(Sought):
    """The least distance of two bodies, each time that they pass.

    body, other : names; None means any body
    within : the largest distance that counts: a quantity, a text such as "0.1 AU", or a number in the system's unit of
        length; None for all
    then : "record", "stop", or what is to be done; see `orbits.events.Event`

    Raises InputError for a distance that is not one finite number above 0, and for names that are not strings.
    """

    body: str | None = None
    other: str | None = None
    within: Any = None

    named = "body", "other"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.within is not None:
            object.__setattr__(self, "within", a_distance(self.within, "CloseApproach.within"))

    def bound(self, system: System) -> list[Bound]:
        """Return d/dt of half the squared distance, which rises through zero where the distance is least."""
        pairs = pairs_of(system, self.body, self.other, type(self).__name__)
        within = np.inf if self.within is None else system.units.length_value(self.within, "CloseApproach.within")
        return [Approaching((None, "close approach"), pairs, float(within))]


class Approaching(PairBound):
    """q.v of two bodies, whose zeros count if they are close enough."""

    def __init__(self, words: tuple[str | None, str | None], pairs: Any, within: float = np.inf) -> None:
        super().__init__(words, pairs)
        self.within = within

    def of(self, q: Array, v: Array) -> Array:
        """Return q.v."""
        return dot(q, v)

    def of_pairs(self) -> tuple[int, Array]:
        """Return the kind of function, which needs no numbers."""
        return CLOSING, np.zeros(4)

    def keeps(self, t: Array, q: Array, v: Array, columns: Whole) -> NDArray[np.bool_]:
        """Return which are within the distance."""
        apart, _ = self.apart(q, v, columns)
        return np.asarray(dot(apart, apart) <= self.within**2)


class Distance(PairBound):
    """The distance of two bodies, less a fixed one; squared."""

    def __init__(self, words: tuple[str | None, str | None], pairs: Any, distance: float) -> None:
        super().__init__(words, pairs)
        self.distance = distance
        self._squared = distance * distance  # infinite beyond the range of floats

    def of(self, q: Array, v: Array) -> Array:
        """Return q.q - d^2."""
        return np.asarray(dot(q, q) - self._squared)

    def of_pairs(self) -> tuple[int, Array]:
        """Return the kind of function, and its bound."""
        return DISTANCE, np.array([0.0, 0.0, 0.0, self._squared])


@dataclass(frozen=True)
class Pericentre(Sought):
    """The passages of a body through the point of its orbit that is closest to its primary.

    body : a name; None means every body but the primary
    primary : a name; optional if one body has more than 90 % of the mass
    then : "record", "stop", or what is to be done; see `orbits.events.Event`
    """

    body: str | None = None
    primary: str | None = None

    named = "body", "primary"

    def bound(self, system: System) -> list[Bound]:
        """Return q.v about the primary, which rises through zero at pericentres, and falls at apocentres."""
        what = type(self).__name__
        primary = primary_of(system, self.primary, what)
        pairs = pairs_of(system, self.body, system.names[primary], what)
        return [Approaching((None, "pericentre") if what == "Pericentre" else ("apocentre", None), pairs)]


@dataclass(frozen=True)
class Apocentre(Pericentre):
    """The passages of a body through the point of its orbit that is farthest from its primary; see `Pericentre`."""


def a_distance(value: Any, what: str) -> Any:
    """Return a distance, read if it is a text. Raises InputError for anything but one finite number above 0."""
    distance = quantity_from_text(value, what, "a quantity, a number, or a text with a unit, such as '0.1 AU'")
    positive_number(distance.value if isinstance(distance, u.Quantity) else distance, what)
    return distance


def primary_of(system: System, name: str | None, what: str) -> int:
    """Return the number of a primary; without a name of the body that has nearly all the mass."""
    if name is not None:
        return index_of(name, system.names)
    gm = system.values.gm
    heaviest = int(np.argmax(gm))
    if gm[heaviest] < DOMINANT * gm.sum():
        heavy = [system.names[k] for k in np.flatnonzero(gm > 0.0)]
        raise InputError(f"{what}: no body has nearly all the mass; name the primary, one of {few(heavy)}.")
    return heaviest


def pairs_of(system: System, body: str | None, other: str | None, what: str) -> list[tuple[int, int]]:
    """Return the pairs of bodies that two names mean; None for any with mass. Raises InputError for one body twice."""
    bodies = [None if name is None else index_of(name, system.names) for name in (body, other)]
    everyone = [int(k) for k in np.flatnonzero(system.massive)]
    one, two = bodies
    if one is not None and one == two:
        raise InputError(f"{what}: {system.names[one]!r} twice; expected two bodies.")
    if one is not None:
        return [(one, k) for k in (everyone if two is None else [two]) if k != one]
    if two is not None:
        return [(k, two) for k in everyone if k != two]
    gm = system.values.gm
    return [(i, j) if gm[i] <= gm[j] else (j, i) for i in everyone for j in everyone if i < j]
