"""The bodies of a system one by one, with their values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.checks import place_in
from orbits.errors import with_unit
from orbits.export import html_pairs

if TYPE_CHECKING:
    from orbits.system.system import System


@dataclass(frozen=True, eq=False, repr=False)
class Body:
    """One body at the epoch of its system, as returned by `system["Ceres"]`.

    name : as in the system
    gm, mass : G times mass, and the mass with the G of the system's units; 0 for a massless particle
    q, v : position and velocity, shape (3,), in the axes of the system and relative to its origin
    radius : None if the system has no radii
    """

    name: str
    gm: u.Quantity
    mass: u.Quantity
    q: u.Quantity
    v: u.Quantity
    radius: u.Quantity | None

    def __eq__(self, other: object) -> bool:
        """Whether another body has the same name and the same values."""
        if not isinstance(other, Body):
            return NotImplemented
        return all(bool(np.all(getattr(self, x.name) == getattr(other, x.name))) for x in fields(self))

    __hash__ = None  # type: ignore[assignment]

    def _pairs(self) -> dict[str, str]:
        pairs = {"gm": f"{self.gm:.10g}".rstrip(), "q": _vector(self.q), "v": _vector(self.v)}
        return pairs if self.radius is None else {**pairs, "radius": f"{self.radius:.6g}".rstrip()}

    def _repr_html_(self) -> str:
        return html_pairs(self.name, self._pairs().items())

    def __repr__(self) -> str:
        return f"Body({self.name}; {'; '.join(f'{key} = {value}' for key, value in self._pairs().items())})"


class Bodies:
    """The methods of `System` for single bodies."""

    __slots__ = ()

    def __getitem__(self, key: str | int) -> Body:
        """Return a body by name or index (negative ones from the end). Raises UnknownNameError or OutOfRangeError."""
        system: System = self  # type: ignore[assignment]
        if isinstance(key, str):
            i = system.index(key)
        else:
            i = place_in(len(system), key, "system", "bodies", 'a name, system["Sun"], or an index, system[0]')
        mass = u.Quantity(system.values.gm[i] / system.units.G, system.units.mass)
        radius = None if system.radii is None else system.radii[i]
        return Body(system.names[i], system.gm[i], mass, system.q[i], system.v[i], radius)

    def __iter__(self) -> Iterator[Body]:
        """Yield the bodies in their order."""
        system: Any = self
        return (system[i] for i in range(len(system)))

    def _ipython_key_completions_(self) -> list[str]:
        system: Any = self
        return list(system.names)


def _vector(x: u.Quantity) -> str:
    return with_unit(f"[{', '.join(f'{component:.6g}' for component in x.value)}]", x.unit)
