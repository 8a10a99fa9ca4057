"""The contract of a term of an N-body Lagrangian, and the sum of Newton's Lagrangian and such terms.

A term is one file: kernels, and a frozen dataclass for users, with units. Its kernels add to their output:

    value(strength, own, t, q, v)                          returns the term's part of L
    gradients(strength, own, t, q, v, f, p)                adds dL/dq to f and dL/dv to p
    momenta(strength, own, t, q, v, f, p)                  adds dL/dv to p, with f as workspace; only for terms where
                                                           that is cheaper than both
    hessians(strength, own, t, q, v, out)                  adds second derivatives, as `binding.hessians` writes them
    accelerate_some(strength, own, q, out, start, stop)    adds the accelerations of bodies start ... stop - 1
    field(strength, own, sources, x, y, z)                 returns the acceleration of a massless particle
    particle_gradients(strength, own, t, sources, speeds, place, velocity)    returns its dL/dx and dL/dv, six numbers
    inertia(strength, own, t, q, v, out)    adds to out, (n,), what each body weighs in the centre of mass besides GM,
                                        for terms without Galilean symmetry
    particle_momenta(...)               returns its dL/dv alone, three numbers; only for terms where that is cheaper
    about(strength, own, gm, r, w)      returns the derivatives, per GM, of the part of L of a body at r with velocity
                                        w relative to that of the term, for terms that are ABOUT_ONE_BODY

`strength` is the parameter vector of `newtonian`, eps^2 and GM of each massive body; `own` is that of the term; t is
the time since the epoch of the system, in its unit. L is multiplied by G, as there. A term of positions alone also has
accelerations and a field, and may be SEPARABLE; one that depends on velocities or on time (TIME_DEPENDENT) may not, and
for massless particles has only particle_gradients. One source works for vectors, rows of stages in lanes and particles
in lanes: read with get(q, k), write with put(out, k, value).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.kernels.binding import SumTag, Tag
from orbits.lagrangians.base import GIVEN, TIME_DEPENDENT, Compiled, Lagrangian
from orbits.lagrangians.symmetry import Symmetry, rotation

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

PARALLEL = 1e-14
"""Unit vectors whose cross product is not longer than this define the same axis."""


@dataclass(frozen=True, eq=False)
class Summand:
    """A term bound to the bodies of a system, for a sum.

    name : for messages; formula : its part of L
    tag, parameters : its kernels and its vector
    traits : properties that methods may require, see `orbits.lagrangians.base`
    axis : the axis of its rotational symmetry, a unit vector, zeros if there is none; None if it is invariant under
        all rotations
    galilean : whether boosts leave it unchanged, so that the centre of mass by GM moves uniformly
    beside_newton : for a term with the attraction of the bodies themselves, which Newton's is left out for: the
        parameters with which it is, added to Newton's of all pairs, the same Lagrangian
    """

    name: str
    formula: str
    tag: Tag
    parameters: Array
    traits: frozenset[str]
    axis: Vector | None
    galilean: bool = True
    beside_newton: Array | None = None


@dataclass(frozen=True)
class Term:
    """Base of the terms of a `System`: frozen dataclasses whose fields are their parameters, with units.

    kind : its name in archives
    alone : whether a system can have only one of this kind; if_two : what to do about a second one, for messages
    body : the name of the massive body to which the term belongs; None for the most massive one
    of_body : names of the fields that are numbers of that body; see `orbits.system.parameters`
    """

    kind: ClassVar[str]
    alone: ClassVar[bool] = False
    of_body: ClassVar[tuple[str, ...]] = ()
    if_two: ClassVar[str] = "Give all that are to act: system.replaced(terms=[...])."
    body: str | None = None

    @property
    def owner(self) -> str | None:
        """The body to which its numbers belong."""
        return self.body

    @property
    def others(self) -> tuple[str, ...]:
        """The fields with names of further massive bodies: a name, a tuple of names, or None."""
        return ()

    @property
    def of_several(self) -> bool:
        """Whether the term belongs to several bodies or to all, so that `body` stays None."""
        return False

    @property
    def whose(self) -> str:
        """The bodies to which the term belongs, for messages."""
        return str(self.body)

    def in_units(self, units: Any) -> Self:
        """Return this term with its numbers checked and in the units of a system.

        Raises InputError, naming the term and the value, for invalid numbers or units.
        """
        raise NotImplementedError

    def summand(self, row: int, units: Any) -> Summand:
        """Return this term, in the units of the system, bound to the massive body of that row."""
        raise NotImplementedError

    @property
    def gives_bodies(self) -> tuple[str, ...]:
        """The names of the massive bodies, the first ones of a system, of which it says where they are at all times."""
        return ()

    def check_bodies(self, names: Sequence[str], gm: Array) -> None:
        """Raise InputError if this term does not go with these bodies of a system; gm : (n,)."""

    def check_span(self, end: float, units: Any) -> None:
        """Raise EpochError if this term does not describe the motion until `end`, the time since the epoch."""

    def among(self, row: Callable[[str], int], bodies: int, units: Any) -> Summand:
        """Return this term bound to the massive bodies of a system.

        row : returns the number of one of them from its name; bodies : how many there are
        """
        return self.summand(row(str(self.body)), units)

    def without(self, gone: Set[str]) -> Self | None:
        """Return this term for a system without some bodies; None if nothing is left of it."""
        return None if self.body in gone else self

    def check_start(self, system: Any) -> None:
        """Raise InputError if this term does not describe the motion of a system in its state at the start of a run."""

    def later(self, time: Any) -> Self:
        """Return this term for a system whose epoch is later by `time`, a quantity: a term that depends on the time
        since the epoch must keep the old one.
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
        """The parameters of the kernels: a vector for each term, Newton's first."""
        newton = np.array([*self.parameters.values()], dtype=np.float64)
        return (newton, *(summand.parameters for summand in self.summands))


