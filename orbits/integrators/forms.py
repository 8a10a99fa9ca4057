"""A form of a method: the compiled functions of its step (see `orbits.kernels.steps`), their numbers and their room."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.binding import Tag
from orbits.kernels.keeping import identity
from orbits.kernels.lanes import WIDTH

Array = NDArray[np.float64]


def padded(count: int) -> int:
    """Return the length of a vector for `count` numbers, so that lanes may read and write past its end."""
    return (count + WIDTH - 1) // WIDTH * WIDTH + WIDTH


class Form:
    """How a method steps: in second-order form, the state being positions and velocities, or in canonical form.

    kernels : "step", and where there are such things "begin", "step_particles", "begin_particles"; and whole numbers
        that they are compiled for: "width", 8 where massless particles lie in lanes (the default), 1 where one
        particle's stages do
    """

    kernels: ClassVar[Mapping[str, Any]]

    @cached_property
    def tag(self) -> Tag:
        """The compiled face; its name tells the kernels from all others."""
        digest = hashlib.sha256()
        for name, kernel in sorted(self.own_kernels().items()):
            shown = identity(kernel.py_func) if hasattr(kernel, "py_func") else repr(kernel)
            digest.update(f"{name}: {shown}\n".encode())
        return Tag(f"method-{digest.hexdigest()[:16]}", self.own_kernels())

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this very form."""
        return self.kernels

    @property
    def serves_particles(self) -> bool:
        """Whether massless particles can be stepped in the stages of the massive bodies."""
        return "step_particles" in self.own_kernels()

    @property
    def shared(self) -> bool:
        """Whether threads can share the step of thousands of bodies: it then always succeeds, and what `begin` writes
        depends on the positions alone.
        """
        return False

    def coefficients(self, h: float, before: float) -> Any:
        """Return what the kernels need to know of a step of h that follows one of `before`; one row of eight."""
        return np.zeros((1, WIDTH))

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of what a step of `size` coordinates goes through: what massless particles feel."""
        raise NotImplementedError(f"{type(self).__name__} must say the shape of its stages")

    def carry_rows(self, size: int) -> int:
        """Return how many rows of eight are carried from step to step; they are stored for resuming."""
        return 0

    @property
    def particle_carry_rows(self) -> int:
        """Rows of eight carried from step to step for each massless particle."""
        return 0

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the scratch that the kernels want, for `size` coordinates and for particles."""
        return 1, padded(size)

    def forget(self, carry: Array) -> None:
        """Take from the carry what belongs to the length of the steps: a step of another length begins cold."""
        carry[:] = 0.0

    def accounts(self, carry: Array) -> Array:
        """Return what each force without a Lagrangian did to the massive bodies as far as the carry tells, (forces, 7):
        work, torque about the origin and impulse, times G.
        """
        return np.zeros((0, 7))


def coefficients_of(form: Form, h: float) -> Any:
    """Return the coefficients of steps of h, those that were made last where the form can be hashed."""
    try:
        hash(form)
    except TypeError:
        return form.coefficients(h, h)
    return _known_coefficients(form, h)


@lru_cache(maxsize=256)
def _known_coefficients(form: Form, h: float) -> Any:
    return form.coefficients(h, h)
