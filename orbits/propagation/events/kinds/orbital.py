"""Events of an orbit: ejection, and elements or the energy that cross a value."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.checks import finite_number, is_one_of
from orbits.errors import InputError, UnknownNameError, shown
from orbits.propagation.events.base import NOBODY, Array, Bound, PairBound, Sought, Whole, dot
from orbits.propagation.events.kinds.of_pairs import a_distance, pairs_of, primary_of
from orbits.propagation.events.kinds.planes import axes_of, wanted
from orbits.units import quantity_from_text

if TYPE_CHECKING:
    from orbits.system import System

SIZES = {"a": "length", "q": "length", "Q": "length", "P": "time", "e": "pure", "inc": "angle", "energy": "energy"}
LIMITS = {"q": (0.0, np.inf), "P": (0.0, np.inf), "e": (0.0, np.inf), "inc": (0.0, np.pi)}
ANGLES = ("Omega", "omega", "f")
"""The elements that can cross a value: numbers of some kind, and angles around a circle."""


@dataclass(frozen=True)
class Ejection(Sought):
    """A body is farther from the barycentre of the others than a distance, and leaves them for good: its energy
    relative to them, as if they were one, is positive.

    distance : a quantity, a text such as "100 AU", or a number in the system's unit of length
    body : a name; None means every body with mass
    then : "record", "stop", or what is to be done; see `orbits.events.Event`

    Raises InputError for a distance that is not one finite number above 0, and for a name that is not a string.
    """

    distance: Any
    body: str | None = None

    named = ("body",)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "distance", a_distance(self.distance, "Ejection.distance"))

    def bound(self, system: System) -> list[Bound]:
        """Return the lesser one of two ratios, distance and energy, that are positive after an ejection."""
        massive = np.flatnonzero(system.massive)
        if len(massive) < 2:
            raise InputError("Ejection needs at least two bodies with mass.")
        bodies = massive if self.body is None else [index_of(self.body, system.names)]
        distance = float(system.units.length_value(self.distance, "Ejection.distance"))
        return [Leaving([(int(k), NOBODY) for k in bodies], system.values.gm, distance)]


class Leaving(Bound):
    """How far bodies are beyond a distance, and their energy above zero; the lesser of both."""

    def __init__(self, pairs: Any, gm: Array, distance: float) -> None:
        super().__init__((None, "ejection"), pairs)
        self._gm, self._distance = gm, distance

    def bodies(self) -> None:
        """Return None: all bodies have a part in the barycentre."""
        return

    def values(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return the function of these columns, (m, len(columns))."""
        way, speed, total = self._from_others(q, v, self.pairs[columns, 0])
        r = np.sqrt(dot(way, way))
        return np.asarray(np.minimum(r / self._distance - 1.0, 0.5 * dot(speed, speed) * r / total - 1.0))

    def figures(self, t: Array, q: Array, v: Array, columns: Whole) -> Array:
        """Return distance and speed relative to the barycentre of the others."""
        out = np.full((len(t), 3), np.nan)
        for row, column in enumerate(columns):
            way, speed, _ = self._from_others(q[row : row + 1], v[row : row + 1], self.pairs[[column], 0])
            out[row, :2] = np.linalg.norm(way), np.linalg.norm(speed)
        return out

    def _from_others(self, q: Array, v: Array, bodies: Whole) -> tuple[Array, Array, Array]:
        """Return position and velocity of bodies relative to the barycentre of all others, and the GM of all."""
        massive = self._gm > 0.0
        gm, total = self._gm[massive], float(self._gm.sum())
        found = []
        for x in (q, v):
            # In the same order for any number of rows.
            sums = sum(gm[k] * x[:, i] for k, i in enumerate(np.flatnonzero(massive)))
            own = x[:, bodies]
            share = self._gm[bodies][:, None]
            found.append(own - (np.asarray(sums)[:, None] - share * own) / (total - share))
        return found[0], found[1], np.full(len(bodies), total)