def compiled_sum(newton: Compiled, summands: Sequence[Summand]) -> Compiled:
    """Return the compiled sum: it has the common traits of all its terms, depends on time if one does, and has given
    bodies if one gives them.
    """
    traits = newton.traits.intersection(*(summand.traits for summand in summands))
    for trait in (TIME_DEPENDENT, GIVEN):
        if any(trait in summand.traits for summand in summands):
            traits |= {trait}
    return Compiled(SumTag((newton.tag, *(summand.tag for summand in summands))), traits)


def axis_of(summands: Sequence[Summand]) -> Vector | None:
    """Return the axis of rotational symmetry of the sum, if there is only one; zeros if there is none; None for all."""
    axes = [summand.axis for summand in summands if summand.axis is not None]
    if not axes:
        return None
    alike = all(any(axis) and float(np.linalg.norm(np.cross(axes[0], axis))) <= PARALLEL for axis in axes)
    return axes[0] if alike else (0.0, 0.0, 0.0)


def kept(symmetries: Sequence[Symmetry], summands: Sequence[Summand], bodies: int) -> tuple[Symmetry, ...]:
    """Return the symmetries of Newton's Lagrangian that the terms keep: translations, boosts, rotations about an
    axis.
    """
    axis, left = axis_of(summands), list(symmetries)
    if not all(summand.galilean for summand in summands):
        left = [symmetry for symmetry in left if not symmetry.name.startswith("boost")]
    if axis is None:
        return tuple(left)
    others = [symmetry for symmetry in left if not symmetry.name.startswith("rotation")]
    if any(axis):
        others.append(rotation(axis, copies=bodies, name="rotation about the pole"))
    return tuple(others)


def number(value: Any, what: str) -> float:
    """Return one finite float. Raises InputError for anything else."""
    array = np.asarray(value)
    if array.shape != () or not np.isfinite(array):
        raise InputError(f"{what} is {array.tolist()}; expected one finite number.")
    return float(array)
