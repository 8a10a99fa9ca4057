"""What a force without a Lagrangian is.

A force is one file: kernels, and a frozen dataclass that people make, with units. Its kernels are

    force(strength, own, t, q, v, f)       adds the forces, times G, to f; vectors, or rows of eight stages
    particle_force(strength, own, t, particle, sources, speeds, place, velocity)
                                           returns the force on a unit of mass; `particle` is its number, or that of the
                                           first of eight in lanes: see `coefficient`

`strength` are the parameters of `newtonian`, `own` is the vector of the force; t is the time since the epoch of the
system, in its unit. A method takes them up by the discrete
Lagrange–d'Alembert principle: with f at the stages, P_i = p + h sum_j a_ij (dL/dq + f)_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from orbits.kernels.binding import OPTIONS, Tag
from orbits.kernels.lanes import LanesType, load


@dataclass(frozen=True, eq=False)
class BoundForce:
    """A force with all its numbers: its name for people, its kernels and its vector."""

    name: str
    tag: Tag
    parameters: NDArray[np.float64]


@dataclass(frozen=True)
class Force:
    """Base of the forces that a `System` takes: frozen dataclasses whose fields are their numbers, with units.

    kind : the name under which archives hold it
    bodies : the names of the bodies that it acts on, massive or not; None stands for all
    """

    kind: ClassVar[str]
    bodies: Sequence[str] | None = None

    def in_units(self, units: Any) -> Self:
        """Return this force with its numbers checked and in the units of a system.

        Raises InputError, naming the force and the value, for numbers or units that cannot be.
        """
        raise NotImplementedError

    def bound(self, massive: NDArray[np.bool_], particles: NDArray[np.bool_], units: Any) -> BoundForce:
        """Return this force, in the units of the system, on those of the massive bodies and of the particles."""
        raise NotImplementedError

    def later(self, time: Any) -> Self:
        """Return this force in a system whose epoch lies later by a time, a quantity: one that depends on the time
        since the epoch has to count from the old one.
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
    """Return a number that each particle has its own of, from the vector of a force, where they stand from `offset` on:
    that of a particle, or `Lanes` of eight for eight particles in lanes.

    sources : the positions of the massive bodies, (3n,), or (3n, 8) at the stages of one particle; x : as the place
    """
    raise NotImplementedError("coefficient() is for compiled code only")


@overload(coefficient, jit_options=OPTIONS)
def _coefficient(own, offset, particle, sources, x):
    if isinstance(x, LanesType) and sources.ndim == 1:
        return lambda own, offset, particle, sources, x: load(own, offset + particle)
    return lambda own, offset, particle, sources, x: own[offset + particle]
