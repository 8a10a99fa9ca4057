"""Events of a body that crosses a plane: nodes of its orbit, and any other plane."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits import checks
from orbits.body_names import index_of
from orbits.elements.frames import from_frame
from orbits.kernels.search.zeros import HEIGHT
from orbits.propagation.events.base import NOBODY, Array, Bound, Sought, Whole, dot
from orbits.propagation.events.kinds.of_pairs import pairs_of, primary_of
from orbits.units import quantity_from_text

if TYPE_CHECKING:
    from orbits.system import System


@dataclass(frozen=True)
class NodeCrossing(Sought):
    """The passages of a body through a node of its orbit: it crosses the reference plane through its primary.

    body : a name; None means every body but the primary
    primary : a name; optional if one body has more than 90 % of the mass
    frame : "ecliptic" (of J2000), "icrf", "sky" or "system" (the system's own axes), whose x-y plane it is; by default
        `System.frame`
    direction : 1 for ascending nodes alone, -1 for descending ones, 0 for both
    then : "record", "stop", or what is to be done; see `orbits.events.Event`
    """

    body: str | None = None
    primary: str | None = None
    frame: str | None = field(default=None, kw_only=True)
    direction: int = field(default=0, kw_only=True)

    named = "body", "primary"

    def bound(self, system: System) -> list[Bound]:
        """Return the height above the plane, which rises through zero at ascending nodes."""
        primary = primary_of(system, self.primary, "NodeCrossing")
        pairs = pairs_of(system, self.body, system.names[primary], "NodeCrossing")
        words = wanted(("descending node", "ascending node"), self.direction)
        return [Height(words, pairs, axes_of(system, self.frame)[2], 0.0)]


@dataclass(frozen=True)
class PlaneCrossing(Sought):
    """The passages of a body through a plane.

    body : a name
    normal : the direction to which the plane is normal, three numbers
    about : the name of a body through which the plane goes, and with which it moves; None for the origin of the system
    offset : the distance of the plane from there, along the normal: a quantity, or a number in the unit of length
    frame : of the normal, "ecliptic" (of J2000), "icrf", "sky" or "system" (the system's own axes); by default
        `System.frame`
    direction : 1 for passages along the normal alone, -1 for those against it, 0 for both
    then : "record", "stop", or what is to be done; see `orbits.events.Event`
    """

    body: str
    normal: Any = (0.0, 0.0, 1.0)
    about: str | None = field(default=None, kw_only=True)
    offset: Any = field(default=0.0, kw_only=True)
    frame: str | None = field(default=None, kw_only=True)
    direction: int = field(default=0, kw_only=True)

    named = "body", "about"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "normal", tuple(checks.direction(self.normal, "PlaneCrossing", width=3).tolist()))
        offset = quantity_from_text(self.offset, "PlaneCrossing.offset", "a distance, such as 0.1 * u.au")
        object.__setattr__(self, "offset", offset)

    def bound(self, system: System) -> list[Bound]:
        """Return the height above the plane."""
        body = index_of(self.body, system.names)
        pair = (body, NOBODY) if self.about is None else pairs_of(system, self.body, self.about, "PlaneCrossing")[0]
        normal = np.array(self.normal) @ axes_of(system, self.frame)
        offset = checks.finite_number(system.units.length_value(self.offset, "PlaneCrossing.offset"), "offset")
        words = wanted(("plane crossed downwards", "plane crossed upwards"), self.direction)
        return [Height(words, [pair], normal / np.linalg.norm(normal), offset)]


class Height(Bound):
    """The height of bodies above a plane through others, or through the origin."""

    def __init__(self, words: tuple[str | None, str | None], pairs: Any, normal: Array, offset: float) -> None:
        super().__init__(words, pairs)
        self._normal, self._offset = normal, offset

    def values(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the heights, (m, len(columns))."""
        found = np.empty((len(columns), len(t)))
        for row, (a, b) in enumerate(self.pairs[columns]):
            found[row] = dot(q[:, a] if b == NOBODY else q[:, a] - q[:, b], self._normal) - self._offset
        return found.T

    def of_pairs(self) -> tuple[int, Array]:
        """Return the kind of function, the normal and the offset."""
        return HEIGHT, np.array([*self._normal, self._offset])


def axes_of(system: System, frame: str | None) -> Array:
    """Return the axes x, y and z of a frame, by default that of a system, a row each, in the axes of the system."""
    return from_frame(np.eye(3), system.frame if frame is None else frame)


def wanted(words: tuple[str, str], direction: int) -> tuple[str | None, str | None]:
    """Return words for functions that fall and that rise, without those of the other direction."""
    return words[0] if direction <= 0 else None, words[1] if direction >= 0 else None
