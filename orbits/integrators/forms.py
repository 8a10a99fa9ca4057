"""A form of a method: the compiled functions of its step (see `orbits.kernels.steps`), coefficients and workspace."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.binding import Tag
from orbits.kernels.compile.frozen import listed
from orbits.kernels.lanes import WIDTH

Array = NDArray[np.float64]


@lru_cache(maxsize=256)
def padded(count: int) -> int:
    """Return the length of a vector of `count` numbers with padding, so that lanes may read and write past its end."""
    return (count + WIDTH - 1) // WIDTH * WIDTH + WIDTH


_TAGS: dict[tuple[Any, ...], Tag] = {}
"""The tags of kernels, which live as long as these."""


def _tag_of(kernels: Mapping[str, Any]) -> Tag:
    """Return the tag of kernels, with a name that tells them from all others."""
    digest = hashlib.sha256(listed(kernels).encode())
    return Tag(f"method-{digest.hexdigest()[:16]}", kernels)


class Form:
    """A form of a method: the second-order form, in positions and velocities, or the canonical form.

    kernels : "step", and optionally "begin", "step_particles", "begin_particles", and those of two times eight
        particles, "begin_pair", "step_pair" and "keep_pair"; and integer constants: "width", 8 if massless particles
        are in lanes (the default), 1 if the stages of one particle are; "group", 8 if of those in lanes eight are
        marched at a time, and not two times eight
    """

    kernels: ClassVar[Mapping[str, Any]]

    @cached_property
    def tag(self) -> Tag:
        """The tag for compiled code; its name identifies the kernels."""
        kernels = self.own_kernels()
        known = tuple(kernels.items())
        if known not in _TAGS:
            _TAGS[known] = _tag_of(kernels)
        return _TAGS[known]

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        return self.kernels

    @property
    def serves_particles(self) -> bool:
        """Whether massless particles can be stepped through the stages of the massive bodies."""
        return "step_particles" in self.for_particles().own_kernels()

    def for_particles(self) -> Form:
        """Return the form that marches massless particles too: by default this one."""
        return self

    def for_bodies(self, count: int) -> Form:
        """Return the form that marches so many massive bodies, if what is compiled depends on it: by default this
        one.
        """
        return self

    @cached_property
    def keeps_particles(self) -> bool:
        """Whether the carry of particles in lanes is kept in their rows of the archived carry."""
        return "keep_particles" in self.own_kernels()

    @cached_property
    def transforms(self) -> bool:
        """Whether what is marched is not what is seen, so that `enter` and `leave` lead from one to the other."""
        return "enter" in self.own_kernels()

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError if bodies in this state cannot be marched; q, v : (n, 3), with the vector of parameters."""

    @staticmethod
    def held(parameters: Any) -> int:
        """Return how many of the massive bodies move as they are given; parameters : the vectors of the Lagrangian."""
        return 0

    @property
    def is_dense(self) -> bool:
        """Whether the carry after a step defines the motion within it: then the form has the kernels `dense` and
        `resolves`.
        """
        return False

    @property
    def shared(self) -> bool:
        """Whether threads can divide the step of thousands of bodies: then it always succeeds, and the results of
        `begin` depend on the positions alone.
        """
        return False

    def coefficients(self, h: float, before: float) -> Any:
        """Return the coefficients for a step of h that follows one of `before`; by default one row of eight."""
        return np.zeros((1, WIDTH))

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the stages of a step of `size` coordinates, from which massless particles are
        accelerated.
        """
        raise NotImplementedError(f"{type(self).__name__} must define the shape of its stages")

    def carry_rows(self, size: int) -> int:
        """Return the number of rows of eight in the carry from step to step; it is stored for resuming."""
        return 0

    @property
    def particle_carry_rows(self) -> int:
        """The number of rows of eight in the carry of each massless particle."""
        return 0

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the scratch of the kernels, for `size` coordinates and for particles."""
        return 1, padded(size)

    def notes_nearest(self, size: int) -> bool:
        """Return whether steps of `size` coordinates note how close the bodies come, in the rows NEAREST of the scratch
        (see `orbits.kernels.maps.layout`), so that all states are looked at only where a passage may be.
        """
        return False

    def stages_read(self, size: int) -> int:
        """Return how many numbers of its stages a step writes or reads: by default all."""
        rows, columns = self.stages_shape(size)
        return rows * columns

    def guess(self, carry: Array, v: Array) -> None:
        """Write what a cold start in canonical form guesses from the velocities, (d,), into the carry: by default
        nothing.
        """

    def forget(self, carry: Array) -> None:
        """Delete the part of the carry that depends on the length of the steps, for a step of another length."""
        carry[:] = 0.0

    def forget_particles(self, carry: Array) -> None:
        """Delete the carry of particles, for a step of another length, unless it is kept."""
        if not self.keeps_particles:
            carry[:] = 0.0

    def accounts(self, carry: Array) -> Array:
        """Return the accounts in the carry of each force without a Lagrangian on the massive bodies, (forces, 7): work,
        torque about the origin and impulse, times G.
        """
        return np.zeros((0, 7))

    def inner_of(self, carry: Array) -> Array:
        """Return a view of the internal variables of forces in the carry, those of one force after another."""
        return carry[:0].reshape(-1)

    def inner_values(self, state: Mapping[str, Array]) -> Array:
        """Return a copy of the internal variables of forces in the arrays of a march, also of massless particles."""
        return self.inner_of(state["memory"]).copy()

    def set_inner(self, state: Mapping[str, Array], values: Array) -> None:
        """Write what `inner_values` returns."""
        self.inner_of(state["memory"])[:] = values


def coefficients_of(form: Form, h: float) -> Any:
    """Return the coefficients of steps of h, cached if the form can be hashed."""
    try:
        hash(form)
    except TypeError:
        return form.coefficients(h, h)
    return _known_coefficients(form, h)


@lru_cache(maxsize=256)
def _known_coefficients(form: Form, h: float) -> Any:
    return form.coefficients(h, h)
