"""The contract of a force without a Lagrangian.

A force is one file: kernels, and a frozen dataclass for users, with units. Its kernels are

    force(strength, own, t, q, v, f)       adds the forces, times G, to f; vectors, or rows of eight stages
    particle_force(strength, own, t, particle, sources, speeds, place, velocity)
                                           returns the force per unit mass; `particle` is its number, or that of the
                                           first of eight in lanes: see `coefficient`

`strength` is the parameter vector of `newtonian`, `own` is that of the force; t is the time since the epoch of the
system, in its unit. A method includes forces by the discrete Lagrange–d'Alembert principle: with f at the stages,
P_i = p + h sum_j a_ij (dL/dq + f)_j.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from orbits.kernels.binding import OPTIONS, Tag
from orbits.kernels.lanes import LanesType, load


@dataclass(frozen=True, eq=False)
class BoundForce:
    """A force bound to the bodies of a system: its name for messages, its kernels and its parameter vector."""

    name: str
    tag: Tag
    parameters: NDArray[np.float64]


@dataclass(frozen=True)
class Force:
    """Base of the forces of a `System`: frozen dataclasses whose fields are their parameters, with units.

    kind : its name in archives
    bodies : the names of the bodies that it acts on, massive or not; None for all
    """

    kind: ClassVar[str]
    bodies: Sequence[str] | None = None

    def in_units(self, units: Any) -> Self:
        """Return this force with its numbers checked and in the units of a system.

        Raises InputError, naming the force and the value, for invalid numbers or units.
        """
        raise NotImplementedError

    def bound(self, massive: NDArray[np.bool_], particles: NDArray[np.bool_], units: Any) -> BoundForce:
        """Return this force, in the units of the system, bound to these massive bodies and particles (masks)."""
        raise NotImplementedError

    def without(self, gone: Set[str]) -> Self | None:
        """Return this force for a system without some bodies, None if nothing is left of it."""
        if self.bodies is None:
            return self
        left = tuple(name for name in self.bodies if name not in gone)
        return replace(self, bodies=left) if left else None

    def later(self, time: Any) -> Self:
        """Return this force for a system whose epoch is later by `time`, a quantity: a force that depends on the time
        since the epoch must keep the old one.
        """
        return self

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Return this force as seen from an origin at that place that moves with that velocity, (3,) quantities: one
        that depends on absolute positions or velocities has to shift its numbers. The default is for one that depends
        on relative ones alone.

        Raises InputError, naming the force, if it cannot be seen from there.
        """
        return self


def coefficient(own, offset, particle, sources, x):
    """Return the coefficient of a particle, from the vector of a force, which has one for each particle from `offset`
    on; or `Lanes` of eight coefficients for eight particles in lanes.

    sources : the positions of the massive bodies, (3n,), or (3n, 8) at the stages of one particle
    x : the x coordinate of the particles
    """
    raise NotImplementedError("coefficient() is for compiled code only")


@overload(coefficient, jit_options=OPTIONS)
def _coefficient(own, offset, particle, sources, x):
    if isinstance(x, LanesType) and sources.ndim == 1:
        return lambda own, offset, particle, sources, x: load(own, offset + particle)
    return lambda own, offset, particle, sources, x: own[offset + particle]
