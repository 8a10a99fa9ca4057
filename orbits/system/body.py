"""One body of a system, for a look at its numbers."""

from __future__ import annotations

from dataclasses import dataclass

from astropy import units as u

from orbits.tables import html_pairs


@dataclass(frozen=True, eq=False, repr=False)
class Body:
    """One body at the epoch of its system: what `system["Ceres"]` gives.

    name : as the system has it
    gm, mass : G times mass, and the mass with the G of the system's units; 0 for a massless particle
    q, v : position and velocity, shape (3,), in the axes of the system and about its origin
    radius : or None where no radii are known
    """

    name: str
    gm: u.Quantity
    mass: u.Quantity
    q: u.Quantity
    v: u.Quantity
    radius: u.Quantity | None

    def _pairs(self) -> dict[str, str]:
        pairs = {"gm": f"{self.gm:.10g}".rstrip(), "q": _vector(self.q), "v": _vector(self.v)}
        return pairs if self.radius is None else {**pairs, "radius": f"{self.radius:.6g}".rstrip()}

    def _repr_html_(self) -> str:
        return html_pairs(self.name, self._pairs().items())

    def __repr__(self) -> str:
        return f"Body({self.name}; {'; '.join(f'{key} = {value}' for key, value in self._pairs().items())})"


def _vector(x: u.Quantity) -> str:
    return f"[{', '.join(f'{component:.6g}' for component in x.value)}] {x.unit}".rstrip()
