"""What the forms of all Wisdom–Holman maps share: planets and massless particles are marched in the carry."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form
from orbits.integrators.maps.dominant import registers_for, require_dominant
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.interaction import ROWS, STATE_ROWS
from orbits.kernels.maps.jacobi_particles import MEMORY_ROWS, store_marched, take_particles
from orbits.kernels.steps import NOWHERE


@kernel(inline=True)
def taken_particles(particles, storage):
    """Return eight particles as they are marched, from their rows of the carry."""
    # Those that are retired are at one place, as the padding is.
    there = 1.0 - (particles.x == NOWHERE) * (particles.y == NOWHERE) * (particles.z == NOWHERE)
    return take_particles(storage.carry, storage.share.start, there, storage.scratch)


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry."""
    return taken_particles(particles, storage)


@kernel(inline=True)
def keep_particles(method, carry, storage):
    """Write eight particles as they are marched into their rows of the carry."""
    store_marched(storage.carry, storage.share.start, carry, storage.scratch)


@kernel
def stretch_rows(own, unit, factor):
    """Write coefficients that are all multiples of the length of a step, for one `factor` times as long."""
    for row in range(own.shape[0]):
        for k in range(own.shape[1]):
            own[row, k] = factor * unit[row, k]


def rows_of(stages: Iterable[tuple[int, float]]) -> Array:
    """Return stages (kind, length) as an array, (s, 2)."""
    return np.array(list(stages), dtype=np.float64).reshape(-1, 2)


def in_order(carry: Array, n: int) -> NDArray[np.int64]:
    """Return the numbers of n bodies in the order of a map whose carry this is, (n,): the dominant one, then the
    planets outwards.
    """
    first = STATE_ROWS * registers_for(3 * n)
    return np.append(carry[first, 6], carry[first + 2 :].ravel()[: n - 1]).astype(np.int64)


@dataclass(frozen=True)
class OnKeplerOrbits(Form):
    """Base of the forms of Wisdom–Holman maps.

    among_particles : whether the planets leave tables for massless particles
    more_kernels : what is then added to `kernels`
    """

    among_particles: bool = field(default=False, kw_only=True)

    more_kernels: ClassVar[Mapping[str, Any]]

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        return {**self.kernels, **self.more_kernels} if self.among_particles else self.kernels

    def for_particles(self) -> Self:
        """Return the form whose planets leave tables for massless particles."""
        return replace(self, among_particles=True)

    def stages_of(self, h: float) -> tuple[Array, Array]:
        """Return what leads from the states that are seen to those that are marched, and a step of h, as stages: rows
        (kind, length) of `orbits.kernels.maps.stages`, for tangent vectors.
        """
        raise NotImplementedError(f"{type(self).__name__} must define its stages")

    def room_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the part of the scratch that has the constants of the planets."""
        return ROWS * registers_for(size) + WIDTH, WIDTH

    def carry_rows(self, size: int) -> int:
        """The planets, eight in a register, with low parts; their centre of mass; their order."""
        return (STATE_ROWS + 1) * registers_for(size) + 2

    @property
    def particle_carry_rows(self) -> int:
        """Massless particles as they are marched."""
        return MEMORY_ROWS if self.among_particles else 0

    def forget(self, carry: Array) -> None:
        """Nothing in the carry depends on the length of the steps."""

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError for softened gravity, and if no body dominates the others."""
        require_dominant(parameters)


@dataclass(frozen=True)
class InJacobiCoordinates(OnKeplerOrbits):
    """Base of the forms in Jacobi coordinates.

    in_two_registers : whether the planets, nine to sixteen, stay in two registers
    """

    in_two_registers: bool = field(default=False, kw_only=True)

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance, and the number of registers if it is compiled for it."""
        own = super().own_kernels()
        return {**own, "registers": 2} if self.in_two_registers else own

    def for_bodies(self, count: int) -> Self:
        """Return the form whose planets stay in two registers, if there are nine to sixteen."""
        return replace(self, in_two_registers=registers_for(3 * count) == 2)
