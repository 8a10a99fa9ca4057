"""What a term of an N-body Lagrangian is, and the sum of Newton's Lagrangian and such terms.

A term is one file: kernels, and a frozen dataclass that people make, with units. Its kernels add to what is there:

    value(strength, own, t, q, v)                          returns the term's part of L
    gradients(strength, own, t, q, v, f, p)                adds dL/dq to f and dL/dv to p
    hessians(strength, own, t, q, v, out)                  adds second derivatives, as `binding.hessians` writes them
    accelerate_some(strength, own, q, out, start, stop)    adds the accelerations of bodies start ... stop - 1
    field(strength, own, sources, x, y, z)                 returns the acceleration of a massless particle
    particle_gradients(strength, own, t, sources, speeds, place, velocity)    returns its dL/dx and dL/dv, six numbers

`strength` are the parameters of `newtonian`, eps^2 and GM of each massive body; `own` is the vector of the term; t is
the time since the epoch of the system, in its unit. L is multiplied by G, as it is there. A term of positions alone has
accelerations and a field too, and may then be SEPARABLE; one that depends on velocities or on time (TIME_DEPENDENT)
cannot, and its massless particles have particle_gradients alone. Vectors, rows of stages in lanes and particles
in lanes are served by one source: read with get(q, k), write with put(out, k, value).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.kernels.binding import SumTag, Tag
from orbits.lagrangians.base import TIME_DEPENDENT, Compiled, Lagrangian
from orbits.lagrangians.symmetry import Symmetry, rotation

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

PARALLEL = 1e-14
"""Unit vectors whose vector product is not longer are one axis."""


@dataclass(frozen=True, eq=False)
class Summand:
    """A term with all its numbers, as a sum takes it.

    name : for people; formula : its part of L
    tag, parameters : its kernels and its vector
    traits : what methods may ask of it, see `orbits.lagrangians.base`
    axis : the only axis about which it may be rotated, a unit vector; None where it may be about every one
    """

    name: str
    formula: str
    tag: Tag
    parameters: Array
    traits: frozenset[str]
    axis: Vector | None


@dataclass(frozen=True)
class Term:
    """Base of the terms that a `System` takes: frozen dataclasses whose fields are their numbers, with units.

    kind : the name under which archives hold it
    body : the field that names the massive body that the term belongs to; None stands for the most massive one
    """

    kind: ClassVar[str]
    body: str | None = None

    def in_units(self, units: Any) -> Self:
        """Return this term with its numbers checked and in the units of a system.

        Raises InputError, naming the term and the value, for numbers or units that cannot be.
        """
        raise NotImplementedError

    def summand(self, row: int, units: Any) -> Summand:
        """Return this term, in the units of the system, for the massive body of that row."""
        raise NotImplementedError

    def later(self, time: Any) -> Self:
        """Return this term in a system whose epoch lies later by a time, a quantity: one that depends on the time since
        the epoch has to count from the old one.
        """
        return self

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Return this term as seen from an origin at that place that moves with that velocity, (3,) quantities: one
        that depends on absolute positions or velocities has to shift its numbers. The default is for one that depends
        on relative ones alone.

        Raises InputError, naming the term, if it cannot be seen from there.
        """
        return self


@dataclass(frozen=True, eq=False)
class SumOfTerms(Lagrangian):
    """Newton's Lagrangian of n bodies, and terms that are added to it; `parameters` are those of Newton's."""

    summands: tuple[Summand, ...] = field(default=(), repr=False)

    @cached_property
    def parameter_vector(self) -> Any:
        """The parameters as the kernels want them: a vector for each term, Newton's first."""
        newton = np.array([*self.parameters.values()], dtype=np.float64)
        return (newton, *(summand.parameters for summand in self.summands))


def compiled_sum(newton: Compiled, summands: Sequence[Summand]) -> Compiled:
    """Return the compiled face of a sum: it has the traits of all of its terms, and depends on time if one does."""
    traits = newton.traits.intersection(*(summand.traits for summand in summands))
    if any(TIME_DEPENDENT in summand.traits for summand in summands):
        traits |= {TIME_DEPENDENT}
    return Compiled(SumTag((newton.tag, *(summand.tag for summand in summands))), traits)


def axis_of(summands: Sequence[Summand]) -> Vector | None:
    """Return the axis about which the sum may be rotated, if it is one alone; zeros where there is none."""
    axes = [summand.axis for summand in summands if summand.axis is not None]
    if not axes:
        return None
    alike = all(float(np.linalg.norm(np.cross(axes[0], axis))) <= PARALLEL for axis in axes[1:])
    return axes[0] if alike else (0.0, 0.0, 0.0)


def kept(symmetries: Sequence[Symmetry], summands: Sequence[Summand], bodies: int) -> tuple[Symmetry, ...]:
    """Return Newton's symmetries that the terms leave: translations, boosts, and rotations about their axis."""
    axis = axis_of(summands)
    if axis is None:
        return tuple(symmetries)
    others = [symmetry for symmetry in symmetries if not symmetry.name.startswith("rotation")]
    if any(axis):
        others.append(rotation(axis, copies=bodies, name="rotation about the pole"))
    return tuple(others)


def direction(value: Any, what: str, units: Any) -> Vector:
    """Return a unit vector from (right ascension, declination) or from three numbers.

    Raises InputError for anything else, and for a declination beyond a right angle: degrees that are plain numbers.
    """
    expected = "expected (right ascension, declination), such as (286.13 * u.deg, 63.87 * u.deg), or a vector x, y, z"
    if value is None:
        raise InputError(f"{what} is missing; {expected}.")
    try:
        count = len(value)
    except TypeError:
        count = 0
    if count == 2:
        ra, dec = (float(units.angle_value(angle, what)) for angle in value)
        if not abs(dec) <= np.pi / 2 + 1e-12:
            raise InputError(f"{what} has the declination {dec:g} rad; plain numbers are radians, degrees need u.deg.")
        found = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    elif count == 3:
        found = np.asarray(units.pure_value(value, what), dtype=np.float64)
    else:
        raise InputError(f"{what} is {shown(value)}; {expected}.")
    length = float(np.linalg.norm(found))
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"{what} is {shown(value)}; expected finite numbers, not all of them 0.")
    # A vector that has the length 1 already stays as it is: what was stored comes back to the same bits.
    unit = found if abs(length - 1.0) <= 4e-16 else found / length
    return float(unit[0]), float(unit[1]), float(unit[2])


def number(value: Any, what: str) -> float:
    """Return one finite float. Raises InputError for anything else."""
    array = np.asarray(value)
    if array.shape != () or not np.isfinite(array):
        raise InputError(f"{what} is {array.tolist()}; expected one finite number.")
    return float(array)
