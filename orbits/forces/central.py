"""What forces that come from one body share: its row, relative places and velocities, numbers for each body.

The parameters of such a force are: the row of the source; the length of a block of coefficients; the numbers of the
force itself; then blocks of coefficients, each with one for every massive body, one for every massless particle and
eight zeros. Bodies that the force does not act on have zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.forces.base import BoundForce, Force, coefficient
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, get

SOURCE, BLOCK, OWN = 0, 1, 2
"""Indices of the row of the source, of the length of a block, and of the first number of the force itself."""


@kernel(inline=True)
def relative(x, i, b, n):
    """Return the difference of the vectors of the bodies i and b, three numbers or lanes."""
    return get(x, i) - get(x, b), get(x, n + i) - get(x, n + b), get(x, 2 * n + i) - get(x, 2 * n + b)


@kernel(inline=True)
def relative_to(place, sources, b, n):
    """Return the difference of a vector of a particle and that of the body b."""
    return place[0] - get(sources, b), place[1] - get(sources, n + b), place[2] - get(sources, 2 * n + b)


@kernel(inline=True)
def of_body(own, first, block, i):
    """Return the coefficient of a massive body; first : the index of the first block; block : its number."""
    return own[first + block * int(own[BLOCK]) + i]


@kernel(inline=True)
def of_particle(own, first, block, n, particle, sources, x):
    """Return the coefficient of a massless particle, or of eight; see `coefficient`."""
    return coefficient(own, first + block * int(own[BLOCK]) + n, particle, sources, x)


@dataclass(frozen=True)
class CentralForce(Force):
    """Base of the forces that come from one massive body and act on others, relative to it.

    source : the massive body; by default the most massive one
    per_body : names of the fields that may have one number for each of `bodies`
    """

    source: str | None = None

    per_body: ClassVar[tuple[str, ...]] = ()
    tag: ClassVar[Tag]

    def without(self, gone: Set[str]) -> Self | None:
        """Return this force for a system without some bodies, None if nothing is left of it."""
        if self.source in gone:
            return None
        if self.bodies is None:
            return self
        kept = [k for k, name in enumerate(self.bodies) if name not in gone]
        values = {name: getattr(self, name) for name in self.per_body}
        fewer: dict[str, Any] = {name: tuple(x[k] for k in kept) for name, x in values.items() if isinstance(x, tuple)}
        return replace(self, bodies=tuple(self.bodies[k] for k in kept), **fewer) if kept else None

    def in_unit(self, unit: Any, name: str, value_of: Callable[..., Any]) -> Any:
        """Return a field as one quantity, or a tuple of one for each body; value_of : returns floats in the unit.

        Raises InputError, naming the force and the field.
        """
        what, given = f"{name} of {type(self).__name__}", getattr(self, name)
        found = np.asarray(value_of(given, what))
        if not np.all(np.isfinite(found)):
            raise InputError(f"{what} is {shown(given)}; expected finite numbers.")
        if found.shape == ():
            return float(found) * unit
        count = None if self.bodies is None else len(self.bodies)
        if found.ndim != 1 or count != len(found):
            named = "bodies does not name any" if count is None else f"bodies names {count}"
            raise InputError(
                f"{what} has the shape {found.shape}, but {named}; expected one number, or one for each body named."
            )
        return tuple(x * unit for x in found.tolist())

    @staticmethod
    def floats(value: Any, value_of: Callable[..., Any]) -> float | tuple[float, ...]:
        """Return a field as `in_unit` made it as a float, or a tuple of floats."""
        found = value_of(list(value) if isinstance(value, tuple) else value)
        return tuple(found.tolist()) if found.ndim else float(found)

    def about(self, row: int, massive: Sequence[str], particles: Sequence[str], units: Any) -> BoundForce:
        """Return this force bound to massive bodies and particles with these names.

        row : of the source among the massive bodies, from 0
        """
        blocks = [self._block(x, row, massive, particles) for x in self.coefficients(units)]
        own = np.concatenate([[row, len(massive) + len(particles) + WIDTH], self.constants(row, units), *blocks])
        return BoundForce(self.kind, self.tag, np.ascontiguousarray(own, dtype=np.float64))

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return the numbers of the force itself, as its kernels expect them."""
        raise NotImplementedError

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return the coefficients of its blocks: one number, or one for each body named."""
        raise NotImplementedError

    def _block(
        self, values: float | tuple[float, ...], row: int, massive: Sequence[str], particles: Sequence[str]
    ) -> NDArray[np.float64]:
        places = {name: k for k, name in enumerate((*massive, *particles))}
        block = np.zeros(len(places) + WIDTH)
        for k, name in enumerate(places if self.bodies is None else self.bodies):
            place = places.get(name, row)
            if place != row:
                block[place] = values[k] if isinstance(values, tuple) else values
        return block
