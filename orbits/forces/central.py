"""What forces that come from one body share: numbers for each body, and the vector of parameters.

Of such a force only the kernel `acceleration` is written; see `orbits.kernels.gravity.central_forces`, also for the
parameters. Bodies that the force does not act on have coefficients of zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.forces.base import BoundForce, Force
from orbits.kernels.binding import Tag
from orbits.kernels.lanes import WIDTH


@dataclass(frozen=True)
class CentralForce(Force):
    """Base of the forces that come from one massive body and act on others, relative to it.

    source : the massive body; by default the most massive one
    of_source : whether it is a property of the source, which must then be named and has one such force
    by_mass : whether it acts by the masses of the bodies, and on massive ones alone
    """

    source: str | None = None

    of_source: ClassVar[bool] = False
    by_mass: ClassVar[bool] = False
    tag: ClassVar[Tag]

    @property
    def owner(self) -> str | None:
        """The source."""
        return self.source

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

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Return this force: it depends on places and velocities relative to the source."""
        return self

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
        inner = np.array(self.inner(units), dtype=np.float64)
        return BoundForce(self.kind, self.tag, np.ascontiguousarray(own, dtype=np.float64), inner)

    def inner(self, units: Any) -> Sequence[float]:
        """Return the internal variables at the start of a run; by default there are none."""
        return ()

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