@dataclass(frozen=True)
class ElementCrossing(Sought):
    """An osculating element, or the energy, of a body crosses a value.

    body : a name
    element : "a", "e", "q" (pericentre distance), "Q" (apocentre distance), "P", "inc", "Omega", "omega", "f" (true
        anomaly), or "energy" (of the two bodies, v^2/2 - GM/r)
    value : a quantity or a number in the system's units; angles in radians
    primary : a name; optional if one body has more than 90 % of the mass
    frame : of the angles, "ecliptic" (of J2000), "icrf", "sky" or "system" (the system's own axes); by default
        `System.frame`
    direction : 1 if it is to rise through the value, -1 if it is to fall, 0 for both
    then : "record", "stop", or what is to be done; see `orbits.events.Event`
    """

    body: str
    element: str
    value: Any
    primary: str | None = None
    frame: str | None = field(default=None, kw_only=True)
    direction: int = field(default=0, kw_only=True)

    named = "body", "primary"

    def __post_init__(self) -> None:
        super().__post_init__()
        known = (*SIZES, *ANGLES)
        if not is_one_of(self.element, known):
            raise UnknownNameError(f"ElementCrossing of {shown(self.element)}; expected one of {', '.join(known)}.")
        value = quantity_from_text(self.value, "ElementCrossing.value", "a quantity or a number")
        object.__setattr__(self, "value", value)

    def bound(self, system: System) -> list[Bound]:
        """Return the element less the value, in a form that is smooth for all orbits."""
        primary = primary_of(system, self.primary, "ElementCrossing")
        pairs = pairs_of(system, self.body, system.names[primary], "ElementCrossing")
        value = finite_number(self._floats(system), "ElementCrossing.value")
        mu = float(system.values.gm[list(pairs[0])].sum())
        least, most = LIMITS.get(self.element, (-np.inf, np.inf))
        if not least <= value <= most or (value == 0.0 and self.element in ("P", "a", "q", "Q")):
            raise InputError(f"ElementCrossing: {self.element} = {self.value} is of no orbit; expected another value.")
        shown_value = f"{self.value:g}".rstrip()
        words = (f"{self.element} falls below {shown_value}", f"{self.element} rises above {shown_value}")
        axes = axes_of(system, self.frame)
        return [Element(wanted(words, self.direction), pairs, (self.element, value), mu, axes)]

    def _floats(self, system: System) -> Any:
        units, what = system.units, f"ElementCrossing of {self.element}"
        kind = SIZES.get(self.element, "angle")
        if kind == "energy":
            return getattr(self.value, "to_value", lambda unit: self.value)(units.speed**2)
        return getattr(units, f"{kind}_value")(self.value, what)


class Element(PairBound):
    """An osculating element less a value, times something positive."""

    def __init__(
        self, words: tuple[str | None, str | None], pairs: Any, which: tuple[str, float], mu: float, axes: Array
    ) -> None:
        super().__init__(words, pairs)
        (self._element, self._value), self._mu, self._axes = which, mu, axes

    def of(self, q: Array, v: Array) -> Array:
        """Return the element less the value, of relative positions and velocities, (..., 3)."""
        if self._element in ANGLES:
            x, y = self._circle(q, v)
            return np.asarray(y * np.cos(self._value) - x * np.sin(self._value))
        value, mu = self._value, self._mu
        r, energy = np.sqrt(dot(q, q)), 0.5 * dot(v, v) - mu / np.sqrt(dot(q, q))
        if self._element == "energy":
            return np.asarray(energy - value)
        if self._element in ("a", "P"):
            a = value if self._element == "a" else np.cbrt(mu * (value / (2.0 * np.pi)) ** 2)
            return np.asarray(energy + mu / (2.0 * a))
        h = np.cross(q, v)
        if self._element == "inc":
            return np.asarray(np.cos(value) - dot(h, self._axes[2]) / np.sqrt(dot(h, h)))
        ecc = np.cross(v, h) / mu - q / r[..., None]
        if self._element == "e":
            return np.asarray(dot(ecc, ecc) - value * value)
        p, e = dot(h, h) / mu, np.sqrt(dot(ecc, ecc))
        if self._element == "q":
            return np.asarray(p - value * (1.0 + e))
        return np.asarray(np.sign(value) * (p - value * (1.0 - e)))  # Q < 0 on hyperbolas

    def keeps(self, t: Array, q: Array, v: Array, columns: Whole) -> NDArray[np.bool_]:
        """Return where an angle is the value, not opposite."""
        if self._element not in ANGLES:
            return super().keeps(t, q, v, columns)
        x, y = self._circle(*self.apart(q, v, columns))
        return np.asarray(x * np.cos(self._value) + y * np.sin(self._value) > 0.0)

    def _circle(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return cosine and sine of the angle, times something positive."""
        h, r = np.cross(q, v), np.sqrt(dot(q, q))
        size = np.sqrt(dot(h, h))
        if self._element == "f":
            return np.asarray(size * size / r - self._mu), np.asarray(size * dot(q, v) / r)
        hx, hy = dot(h, self._axes[0]), dot(h, self._axes[1])
        if self._element == "Omega":
            return -hy, hx
        node = -hy[..., None] * self._axes[0] + hx[..., None] * self._axes[1]
        node = np.where(((hx == 0.0) & (hy == 0.0))[..., None], self._axes[0], node)  # as in elements, Omega is then 0
        ecc = np.cross(v, h) / self._mu - q / r[..., None]
        return dot(ecc, node), dot(ecc, np.cross(h, node)) / size
