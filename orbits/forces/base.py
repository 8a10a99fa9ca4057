"""The contract of a force without a Lagrangian.

A force is one file: kernels, and a frozen dataclass for users, with units. Its kernels are

    force(strength, own, t, q, v, f)       adds the forces, times G, to f; vectors, or rows of eight stages
    particle_force(strength, own, t, particle, sources, speeds, place, velocity)
                                           returns the force per unit mass; `particle` is its number, or that of the
                                           first of eight in lanes: see `coefficient`

A force with internal variables y, such as a spin, has their number as the kernel constant `inner`, and its forces are

    force(strength, own, t, q, v, y, f, rates)   adds the forces, and writes y' to `rates`; vectors, or rows

`strength` is the parameter vector of `newtonian`, `own` is that of the force; t is the time since the epoch of the
system, in its unit. One that comes from a body and acts on others relative to it has a single kernel instead of both,
`acceleration`: see `orbits.kernels.gravity.central_forces`. A method includes forces by the discrete
Lagrange–d'Alembert principle: with f at the stages, P_i = p + h sum_j a_ij (dL/dq + f)_j.
"""

from __future__ import annotations

import dis
from collections.abc import Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.checks import check_kernel
from orbits.errors import InputError, shown
from orbits.kernels.binding import Tag, kernel_of
from orbits.kernels.gravity.central_forces import coefficient

__all__ = ["BoundForce", "Force", "coefficient"]


FORCE = "strength, own, t, q, v, f"
FORCE_WITH_VARIABLES = "strength, own, t, q, v, y, f, rates"
PARTICLE_FORCE = "strength, own, t, particle, sources, speeds, place, velocity"
"""The arguments of the kernels."""

TIME = 2
"""The place of the time among the arguments of all kernels."""

LOADS = "LOAD_FAST", "LOAD_DEREF", "LOAD_CLOSURE"
"""The instructions by which a function, or one within it, reads an argument."""


@cache
def _reads_time(tag_type: Any) -> bool:
    """Return whether a kernel of a force reads the time; the type of its tag stands for the code of all."""
    kernels = (kernel_of(tag_type, name) for name in ("force", "particle_force", "acceleration"))
    codes = [x.py_func.__code__ for x in kernels if hasattr(x, "py_func")]
    read = [(code.co_varnames[TIME], step) for code in codes for step in dis.get_instructions(code)]
    return any(t in np.atleast_1d(step.argval) for t, step in read if step.opname.startswith(LOADS))


@dataclass(frozen=True, eq=False)
class BoundForce:
    """A force bound to the bodies of a system: its name for messages, its kernels, its parameter vector, and its
    internal variables at the start, as many as its kernel `inner` says.
    """

    name: str
    tag: Tag
    parameters: NDArray[np.float64]
    inner: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def depends_on_time(self) -> bool:
        """Whether one of its kernels reads the time."""
        return _reads_time(self.tag.type)

    def check(self, particles: bool) -> None:
        """Raise InputError for what compiled code cannot take; particles : whether there are massless ones."""
        whose = f"the force {shown(self.name)}"
        if not isinstance(self.tag, Tag):
            raise InputError(f"{whose}: tag is {shown(self.tag)}; expected orbits.kernels.binding.Tag(name, kernels)")
        for name in ("parameters", "inner"):
            vector = getattr(self, name)
            is_vector = isinstance(vector, np.ndarray) and vector.dtype == np.float64 and vector.ndim == 1
            if not (is_vector and vector.flags.c_contiguous):
                raise InputError(
                    f"{whose}: {name} is {shown(vector)}, a {type(vector).__name__}; expected a vector of floats, "
                    "np.array([...], dtype=np.float64), which may be empty"
                )
        needed = {"force": FORCE_WITH_VARIABLES if len(self.inner) else FORCE}
        if particles:
            needed["particle_force"] = PARTICLE_FORCE
        for name, arguments in needed.items():
            if not self.tag.provides(name):
                which = "massive bodies" if name == "force" else "the massless bodies of this system"
                raise InputError(
                    f"{whose} has no kernel {name} for {which}; expected {name}({arguments}) among those of its tag"
                )
            check_kernel(kernel_of(self.tag.type, name), name, arguments, whose)


@dataclass(frozen=True)
class Force:
    """Base of the forces of a `System`: frozen dataclasses whose fields are their parameters, with units.

    kind : its name in archives
    bodies : the names of the bodies that it acts on, massive or not; None for all
    variables : the number of its internal variables
    per_body : names of the fields that may have one number for each of `bodies`; of_body : of those that are numbers of
        its `owner`. Runs have derivatives by them, and fits determine them: see `orbits.system.parameters`
    """

    kind: ClassVar[str]
    variables: ClassVar[int] = 0
    per_body: ClassVar[tuple[str, ...]] = ()
    of_body: ClassVar[tuple[str, ...]] = ()
    bodies: Sequence[str] | None = None

    @property
    def whom(self) -> str:
        """What it acts on, in words."""
        return f"on {'all' if self.bodies is None else few(self.bodies, 3)}"

    @property
    def owner(self) -> str | None:
        """The name of the body that it comes from; None if it comes from none."""
        return None

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it, for tests: in dimensionless units with G = 1, for a "star" of the mass 1 and others
        about 1 from it.
        """
        return ()

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

    def continued(self, inner: NDArray[np.float64], units: Any) -> Self:
        """Return this force with these internal variables, (variables,), as a run has left them."""
        raise NotImplementedError

    def masses(self, gm: NDArray[np.float64], names: Sequence[str], t: Any, units: Any) -> NDArray[np.float64]:
        """Return the GM of the bodies with these names at times t since the epoch, (..., bodies); gm itself, (bodies,)
        or (..., bodies), where the force does not change it.
        """
        return gm

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Return this force as seen from an origin at that place that moves with that velocity, (3,) quantities: one
        that depends on absolute positions or velocities has to shift its numbers, and one that depends on relative ones
        alone is the same.

        Raises InputError, naming the force, if it cannot be seen from there, as one that does not say what it is.
        """
        raise InputError(
            f"{type(self).__name__} does not say what it is from another origin; expected a method seen_from(self, "
            "place, velocity) that returns it with its numbers shifted, as Drag does, or itself if it depends on "
            "relative positions and velocities alone."
        )
